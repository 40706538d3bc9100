"""Signed gap of every boundary piece of a groove on its own: arc surface, flat faces M and N, end faces -z and +z.

Outside the material each gap is the plain distance of the axis from the piece (its edges included) minus the
cylinder's radius, so the least of them is the signed distance. With the axis inside the material a piece's gap is
negative on the piece's side of the lip and goes over into the plain distance on the other side:
``cos`` of the angle about the lip makes that smooth, and the distance less on the way from one to the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.kernel import features
from clamp3d.kernel.features import Candidate, Groove, Rod
from clamp3d.kernel.jit import formula, inlined
from clamp3d.kernel.nearest import edge_normal, is_parallel
from clamp3d.kernel.vector import Vector, dot, length, minus, over

ARC_SURFACE, FACE_M, FACE_N, END_BELOW, END_ABOVE = range(5)


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


@inlined
def end_of(piece: int) -> float:
    """Sign of z of an end face."""
    return -1.0 if piece == END_BELOW else 1.0


@formula
def section_foot_of(groove: Groove, piece: int, x: float, y: float) -> tuple[float, float, float]:
    """Nearest point (x, y) of the section of a piece, and its feature; on an end face the point itself."""
    s, h = groove.s, groove.h
    if piece >= END_BELOW:
        gap, feature = features.section(groove, x, y)
        if gap <= 0.0:
            return x, y, features.END_FACE
        qx, qy, _, _ = features.section_foot(groove, feature, x, y)
        return qx, qy, features.beyond_end(feature)
    side = side_of(piece, x)
    if piece == ARC_SURFACE:
        if abs(x) * -h + y * s <= 0.0:
            qx, qy, _, _ = features.section_foot(groove, features.ARC, x, y)
            return qx, qy, features.ARC
    elif side * x >= s:
        return x, h, features.FLAT_N if side > 0.0 else features.FLAT_M
    return side * s, h, features.LIP_N if side > 0.0 else features.LIP_M


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
def on_piece_at(groove: Groove, rod: Rod, piece: int, t: float, best: Candidate) -> Candidate:
    """The best so far, or the point of a piece that is nearest to the axis point at t."""
    p = features.axis_point(rod, t)
    x, y, feature = section_foot_of(groove, piece, p.x, p.y)
    z = min(max(p.z, -groove.H), groove.H)
    if piece >= END_BELOW:
        z = end_of(piece) * groove.H
    elif z != p.z:
        feature = features.beyond_end(feature)
    q = Vector(x, y, z)
    off = minus(p, q)
    d2 = dot(off, off)
    return Candidate(d2, t, feature, q) if d2 < best.d2 else best


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
def on_edges(groove: Groove, rod: Rod, piece: int, best: Candidate) -> Candidate:
    """The best so far, or the point of the edges and corners of a piece that is nearest to the axis' inside."""
    is_flat, is_end = piece in (FACE_M, FACE_N), piece >= END_BELOW
    for side in (-1.0, 1.0):
        if not is_end and not (is_flat and side != side_of(piece, 0.0)):
            best = features.on_lip(groove, rod, side, best)
        if is_end and side != end_of(piece):
            continue
        ez = side * groove.H
        if not is_flat:
            best = features.on_end_arc(groove, rod, features.end_circle(groove, rod, ez), best)
        if piece != ARC_SURFACE:
            edge = features.on_end_edge(groove, rod, ez, best)
            best = edge if is_end or edge.point.x * side_of(piece, 0.0) > 0.0 else best
        for corner in (-1.0, 1.0):
            if not (is_flat and corner != side_of(piece, 0.0)):
                best, _ = features.on_corner(groove, rod, corner, ez, best)
    return best


@formula
def free_gap(groove: Groove, rod: Rod, piece: int) -> Gap:
    """Gap of a piece without regard to sign."""
    H, half, z, dz = groove.H, rod.half, rod.centre.z, rod.axis.z
    best = Candidate(math.inf, 0.0, features.ARC, rod.centre)
    if is_parallel(groove, rod):  # one point of the stretch next to the piece, or the nearer end
        middle = 0.5 * (max(z - half, -H) + min(z + half, H))
        t = ((end_of(piece) * H if piece >= END_BELOW else middle) - z) / dz
        if abs(t) <= half:
            best = on_piece_at(groove, rod, piece, t, best)
    best = on_piece_at(groove, rod, piece, -half, best)
    best = on_piece_at(groove, rod, piece, half, best)
    if not is_parallel(groove, rod):
        if piece == ARC_SURFACE:
            best = on_back_of_arc(groove, rod, best)
        best = on_edges(groove, rod, piece, best)
    return plain_gap(groove, rod, best)


@formula
def end_gap(groove: Groove, rod: Rod, piece: int) -> Gap:
    """Gap of an end face: of one that the axis goes through by the way out, sideways or back along z."""
    end, d = end_of(piece), rod.axis
    reach = rod.half * abs(d.z)
    front, back = end * rod.centre.z + reach - groove.H, groove.H - end * rod.centre.z + reach  # on either side of it
    x, y, ez = features.axis_point(rod, (end * groove.H - rod.centre.z) / d.z)
    gap, feature = features.section(groove, x, y)
    if not (front > 0.0 and back > 0.0 and d.z != 0.0 and gap < 0.0):
        return free_gap(groove, rod, piece)
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
    qx, qy, feature = section_foot_of(groove, piece, p.x, p.y)
    gap = math.sqrt((p.x - qx) * (p.x - qx) + (p.y - qy) * (p.y - qy))
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
