"""Penetration depth: the length of the shortest translation that separates two bodies, between proven bounds.

From above: a translation after which the distance engine finds the bodies apart. From below: convex pieces inside the
bodies, which overlap at all shorter translations; a single pair of them, or many that together leave no way out.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.body import ClosedForm
from clamp3d.collide.convex import Convex, Rod
from clamp3d.collide.depth_convex import Supports, convex_depth, supports
from clamp3d.collide.depth_cover import Union, difference, nearest_behind
from clamp3d.collide.depth_pieces import around_in_form, around_in_mesh
from clamp3d.collide.drilled import drilled_depth, is_drilled
from clamp3d.collide.hull import Hull
from clamp3d.collide.model import Model
from clamp3d.collide.refine import from_boxes, refine
from clamp3d.collide.surface import Surface
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.linear import dot, norm, to_source, to_target
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import SolverError

RELATIVE, ABSOLUTE = 0.05, 0.01
"""A depth is refined until its bounds are this close: relative to it, or in mm, whichever is more."""
TOUCH = 1e-9
"""Relative to the size: an overlap this deep is a contact, for no bound is known better."""
_SETS = 60
"""Pairs of convex pieces that are tried."""
_NODES = 500
"""Sets of planes that are tried for the shortest way past all pieces, before cubes of translations are."""
_CUBES = 20
"""Times that cubes are tried."""
_EXTRA = 8
"""Pieces after which a depth that is `known_well` is not made better."""
_STEPS = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_HALF_EXTENT = 8.0
"""Half extent of the box about a common point that pieces of large meshes are cut to, by the shortest known way out."""
_FINE = 0.01
"""Chord error (mm) of the mesh that stands for a part without closed form."""

Body: TypeAlias = ClosedForm | Surface
"""A closed form, or the mesh of a part that has none."""


def known_well(found: Distance) -> bool:
    """Whether the depth that ``found`` tells is as near as is asked for; also for bodies that are apart."""
    width = found.upper - found.lower
    return width <= max(ABSOLUTE, RELATIVE * -found.upper)


class _Pair:
    """Two bodies and the translations that are known to separate them."""

    def __init__(self, a: Model, b: Model, T: Array) -> None:
        self.a, self.b, self.T = a, b, T
        self.size = float(np.abs(a.bounds).max() + np.abs(b.bounds).max() + np.abs(T[:3, 3]).max())
        self.slack = TOUCH * self.size
        self.best: tuple[float, Array, Distance] | None = None
        self.own, self.other = _bodies(a), _bodies(b)

    def ask(self, t: Array) -> Distance:
        """What is known of b moved by ``t`` (3,): enough to tell whether they are apart."""
        T = self.T.copy()
        T[:3, 3] += t

        def told(known: Distance) -> bool:
            return known.lower >= -self.slack or known.upper < -10.0 * self.slack

        try:
            found = refine(self.a, self.b, T, from_boxes(self.a, self.b, T), Thresholds(1e-6), told, search=False)
        except SolverError:
            return Distance()
        size = norm(t)
        if found.lower >= -self.slack:
            size += 4.0 * max(0.0, -found.lower) + 1e-13 * self.size
            if self.best is None or size < self.best[0]:
                self.best = (size, t, found)
        return found

    def overlap_at(self, t: Array, known: Distance, half_extent: float) -> Array | None:
        """Planes (k, 4) of a convex set of translations that overlap, ``t`` (3,) among them; None if none is found.

        Of large meshes it is made of what lies in a box about a common point, ``half_extent`` mm to each side.
        """
        named = [x for x in (known.point_a, known.point_b) if x is not None and known.upper < 0.0]
        if len(named) == 2:
            named.append(0.5 * (named[0] + named[1]))
        for points in (named, self._common(t)):
            found = [
                (*_innermost(x, y, self.T, t, point, 0.05 * self.size), x, y)
                for point in points
                for x in self.own
                for y in self.other
            ]
            margin, p, x, y = max(found, key=lambda item: item[0], default=(0.0, t, None, None))
            if margin > 0.0 and x is not None and y is not None:
                A, B = _around(x, p, half_extent), _around(y, to_source(self.T, p - t), half_extent)
                if A is not None and B is not None:
                    try:
                        return difference(A, _moved(B, self.T))
                    except ValueError:  # too thin
                        continue
        return None

    def _common(self, t: Array) -> Iterator[Array]:
        """Points (3,) that may lie in both bodies, b moved by ``t`` (3,): by meshes that they hold."""
        T = self.T.copy()
        T[:3, 3] += t
        a, b = self.a.inner(_FINE), self.b.inner(_FINE)
        if a is None or b is None:
            return
        common = a.manifold ^ b.manifold.transform(np.ascontiguousarray(T[:3]))
        for part in sorted(common.decompose(), key=lambda part: -part.volume())[:2]:
            yield from _inner(part)

    def freed(self, known: Distance, way: Array) -> bool:
        """Whether bodies that touch within their errors come apart by a little more, along the normal or ``way``."""
        if not known.lower > -np.inf:
            return False
        for more in (1.0, 2.0, 8.0):
            for n in [way] if known.normal is None else [known.normal, way]:
                if self.ask(-known.lower * (1.0 + 1e-9) * more * n).lower >= -self.slack:
                    return True
        return False

    def push(self, start: Array, found: Distance, steps: int) -> None:
        """Move b out along the normals that the engine names, by what it says is left, until the bodies are apart.

        Where several places touch, the next translation is the nearest that is out at all of them.
        """
        t = start
        planes: list[Array] = []
        for _ in range(steps):
            if found.lower >= -self.slack or found.normal is None or not found.upper < 0.0:
                return
            planes.append(np.array([*found.normal, float(dot(found.normal, t)) - found.upper + 0.1 * self.slack]))
            start, t = t, nearest_behind(np.array(planes[-6:]), t)
            if t is start:  # no translation is behind all of them
                return
            if self.best is not None and norm(t) >= self.best[0]:
                return
            found = self.ask(t)
        self.back(t, found)

    def part(self, t: Array, found: Distance) -> None:
        """Verified translations at or just beyond ``t`` (3,), where the bodies touch to rounding or to their errors."""
        if not t.any():
            return
        self.push(t, found, 8)
        for more in (1e-9, 1e-7, 1e-5, 1e-3, 1e-2):
            if self.best is not None and self.best[0] <= norm(t) * (1.0 + more):
                return
            self.ask(t * (1.0 + more))

    def back(self, t: Array, found: Distance) -> None:
        """Back towards the origin by the distance that is left, as long as it is worth it."""
        size = norm(t)
        for _ in range(12):
            if not found.lower > 1e-3 * size:
                return
            t = t * (1.0 - min(found.lower, size) / size)
            size = norm(t)
            if size <= 0.0:
                return
            found = self.ask(t)
            if found.lower < -self.slack:
                return


def is_quick(a: Model, b: Model) -> bool:
    """Whether a check searches the depth of a pair: of two solids from CAD, where it takes seconds, `distance` does."""
    return a.faces is None or b.faces is None


def penetration(a: Model, b: Model, T: Array, known: Distance) -> Distance:
    """The signed distance of two bodies of which the engine says that they overlap, or may.

    Parameters
    ----------
    a, b : Model
        The bodies, b placed by ``T`` (4, 4) in a's frame.
    known : Distance
        What the engine says: its ``upper``, which a point in both bodies attests, holds.

    Returns
    -------
    Distance
        Minus the penetration depth between proven bounds, `known_well` where the search came to its end; ``normal``
        is the direction in which b moves out, the points are those that part last.
    """
    if _key(a) > _key(b):  # one order, so that the answer does not depend on it
        return penetration(b, a, inverse(T), known.moved(inverse(T)).swapped()).moved(T).swapped()
    pair = _Pair(a, b, T)
    if known.lower >= -pair.slack:
        return known
    interference = (max(0.0, -known.upper), max(0.0, -known.lower))
    # Of an open mesh it is not known what is inside.
    found = _measured(pair, known) if a.closed and b.closed else known.of_overlap()
    return replace(found, interference=interference)


def _key(model: Model) -> tuple[float, ...]:
    return (float(np.prod(model.bounds[1] - model.bounds[0])), *model.bounds.ravel().tolist())


def _measured(pair: _Pair, known: Distance) -> Distance:
    a, b, T = pair.a, pair.b, pair.T
    exact = _closed_pair(a, b, T)
    if exact is not None and exact.lower >= 0.0:  # a plane parts them
        return replace(known, lower=max(known.lower, 0.0))
    if exact is not None:
        return _with_points(pair, replace(exact, upper=min(exact.upper, known.upper)).ordered())
    length, way = _exit(a, b, T)
    if known.upper >= -pair.slack and pair.freed(known, way):
        assert pair.best is not None
        size, t, _ = pair.best
        return replace(known, lower=-size, normal=t / norm(t))
    found = Distance(-length, known.upper, None, None, way, None, known.level, known.method).ordered()
    if found.upper - found.lower <= pair.slack:
        return found
    pair.push(np.zeros(3), known, 4)
    found = _joined(pair, found)
    return found if found.upper - found.lower <= pair.slack else _searched(pair, found, known)


def _searched(pair: _Pair, found: Distance, known: Distance) -> Distance:
    """Proves ever longer translations to overlap, by convex pieces around points that both bodies have there.

    The shortest translation that the pieces so far leave open is asked of the bodies. Where they are apart it is the
    shortest of all; where they overlap they have a point in common, and the pieces around it leave it no longer open.
    """
    sets: list[Array] = []
    t, proven, cubes = np.zeros(3), 0.0, 0
    for step in range(_SETS):
        new = pair.overlap_at(t, known, _HALF_EXTENT * -found.lower)
        if new is not None:
            sets.append(new)
            union = Union(sets, -found.lower * (1.0 + 1e-9))
        if new is None or union.reach(t[None])[0] <= 0.0:  # too thin to prove anything: all but apart
            pair.part(t, known)
            break
        length, way = union.shortest(_NODES if cubes < 3 else 0)  # where planes are too many they stay so
        if way is None and length < -found.lower:
            cubes += 1
            covered, way = union.clearance(0.5 * RELATIVE, 0.5 * ABSOLUTE)
            length = max(length, covered)
        proven = max(proven, min(length, -found.lower) - 1e-12 * pair.size)
        width, found = found.upper - found.lower, _joined(pair, found, proven)
        slow = found.upper - found.lower > 0.7 * width  # else it is soon known to rounding
        if way is None or cubes > _CUBES or (known_well(found) and step >= _EXTRA and slow):
            break
        t, known = way, pair.ask(way)
        if known.lower >= -pair.slack:
            break
        if step % 3 == 0 or known.upper > -1e-3 * norm(t):  # all but out: by how little?
            pair.push(t, known, 6)
        if step % 4 == 3:  # a little further may be out, and near enough
            size = norm(t)
            pair.ask(t * (1.0 + max(0.5 * RELATIVE, 0.5 * ABSOLUTE / max(size, 1e-300))))
    return _joined(pair, found, proven)


def _joined(pair: _Pair, found: Distance, proven: float = 0.0) -> Distance:
    """``found`` with the shortest translation that is verified, and a depth (mm) that is ``proven``."""
    upper = min(found.upper, -proven) if proven > 0.0 else found.upper
    if pair.best is not None and pair.best[0] <= -found.lower:
        size, t, at = pair.best
        p, q = at.point_a, at.point_b
        normal = t / norm(t) if size > 0.0 else found.normal
        found = Distance(-size, upper, p, None if q is None else q - t, normal, None)
    return replace(found, upper=upper, level="depth", method="convex pieces").ordered()


def is_exact(a: Model, b: Model) -> bool:
    """Whether both bodies are boxes or cylinders, of which distance and depth are known in closed form."""
    pieces = [_convex_piece(model) for model in (a, b)]
    return all(piece is not None and piece[0].sum is not None for piece in pieces)


def touches_hole(a: Model, b: Model, known: Distance) -> bool:
    """Whether a pin and a drilled plate have a point in common, to rounding: then their depth is all that is open."""
    if known.point_a is None or known.upper > TOUCH or a.bodies is None or b.bodies is None:
        return False
    return len(a.bodies) == len(b.bodies) == 1 and (
        is_drilled(a.bodies[0], b.bodies[0]) or is_drilled(b.bodies[0], a.bodies[0])
    )


def _convex_piece(model: Model) -> tuple[Convex, float] | None:
    """The one convex piece that a body is, and its error; None for other bodies."""
    forms = model.bodies
    if forms is None or len(forms) != 1 or forms[0].bores or len(forms[0].outers) != 1 or forms[0].surface:
        return None
    return forms[0].outers[0], forms[0].error


def _closed_pair(a: Model, b: Model, T: Array) -> Distance | None:
    """The depth of two bodies that are one convex piece each, or a pin and a drilled plate; None for others."""
    x, y = _convex_piece(a), _convex_piece(b)
    if x is not None and y is not None:
        return convex_depth(x[0], np.eye(4), y[0], T).widened(x[1] + y[1])
    if x is not None and (found := _closed_pair(b, a, inverse(T))) is not None:
        return found.moved(T).swapped()
    if a.bodies is None or b.bodies is None or not len(a.bodies) == len(b.bodies) == 1:
        return None
    return drilled_depth(a.bodies[0], b.bodies[0], T)


def _with_points(pair: _Pair, found: Distance) -> Distance:
    """``found`` with the points that part last."""
    assert found.normal is not None
    t = -found.lower * found.normal
    p, q = found.point_a, found.point_b
    if p is not None and q is not None and np.abs(q + t - p).max() <= pair.slack:
        return found
    at = pair.ask(t)
    if at.point_a is None or at.point_b is None or at.lower < -pair.slack:
        return found
    return replace(found, point_a=at.point_a, point_b=at.point_b - t)


def _outer(model: Model, T: Array) -> list[tuple[list[Supports], float]]:
    """Support functions of convex pieces that hold the part: for each form the ones of its outer pieces."""
    if model.bodies is not None:
        return [([supports(piece, T) for piece in form.outers], form.error) for form in model.bodies]
    mesh = model.outer(_FINE)
    V = to_target(T, mesh.vertices)
    return [([lambda N: V[np.argmax(dot(N, V.T), axis=1)]], mesh.error)]


def _heights(outer: list[tuple[list[Supports], float]], N: Array) -> Array:
    """Support (k,) of a part along ``N`` (k, 3), or more."""
    heights = [np.min([(N * s(N)).sum(axis=1) for s in pieces], axis=0) + error for pieces, error in outer]
    return np.asarray(np.max(heights, axis=0))


def _exit(a: Model, b: Model, T: Array) -> tuple[float, Array]:
    """Length and direction (3,) of a way out that leaves the other's convex hull."""
    outer_a, outer_b = _outer(a, np.eye(4)), _outer(b, T)
    seeds = [np.vstack([np.eye(3), -np.eye(3), T[:3, :3].T, -T[:3, :3].T])]
    for model, P, sign in ((a, np.eye(4), 1.0), (b, T, -1.0)):
        for form in model.bodies or ():
            for piece in form.outers:
                axes = np.array([piece.T[:3, 2], -piece.T[:3, 2]]) if isinstance(piece, Rod) else piece.planes[:60, :3]
                seeds.append(dot(sign * axes, P[:3, :3].T))
    centre = to_target(T, b.bounds.mean(axis=0)) - a.bounds.mean(axis=0)
    if norm(centre) > 0.0:
        seeds.append((centre / norm(centre))[None])
    N = np.vstack(seeds)
    h = _heights(outer_a, N) + _heights(outer_b, -N)
    k = int(np.argmin(h))
    return float(h[k]), N[k]


def _bodies(model: Model) -> tuple[Body, ...]:
    """The part's closed forms, or its mesh where it has none."""
    if model.bodies is not None and all(form.surface is None for form in model.bodies):
        return model.bodies
    mesh = model.inner(_FINE)
    return () if mesh is None else (mesh,)


def _around(body: Body, x: Array, half_extent: float) -> Hull | None:
    return around_in_mesh(body, x, half_extent) if isinstance(body, Surface) else around_in_form(body, x)


def _innermost(x: Body, y: Body, T: Array, t: Array, point: Array, size: float) -> tuple[float, Array]:
    """A point (3,) near ``point`` that lies deep in both bodies, and how deep (mm); y is placed by ``T`` and ``t``.

    A pattern search with steps of ``size`` mm at first.
    """

    def margin(points: Array) -> Array:
        return np.minimum(x.depth(points), y.depth(to_source(T, points - t)))

    best, here = float(margin(point[None])[0]), point
    step = size
    for _ in range(40):
        around = here + step * _STEPS
        found = margin(around)
        k = int(np.argmax(found))
        if found[k] > best + 0.05 * step:
            best, here = float(found[k]), around[k]
        else:
            step *= 0.35
        if step < 0.01 * best or step < 1e-12:
            break
    return best, here


def _inner(part: Any) -> list[Array]:
    """Points (3,) inside a part of an overlap: below the middles of its largest triangles, by its mean thickness."""
    raw = part.to_mesh64()
    V = np.asarray(raw.vert_properties)[:, :3]
    C = V[np.asarray(raw.tri_verts, dtype=np.int64)]
    cross = np.cross(C[:, 1] - C[:, 0], C[:, 2] - C[:, 0])
    size = np.linalg.norm(cross, axis=1)
    rows = np.argsort(-size, kind="stable")[:3]
    rows = rows[size[rows] > 0.0]
    thick = part.volume() / max(float(size.sum()) / 2.0, 1e-300)
    middle, normal = C[rows].mean(axis=1), cross[rows] / size[rows, None]
    return [V.mean(axis=0), *(x for h in (thick, 0.3 * thick) for x in middle - h * normal)]


def _moved(piece: Hull, T: Array) -> Hull:
    N = dot(piece.planes[:, :3], T[:3, :3].T)
    planes = np.column_stack([N, piece.planes[:, 3] - dot(N, T[:3, 3])])
    return Hull(to_target(T, piece.vertices), planes, piece.faces)
