"""Properties that every bound must have, for tests of any shape, against one oracle that shares no formula with the engine.

The oracle knows a body only by its definition, as a `Body`: a function of points that tells how far outside they are at
least. From that alone `common` bounds how deep two bodies share a point, by branch and bound over boxes of points, and
`separation` their distance. The ``assert_...`` functions state what an answer promises and raise AssertionError where
the oracle proves it broken; what the oracle cannot decide passes.

>>> from clamp3d import distance, shapes
>>> from clamp3d.core.pose import translation
>>> box, wire, T = shapes.box((10, 10, 10)), shapes.cylinder(3, 20), translation(9, 0, 0)
>>> assert_distance(distance(box, wire, T), box, wire, T)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.collide.answer import Distance
from clamp3d.collide.motions import MotionDistance
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.core.profile import Arc, Profile
from clamp3d.core.shapes import MeshShape, Solid
from clamp3d.errors import InputError
from clamp3d.fit.features import FittedSurface

_PROJECTIONS, _FOLLOWED = 8, 3
"""How often near points are projected to and fro between two bodies, and how many of them are followed to the end."""

_WAYS = 8
"""Directions in which bodies are moved to see whether less than their depth parts them."""

Field = Callable[[Array], Array]
"""Of points (n, 3): <= 0 on the body, > 0 elsewhere, and nowhere steeper than 1. So a point with the value g > 0 is at
least g mm from the body, and one with g < 0 is the centre of a ball of radius -g mm in it."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A body by its definition: a `Field`, and the corners (2, 3) of a ``box`` that holds it (infinite for a body without
    end)."""

    field: Field
    box: Array

    def at(self, T: Array) -> Body:
        """The body placed by ``T`` (4, 4)."""
        box = self.box
        if np.isfinite(box).all():
            middle, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
            centre, reach = T[:3, :3] @ middle + T[:3, 3], np.abs(T[:3, :3]) @ half
            box = np.array([centre - reach, centre + reach])
        return Body(lambda x: self.field((x - T[:3, 3]) @ T[:3, :3]), box)


AnyBody = Body | Solid | MeshShape | Cylinder | SweptArc


def body(shape: AnyBody) -> Body:
    """The definition of a shape. Raises InputError for what is neither a shape nor a `Body`."""
    if isinstance(shape, Body):
        return shape
    if isinstance(shape, Solid):
        return Body(_solid(shape), shape.bounds)
    if isinstance(shape, MeshShape):
        V = shape.mesh.vertices
        return Body(_mesh(V[shape.mesh.faces]), np.array([V.min(axis=0), V.max(axis=0)]))
    if isinstance(shape, Cylinder):
        r, half = shape.radius, 0.5 * shape.length
        corner = np.array([r, r, half])
        return Body(
            lambda x: _prism(np.hypot(x[:, 0], x[:, 1]) - r, np.abs(x[:, 2]) - half), np.array([-corner, corner])
        )
    if isinstance(shape, SweptArc):
        far = np.full(3, math.inf)
        return Body(_groove(shape), np.array([-far, far]))
    raise InputError(f"shape must be a Solid, MeshShape, Cylinder, SweptArc or Body, got {type(shape).__name__}")


def convex_body(vertices: ArrayLike) -> Body:
    """The convex hull of points (n, 3), mm."""
    from scipy.spatial import ConvexHull

    V = np.asarray(vertices, dtype=np.float64)
    planes = ConvexHull(V).equations
    return Body(lambda x: (x @ planes[:, :3].T + planes[:, 3]).max(axis=1), np.array([V.min(axis=0), V.max(axis=0)]))


def _prism(across: Array, along: Array) -> Array:
    """From the distances across and along the axis of what is drawn along it."""
    return np.asarray(np.hypot(np.maximum(across, 0), np.maximum(along, 0)) + np.minimum(np.maximum(across, along), 0))


def _outline(profile: Profile) -> Callable[[Array], Array]:
    """Signed distance of points (n, 2) from an outline, from the definition of its segments and arcs."""

    def distance(x: Array) -> Array:
        least, turn = np.full(len(x), np.inf), np.zeros(len(x))
        for edge in profile.edges:
            start, end = np.array(edge.start), np.array(edge.end)
            a, b = x - start, x - end
            along = end - start
            if isinstance(edge, Arc):
                c = x - edge.centre
                rho, off = np.hypot(*c.T), np.arctan2(c[:, 1], c[:, 0]) - 0.5 * (edge.start_angle + edge.end_angle)
                on = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi) <= 0.5 * abs(edge.sweep)
                ends = np.minimum(np.hypot(*a.T), np.hypot(*b.T))
                least = np.minimum(least, np.where(on, np.abs(rho - edge.radius), ends))
                # Between an arc and its chord the arc turns once more round the point than the chord does.
                side = (along[0] * a[:, 1] - along[1] * a[:, 0]) * np.sign(edge.sweep)
                whole = abs(edge.sweep) >= 2.0 * math.pi - 1e-9
                turn += np.sign(edge.sweep) * ((rho < edge.radius) & ((side < 0.0) | whole))
                if whole:
                    continue
            else:
                s = np.clip(a @ along / (along @ along), 0.0, 1.0)[:, None]
                least = np.minimum(least, np.hypot(*(a - s * along).T))
            turn += np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)) / (2.0 * math.pi)
        return np.where(np.round(turn) != 0, -least, least)

    return distance


def _solid(solid: Solid) -> Field:
    """The bodies less the holes. A hole along a body's own axis is cut out of its outline: that keeps distances exact."""
    holes = [(hole, _outline(hole.profile)) for hole in solid.holes]

    def one(extrusion: Extrusion) -> Field:
        outline, frame = _outline(extrusion.profile), extrusion.frame
        middle, half = 0.5 * (extrusion.start + extrusion.end), 0.5 * (extrusion.end - extrusion.start)

        def field(x: Array) -> Array:
            local = x @ frame
            across = outline(local[:, :2])
            for hole, circle in holes:
                if hole.axis == extrusion.axis:
                    across = np.maximum(across, -circle(local[:, :2]))
            return _prism(across, np.abs(local[:, 2] - middle) - half)

        return field

    fields = [one(extrusion) for extrusion in solid.bodies]
    crossing = [(hole, f) for hole, f in holes if any(hole.axis != made.axis for made in solid.bodies)]

    def field(x: Array) -> Array:
        found = np.min([f(x) for f in fields], axis=0)
        for hole, circle in crossing:
            found = np.maximum(found, -circle((x @ hole.frame)[:, :2]))
        return np.asarray(found)

    return field


def _groove(groove: SweptArc) -> Field:
    R, s, h = groove.radius, groove.radius * math.sin(groove.half_angle), -groove.radius * math.cos(groove.half_angle)

    def field(x: Array) -> Array:
        u, v = np.abs(x[:, 0]), x[:, 1]
        rho, lip = np.hypot(u, v), np.hypot(u - s, v - h)
        edge = np.minimum(
            np.where(np.arctan2(u, -v) <= groove.half_angle, np.abs(rho - R), lip), np.where(u >= s, np.abs(v - h), lip)
        )
        return _prism(np.where((v <= h) & (rho >= R), -edge, edge), np.abs(x[:, 2]) - 0.5 * groove.length)

    return field


def _mesh(triangles: Array) -> Field:
    """Distance from triangles (m, 3, 3), negative where they wind round the point (solid angles)."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    walls = np.cross(normal[:, None], sides)

    def some(x: Array) -> Array:
        r = x[:, None, None] - triangles
        s = np.clip((r * sides).sum(-1) / np.maximum((sides * sides).sum(-1), 1e-300), 0.0, 1.0)
        edge = np.linalg.norm(r - s[..., None] * sides, axis=-1).min(axis=2)
        height = np.abs(np.einsum("nmj,mj->nm", r[:, :, 0], normal))
        least = np.where(((r * walls).sum(-1) >= 0.0).all(axis=2), height, edge).min(axis=1)
        a, b, c = (-r[:, :, k] for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
        below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
        turns = np.arctan2((a * np.cross(b, c)).sum(-1), below).sum(axis=1) / (2.0 * math.pi)
        return np.where(turns > 0.5, -least, least)

    step = max(1, 200_000 // len(triangles))
    return lambda x: np.concatenate([some(x[k : k + step]) for k in range(0, len(x), step)] or [np.empty(0)])


@dataclass(frozen=True, slots=True, eq=False)
class Common:
    """The least of ``max(field_a, field_b)`` over all points lies between ``lower`` and ``upper``, mm.

    Negative: the bodies share a ball of that radius; positive: they are at least twice as far apart. ``points`` (k, 3)
    are the lowest that were looked at, the first has ``upper``.
    """

    lower: float
    upper: float
    points: Array


def common(
    a: AnyBody, b: AnyBody, T_a_b: Array | None = None, *, accuracy: float = 0.01, cells: int = 100_000
) -> Common:
    """How deep two bodies share a point, or how far both are from the point nearest to both, by branch and bound.

    Parameters
    ----------
    a, b : Body or shape
    T_a_b : ndarray (4, 4), optional
        Pose of b in the frame of a.
    accuracy : float
        Width in mm at which the search ends.
    cells : int
        Number of boxes looked at after which it ends with what is proven.
    """
    x, y = body(a), body(b) if T_a_b is None else body(b).at(T_a_b)
    low, high = _region(x, y)
    centre, half = 0.5 * (low + high)[None], 0.5 * (high - low)
    best, floor, seen = math.inf, math.inf, 0
    kept, values = np.empty((0, 3)), np.empty(0)
    while len(centre):
        value = np.maximum(x.field(centre), y.field(centre))
        seen += len(centre)
        best = min(best, float(value.min()))
        radius = float(np.linalg.norm(half))
        order = np.argsort(np.concatenate([values, value]), kind="stable")[:64]
        kept, values = np.concatenate([kept, centre])[order], np.concatenate([values, value])[order]
        open_ = value - radius < best - accuracy
        if seen > cells:
            floor = float((value - radius).min(initial=math.inf, where=open_))
            break
        centre = centre[open_]
        k = int(np.argmax(half))
        half = np.where(np.arange(3) == k, 0.5 * half, half)
        shift = np.eye(3)[k] * half[k]
        centre = np.concatenate([centre - shift, centre + shift])
    return Common(min(floor, best - accuracy), best, kept)


def _region(x: Body, y: Body) -> tuple[Array, Array]:
    """A box with every point that can be the nearest to both; of a body without end only what is near the other."""
    boxes = [x.box, y.box]
    for k, (one, other) in enumerate(((x, y), (y, x))):
        if not np.isfinite(one.box).all():
            middle, reach = other.box.mean(axis=0), float(np.linalg.norm(0.5 * np.diff(other.box, axis=0)))
            reach += max(0.0, float(one.field(middle[None])[0]))
            boxes[k] = np.array([other.box[0] - reach, other.box[1] + reach])
    return np.minimum(boxes[0][0], boxes[1][0]), np.maximum(boxes[0][1], boxes[1][1])


def separation(
    a: AnyBody, b: AnyBody, T_a_b: Array | None = None, *, accuracy: float = 0.01, cells: int = 20_000
) -> Distance:
    """Distance of two bodies, 0 where they meet: ``lower`` proven by `common`, ``upper`` by points of both.

    The points are found by descent from the lowest ones of the search: they need not be the nearest, but they are there.
    """
    x, y = body(a), body(b) if T_a_b is None else body(b).at(T_a_b)
    found = common(x, y, accuracy=0.5 * accuracy, cells=cells)
    if found.upper <= 0.0:
        return Distance(0.0, 0.0, found.points[0], found.points[0])
    q = found.points
    for _ in range(_PROJECTIONS):
        p = _onto(x, q)
        q = _onto(y, p)
        gaps = np.linalg.norm(q - p, axis=1)
        q = q[np.argsort(gaps)[: max(_FOLLOWED, len(q) // 2)]]
    trials = np.concatenate([q, *(_polished(x, y, point) for point in q)])
    p = _onto(x, trials)
    q = _onto(y, p)
    # What the last projection has left outside is added: from there the bodies are no further.
    outside = np.maximum(x.field(p), 0.0) + np.maximum(y.field(q), 0.0)
    gaps = np.where(outside <= 1e-9 * (1.0 + np.abs(p).max()), np.linalg.norm(q - p, axis=1) + outside, np.inf)
    k = int(np.argmin(gaps))
    return Distance(max(0.0, 2.0 * found.lower), float(gaps[k]), p[k], q[k], method="branch and bound")


def _polished(x: Body, y: Body, start: Array) -> Array:
    """Points (2, 3) near ``start`` (3,) on the two bodies that a descent finds nearest to each other."""
    from scipy.optimize import minimize

    def inside(v: Array) -> list[float]:
        return [-float(x.field(v[None, :3])[0]), -float(y.field(v[None, 3:])[0])]

    def slopes(v: Array) -> Array:
        out = np.zeros((2, 6))
        out[0, :3], out[1, 3:] = -_slope(x, v[None, :3])[0], -_slope(y, v[None, 3:])[0]
        return out

    found = minimize(
        lambda v: np.sum((v[:3] - v[3:]) ** 2),
        np.concatenate([_onto(x, start[None])[0], start]),
        jac=lambda v: 2.0 * np.concatenate([v[:3] - v[3:], v[3:] - v[:3]]),
        constraints={"type": "ineq", "fun": inside, "jac": slopes},
        method="SLSQP",
        options={"maxiter": 40, "ftol": 1e-13},
    )
    return np.asarray(found.x.reshape(2, 3))


def _slope(it: Body, x: Array) -> Array:
    """Slopes (n, 3) of the field at points (n, 3), by differences."""
    step = 1e-6 * np.concatenate([np.eye(3), -np.eye(3)])
    values = it.field((x[None] + step[:, None]).reshape(-1, 3)).reshape(6, len(x))
    return np.asarray((values[:3] - values[3:]).T / 2e-6)


def _onto(it: Body, x: Array) -> Array:
    """Points (n, 3) moved down the field until they are on the body."""
    for _ in range(6):
        out = it.field(x)
        far = np.flatnonzero(out > 0.0)
        if not len(far):
            break
        x = x.copy()
        x[far] -= out[far, None] * _slope(it, x[far])
    return x


def directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over the sphere (Fibonacci)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    return np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])


def assert_distance(
    found: Distance, a: AnyBody, b: AnyBody, T_a_b: Array | None = None, *, tolerance: float = 1e-6, cells: int = 20_000
) -> None:
    """``lower <= true signed distance <= upper``, and the points and the normal are what they are said to be.

    Apart: no two points of the bodies are nearer than ``lower``; the named points lie on the bodies and are ``upper``
    apart. In an overlap: no translation shorter than ``-upper`` parts the bodies, one by ``-lower`` along the normal
    does. Moving by the distance along the normal makes them touch.

    Parameters
    ----------
    found : Distance
        The answer, points in the frame of a.
    a, b, T_a_b
        As for `common`.
    tolerance : float
        What the answer may be wrong by, mm.
    cells : int
        Work of one search.
    """
    x, y = body(a), body(b) if T_a_b is None else body(b).at(T_a_b)
    assert found.lower <= found.upper + tolerance, f"bounds are crossed: {found.lower} > {found.upper}"
    p, q, n = found.point_a, found.point_b, found.normal
    if p is not None and q is not None and found.upper < math.inf:
        for name, it, point in (("a", x, p), ("b", y, q)):
            out = float(it.field(point[None])[0])
            assert out <= tolerance, f"point on {name} is {out:.3g} mm outside"
        if found.upper >= 0.0:
            assert np.linalg.norm(q - p) <= found.upper + tolerance, "the points are further apart than upper"
    truth = separation(x, y, cells=cells)
    if truth.upper > 0.0:
        assert found.lower <= truth.upper + tolerance, f"lower {found.lower} > attained {truth.upper}"
        assert truth.lower <= found.upper + tolerance, f"upper {found.upper} < proven {truth.lower}"
    else:
        deep = common(x, y, cells=cells).upper
        assert found.lower <= 2.0 * deep + tolerance, f"lower {found.lower}, but they share a ball of {-deep} mm"
    if found.upper < -tolerance:
        ways = directions(_WAYS) if n is None else np.vstack([n, directions(_WAYS)])
        for way in ways:
            kept = common(x, _moved(y, -0.999 * found.upper * way), cells=cells // 10)
            assert kept.lower <= 0.0, f"parted by less than {-found.upper} mm along {way}"
    if n is not None and math.isfinite(found.lower):
        assert abs(float(np.linalg.norm(n)) - 1.0) <= 1e-9, "the normal is no unit vector"
        closed = common(x, _moved(y, -found.lower * n), cells=cells).upper
        assert closed >= -0.5 * tolerance, f"moved by {-found.lower} along the normal they overlap by {-2.0 * closed}"


def _moved(it: Body, by: Array) -> Body:
    T = np.eye(4)
    T[:3, 3] = by
    return it.at(T)


def pose_at(motion: Motion, t: float, start: Array) -> Array:
    """Pose (4, 4) at time t of a body that stands at ``start`` (4, 4): the exponential of the motion's twist."""
    from scipy.linalg import expm

    u = motion.angle * motion.axis
    twist = np.zeros((4, 4))
    twist[:3, :3] = [[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]]
    turn = expm(t * twist)
    T = turn @ start
    T[:3, 3] += motion.point - turn[:3, :3] @ motion.point + t * motion.travel
    return T


def assert_lower_on_way(
    lower: float, a: AnyBody, b: AnyBody, poses: Iterable[Array], *, tolerance: float = 1e-6, cells: int = 5_000
) -> None:
    """At none of the ``poses`` (4, 4) of b two points are nearer than ``lower`` mm, nor do the bodies overlap more."""
    if lower == -math.inf:
        return
    x, y = body(a), body(b)
    for k, T in enumerate(poses):
        truth = separation(x, y.at(T), cells=cells)
        value = truth.upper if truth.upper > 0.0 else 2.0 * common(x, y.at(T), cells=cells).upper
        assert lower <= value + tolerance, f"lower {lower} on the way, but {value} at pose {k}"


def assert_motion(
    found: MotionDistance,
    a: AnyBody,
    b: AnyBody,
    motion: Motion,
    T_a_b: Array,
    *,
    first: bool = False,
    times: int = 17,
    tolerance: float = 1e-6,
    cells: int = 5_000,
) -> None:
    """No time has a distance below the least one; with ``first``: none before the first contact has an overlap.

    Parameters
    ----------
    found : MotionDistance
        What `min_clearance` or, with ``first``, `first_contact` (margin 0) said.
    a, b, motion, T_a_b
        What it was asked: b moves from its pose ``T_a_b`` (4, 4) in the frame of a.
    times : int
        Number of even times that are looked at.
    tolerance, cells
        As for `assert_distance`.
    """
    apart = np.abs(found.pose - pose_at(motion, found.t, T_a_b)).max()
    assert apart <= 1e-9 * (1.0 + np.abs(found.pose).max()), f"the pose is not that of t = {found.t}"
    until = found.t if first and found.touches else 1.0
    poses = [pose_at(motion, t, T_a_b) for t in np.linspace(0.0, until, times)[: -1 if until < 1.0 else None]]
    if not first or not found.touches:
        assert_lower_on_way(found.distance.lower, a, b, poses, tolerance=tolerance, cells=cells)
        point = replace(found.distance, lower=-math.inf)
        assert_distance(point, a, b, found.pose, tolerance=tolerance, cells=cells)
    else:
        assert_lower_on_way(0.0, a, b, poses, tolerance=max(tolerance, found.resolution), cells=cells)


def assert_fit(feature: FittedSurface, points: Array, *, assumed_round: bool = False) -> None:
    """Points (n, 3) of the true surface, between the feature's ends, lie within its stated error of the fitted one."""
    local = (points - feature.T_part_feature[:3, 3]) @ feature.T_part_feature[:3, :3]
    off = float(np.abs(np.hypot(local[:, 0], local[:, 1]) - feature.radius).max())
    error = feature.fit_error if assumed_round else feature.error_bound
    assert off <= error + 1e-12 * feature.radius, f"{feature.name}: {off} mm off, stated {error} mm"


def assert_pieces(whole: AnyBody, pieces: Iterable[AnyBody], *, outside: float, count: int = 20_000) -> None:
    """The pieces of a decomposition cover the body, and stand out of it by ``outside`` mm at most, at ``count`` points."""
    it, parts = body(whole), [body(piece) for piece in pieces]
    low, high = np.min([p.box[0] for p in [it, *parts]], axis=0), np.max([p.box[1] for p in [it, *parts]], axis=0)
    from scipy.stats import qmc

    x = qmc.scale(qmc.Halton(3, seed=0).random(count), low, high)
    own, covered = it.field(x), np.min([p.field(x) for p in parts], axis=0)
    missing = (own < 0.0) & (covered > 1e-9)
    assert not missing.any(), f"{x[missing][0]} is in the body and in no piece"
    out = float(np.max(own, where=covered < 0.0, initial=-math.inf))
    assert out <= outside + 1e-9, f"a piece stands out by {out} mm"


def assert_returns(solve: Callable[[Array], Array], state: Array, neighbours: Iterable[Array], tolerance: float) -> None:
    """An equilibrium solved again from its ``neighbours`` is the same to ``tolerance``; ``solve(start)`` -> state."""
    for start in neighbours:
        off = float(np.abs(solve(start) - state).max())
        assert off <= tolerance, f"from {start} it ends {off} away"
