"""The signed distance of a cylinder's axis segment from a groove, with witnesses: one formula for single and batch."""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.core.jit import formula, inlined
from clamp3d.core.kernel_features import (
    ARC,
    END_ARC,
    END_EDGE_M,
    END_EDGE_N,
    END_FACE,
    FLAT_M,
    FLAT_N,
    LIP_M,
    LIP_N,
    Candidate,
    Groove,
    Rod,
    beyond_end,
    clip,
    deepest,
    end_circle,
    is_behind_arc,
    on_axis_end,
    on_corner,
    on_end_arc,
    on_end_edge,
    on_lip,
    point_depth,
    section,
    section_foot,
)

UNIT = 2.0**-53
"""Unit roundoff of float64."""

PARALLEL = 2.0**-60
"""An axis that leaves the groove's direction by less than this part of R over its length counts as parallel: the
deviation is smaller than the rounding of R itself, and it is part of the error bound."""


class Answer(NamedTuple):
    """Signed distance of the cylinder's surface, the groove's point (x, y, z), unit normal from groove to cylinder.

    And the feature, the place t on the axis and a bound on the rounding error of the distance.
    """

    distance: float
    x: float
    y: float
    z: float
    nx: float
    ny: float
    nz: float
    feature: float
    t: float
    bound: float


class Rate(NamedTuple):
    """Rate of the distance by a shift of the cylinder."""

    x: float
    y: float
    z: float


@inlined
def is_parallel(groove: Groove, rod: Rod, reach: float) -> bool:
    """Whether an axis that reaches so far counts as parallel to the groove."""
    return rod.e2 * (reach * reach) <= (PARALLEL * groove.R) * (PARALLEL * groove.R)


@inlined
def parallel(groove: Groove, rod: Rod) -> Answer:
    """Axis along z: the plane problem of a point and the section, and the gap along z."""
    R, H, x, y, z, r, half = groove.R, groove.H, rod.x, rod.y, rod.z, rod.r, rod.half
    gap, feature = section(groove, x, y)
    qx, qy, nx, ny = section_foot(groove, feature, x, y)
    up = math.copysign(1.0, rod.dz)
    lo, hi = max(z - half, -H), min(z + half, H)
    bound = UNIT * (6.0 * (R + abs(x) + abs(y)) + r)
    bound_along = bound + UNIT * 4.0 * (H + abs(z) + half)
    if lo <= hi:
        inside = lo if lo > 0.0 else (hi if hi < 0.0 else 0.0)  # the axis point that is farthest from both ends
        if H - abs(inside) < -gap:
            side = -1.0 if inside < 0.0 else 1.0
            t = (inside - z) * up
            return Answer(abs(inside) - H - r, x, y, side * H, 0.0, 0.0, side, END_FACE, t, bound_along)
        middle = 0.5 * (lo + hi)
        # R - r first: exact for nearly equal radii, and rho is what is left.
        distance = (R - r) - math.sqrt(x * x + y * y) if feature == ARC else gap - r
        return Answer(distance, qx, qy, middle, nx, ny, 0.0, feature, (middle - z) * up, bound)
    side = 1.0 if hi == H else -1.0
    t, end = -side * half * up, lo - hi
    if gap <= 0.0:
        return Answer(end - r, x, y, side * H, 0.0, 0.0, side, END_FACE, t, bound_along)
    distance = math.sqrt(gap * gap + end * end)
    nx, ny, nz = nx * (gap / distance), ny * (gap / distance), side * (end / distance)
    return Answer(distance - r, qx, qy, side * H, nx, ny, nz, beyond_end(feature), t, bound_along)


@formula
def way_out(groove: Groove, x: float, y: float, z: float) -> Answer:
    """Minus the depth of a point of the material, its nearest point of the boundary, the normal there, the feature."""
    depth, feature = point_depth(groove, x, y, z)
    if feature == END_FACE:
        side = 1.0 if z >= 0.0 else -1.0
        return Answer(-depth, x, y, side * groove.H, 0.0, 0.0, side, feature, 0.0, 0.0)
    qx, qy, nx, ny = section_foot(groove, feature, x, y)
    return Answer(-depth, qx, qy, z, nx, ny, 0.0, feature, 0.0, 0.0)


@formula
def inside(groove: Groove, rod: Rod, lo: float, hi: float, bound: float) -> Answer:
    """Axis that is in S for lo <= t <= hi: minus the depth of its deepest point, minus r."""
    t = deepest(groove, rod, lo, hi)
    out = way_out(groove, rod.x + t * rod.dx, rod.y + t * rod.dy, rod.z + t * rod.dz)
    return Answer(out.distance - rod.r, out.x, out.y, out.z, out.nx, out.ny, out.nz, out.feature, t, bound)


@formula
def inside_rate(groove: Groove, rod: Rod, t: float) -> Rate:
    """Rate of the depth's negative by a shift of an axis inside S whose deepest point is at t.

    At an end of the axis that is the normal of the face it is nearest to. Between its ends the deepest point is as near
    to a second face, towards which the axis leads the other way: the depth falls by that mixture of both normals that
    is square to the axis.
    """
    x, y, z = rod.x + t * rod.dx, rod.y + t * rod.dy, rod.z + t * rod.dz
    rho, up = math.sqrt(x * x + y * y), 1.0 if z >= 0.0 else -1.0
    depths = (rho - groove.R, groove.h - y, groove.H - abs(z), groove.H + abs(z))
    normals = (Rate(-x / rho, -y / rho, 0.0), Rate(0.0, 1.0, 0.0), Rate(0.0, 0.0, up), Rate(0.0, 0.0, -up))
    first = 0
    for face in range(1, 4):
        if depths[face] < depths[first]:
            first = face
    normal = normals[first]
    along = normal.x * rod.dx + normal.y * rod.dy + normal.z * rod.dz
    if abs(t) >= rod.half or along == 0.0:
        return normal
    nearest_depth = math.inf
    other, other_along = normal, 0.0
    for face in range(4):
        leads = normals[face].x * rod.dx + normals[face].y * rod.dy + normals[face].z * rod.dz
        if leads * along < 0.0 and depths[face] < nearest_depth:
            nearest_depth, other, other_along = depths[face], normals[face], leads
    if nearest_depth - depths[first] > 1e-9 * (groove.R + groove.H + depths[first]):
        return normal
    u = other_along / (other_along - along)
    v = 1.0 - u
    return Rate(u * normal.x + v * other.x, u * normal.y + v * other.y, u * normal.z + v * other.z)


@formula
def edge_normal(groove: Groove, feature: float, qx: float, qy: float, qz: float) -> Rate:
    """A unit normal in the middle of the normal cone of an edge, for an axis that passes through the edge itself."""
    x, y, z = -qx / groove.R, -qy / groove.R, 0.0
    if feature in (LIP_M, LIP_N):
        y += 1.0
    elif feature != END_ARC:
        x = 0.0 if feature in (END_EDGE_M, END_EDGE_N) else x
        y = 1.0
    if feature not in (LIP_M, LIP_N):
        z = 1.0 if qz > 0.0 else -1.0
    n = math.sqrt(x * x + y * y + z * z)
    return Rate(x / n, y / n, z / n)


@inlined
def is_in_material(groove: Groove, rod: Rod, t: float, is_rising: bool) -> bool:
    """Whether a point of the axis in the block is in S; ``is_rising``: it may be where the axis passes y = h."""
    x, y = rod.x + t * rod.dx, rod.y + t * rod.dy
    return is_behind_arc(groove, x, y) or (is_rising and abs(x) >= groove.s and t == (groove.h - rod.y) / rod.dy)


@inlined
def outside(groove: Groove, rod: Rod) -> Candidate:
    """Nearest feature of an axis that does not enter S.

    A feature whose line, or whose end's plane, is no nearer than the best so far is not looked at.
    """
    H, half = groove.H, rod.half
    # Whether the axis reaches beyond the end faces, or level with them: an axis in the plane of an end face leaves it
    # by less than rounding.
    top, bottom = rod.z + half * abs(rod.dz) >= H, rod.z - half * abs(rod.dz) <= -H
    is_through = top and bottom  # then its ends are far from S
    best = Candidate(math.inf, 0.0, ARC, 0.0, 0.0, 0.0)
    if not is_through:
        best = on_axis_end(groove, rod, -half, best)
        best = on_axis_end(groove, rod, half, best)
    best = on_lip(groove, rod, -1.0, best)
    best = on_lip(groove, rod, 1.0, best)
    if top or bottom:
        best = at_ends(groove, rod, best, top, bottom)
    if is_through:
        best = on_axis_end(groove, rod, -half, best)
        best = on_axis_end(groove, rod, half, best)
    return best


@inlined
def at_ends(groove: Groove, rod: Rod, best: Candidate, top: bool, bottom: bool) -> Candidate:
    """The best so far, or a corner, an edge or an arc of the ends that the axis reaches."""
    H = groove.H
    is_above = rod.y + rod.half * abs(rod.dy) >= groove.h
    low, high = end_circle(groove, rod, -H), end_circle(groove, rod, H)
    is_low_asked = is_high_asked = False
    if bottom:
        best, falls = on_corner(groove, rod, -1.0, -H, best)
        best, falls_too = on_corner(groove, rod, 1.0, -H, best)
        is_low_asked = falls or falls_too or has_two_minima(rod, low.p, low.v)
        if is_above:
            best = on_end_edge(groove, rod, -H, best)
    if top:
        best, falls = on_corner(groove, rod, -1.0, H, best)
        best, falls_too = on_corner(groove, rod, 1.0, H, best)
        is_high_asked = falls or falls_too or has_two_minima(rod, high.p, high.v)
        if is_above:
            best = on_end_edge(groove, rod, H, best)
    if is_low_asked and not (is_high_asked and high.reach < low.reach):
        best = on_end_arc(groove, rod, low, best)
        is_low_asked = False
    if is_high_asked:
        best = on_end_arc(groove, rod, high, best)
    if is_low_asked:
        best = on_end_arc(groove, rod, low, best)
    return best


@inlined
def has_two_minima(rod: Rod, p: float, v: float) -> bool:
    """Whether the distance from an end's circle may have two minima.

    With one, and where it falls from no corner into the arc, none is on the arc.
    """
    return abs(p) < rod.e2 and abs(rod.dz * v) < rod.e2


@inlined
def rounding(groove: Groove, rod: Rod) -> float:
    """Bound on the rounding error of the distance of an axis.

    A direction is normalised to 3 units, a point of the axis (a product and a sum, |t| <= half) known to 5 units of
    |c| + half, s and h to 3 units of R, a difference of these and its norm to 3 more: 11, rounded up, and r's own.
    """
    size = abs(rod.x) + abs(rod.y) + abs(rod.z) + 2.0 * rod.half + groove.H + groove.R
    return UNIT * (12.0 * size + rod.r)


@inlined
def from_outside(groove: Groove, rod: Rod, best: Candidate) -> Answer:
    """The answer of the candidate that is nearest to an axis outside S."""
    t, feature, bound = best.t, best.feature, rounding(groove, rod)
    x, y = rod.x + t * rod.dx, rod.y + t * rod.dy
    if feature == ARC:
        # R - r first: exact for nearly equal radii, and rho is what is left.
        distance = (groove.R - rod.r) - math.sqrt(x * x + y * y)
        nx, ny = -best.x / groove.R, -best.y / groove.R
        return Answer(distance, best.x, best.y, best.z, nx, ny, 0.0, ARC, t, bound)
    distance = math.sqrt(best.d2) - rod.r
    if feature in (FLAT_M, FLAT_N):
        return Answer(distance, best.x, best.y, best.z, 0.0, 1.0, 0.0, feature, t, bound)
    if feature == END_FACE:
        return Answer(distance, best.x, best.y, best.z, 0.0, 0.0, math.copysign(1.0, best.z), feature, t, bound)
    normal = normal_of_edge(groove, rod, best, bound)
    return Answer(distance, best.x, best.y, best.z, normal.x, normal.y, normal.z, feature, t, bound)


@inlined
def normal_of_edge(groove: Groove, rod: Rod, best: Candidate, bound: float) -> Rate:
    """Unit normal from a nearest point on an edge to the axis."""
    t, dx, dy, dz = best.t, rod.dx, rod.dy, rod.dz
    nx, ny, nz = rod.x + t * dx - best.x, rod.y + t * dy - best.y, rod.z + t * dz - best.z
    if nx * nx + ny * ny + nz * nz <= bound * bound:
        nx, ny, nz = edge_normal(groove, best.feature, best.x, best.y, best.z)
    # Inside the axis the normal is across it, at an end it points back from it: with the axis close to the edge itself
    # the difference above knows that to few digits only.
    along = nx * dx + ny * dy + nz * dz
    if abs(t) < rod.half or along * t > 0.0:
        nx, ny, nz = nx - along * dx, ny - along * dy, nz - along * dz
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if n == 0.0:
        nx, ny, nz, n = -dy, dx, 0.0, math.sqrt(rod.e2)
    return Rate(nx / n, ny / n, nz / n)


@inlined
def nearest(groove: Groove, rod: Rod) -> Answer:
    """Signed distance of a capsule: of its axis, less its radius."""
    if is_parallel(groove, rod, rod.half):
        return parallel(groove, rod)
    if rod.y - rod.half * abs(rod.dy) <= groove.h:
        lo, hi = clip(groove, rod, rod.half)
        # rho is convex along the axis: if any point of the part in the block is behind the arc, an end of it is.
        if lo <= hi and (
            is_in_material(groove, rod, lo, rod.dy < 0.0) or is_in_material(groove, rod, hi, rod.dy > 0.0)
        ):
            return inside(groove, rod, lo, hi, rounding(groove, rod))
    return from_outside(groove, rod, outside(groove, rod))
