"""Signed gap of every boundary piece of a groove on its own: arc surface, flat faces M and N, end faces -z and +z.

Outside the material each gap is the plain distance of the axis from the piece (its edges included) minus the
cylinder's radius, so the least of them is the signed distance. With the axis inside the material a piece's gap is
negative on the piece's side of the lip and goes over into the plain distance on the other side:
``cos`` of the angle about the lip makes that smooth, and the distance less on the way from one to the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.core.jit import entry, formula, inlined
from clamp3d.core.kernel import groove_of, put
from clamp3d.core.kernel_distance import edge_normal, is_parallel
from clamp3d.core.kernel_features import (
    ARC,
    END_FACE,
    FLAT_M,
    FLAT_N,
    LIP_M,
    LIP_N,
    TINY,
    Candidate,
    Groove,
    Rod,
    beyond_end,
    clip,
    deepest,
    end_circle,
    on_corner,
    on_end_arc,
    on_end_edge,
    on_lip,
    section,
    section_foot,
)
from clamp3d.core.kernel_pose import rigid, rod_at
from clamp3d.core.pose import Array

# Columns of an answer; the rows are arc surface, flat M, flat N, end -z, end +z.
DISTANCE, POINT, NORMAL, FEATURE, RATE, WIDTH = 0, 1, 4, 7, 8, 14

ARC_SURFACE, FACE_M, FACE_N = range(3)


class Gap(NamedTuple):
    """Signed gap of a piece: distance, point (x, y, z), normal, feature, rate g by a shift, the axis' point a."""

    distance: float
    x: float
    y: float
    z: float
    nx: float
    ny: float
    nz: float
    feature: float
    gx: float
    gy: float
    gz: float
    ax: float
    ay: float
    az: float


@formula
def piece_section(groove: Groove, piece: int, x: float, y: float) -> tuple[float, float, float, float]:
    """Distance of (x, y) from the section of a side piece alone, nearest point, feature."""
    R, s, h = groove.R, groove.s, groove.h
    side = 1.0 if piece == FACE_N or (piece == ARC_SURFACE and x >= 0.0) else -1.0
    if piece == ARC_SURFACE:
        if abs(x) * -h + y * s <= 0.0:
            rho = math.sqrt(x * x + y * y)
            return (abs(R - rho), x / rho * R, y / rho * R, ARC) if rho >= TINY else (R, 0.0, -R, ARC)
    elif side * x >= s:
        return abs(y - h), x, h, FLAT_N if side > 0.0 else FLAT_M
    lip = LIP_N if side > 0.0 else LIP_M
    return math.sqrt((side * x - s) * (side * x - s) + (y - h) * (y - h)), side * s, h, lip


@formula
def sign(groove: Groove, piece: int, x: float, y: float) -> tuple[float, float, float]:
    """Factor in [-1, 1] of a piece's distance for an axis at (x, y) inside the material, and its rates by x and y."""
    side = 1.0 if piece == FACE_N or (piece == ARC_SURFACE and x >= 0.0) else -1.0
    X, Y = side * x - groove.s, groove.h - y
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
    R, feature = groove.R, best.feature
    ax, ay, az = rod.x + best.t * rod.dx, rod.y + best.t * rod.dy, rod.z + best.t * rod.dz
    nx, ny, nz = ax - best.x, ay - best.y, az - best.z
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if n > 1e-13 * R:
        nx, ny, nz = nx / n, ny / n, nz / n
    elif feature == ARC:
        nx, ny, nz = -best.x / R, -best.y / R, 0.0
    elif feature in (FLAT_M, FLAT_N):
        nx, ny, nz = 0.0, 1.0, 0.0
    elif feature == END_FACE:
        nx, ny, nz = 0.0, 0.0, 1.0 if best.z > 0.0 else -1.0
    else:
        nx, ny, nz = edge_normal(groove, feature, best.x, best.y, best.z)
    distance = math.sqrt(best.d2) - rod.r
    return Gap(distance, best.x, best.y, best.z, nx, ny, nz, feature, nx, ny, nz, ax, ay, az)


@formula
def on_side_at(groove: Groove, rod: Rod, piece: int, t: float, best: Candidate) -> Candidate:
    """The best so far, or the point of a side piece that is nearest to the axis point at t."""
    z = rod.z + t * rod.dz
    gap, x, y, feature = piece_section(groove, piece, rod.x + t * rod.dx, rod.y + t * rod.dy)
    end = abs(z) - groove.H
    d2 = gap * gap
    if end > 0.0:
        d2, z, feature = d2 + end * end, math.copysign(groove.H, z), beyond_end(feature)
    return Candidate(d2, t, feature, x, y, z) if d2 < best.d2 else best


@formula
def on_back_of_arc(groove: Groove, rod: Rod, best: Candidate) -> Candidate:
    """The best so far, or the arc from behind, where it is convex: the axis' approach to the groove's own axis."""
    t = -(rod.x * rod.dx + rod.y * rod.dy) / rod.e2
    x, y, z = rod.x + t * rod.dx, rod.y + t * rod.dy, rod.z + t * rod.dz
    rho = math.sqrt(x * x + y * y)
    gap = rho - groove.R
    if abs(t) > rod.half or abs(z) > groove.H or gap <= 0.0 or gap * gap >= best.d2:
        return best
    if abs(x) * -groove.h + y * groove.s > 0.0:
        return best
    return Candidate(gap * gap, t, ARC, x / rho * groove.R, y / rho * groove.R, z)


@formula
def side_gap(groove: Groove, rod: Rod, piece: int) -> Gap:
    """Gap of the arc surface or of a flat face without regard to sign."""
    H, half = groove.H, rod.half
    best = Candidate(math.inf, 0.0, ARC, 0.0, 0.0, 0.0)
    if is_parallel(groove, rod, half):  # one point in the middle of the stretch next to the groove, or the nearer end
        lo, hi = max(rod.z - half, -H), min(rod.z + half, H)
        along = 0.5 * (lo + hi) - rod.z if lo <= hi else (-half if hi == H else half)
        return plain_gap(groove, rod, on_side_at(groove, rod, piece, along * rod.dz, best))
    best = on_side_at(groove, rod, piece, -half, best)
    best = on_side_at(groove, rod, piece, half, best)
    if piece == ARC_SURFACE:
        best = on_back_of_arc(groove, rod, best)
    for k in range(2):
        side = -1.0 if k == 0 else 1.0
        ez = side * H
        if piece != (FACE_N if k == 0 else FACE_M):  # its own lip and corners
            best = on_lip(groove, rod, side, best)
            best, _ = on_corner(groove, rod, side, -H, best)
            best, _ = on_corner(groove, rod, side, H, best)
        if piece == ARC_SURFACE:
            best = on_end_arc(groove, rod, end_circle(groove, rod, ez), best)
        else:
            edge = on_end_edge(groove, rod, ez, best)
            best = edge if edge.x * (1.0 if piece == FACE_N else -1.0) > 0.0 else best
    return plain_gap(groove, rod, best)


@formula
def on_face_at(groove: Groove, rod: Rod, ez: float, t: float, best: Candidate) -> Candidate:
    """The best so far, or the point of the end face z = ez that is nearest to the axis point at t."""
    x, y, end = rod.x + t * rod.dx, rod.y + t * rod.dy, rod.z + t * rod.dz - ez
    gap, feature = section(groove, x, y)
    d2 = end * end
    if gap <= 0.0:
        feature = END_FACE
    else:
        x, y, _, _ = section_foot(groove, feature, x, y)
        d2, feature = d2 + gap * gap, beyond_end(feature)
    return Candidate(d2, t, feature, x, y, ez) if d2 < best.d2 else best


@formula
def end_gap(groove: Groove, rod: Rod, up: float) -> Gap:
    """Gap of the end face at the top (up = 1) or the bottom (-1)."""
    ez = up * groove.H
    reach = rod.half * abs(rod.dz)
    front, back = up * rod.z + reach - groove.H, groove.H - up * rod.z + reach  # how far the axis is on either side
    is_through = front > 0.0 and back > 0.0 and rod.dz != 0.0
    t = (ez - rod.z) / rod.dz
    if is_through and section(groove, rod.x + t * rod.dx, rod.y + t * rod.dy)[0] < 0.0:
        return gap_through(groove, rod, up, front, back)
    best = Candidate(math.inf, 0.0, END_FACE, 0.0, 0.0, ez)
    best = on_face_at(groove, rod, ez, -rod.half, best)
    best = on_face_at(groove, rod, ez, rod.half, best)
    if is_parallel(groove, rod, rod.half):
        if is_through:
            best = on_face_at(groove, rod, ez, t, best)
    else:
        best = on_end_edge(groove, rod, ez, best)
        best, _ = on_corner(groove, rod, -1.0, ez, best)
        best, _ = on_corner(groove, rod, 1.0, ez, best)
        best = on_end_arc(groove, rod, end_circle(groove, rod, ez), best)
    return plain_gap(groove, rod, best)


@formula
def gap_through(groove: Groove, rod: Rod, up: float, front: float, back: float) -> Gap:
    """Gap of an end face that the axis goes through: by its way out, sideways or back along z."""
    ez = up * groove.H
    t = (ez - rod.z) / rod.dz
    x, y = rod.x + t * rod.dx, rod.y + t * rod.dy
    gap, feature = section(groove, x, y)
    if min(front, back) < -gap:
        way = up if back < front else -up
        end = math.copysign(rod.half, -rod.dz * way)
        ax, ay, az = rod.x + end * rod.dx, rod.y + end * rod.dy, rod.z + end * rod.dz
        return Gap(-min(front, back) - rod.r, x, y, ez, 0.0, 0.0, up, END_FACE, 0.0, 0.0, way, ax, ay, az)
    qx, qy, nx, ny = section_foot(groove, feature, x, y)
    gz = -(nx * rod.dx + ny * rod.dy) / rod.dz  # the crossing point moves in the face's plane
    return Gap(gap - rod.r, qx, qy, ez, nx, ny, 0.0, beyond_end(feature), nx, ny, gz, x, y, ez)


@formula
def gap_inside(groove: Groove, rod: Rod, piece: int, t: float, outer: Gap) -> Gap:
    """Gap of a side piece, whose distance is that of ``outer``, for an axis that is deepest in the material at t."""
    x, y, z = rod.x + t * rod.dx, rod.y + t * rod.dy, rod.z + t * rod.dz
    factor, fx, fy = sign(groove, piece, x, y)
    a = outer
    if factor > 0.0:
        free = a.distance + rod.r
        gx, gy, gz = factor * a.gx + free * fx, factor * a.gy + free * fy, factor * a.gz
        distance = factor * free - rod.r
        return Gap(distance, a.x, a.y, a.z, a.nx, a.ny, a.nz, a.feature, gx, gy, gz, a.ax, a.ay, a.az)
    gap, qx, qy, feature = piece_section(groove, piece, x, y)
    a = plain_gap(groove, rod, Candidate(gap * gap, t, feature, qx, qy, z))
    flip = -1.0 if x * x + y * y > groove.R * groove.R and gap > 1e-13 * groove.R else 1.0
    nx, ny = flip * a.nx, flip * a.ny
    gx, gy = -factor * nx + gap * fx, -factor * ny + gap * fy
    return Gap(factor * gap - rod.r, qx, qy, z, nx, ny, a.nz, feature, gx, gy, 0.0, x, y, z)


@formula
def write(gap: Gap, row: Array) -> None:
    """Write a gap into a row (WIDTH,)."""
    row[DISTANCE], row[FEATURE] = gap.distance, gap.feature
    put(row, POINT, gap.x, gap.y, gap.z)
    put(row, NORMAL, gap.nx, gap.ny, gap.nz)
    gx, gy, gz, x, y, z = gap.gx, gap.gy, gap.gz, gap.ax, gap.ay, gap.az
    put(row, RATE, gx, gy, gz)
    put(row, RATE + 3, y * gz - z * gy, z * gx - x * gz, x * gy - y * gx)


@inlined
def place_inside(groove: Groove, rod: Rod) -> float:
    """Place of the axis' deepest point in the material, as if the groove were endless; NaN if it is in none."""
    lo, hi = clip(groove, rod, rod.half)
    # An axis that only touches an end face is on it, not inside.
    if lo > hi or abs(rod.z + 0.5 * (lo + hi) * rod.dz) >= groove.H:
        return math.nan
    endless = Groove(groove.R, groove.half_angle, groove.s, groove.h, 2.0 * (groove.H + abs(rod.z) + rod.half))
    t = deepest(endless, rod, lo, hi)
    x, y = rod.x + t * rod.dx, rod.y + t * rod.dy
    return t if min(math.sqrt(x * x + y * y) - groove.R, groove.h - y) > 0.0 else math.nan


@entry
def pieces(T: Array, R: float, half_angle: float, H: float, r: float, half: float, out: Array) -> bool:
    """The five pieces at one pose (1, 4, 4) into ``out`` (5, WIDTH); False for a pose that is not rigid."""
    if not rigid(T, 0):
        return False
    groove, rod = groove_of(R, half_angle, H), rod_at(T, 0, r, half)
    t = place_inside(groove, rod)
    for piece in range(3):
        gap = side_gap(groove, rod, piece)
        write(gap if math.isnan(t) else gap_inside(groove, rod, piece, t, gap), out[piece])
    for k in range(2):
        write(end_gap(groove, rod, 2.0 * k - 1.0), out[3 + k])
    return True
