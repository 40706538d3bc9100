"""The signed distance of a cylinder's axis segment from a groove, with witnesses: one formula for single and batch."""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.kernel import features
from clamp3d.kernel.features import Candidate, Groove, Rod
from clamp3d.kernel.jit import formula, inlined
from clamp3d.kernel.vector import Vector, dot, length, minus, over, plus, times

UNIT = 2.0**-53
"""Unit roundoff of float64."""

PARALLEL = 2.0**-60
"""An axis that leaves the groove's direction by less than this part of R over its length counts as parallel: the
deviation is smaller than the rounding of R itself, and it is part of the error bound."""


class Answer(NamedTuple):
    """Signed distance of the cylinder's surface, the groove's point, unit normal from groove to cylinder, feature.

    And the place t on the axis and a bound on the rounding error of the distance.
    """

    distance: float
    point: Vector
    normal: Vector
    feature: float
    t: float
    bound: float


@inlined
def is_parallel(groove: Groove, rod: Rod) -> bool:
    """Whether an axis counts as parallel to the groove."""
    return rod.e2 * (rod.half * rod.half) <= (PARALLEL * groove.R) * (PARALLEL * groove.R)


@inlined
def parallel(groove: Groove, rod: Rod) -> Answer:
    """Axis along z: the plane problem of a point and the section, and the gap along z."""
    R, H, r, half = groove.R, groove.H, rod.r, rod.half
    x, y, z = rod.centre
    gap, feature = features.section(groove, x, y)
    qx, qy, nx, ny = features.section_foot(groove, feature, x, y)
    axis_sign = math.copysign(1.0, rod.axis.z)
    lo, hi = max(z - half, -H), min(z + half, H)
    bound = UNIT * (6.0 * (R + abs(x) + abs(y)) + r)
    bound_along = bound + UNIT * 4.0 * (H + abs(z) + half)
    if lo <= hi:
        inside = lo if lo > 0.0 else (hi if hi < 0.0 else 0.0)  # the axis point that is farthest from both ends
        if H - abs(inside) < -gap:
            side = -1.0 if inside < 0.0 else 1.0
            point, t = Vector(x, y, side * H), (inside - z) * axis_sign
            return Answer(abs(inside) - H - r, point, Vector(0.0, 0.0, side), features.END_FACE, t, bound_along)
        middle = 0.5 * (lo + hi)
        # R - r first: exact for nearly equal radii, and rho is what is left.
        distance = (R - r) - math.sqrt(x * x + y * y) if feature == features.ARC else gap - r
        return Answer(distance, Vector(qx, qy, middle), Vector(nx, ny, 0.0), feature, (middle - z) * axis_sign, bound)
    side = 1.0 if hi == H else -1.0
    t, end = -side * half * axis_sign, lo - hi
    if gap <= 0.0:
        return Answer(end - r, Vector(x, y, side * H), Vector(0.0, 0.0, side), features.END_FACE, t, bound_along)
    distance = math.sqrt(gap * gap + end * end)
    normal = Vector(nx * (gap / distance), ny * (gap / distance), side * (end / distance))
    return Answer(distance - r, Vector(qx, qy, side * H), normal, features.beyond_end(feature), t, bound_along)


@formula
def way_out(groove: Groove, p: Vector) -> Answer:
    """Minus the depth of a point of the material, its nearest point of the boundary, the normal there, the feature."""
    depth, feature = features.depth_of(groove, p)
    if feature == features.END_FACE:
        side = 1.0 if p.z >= 0.0 else -1.0
        return Answer(-depth, Vector(p.x, p.y, side * groove.H), Vector(0.0, 0.0, side), feature, 0.0, 0.0)
    qx, qy, nx, ny = features.section_foot(groove, feature, p.x, p.y)
    return Answer(-depth, Vector(qx, qy, p.z), Vector(nx, ny, 0.0), feature, 0.0, 0.0)


@formula
def inside(groove: Groove, rod: Rod, lo: float, hi: float, bound: float) -> Answer:
    """Axis that is in S for lo <= t <= hi: minus the depth of its deepest point, minus r."""
    t = features.deepest(groove, rod, lo, hi)
    out = way_out(groove, features.axis_point(rod, t))
    return Answer(out.distance - rod.r, out.point, out.normal, out.feature, t, bound)


@formula
def inside_rate(groove: Groove, rod: Rod, t: float) -> Vector:
    """Rate of the depth's negative by a shift of an axis inside S whose deepest point is at t.

    At an end of the axis that is the normal of the face it is nearest to. Between its ends the deepest point is as near
    to a second face, towards which the axis leads the other way: the depth falls by that mixture of both normals that
    is square to the axis.
    """
    x, y, z = features.axis_point(rod, t)
    rho, z_sign = math.sqrt(x * x + y * y), 1.0 if z >= 0.0 else -1.0
    depths = (rho - groove.R, groove.h - y, groove.H - abs(z), groove.H + abs(z))
    normals = (
        Vector(-x / rho, -y / rho, 0.0),
        Vector(0.0, 1.0, 0.0),
        Vector(0.0, 0.0, z_sign),
        Vector(0.0, 0.0, -z_sign),
    )
    first = 0
    for face in range(1, 4):
        if depths[face] < depths[first]:
            first = face
    normal = normals[first]
    along = dot(normal, rod.axis)
    if abs(t) >= rod.half or along == 0.0:
        return normal
    nearest_depth = math.inf
    other, other_along = normal, 0.0
    for face in range(4):
        leads = dot(normals[face], rod.axis)
        if leads * along < 0.0 and depths[face] < nearest_depth:
            nearest_depth, other, other_along = depths[face], normals[face], leads
    if nearest_depth - depths[first] > 1e-9 * (groove.R + groove.H + depths[first]):
        return normal
    u = other_along / (other_along - along)
    return plus(times(u, normal), 1.0 - u, other)


@formula
def edge_normal(groove: Groove, feature: float, q: Vector) -> Vector:
    """A unit normal in the middle of the normal cone of an edge, for an axis that passes through the edge itself."""
    x, y, z = -q.x / groove.R, -q.y / groove.R, 0.0
    if feature in (features.LIP_M, features.LIP_N):
        y += 1.0
    elif feature != features.END_ARC:
        x = 0.0 if feature in (features.END_EDGE_M, features.END_EDGE_N) else x
        y = 1.0
    if feature not in (features.LIP_M, features.LIP_N):
        z = 1.0 if q.z > 0.0 else -1.0
    return over(Vector(x, y, z), math.sqrt(x * x + y * y + z * z))


@inlined
def is_in_material(groove: Groove, rod: Rod, t: float, is_rising: bool) -> bool:
    """Whether a point of the axis in the block is in S; ``is_rising``: it may be where the axis passes y = h."""
    p = features.axis_point(rod, t)
    is_level = is_rising and abs(p.x) >= groove.s and t == (groove.h - rod.centre.y) / rod.axis.y
    return features.is_behind_arc(groove, p.x, p.y) or is_level


@inlined
def outside(groove: Groove, rod: Rod) -> Candidate:
    """Nearest feature of an axis that does not enter S.

    A feature whose line, or whose end's plane, is no nearer than the best so far is not looked at.
    """
    H, half, z = groove.H, rod.half, rod.centre.z
    best = Candidate(math.inf, 0.0, features.ARC, rod.centre)
    for side in (-1.0, 1.0):
        best = features.on_lip(groove, rod, side, best)
    for end in (-1.0, 1.0):
        # Whether the axis reaches beyond the end face, or level with it: an axis in its plane leaves it by less than
        # rounding.
        if end * z + half * abs(rod.axis.z) >= H:
            best = at_end(groove, rod, end * H, best)
    for end in (-half, half):
        best = features.on_axis_end(groove, rod, end, best)
    return best


@formula
def at_end(groove: Groove, rod: Rod, ez: float, best: Candidate) -> Candidate:
    """The best so far, or a corner, an edge or the arc of the end in the plane z = ez."""
    circle = features.end_circle(groove, rod, ez)
    # Whether the distance from the circle may have two minima. With one, and where it falls from no corner into the
    # arc, none is on the arc.
    is_asked = abs(circle.p) < rod.e2 and abs(rod.axis.z * circle.v) < rod.e2
    for side in (-1.0, 1.0):
        best, falls = features.on_corner(groove, rod, side, ez, best)
        is_asked = is_asked or falls
    if rod.centre.y + rod.half * abs(rod.axis.y) >= groove.h:
        best = features.on_end_edge(groove, rod, ez, best)
    return features.on_end_arc(groove, rod, circle, best) if is_asked else best


@inlined
def rounding(groove: Groove, rod: Rod) -> float:
    """Bound on the rounding error of the distance of an axis.

    A direction is normalised to 3 units, a point of the axis (a product and a sum, |t| <= half) known to 5 units of
    |c| + half, s and h to 3 units of R, a difference of these and its norm to 3 more: 11, rounded up, and r's own.
    """
    c = rod.centre
    size = abs(c.x) + abs(c.y) + abs(c.z) + 2.0 * rod.half + groove.H + groove.R
    return UNIT * (12.0 * size + rod.r)


@inlined
def from_outside(groove: Groove, rod: Rod, best: Candidate) -> Answer:
    """The answer of the candidate that is nearest to an axis outside S."""
    bound = rounding(groove, rod)
    distance, normal = math.sqrt(best.d2) - rod.r, features.face_normal(groove, best.feature, best.point)
    if best.feature == features.ARC:
        # R - r first: exact for nearly equal radii, and rho is what is left.
        p = features.axis_point(rod, best.t)
        distance = (groove.R - rod.r) - math.sqrt(p.x * p.x + p.y * p.y)
    elif best.feature >= features.END_ARC or best.feature in (features.LIP_M, features.LIP_N):
        normal = normal_of_edge(groove, rod, best, bound)
    return Answer(distance, best.point, normal, best.feature, best.t, bound)


@inlined
def normal_of_edge(groove: Groove, rod: Rod, best: Candidate, bound: float) -> Vector:
    """Unit normal from a nearest point on an edge to the axis."""
    n = minus(features.axis_point(rod, best.t), best.point)
    if dot(n, n) <= bound * bound:
        n = edge_normal(groove, best.feature, best.point)
    # Inside the axis the normal is across it, at an end it points back from it: with the axis close to the edge itself
    # the difference above knows that to few digits only.
    along = dot(n, rod.axis)
    if abs(best.t) < rod.half or along * best.t > 0.0:
        n = plus(n, -along, rod.axis)
    size = length(n)
    if size == 0.0:
        n, size = Vector(-rod.axis.y, rod.axis.x, 0.0), math.sqrt(rod.e2)
    return over(n, size)


@inlined
def nearest(groove: Groove, rod: Rod) -> Answer:
    """Signed distance of a capsule: of its axis, less its radius."""
    if is_parallel(groove, rod):
        return parallel(groove, rod)
    if rod.centre.y - rod.half * abs(rod.axis.y) <= groove.h:
        lo, hi = features.clip(groove, rod, rod.half)
        # rho is convex along the axis: if any point of the part in the block is behind the arc, an end of it is.
        if lo <= hi and (
            is_in_material(groove, rod, lo, rod.axis.y < 0.0) or is_in_material(groove, rod, hi, rod.axis.y > 0.0)
        ):
            return inside(groove, rod, lo, hi, rounding(groove, rod))
    return from_outside(groove, rod, outside(groove, rod))
