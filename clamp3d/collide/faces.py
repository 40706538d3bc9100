"""Signed distance of two solids with known faces, between proven bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import CONE, OTHER, PLANE, SPHERE, TORUS, Faces, bends, height
from clamp3d.collide.answer import Distance
from clamp3d.collide.faces_search import FEW, Descent, Search
from clamp3d.collide.verdict import RESOLUTION
from clamp3d.core.linear import dot, to_target
from clamp3d.core.pose import Array, inverse
from clamp3d.core.triangles import distinct

MOST = 20_000
"""Pieces looked at before a direction ends with what is known."""
_LEAST = 5e-4
"""So far (mm) may a face beside another reach above it: pieces that leave it in a tangent need not be cut for ever."""
_ASKED = 8
"""Triangles below which a point is looked for that only one of two touching solids has."""
_BESIDE = 8
"""Faces beside the nearest one whose surfaces are tried."""


@dataclass(eq=False)
class FaceModel:
    """A solid's faces as the compiled search takes them, with a tree over their triangles."""

    solid: BrepSolid

    @property
    def faces(self) -> Faces:
        """The faces."""
        return self.solid.surfaces

    @cached_property
    def frames(self) -> Array:
        """Origin and axes (n, 12) of each surface."""
        return np.ascontiguousarray(self.faces.frame.reshape(-1, 12))

    @cached_property
    def spread(self) -> Array:
        """So far (m,) mm are each triangle and the piece of its face that has its parameters from each other at most.

        Of a cone, ball or torus that is more than the distance of the triangle from the face: the piece bulges beyond
        the triangle's sides along the surface, where the triangle beside it is nearer.
        """
        from clamp3d.collide.faces_tree import bulges

        f, found = self.faces, self.faces.error.copy()
        there = np.empty(len(found))
        bulges(f.kind, f.size, f.uv, f.face, there)
        start = np.searchsorted(f.face, np.arange(len(f.kind) + 1))
        for i in np.flatnonzero((f.kind == CONE) | (f.kind == SPHERE) | (f.kind == TORUS)):
            rows = slice(start[i], start[i + 1])
            size = (float(f.size[i, 0]), float(f.size[i, 1]))
            found[rows] += np.maximum(there[rows] - bends(int(f.kind[i]), size, f.uv[rows], f.corners[rows]), 0.0)
        return found

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper corner (2, 3) of a box that holds the solid, mm."""
        c, e = self.faces.corners, self.faces.error[:, None]
        return np.array([(c.min(axis=1) - e).min(axis=0), (c.max(axis=1) + e).max(axis=0)])

    @cached_property
    def slack(self) -> Array:
        """By so much (2 n,) mm can faces beside each face reach above it by the errors of the borders that they share.

        Then the least such height, for places where no border is near.
        """
        f = self.faces
        rows, sides = np.nonzero(f.sag)
        sag = f.sag[rows, sides]
        start, end = f.corners[rows, sides], f.corners[rows, (sides + 1) % 3]
        found = np.zeros(len(f.kind))
        for i in range(len(f.kind)):
            size = (float(f.size[i, 0]), float(f.size[i, 1]))
            on = f.face[rows] == i
            if f.kind[i] != OTHER:
                near = 1e-6 + 2.0 * f.deviation.max()
                for corner in (start, end):
                    on |= np.abs(height(int(f.kind[i]), f.frame[i], size, corner)) < near
            found[i] = sag[on].max(initial=0.0)
        beside = np.zeros(len(f.kind))
        np.maximum.at(beside, self._adjacent[:, 0], f.deviation[self._adjacent[:, 1]])
        scale = float(np.abs(self.bounds).max())
        rounding = f.deviation + beside + 1e-9 + 1e-12 * scale
        same = 1e-6 + 4e-7 * scale  # so far apart can faces of one of the ``groups`` be
        return np.concatenate([np.maximum(2.1 * found, _LEAST) + rounding, same + rounding])

    @cached_property
    def groups(self) -> NDArray[np.int64]:
        """Number (n,) of the surface of each face: faces of one surface share it."""
        kind, frame, size, sense = self.faces.kind, self.faces.frame, self.faces.size, self.faces.sense
        found = np.arange(len(kind))
        for i in range(len(kind)):
            if kind[i] == 5 or found[i] != i:
                continue
            same = (kind == kind[i]) & (sense == sense[i]) & (np.abs(size - size[i]).max(axis=1) < 1e-7)
            z, o = frame[i, 3], frame[i, 0]
            same &= np.abs(dot(frame[:, 3], z)) > 1.0 - 1e-14
            away = frame[:, 0] - o
            if kind[i] == 1:
                same &= np.linalg.norm(away - np.outer(dot(away, z), z), axis=1) < 1e-7
            elif kind[i] == 0:
                same &= (np.abs(dot(away, z)) < 1e-7) & (dot(frame[:, 3], z) > 0.0)
            else:
                same &= np.linalg.norm(away, axis=1) < 1e-7
                if kind[i] == 2:
                    same &= dot(frame[:, 3], z) > 0.0
            found[same] = i
        return found.astype(np.int64)

    @cached_property
    def arrays(self) -> tuple[NDArray[np.generic], ...]:
        """What the compiled search reads of the solid that distances are measured from."""
        from clamp3d.collide.faces_tree import NEW, tree_of

        f, m, n = self.faces, len(self.faces.face), len(self.faces.kind)
        box, link, order, root = tree_of(f.corners, self.spread, np.searchsorted(f.face, np.arange(n + 1)))
        return (
            f.corners, f.error, f.face, box, link, order, root, f.uv, np.ascontiguousarray(f.sag.max(axis=1)),
            f.kind, f.size, self.frames, f.sense, f.deviation, self.groups, self.neighbours,
            np.full((2 * n, m), NEW, dtype=np.int8), np.full((2 * n, len(box)), NEW, dtype=np.int8),
            self.spread,
        )  # fmt: skip

    @cached_property
    def neighbours(self) -> NDArray[np.int64]:
        """Up to so many faces (n, k) that share a corner with each face; -1 where there are fewer."""
        made = np.full((len(self.faces.kind), _BESIDE), -1, dtype=np.int64)
        i, j = self._adjacent.T
        place = np.arange(len(i)) - np.searchsorted(i, i)
        made[i[place < _BESIDE], place[place < _BESIDE]] = j[place < _BESIDE]
        return made

    @cached_property
    def _adjacent(self) -> NDArray[np.int64]:
        """Pairs (k, 2) of faces that share a corner, both ways, sorted."""
        faces = len(self.faces.kind)
        at = distinct(self.solid.mesh.faces * faces + self.solid.face[:, None])
        corner, face = at // faces, at % faces
        order = np.arange(len(at))
        last = np.searchsorted(corner, corner, side="right")
        pairs = []
        for step in range(1, int((last - order).max(initial=1))):
            first = order[order + step < last]
            pairs += [face[first] * faces + face[first + step], face[first + step] * faces + face[first]]
        found = distinct(np.concatenate(pairs)) if pairs else np.zeros(0, dtype=np.int64)
        return np.column_stack([found // faces, found % faces])


def _flattened(model: FaceModel, low: Array, high: Array) -> FaceModel:
    """The model with each triangle of its free-form faces that comes into a box a plane of its own.

    Such a plane is as near to the face as the triangle, and says more than its distance where two faces touch.
    """
    f, solid = model.faces, model.solid
    c, e = f.corners, f.error[:, None]
    near = ((c.min(axis=1) - e <= high) & (c.max(axis=1) + e >= low)).all(axis=1)
    rows = np.flatnonzero(near & (f.kind[f.face] == OTHER))
    own = np.flatnonzero(f.kind[solid.face] == OTHER)
    if not len(rows) or len(own) != np.count_nonzero(f.kind[f.face] == OTHER):
        return model
    x = c[rows, 1] - c[rows, 0]
    x /= np.linalg.norm(x, axis=1)[:, None]
    z = np.cross(x, c[rows, 2] - c[rows, 0])
    z /= np.linalg.norm(z, axis=1)[:, None]
    frames = np.stack([c[rows, 0], x, np.cross(z, x), z], axis=1)
    face, uv, sag, n = f.face.copy(), f.uv.copy(), f.sag.copy(), len(f.kind)
    face[rows] = n + np.arange(len(rows))
    away = c[rows] - c[rows, :1]
    uv[rows] = np.stack([np.einsum("nij,nj->ni", away, frames[:, k]) for k in (1, 2)], axis=2)
    sag[rows] = np.maximum(sag[rows], f.error[rows, None])
    of_mesh = solid.face.copy()
    of_mesh[own] = face[f.kind[f.face] == OTHER]
    used, face = np.unique(face, return_inverse=True)  # of some faces nothing is left
    order = np.argsort(face, kind="stable")
    one = np.ones(len(rows))
    columns = (
        (f.kind, np.full(len(rows), PLANE)), (f.frame, frames), (f.size, np.zeros((len(rows), 2))),
        (f.sense, one), (f.deviation, f.error[rows]),
    )  # fmt: skip
    of_faces = [np.concatenate(column)[used] for column in columns]
    of_triangles = [np.ascontiguousarray(x[order]) for x in (f.error, c, uv, face, sag)]
    return FaceModel(replace(solid, surfaces=Faces(*of_faces, *of_triangles), face=np.searchsorted(used, of_mesh)))


def flat_where_near(a: FaceModel, b: FaceModel, T: Array, reach: float) -> tuple[FaceModel, FaceModel]:
    """Both with facets for planes where they are free-form and ``reach`` mm from the other's box, b at ``T``."""
    made = []
    for model, other, place in ((a, b, T), (b, a, inverse(T))):
        middle, half = other.bounds.mean(axis=0), 0.5 * (other.bounds[1] - other.bounds[0])
        centre, size = to_target(place, middle), dot(abs(place[:3, :3]), half) + reach
        made.append(_flattened(model, centre - size, centre + size))
    return made[0], made[1]


def faces_distance(
    a: FaceModel,
    b: FaceModel,
    T: Array,
    *,
    contact: float,
    clearance: float = 0.0,
    tol: float | None = None,
    most: int = MOST,
    brief: float | None = None,
) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame.

    Stops when the bounds are on the same side of ``contact`` and ``clearance`` mm, or no further apart than
    ``tol``, where that is given, or after ``most`` pieces in one direction, or where more of them tell next to
    nothing more: soon, if the bounds are then further apart than ``brief`` mm, where that is given.
    """
    here = inverse(T)
    if len(a.faces.face) < len(b.faces.face):  # the pieces of the one with fewer first: they often decide
        turned = faces_distance(b, a, here, contact=contact, clearance=clearance, tol=tol, most=most, brief=brief)
        return turned.moved(T).swapped()
    one = Search(a, b, T, contact, clearance, tol, most, brief)
    clash, margin, few = -contact - 2.0 * RESOLUTION if tol is None else -np.inf, max(contact, clearance), FEW
    first = one.more(few)
    if first.upper < clash:
        return _told(replace(first.swapped(), lower=-np.inf))
    if first.lower > margin and not _may_hold(a, b, here):
        return _told((first if tol is None else one.more(most)).swapped())
    other = Search(b, a, here, contact, clearance, tol, most, brief)
    # The other way tells perhaps at once: then little of this way is left to look at.
    second = other.more(most, first.lower, first.upper) if one.done else other.more(few, upper=first.upper)
    if second.upper < clash:
        return _told(replace(second.moved(T), lower=-np.inf))
    if second.lower > margin and tol is None and not _may_hold(b, a, T):
        return _told(second.moved(T))
    if not one.done:
        if second.upper < first.upper:  # with a lower point known, pieces have other bounds: from the start
            one = Search(a, b, T, contact, clearance, tol, most, brief)
        first = one.more(most, second.lower if other.done else np.inf, min(first.upper, second.upper))
        if first.lower > margin and not _may_hold(a, b, here):
            return _told(replace(_best(first.swapped(), second.moved(T)), lower=first.lower))
    if not other.done and not first.upper < clash:
        if first.upper < second.upper:
            other = Search(b, a, here, contact, clearance, tol, most, brief)
        second = other.more(most, first.lower, min(first.upper, second.upper))
    first, second, low = first.swapped(), second.moved(T), first.lower
    best = _best(first, second)
    if low > 0.0 and second.lower > 0.0:
        return _told(replace(best, lower=max(low, second.lower)))
    low = min(low, second.lower)
    high = best.upper
    if high >= -contact and not (_own(b, a, T, first.estimate, contact) and _own(a, b, here, second.estimate, contact)):
        low = -np.inf  # nothing of one is certainly out of the other: a copy of it, perhaps
    return _told(replace(best, lower=low))


def _own(b: FaceModel, a: FaceModel, T: Array, outside: float | None, contact: float) -> bool:
    """Whether some of ``b``, at ``T`` in a's frame, is certainly not in ``a``.

    No point of one surface lies deep in the other. So what is deep in b is in a as a whole or not at all: one point
    of it tells. ``outside``: how far a point of b's surface is known to be out of a.
    """
    if outside is not None and outside > 4.0 * contact:
        return True
    c = b.faces.corners
    normal = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    size = np.linalg.norm(normal, axis=1)
    for k in np.argsort(-size, kind="stable")[:_ASKED]:
        for depth in (1.0, 0.2, 4.0 * contact):
            p = c[k].mean(axis=0) - depth * normal[k] / size[k]
            if _at(b, p)[1] < -2.0 * contact and _at(a, to_target(T, p))[0] > 0.0:
                return True
    return False


def stands_out(b: FaceModel, a: FaceModel, T: Array, slack: float) -> bool:
    """Whether one of the outermost corners of ``b``, at ``T`` in a's frame, is certainly ``slack`` mm out of ``a``.

    A no says nothing.
    """
    c = to_target(T, b.faces.corners.reshape(-1, 3))
    rows = {int(k) for k in (*c.argmin(axis=0), *c.argmax(axis=0))}
    return any(_at(a, c[k])[0] > slack + float(b.faces.deviation.max()) for k in rows)


def _at(a: FaceModel, point: Array) -> tuple[float, float]:
    """Bounds of a point's signed distance from a solid."""
    box, none = np.concatenate([point, point, [0.0]])[None], np.zeros(1, dtype=np.int64)
    pieces = np.tile(point, (1, 3, 1)), np.zeros((1, 3, 2)), none, np.zeros((1, 3))
    tree = box, np.array([[0, 1]]), none, none
    surface = np.array([OTHER]), np.zeros((1, 2)), np.zeros((1, 12)), np.zeros(1)
    search = Descent(a, pieces, tree, np.eye(4), surface, (1.0, 0.0, 1e-3), 0)
    return search.go(0, np.inf), float(search.out[0])


def _best(first: Distance, second: Distance) -> Distance:
    """That of two with the lesser upper bound and points: one that found nothing below the other's has none."""
    known = first.point_a is not None and first.upper <= second.upper
    return first if known or second.point_a is None else second


def _told(found: Distance) -> Distance:
    return replace(found.ordered(), estimate=None)


def _may_hold(inner: FaceModel, outer: FaceModel, T: Array) -> bool:
    """Whether the first, placed by ``T``, can lie inside the second: by their boxes."""
    box = inner.bounds
    middle, half = box.mean(axis=0), 0.5 * (box[1] - box[0])
    centre = to_target(T, middle)
    return not ((centre < outer.bounds[0]) | (centre > outer.bounds[1])).any() and half.min() >= 0.0
