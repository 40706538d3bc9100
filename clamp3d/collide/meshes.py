"""Two shapes by their meshes: distance, overlap and containment between bounds, by FCL, libigl and manifold3d.

A drawn solid lies between two meshes, one wholly inside it and one wholly around it. Both the distance and the depth
of an overlap only shrink or grow with the bodies, so the outer pair bounds the truth from below and the inner pair from
above, whatever angles faces and holes meet at. Other meshes are the part but for an error of each triangle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distance
from clamp3d.collide.model import Model
from clamp3d.collide.overlap import common, deepest, deepest_at_most
from clamp3d.collide.surface import Surface
from clamp3d.core.linear import dot, norm, to_source, to_target
from clamp3d.core.pose import Array, inverse
from clamp3d.core.triangles import distinct

_HALVINGS = 16
"""Ninths of a way that the surface of a body is looked for in, one after another: then it is known to rounding."""
_SPREAD = 100
"""Vertices of a mesh, spread over it, that are looked for in another one."""
_TRIED = 3
"""Directions in which an overlap is tried to be parted."""

Enough: TypeAlias = Callable[[Distance], bool]
Rows: TypeAlias = NDArray[np.intp]


def meshes_distance(
    a: Model, b: Model, T: Array, error: float, enough: Enough = lambda _: False, *, search: bool = True
) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame, from meshes of chord error ``error`` mm.

    In an overlap ``upper`` is minus a depth that a point of both has, ``lower`` minus a move that parts them if one
    of the few that are tried does. A depth that is ``enough`` ends the search: that of one vertex often is. With
    ``search`` the deepest point is limited from above too.
    """
    if not (a.between or b.between):
        return surface_distance(a.outer(error), b.outer(error), T, enough, search=search)
    outer = surface_distance(a.outer(error), b.outer(error), T)
    inner_a, inner_b = a.inner(error), b.inner(error)
    if inner_a is None or inner_b is None:
        return replace(outer, upper=np.inf, point_a=None, point_b=None, normal=None)
    inner = surface_distance(inner_a, inner_b, T)
    if inner.lower > 0.0 and inner.point_a is not None and inner.point_b is not None:
        p = _on_surface(a, np.eye(4), inner.point_a, inner.point_b)
        q = _on_surface(b, T, inner.point_b, p)
        off = inner_a.error + inner_b.error + rounding_of(inner_a, inner_b, T)
        inner = replace(inner, upper=norm(q - p) + off, point_a=p, point_b=q)
    found = replace(inner, lower=min(outer.lower, inner.upper), normal=None)
    if search and outer.upper < 0.0 and not enough(found):
        outer = surface_distance(a.outer(error), b.outer(error), T, search=True)
        found = replace(found, lower=min(outer.lower, inner.upper))
    return found


def _on_surface(model: Model, T: Array, inside: Array, outside: Array) -> Array:
    """Last point (3,) of a drawn solid at ``T`` (4, 4) on the way from a point of its inner mesh to one outside."""
    forms = model.bodies
    if forms is None or not model.between:
        return inside
    start, way = to_source(T, inside), dot(outside - inside, T[:3, :3])
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        steps = np.linspace(low, high, 10)[1:-1]
        depth = np.max([form.depth(start + steps[:, None] * way) for form in forms], axis=0)
        out = np.flatnonzero(depth < 0.0)
        first = int(out[0]) if len(out) else len(steps)
        low, high = (steps[first - 1] if first else low), (steps[first] if first < len(steps) else high)
    return np.asarray(inside + low * (outside - inside))


def surface_distance(
    a: Surface, b: Surface, T: Array, enough: Enough = lambda _: False, *, search: bool = False
) -> Distance:
    """Signed distance of two meshes, ``b`` at ``T`` (4, 4) in a's frame; answers as `meshes_distance`.

    With ``search`` the deepest point of an overlap is limited from above too, if the rest is not ``enough``.
    """
    rounding = rounding_of(a, b, T)
    meeting = _contacts(a, b, T)
    if meeting is not None:
        first = _vertex_depth(a, b, T, meeting, rounding)
        return first if enough(first) else _overlap(a, b, T, rounding, enough, search)
    lower, upper, p, q = _gap(a, b, T)
    if upper <= rounding:
        return _overlap(a, b, T, rounding, enough, search)
    for outer, inner, place, swapped in ((a, b, T, False), (b, a, inverse(T), True)):
        if any_inside(outer, inner, place):  # no surface in common: that shell lies inside as a whole
            points = to_target(place, inner.vertices[:: max(1, len(inner.vertices) // 50)])
            away = outer.distance(points) if len(inner.shells) == 1 else np.array([upper])
            k = int(np.argmax(away))
            depth = max(upper, float(away[k])) - a.error - b.error - rounding
            at = to_target(T, points[k]) if swapped else points[k]
            one = len(away) == len(points)
            return Distance(-np.inf, -depth, at if one else None, at if one else None)
    off = float(a.error_at(p[None])[0] + b.error_at(dot((q - T[:3, 3])[None], T[:3, :3]))[0])
    return Distance(lower - rounding, upper + off + rounding, p, q)


def gap(a: Surface, b: Surface, T: Array) -> float:
    """Gap (mm) that ``b`` at ``T`` (4, 4) certainly keeps from ``a``.

    Minus infinity if they meet or one holds the other. The errors of both meshes are taken off.
    """
    rounding = rounding_of(a, b, T)
    lower, upper, _, _ = nearest_of(a, b, T)
    if upper <= rounding or any_inside(a, b, T) or any_inside(b, a, inverse(T)):
        return -np.inf
    return lower - rounding


def any_inside(outer: Surface, inner: Surface, T: Array) -> bool:
    """Whether a shell of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer``; no surfaces may meet.

    A shell with a vertex outside of the other's box is not inside; only for the others winding numbers are asked.
    A surface with an edge may hold a part of a shell alone.
    """
    points = to_target(T, inner.shell_points)
    if not outer.rimless:
        each = points.reshape(-1, 1, 3)
        each = each[((each > outer.box[0]) & (each < outer.box[1])).all(axis=(1, 2))]
        return any(outer.contains(point)[0] for point in each)  # one will do, and each takes a sum over all triangles
    boxed = ((points >= outer.box[0]) & (points <= outer.box[1])).all(axis=(1, 2))
    return bool(boxed.any()) and bool(outer.contains(points[boxed, 0]).any())


def rounding_of(a: Surface, b: Surface, T: Array) -> float:
    """What the distance of two meshes may be off by, mm: manifold3d merges vertices within 1e-12 of the size."""
    return 4e-12 * (a.scale + b.scale + float(np.abs(T[:3, 3]).max()))


def _contacts(a: Surface, b: Surface, T: Array, most: int = 16) -> tuple[Rows, Rows] | None:
    """Triangles of either mesh that meet one of the other, ``most`` pairs at most; None if the surfaces do not meet."""
    import fcl

    oa, ob = fcl.CollisionObject(a.bvh, fcl.Transform()), fcl.CollisionObject(b.bvh, fcl.Transform(T[:3, :3], T[:3, 3]))
    found = fcl.CollisionResult()
    fcl.collide(oa, ob, fcl.CollisionRequest(num_max_contacts=most, enable_contact=most > 1), found)
    if not found.is_collision:
        return None
    rows = np.array([(c.b1, c.b2) for c in found.contacts], dtype=np.intp).reshape(-1, 2)
    return rows[:, 0], rows[:, 1]


def _vertex_depth(a: Surface, b: Surface, T: Array, meeting: tuple[Rows, Rows], rounding: float) -> Distance:
    """The deepest of some vertices of either mesh in the other: those of triangles that meet, and of all a few."""
    found = Distance()
    for outer, inner, place, rows in ((a, b, T, meeting[1]), (b, a, inverse(T), meeting[0])):
        spread = inner.vertices[:: max(1, len(inner.vertices) // _SPREAD)]
        points = to_target(place, np.vstack([inner.vertices[distinct(inner.faces[rows])], spread]))
        points = points[((points >= outer.box[0]) & (points <= outer.box[1])).all(axis=1)]
        if len(points):
            depth = outer.certain_depth(points) - a.error - b.error - rounding
            k = int(np.argmax(depth))
            if -depth[k] < found.upper:
                at = points[k] if outer is a else to_target(T, points[k])
                found = Distance(-np.inf, -float(depth[k]), at, at)
    return found


def nearest_of(a: Surface, b: Surface, T: Array) -> tuple[float, float, Array, Array]:
    """Distance of the true surfaces at least, of the meshes, and its points (3,); 0.0 if the meshes' surfaces meet."""
    if _contacts(a, b, T, 1) is not None:
        return -np.inf, 0.0, np.zeros(3), np.zeros(3)
    return _gap(a, b, T)


def _gap(a: Surface, b: Surface, T: Array) -> tuple[float, float, Array, Array]:
    """The same for meshes whose surfaces do not meet."""
    import fcl

    place, here = fcl.Transform(T[:3, :3], T[:3, 3]), fcl.Transform()
    none = np.zeros(3)
    low, best, p, q = np.inf, np.inf, none, none
    for first, e in a.groups:
        for second, f in b.groups:
            oa, ob = fcl.CollisionObject(first, here), fcl.CollisionObject(second, place)
            answer = fcl.DistanceResult()
            d = float(fcl.distance(oa, ob, fcl.DistanceRequest(enable_nearest_points=True), answer))
            low = min(low, d - e - f)
            if d < best:
                best = d
                p, q = (np.asarray(x, dtype=np.float64) for x in answer.nearest_points)
    return low, max(best, 0.0), p, q


def _overlap(a: Surface, b: Surface, T: Array, rounding: float, enough: Enough, search: bool) -> Distance:
    """Bounds of two meshes whose surfaces meet."""
    shared = common(a, b, T)
    if shared is None:
        off = a.error + b.error + rounding
        return Distance(-off, off)
    depth, at = deepest(a, b, T, shared)
    limit = _parted(a, b, T, shared.vertices, shared.directions())
    found = Distance(-limit, rounding - depth, at, at)
    if not search or a.error + b.error > 0.0 or limit <= 1.05 * depth + rounding or enough(found):
        return found
    return replace(found, lower=max(-limit, -deepest_at_most(a, b, T, shared, depth) - rounding))


def _parted(a: Surface, b: Surface, T: Array, points: Array, directions: Array) -> float:
    """Length (mm) of a move along one of the ``directions`` (k, 3) that certainly parts the meshes, or infinity.

    ``points`` (k, 3) are those that they share: the move goes beyond them, and is tried.
    """
    off = a.error + b.error
    reach = np.ptp(dot(points, directions.T), axis=0)
    slack = 2.0 * rounding_of(a, b, T)
    for more in (0.0, off) if off > 0.0 else (0.0,):
        for k in np.argsort(reach, kind="stable")[:_TRIED].tolist():
            length = (float(reach[k]) + more) * (1.0 + 1e-9) + 2.0 * slack
            for sign in (1.0, -1.0):
                moved = T.copy()
                moved[:3, 3] += sign * length * directions[k]
                if gap(a, b, moved) >= 0.0:
                    return length
    return np.inf


def within(inner: Model, outer: Model, T: Array, error: float, slack: float) -> bool:
    """Whether all of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer`` or within ``slack`` mm of it.

    A vertex that is certainly outside by more says no at once; ``error`` mm is the chord error that is asked with.
    """
    small, large = inner.outer(error), outer.inner(error)
    if large is None:
        return False
    slack += small.error + large.error + (error if inner.refines else 0.0) + (error if outer.refines else 0.0)
    corners = to_target(T, small.shell_points.reshape(-1, 3))
    for points in (corners, to_target(T, small.vertices)):
        if (points < large.box[0] - slack).any() or (points > large.box[1] + slack).any():
            return False
        some = points[:: max(1, len(points) // 16)]
        far = some[large.distance(some) > slack]
        if len(far) and not large.contains(far[:4]).all():
            return False
    outside = small.manifold.transform(np.ascontiguousarray(T[:3])) - large.manifold
    if outside.is_empty():
        return True
    rest = outside.to_mesh64()
    points = np.array(rest.vert_properties, dtype=np.float64)[:, :3]
    if large.distance(points).max() > slack:
        return False
    # What fills a hole of the other may have all its corners on the hole's rim: points below its triangles are not.
    corners = points[np.array(rest.tri_verts, dtype=np.int64)]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    below = corners.mean(axis=1) - 1.5 * slack * normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    below = below[large.distance(below) > slack]
    below = below[~large.contains(below)]
    return not bool(small.contains(to_target(inverse(T), below)).any())
