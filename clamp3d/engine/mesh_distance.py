"""Two shapes by their meshes: distance and overlap between bounds, by FCL and manifold3d.

A drawn solid lies between two meshes, one wholly inside it and one wholly around it. Distance falls and depth grows
with the bodies, so the outer pair bounds the truth from below and the inner pair from above. Other meshes are the part
but for an error of each triangle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.model import Model
from clamp3d.engine.overlap import common, deepest, thickness
from clamp3d.engine.surface import Surface
from clamp3d.geometry.pose import Array, inverse

Enough = Callable[[Distance], bool]

_MOST_POINTS = 400
"""Vertices of a mesh, spread over it, that are tried as points inside another one."""
_CUTS, _FEW_CUTS = 100_000, 2_000
"""Triangles that those of an overlap are cut into beyond their number, to bound its thickness: seconds, or much
less where Open CASCADE can be asked instead.
"""
_HALVINGS = 30
"""Halvings of the way between two nearest points after which the true surface on it is known to rounding."""


def meshes_distance(a: Model, b: Model, T: Array, error: float, enough: Enough) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame, from meshes of chord error ``error`` mm.

    In an overlap the bounds are those of the interference: the greatest depth of a point of one body in the other. It
    is bounded from above only where that can be ``enough``.
    """
    cuts = _CUTS if a.exact is None or b.exact is None else _FEW_CUTS
    outer = surface_distance(a.outer(error), b.outer(error), T, enough, cuts)
    if not (a.bracketed or b.bracketed):
        return outer
    inner_a, inner_b = a.inner(error), b.inner(error)
    if inner_a is None or inner_b is None:
        return Distance(outer.lower)
    inner = surface_distance(inner_a, inner_b, T, _nothing)
    p, q = inner.point_a, inner.point_b
    if inner.lower > 0.0 and p is not None and q is not None:
        p = _towards(a, np.eye(4), p, q)
        q = _towards(b, T, q, p)
        slack = float(inner_a.error_at(p[None])[0] + inner_b.error + rounding_of(inner_a, inner_b, T))
        inner = replace(inner, upper=min(inner.upper, float(np.linalg.norm(q - p)) + slack), point_a=p, point_b=q)
    return replace(inner, lower=min(outer.lower, inner.upper), normal=None)


def _towards(model: Model, T: Array, inside: Array, outside: Array) -> Array:
    """Last point (3,) of a drawn solid at ``T`` (4, 4) on the way from a point of its inner mesh to one outside."""
    if model.bodies is None or not model.bracketed:
        return inside
    R, t = T[:3, :3], T[:3, 3]
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        point = (inside + middle * (outside - inside) - t) @ R
        if max(float(body.depth(point[None])[0]) for body in model.bodies) >= 0.0:
            low = middle
        else:
            high = middle
    return np.asarray(inside + low * (outside - inside))


def surface_distance(a: Surface, b: Surface, T: Array, enough: Enough, cuts: int = _CUTS) -> Distance:
    """Signed distance of two meshes, ``b`` at ``T`` (4, 4) in a's frame; answers as `meshes_distance`."""
    rounding = rounding_of(a, b, T)
    if surfaces_meet(a, b, T):
        return _overlap(a, b, T, enough, cuts)
    lower, upper, p, q = nearest_points(a, b, T)
    if upper <= rounding:
        return _overlap(a, b, T, enough, cuts)
    if one_inside(a, b, T) or one_inside(b, a, inverse(T)):
        return _overlap(a, b, T, enough, cuts)
    local = (q - T[:3, 3]) @ T[:3, :3]
    off = float(a.error_at(p[None])[0] + b.error_at(local[None])[0])
    return Distance(lower - rounding, upper + off + rounding, p, q)


def _overlap(a: Surface, b: Surface, T: Array, enough: Enough, cuts: int) -> Distance:
    """Bounds of the interference of two meshes of which one meets the other or lies inside it."""
    rounding = rounding_of(a, b, T)
    off = a.error + b.error + rounding
    vertex = _deepest_vertex(a, b, T)
    if vertex is not None and -vertex.upper > 0.05 * min(float(np.ptp(s.box, axis=0).max()) for s in (a, b)):
        return vertex  # so deep that neither where nor how deep matters for any verdict
    shared = common(a, b, T)
    if shared is None:
        return Distance(-off, off)
    depth, deepest_point = deepest(a, b, T, shared)
    point: Array | None = deepest_point
    upper = rounding - depth
    if vertex is not None and vertex.upper < upper:
        upper, point = vertex.upper, vertex.point_a

    def of_thickness(bound: float) -> Distance:
        return Distance(-bound - off, max(upper, -bound - off), point, point)

    unbounded = Distance(-np.inf, upper, point, point)
    of_meshes = depth + a.error + b.error  # what was measured there: no bound of the meshes' overlap is less
    if enough(unbounded) or not enough(of_thickness(max(0.0, -upper, of_meshes))):
        return unbounded
    return of_thickness(thickness(a, b, T, shared, lambda bound: enough(of_thickness(bound)), cuts))


def _nothing(_: Distance) -> bool:
    """Nothing is enough, and no upper bound of an overlap is asked for: the inner meshes attest depths alone."""
    return False


def _deepest_vertex(a: Surface, b: Surface, T: Array) -> Distance | None:
    """The deepest of some vertices of either mesh in the other, which attests a depth without the common part."""
    best = None
    for outer, inner, place, back in ((a, b, T, None), (b, a, inverse(T), T)):
        points = inner.vertices[:: max(1, len(inner.vertices) // _MOST_POINTS)] @ place[:3, :3].T + place[:3, 3]
        depth = outer.certain_depth(points) - inner.error - rounding_of(a, b, T)
        k = int(np.argmax(depth))
        if depth[k] > 0.0 and (best is None or -depth[k] < best.upper):
            point = points[k] if back is None else back[:3, :3] @ points[k] + back[:3, 3]
            best = Distance(-np.inf, -float(depth[k]), point, point)
    return best


def are_apart(a: Surface, b: Surface, T: Array) -> bool:
    """Whether the true bodies of two meshes certainly do not overlap, ``b`` at ``T`` (4, 4) in a's frame."""
    rounding = rounding_of(a, b, T)
    if surfaces_meet(a, b, T):
        return False
    lower, upper, _, _ = nearest_points(a, b, T)
    return lower >= rounding and upper > rounding and not (one_inside(a, b, T) or one_inside(b, a, inverse(T)))


def one_inside(outer: Surface, inner: Surface, T: Array) -> bool:
    """Whether a shell of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer``; no surfaces may meet."""
    points = inner.shell_points @ T[:3, :3].T + T[:3, 3]
    boxed = ((points >= outer.box[0]) & (points <= outer.box[1])).all(axis=(1, 2))
    return bool(boxed.any()) and bool(outer.contains(points[boxed, 0]).any())


def rounding_of(a: Surface, b: Surface, T: Array) -> float:
    """What the distance of two meshes may be off by, mm: manifold3d merges vertices within 1e-12 of the size."""
    return 4e-12 * (a.scale + b.scale + float(np.abs(T[:3, 3]).max()))


def surfaces_meet(a: Surface, b: Surface, T: Array) -> bool:
    """Whether a triangle of ``a`` meets one of ``b``, placed by ``T`` (4, 4) in a's frame."""
    import fcl

    place = fcl.Transform(T[:3, :3], T[:3, 3])
    objects = fcl.CollisionObject(a.bvh, fcl.Transform()), fcl.CollisionObject(b.bvh, place)
    return bool(fcl.collide(*objects, fcl.CollisionRequest(), fcl.CollisionResult()))


def nearest_points(a: Surface, b: Surface, T: Array) -> tuple[float, float, Array, Array]:
    """Distance (mm) of the true surfaces at least, of the meshes, and its points (3,); no surfaces may meet."""
    import fcl

    place, here = fcl.Transform(T[:3, :3], T[:3, 3]), fcl.Transform()
    lower, best, points = np.inf, np.inf, (np.zeros(3), np.zeros(3))
    for first, e in a.groups:
        for second, f in b.groups:
            objects = fcl.CollisionObject(first, here), fcl.CollisionObject(second, place)
            answer = fcl.DistanceResult()
            d = float(fcl.distance(*objects, fcl.DistanceRequest(enable_nearest_points=True), answer))
            lower = min(lower, d - e - f)
            if d < best:
                p, q = answer.nearest_points
                best, points = d, (np.array(p, dtype=np.float64), np.array(q, dtype=np.float64))
    return lower, max(best, 0.0), *points


def within(inner: Surface, outer: Surface, T: Array, slack: float) -> bool:
    """Whether all of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer`` or within ``slack`` mm of it."""
    points = inner.vertices @ T[:3, :3].T + T[:3, 3]
    if (points < outer.box[0] - slack).any() or (points > outer.box[1] + slack).any():
        return False
    if not outer.contains(points[outer.distance(points) > slack]).all():
        return False
    rest = inner.manifold.transform(np.ascontiguousarray(T[:3])) - outer.manifold
    if rest.is_empty():
        return True
    mesh = rest.to_mesh64()
    corners = np.array(mesh.vert_properties, dtype=np.float64)[:, :3]
    if outer.distance(corners).max() > slack:
        return False
    # What fills a hole of the other may have all its corners on the hole's rim: the middle of its triangles has not.
    middles = corners[np.array(mesh.tri_verts, dtype=np.int64)].mean(axis=1)
    return bool((outer.distance(middles) <= slack).all())
