"""Signed gap of every boundary piece of a groove on its own: arc surface, flat faces M and N, end faces -z and +z.

Outside the material each gap is the plain distance of the axis from the piece (its edges included) minus the
cylinder's radius, so the least of them is the signed distance. With the axis inside the material a piece's gap is
negative on the piece's side of the lip and goes over into the plain distance on the other side:
``cos`` of the angle about the lip makes that smooth, and the distance less on the way from one to the other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from clamp3d.geometry.pose import Array
from clamp3d.kernel import features
from clamp3d.kernel.features import Candidate, Groove, Rod
from clamp3d.kernel.jit import entry, formula, inlined
from clamp3d.kernel.nearest import edge_normal, is_parallel
from clamp3d.kernel.pose_rows import rigid, rod_at
from clamp3d.kernel.vector import Vector, cross, length, minus, over, put

ARC_SURFACE, FACE_M, FACE_N = range(3)


class Gap(NamedTuple):
    """Signed gap of a piece: distance, point, normal, feature, rate by a shift, and the axis' point."""

    distance: float
    point: Vector
    normal: Vector
    feature: float
    rate: Vector
    axis_point: Vector


@inlined
def side_of(piece: int, x: float) -> float:
    """Side of the lip next to a side piece: -1 for M, 1 for N; of the arc surface that of x."""
    return 1.0 if piece == FACE_N or (piece == ARC_SURFACE and x >= 0.0) else -1.0


@formula
def piece_section(groove: Groove, piece: int, p: Vector) -> tuple[float, float, float, float]:
    """Distance of (x, y) from the section of a side piece alone, nearest point, feature."""
    R, s, h = groove.R, groove.s, groove.h
    side = side_of(piece, p.x)
    if piece == ARC_SURFACE:
        if abs(p.x) * -h + p.y * s <= 0.0:
            rho = math.sqrt(p.x * p.x + p.y * p.y)
            return (
                (abs(R - rho), p.x / rho * R, p.y / rho * R, features.ARC)
                if rho >= features.TINY
                else (R, 0.0, -R, features.ARC)
            )
    elif side * p.x >= s:
        return abs(p.y - h), p.x, h, features.FLAT_N if side > 0.0 else features.FLAT_M
    lip = features.LIP_N if side > 0.0 else features.LIP_M
    return math.sqrt((side * p.x - s) * (side * p.x - s) + (p.y - h) * (p.y - h)), side * s, h, lip


@formula
def sign(groove: Groove, piece: int, p: Vector) -> tuple[float, float, float]:
    """Factor in [-1, 1] of a piece's distance for an axis at (x, y) inside the material, and its rates by x and y."""
    side = side_of(piece, p.x)
    X, Y = side * p.x - groove.s, groove.h - p.y
    n2 = X * X + Y * Y
    half = 0.5 * (math.pi - groove.half_angle)  # half of the material's angle at the lip, from the flat face to the arc
    part = math.atan2(Y, X) / half - (0.0 if piece == ARC_SURFACE else 1.0)
    flip = 1.0 if piece == ARC_SURFACE else -1.0
    if part <= 0.0 or n2 == 0.0:
        return flip, 0.0, 0.0
    if part >= 1.0:
        return -flip, 0.0, 0.0
    slope = -flip * math.sin(math.pi * part) * math.pi / half / n2
    return flip * math.cos(math.pi * part), slope * -Y * side, slope * -X


@formula
def plain_gap(groove: Groove, rod: Rod, best: Candidate) -> Gap:
    """Gap of a piece that the axis is outside of."""
    p = features.axis_point(rod, best.t)
    normal = minus(p, best.point)
    n = length(normal)
    if n > 1e-13 * groove.R:
        normal = over(normal, n)
    elif best.feature in (features.ARC, features.FLAT_M, features.FLAT_N, features.END_FACE):
        normal = features.face_normal(groove, best.feature, best.point)
    else:
        normal = edge_normal(groove, best.feature, best.point)
    return Gap(math.sqrt(best.d2) - rod.r, best.point, normal, best.feature, normal, p)


@formula
def on_side_at(groove: Groove, rod: Rod, piece: int, t: float, best: Candidate) -> Candidate:
    """The best so far, or the point of a side piece that is nearest to the axis point at t."""
    p = features.axis_point(rod, t)
    gap, x, y, feature = piece_section(groove, piece, p)
    d2, z, end = gap * gap, p.z, abs(p.z) - groove.H
    if end > 0.0:
        d2, z, feature = d2 + end * end, math.copysign(groove.H, z), features.beyond_end(feature)
    return Candidate(d2, t, feature, Vector(x, y, z)) if d2 < best.d2 else best


@formula
def on_back_of_arc(groove: Groove, rod: Rod, best: Candidate) -> Candidate:
    """The best so far, or the arc from behind, where it is convex: the axis' approach to the groove's own axis."""
    t = -(rod.centre.x * rod.axis.x + rod.centre.y * rod.axis.y) / rod.e2
    x, y, z = features.axis_point(rod, t)
    rho = math.sqrt(x * x + y * y)
    gap = rho - groove.R
    if abs(t) > rod.half or abs(z) > groove.H or gap <= 0.0 or gap * gap >= best.d2:
        return best
    if abs(x) * -groove.h + y * groove.s > 0.0:
        return best
    return Candidate(gap * gap, t, features.ARC, Vector(x / rho * groove.R, y / rho * groove.R, z))


@formula
def side_gap(groove: Groove, rod: Rod, piece: int) -> Gap:
    """Gap of the arc surface or of a flat face without regard to sign."""
    H, half, z = groove.H, rod.half, rod.centre.z
    best = Candidate(math.inf, 0.0, features.ARC, rod.centre)
    if is_parallel(groove, rod, half):  # one point in the middle of the stretch next to the groove, or the nearer end
        lo, hi = max(z - half, -H), min(z + half, H)
        along = 0.5 * (lo + hi) - z if lo <= hi else (-half if hi == H else half)
        return plain_gap(groove, rod, on_side_at(groove, rod, piece, along * rod.axis.z, best))
    best = on_side_at(groove, rod, piece, -half, best)
    best = on_side_at(groove, rod, piece, half, best)
    if piece == ARC_SURFACE:
        best = on_back_of_arc(groove, rod, best)
    for k in range(2):
        side = -1.0 if k == 0 else 1.0
        ez = side * H
        if piece != (FACE_N if k == 0 else FACE_M):  # its own lip and corners
            best = features.on_lip(groove, rod, side, best)
            best, _ = features.on_corner(groove, rod, side, -H, best)
            best, _ = features.on_corner(groove, rod, side, H, best)
        if piece == ARC_SURFACE:
            best = features.on_end_arc(groove, rod, features.end_circle(groove, rod, ez), best)
        else:
            edge = features.on_end_edge(groove, rod, ez, best)
            best = edge if edge.point.x * side_of(piece, 0.0) > 0.0 else best
    return plain_gap(groove, rod, best)


@formula
def on_face_at(groove: Groove, rod: Rod, ez: float, t: float, best: Candidate) -> Candidate:
    """The best so far, or the point of the end face z = ez that is nearest to the axis point at t."""
    x, y, z = features.axis_point(rod, t)
    gap, feature = features.section(groove, x, y)
    d2 = (z - ez) * (z - ez)
    if gap <= 0.0:
        feature = features.END_FACE
    else:
        x, y, _, _ = features.section_foot(groove, feature, x, y)
        d2, feature = d2 + gap * gap, features.beyond_end(feature)
    return Candidate(d2, t, feature, Vector(x, y, ez)) if d2 < best.d2 else best


@formula
def end_gap(groove: Groove, rod: Rod, end: float) -> Gap:
    """Gap of the end face at the top (end = 1) or the bottom (-1)."""
    ez, z, dz = end * groove.H, rod.centre.z, rod.axis.z
    reach = rod.half * abs(dz)
    front, back = end * z + reach - groove.H, groove.H - end * z + reach  # how far the axis is on either side
    is_through = front > 0.0 and back > 0.0 and dz != 0.0
    t = (ez - z) / dz
    p = features.axis_point(rod, t)
    if is_through and features.section(groove, p.x, p.y)[0] < 0.0:
        return gap_through(groove, rod, end, front, back)
    best = Candidate(math.inf, 0.0, features.END_FACE, rod.centre)
    best = on_face_at(groove, rod, ez, -rod.half, best)
    best = on_face_at(groove, rod, ez, rod.half, best)
    if is_parallel(groove, rod, rod.half):
        if is_through:
            best = on_face_at(groove, rod, ez, t, best)
    else:
        best = features.on_end_edge(groove, rod, ez, best)
        best, _ = features.on_corner(groove, rod, -1.0, ez, best)
        best, _ = features.on_corner(groove, rod, 1.0, ez, best)
        best = features.on_end_arc(groove, rod, features.end_circle(groove, rod, ez), best)
    return plain_gap(groove, rod, best)


@formula
def gap_through(groove: Groove, rod: Rod, end: float, front: float, back: float) -> Gap:
    """Gap of an end face that the axis goes through: by its way out, sideways or back along z."""
    ez, d = end * groove.H, rod.axis
    x, y, _ = features.axis_point(rod, (ez - rod.centre.z) / d.z)
    gap, feature = features.section(groove, x, y)
    if min(front, back) < -gap:
        way = end if back < front else -end
        axis_end = features.axis_point(rod, math.copysign(rod.half, -d.z * way))
        point, normal, rate = Vector(x, y, ez), Vector(0.0, 0.0, end), Vector(0.0, 0.0, way)
        return Gap(-min(front, back) - rod.r, point, normal, features.END_FACE, rate, axis_end)
    qx, qy, nx, ny = features.section_foot(groove, feature, x, y)
    rate = Vector(nx, ny, -(nx * d.x + ny * d.y) / d.z)  # the crossing point moves in the face's plane
    point, normal, crossing = Vector(qx, qy, ez), Vector(nx, ny, 0.0), Vector(x, y, ez)
    return Gap(gap - rod.r, point, normal, features.beyond_end(feature), rate, crossing)


@formula
def gap_inside(groove: Groove, rod: Rod, piece: int, t: float, outer: Gap) -> Gap:
    """Gap of a side piece, whose distance is that of ``outer``, for an axis that is deepest in the material at t."""
    p = features.axis_point(rod, t)
    factor, fx, fy = sign(groove, piece, p)
    if factor > 0.0:
        free, g = outer.distance + rod.r, outer.rate
        rate = Vector(factor * g.x + free * fx, factor * g.y + free * fy, factor * g.z)
        return Gap(factor * free - rod.r, outer.point, outer.normal, outer.feature, rate, outer.axis_point)
    gap, qx, qy, feature = piece_section(groove, piece, p)
    a = plain_gap(groove, rod, Candidate(gap * gap, t, feature, Vector(qx, qy, p.z)))
    flip = -1.0 if p.x * p.x + p.y * p.y > groove.R * groove.R and gap > 1e-13 * groove.R else 1.0
    nx, ny = flip * a.normal.x, flip * a.normal.y
    rate = Vector(-factor * nx + gap * fx, -factor * ny + gap * fy, 0.0)
    return Gap(factor * gap - rod.r, a.point, Vector(nx, ny, a.normal.z), feature, rate, p)


@inlined
def place_inside(groove: Groove, rod: Rod) -> float:
    """Place of the axis' deepest point in the material, as if the groove were endless; NaN if it is in none."""
    lo, hi = features.clip(groove, rod, rod.half)
    # An axis that only touches an end face is on it, not inside.
    if lo > hi or abs(rod.centre.z + 0.5 * (lo + hi) * rod.axis.z) >= groove.H:
        return math.nan
    endless = 2.0 * (groove.H + abs(rod.centre.z) + rod.half)
    t = features.deepest(Groove(groove.R, groove.half_angle, groove.s, groove.h, endless), rod, lo, hi)
    p = features.axis_point(rod, t)
    return t if min(math.sqrt(p.x * p.x + p.y * p.y) - groove.R, groove.h - p.y) > 0.0 else math.nan


@entry
def pieces(T: Array, R: float, half_angle: float, H: float, r: float, half: float, out: Any) -> bool:
    """The five pieces at one pose (1, 4, 4) into records (5,); False for a pose that is not rigid."""
    if not rigid(T, 0):
        return False
    groove, rod = features.groove_of(R, half_angle, H), rod_at(T, 0, r, half)
    t = place_inside(groove, rod)
    for piece in range(5):
        if piece < 3:
            gap = side_gap(groove, rod, piece)
            if not math.isnan(t):
                gap = gap_inside(groove, rod, piece, t, gap)
        else:
            gap = end_gap(groove, rod, -1.0 if piece == 3 else 1.0)
        row = out[piece]
        row.distance, row.feature = gap.distance, gap.feature
        put(row.point_on_groove, gap.point)
        put(row.normal, gap.normal)
        put(row.gradient[:3], gap.rate)
        put(row.gradient[3:], cross(gap.axis_point, gap.rate))
    return True
