"""Two shapes by their meshes: distance and overlap between bounds, by FCL and manifold3d.

A drawn solid lies between two meshes, one wholly inside it and one wholly around it. Distance falls and depth grows
with the bodies, so the outer pair bounds the truth from below and the inner pair from above. Other meshes are the part
but for an error of each triangle.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.farthest import End
from clamp3d.engine.model import Model
from clamp3d.engine.overlap import Common, common, deepest, thickness
from clamp3d.engine.surface import TURN, Surface, fcl_pair, rounding_of, tree_distance
from clamp3d.geometry.manifolds import arrays_of
from clamp3d.geometry.pose import Array, inverse, to_source, to_target

CUTS, FEW_CUTS = 100_000, 20_000
"""Triangles that those of an overlap are cut into beyond their number, to bound its thickness: seconds, or much
less where Open CASCADE can be asked next.
"""
_HALVINGS = 30
"""Halvings of the way between two nearest points after which the true surface on it is known to rounding."""


def meshes_distance(a: Model, b: Model, T: Array, error: float, enough: Enough, cuts: int = CUTS) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame, from meshes of chord error ``error`` mm.

    In an overlap the bounds are those of the interference: the greatest depth of a point of one body in the other. It
    is bounded from above only where that can be ``enough``. ``cuts``: triangles that those of an overlap are cut into
    beyond their number, to bound its thickness.
    """
    chord_error = f", chord error {error:.2g} mm" if a.refines or b.refines else ""
    distance = _between_meshes(a, b, T, error, enough, cuts)
    return replace(distance, method=f"meshes (FCL){chord_error}")


def _between_meshes(a: Model, b: Model, T: Array, error: float, enough: Enough, cuts: int) -> Distance:
    outer_a, outer_b = a.outer(error), b.outer(error)
    outer = surface_distance(outer_a, outer_b, T, enough, cuts)
    if not (a.bracketed or b.bracketed):
        return outer
    inner_a, inner_b = a.inner(error), b.inner(error)
    if inner_a is None or inner_b is None:
        return Distance(outer.lower)
    # No upper bound of an overlap is asked for: the inner meshes attest depths alone.
    inner = surface_distance(inner_a, inner_b, T, lambda _: False)
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
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        point = to_source(T, inside + middle * (outside - inside))
        if max(float(body.depth(point[None])[0]) for body in model.bodies) >= 0.0:
            low = middle
        else:
            high = middle
    return np.asarray(inside + low * (outside - inside))


def surface_distance(a: Surface, b: Surface, T: Array, enough: Enough, cuts: int = CUTS) -> Distance:
    """Signed distance of two meshes, ``b`` at ``T`` (4, 4) in a's frame; answers as `meshes_distance`."""
    rounding = rounding_of(a, b, T)
    if not surfaces_meet(a, b, T):
        lower, upper, p, q = nearest_points(a, b, T)
        if upper > rounding and not one_in_other(a, b, T):
            off = float(a.error_at(p[None])[0] + b.error_at(to_source(T, q)[None])[0])
            return Distance(lower - rounding, upper + off + rounding, p, q)
    shared = common(a, b, T)
    if shared is None:
        off = errors_nearby(a, b, T) + rounding
        return Distance(-off, off)
    depth, point = deepest(a, b, T, shared)
    upper = rounding - depth

    def bounded(overlap: float) -> Distance:
        return Distance(-overlap - rounding, max(upper, -overlap - rounding), point, point)

    unbounded = Distance(-np.inf, upper, point, point)
    measured = max(0.0, depth + a.error + b.error)  # of the meshes, there: no bound is less
    if enough(unbounded) or not enough(bounded(measured)):
        return unbounded

    def end(bound: float, reached: float) -> bool:
        return enough(bounded(bound)) or not enough(bounded(max(measured, reached)))

    bound = greatest_overlap(a, b, T, shared, end, cuts)
    return bounded(bound) if bound + rounding >= depth else unbounded


def greatest_overlap(a: Surface, b: Surface, T: Array, shared: Common, end: End, cuts: int) -> float:
    """Upper bound (mm) of how deep a point of one true body lies in the other, from their meshes' common part.

    It is sharpened as `thickness` is, unless it cannot be enough for the ``end`` at all.
    """
    off = errors_nearby(a, b, T)
    if off > 0.0 and end(np.inf, off):
        return np.inf
    return max(off, thickness(a, b, T, shared, lambda bound, least: end(max(bound, off), max(least, off)), cuts))


def errors_nearby(a: Surface, b: Surface, T: Array) -> float:
    """The largest sum (mm) of the errors of a triangle of each mesh that are no further apart than that.

    Lemma: where the meshes do not overlap, the true bodies overlap by no more: a point of both is within each
    triangle's error of it.
    """
    pairs, rounding = itertools.product(a.fine_groups, b.fine_groups), rounding_of(a, b, T)
    for first, second in sorted(pairs, key=lambda pair: -pair[0].error - pair[1].error):
        total = first.error + second.error
        if tree_distance(first.tree, second.tree, T) <= total + rounding:
            return total
    return 0.0


def are_apart(a: Surface, b: Surface, T: Array) -> bool:
    """Whether the true bodies of two meshes certainly do not overlap, ``b`` at ``T`` (4, 4) in a's frame."""
    rounding = rounding_of(a, b, T)
    if surfaces_meet(a, b, T):
        return False
    gap = tree_distance(a.bvh, b.bvh, T)
    if gap <= rounding or (gap < a.error + b.error + rounding and nearest_points(a, b, T)[0] < rounding):
        return False
    return not one_in_other(a, b, T)


def one_in_other(a: Surface, b: Surface, T: Array) -> bool:
    """Whether a shell of a mesh lies in the other one, ``b`` at ``T`` (4, 4) in a's frame; no surfaces may meet."""
    return one_inside(a, b, T) or one_inside(b, a, inverse(T))


def one_inside(outer: Surface, inner: Surface, T: Array) -> bool:
    """Whether a shell of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer``; no surfaces may meet."""
    return bool(outer.contains(to_target(T, inner.shell_points)).any())


def surfaces_meet(a: Surface, b: Surface, T: Array) -> bool:
    """Whether a triangle of ``a`` meets one of ``b``, placed by ``T`` (4, 4) in a's frame."""
    import fcl

    return bool(fcl.collide(*fcl_pair(a.bvh, b.bvh, T), fcl.CollisionRequest(), fcl.CollisionResult()))


def nearest_points(a: Surface, b: Surface, T: Array) -> tuple[float, float, Array, Array]:
    """Distance (mm) of the true surfaces at least, of the meshes, and its points (3,); no surfaces may meet."""
    import fcl

    lower, best, points = np.inf, np.inf, (np.zeros(3), np.zeros(3))
    turned = T @ TURN
    for first, second in itertools.product(a.groups, b.groups):
        answer = fcl.DistanceResult()
        request = fcl.DistanceRequest(enable_nearest_points=True)
        d = float(fcl.distance(*fcl_pair(first.tree, second.tree, turned), request, answer))
        lower = min(lower, d - first.error - second.error)
        if d < best:
            p, q = answer.nearest_points
            best, points = d, (np.array(p, dtype=np.float64), np.array(q, dtype=np.float64))
    return lower, max(best, 0.0), *points


def within(inner: Surface, outer: Surface, T: Array, slack: float) -> bool:
    """Whether all of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer`` or within ``slack`` mm of it."""
    points = to_target(T, inner.vertices)
    if (points < outer.box[0] - slack).any() or (points > outer.box[1] + slack).any():
        return False
    if not outer.contains(points[outer.distance(points) > slack]).all():
        return False
    corners, faces = arrays_of(inner.manifold.transform(np.ascontiguousarray(T[:3])) - outer.manifold)
    # What fills a hole of the other may have all its corners on the hole's rim, but not the middles of its triangles;
    # what fills a void has these on its walls too, but not what is inside.
    beneath = Common(corners, faces).inner_points if len(faces) else corners
    return bool((outer.distance(np.vstack([corners, corners[faces].mean(axis=1), beneath])) <= slack).all())


def is_deep_inside(inner: Surface, outer: Surface, T: Array, slack: float) -> bool:
    """Whether all of ``inner``, at ``T`` (4, 4) in outer's frame, lies in ``outer``, by more than ``slack`` mm."""
    if tree_distance(outer.bvh, inner.bvh, T) <= slack:
        return False
    return bool((inner.manifold.transform(np.ascontiguousarray(T[:3])) - outer.manifold).is_empty())
