"""Signed gap of every boundary piece of a groove on its own: arc surface, flat faces M and N, end faces -z and +z.

Outside the material each gap is the plain distance of the axis from the piece (its edges included) minus the
cylinder's radius, so the least of them is the signed distance. With the axis inside the material a piece's gap is
negative on the piece's side of the lip and goes over into the plain distance on the other side:
``cos`` of the angle about the lip makes that smooth, and the distance less on the way from one to the other.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_distance import edge_normal, is_parallel
from clamp3d.core.kernel_features import (
    ARC,
    CORNER_M,
    CORNER_N,
    END_ARC,
    END_EDGE_M,
    END_EDGE_N,
    END_FACE,
    FLAT_M,
    FLAT_N,
    LIP_M,
    LIP_N,
    TINY,
    beyond_end,
    clip,
    corner,
    deepest,
    ellipse,
    end_arc,
    end_arc_reach,
    end_edge,
    lip_line,
    section,
    section_foot,
)
from clamp3d.core.kernel_pose import axis, rigid

PIECES = 5
COLUMNS = 14
"""distance, point on groove (3), normal (3), feature, rate by the cylinder's twist (6)."""


@formula
def arc_section(x, y, R, s, h):  # type: ignore[no-untyped-def]
    """Distance of (x, y) from the section's arc alone, nearest point, feature."""
    ax = abs(x)
    rho = math.sqrt(x * x + y * y)
    if ax * -h + y * s <= 0.0:
        if rho < TINY:
            return R, 0.0, -R, ARC
        return abs(R - rho), x / rho * R, y / rho * R, ARC
    gap = math.sqrt((ax - s) * (ax - s) + (y - h) * (y - h))
    return gap, s if x >= 0.0 else -s, h, LIP_N if x >= 0.0 else LIP_M


@formula
def flat_section(side, x, y, s, h):  # type: ignore[no-untyped-def]
    """Distance of (x, y) from the flat face at side (-1: M, +1: N) alone, nearest point, feature."""
    if side * x >= s:
        return abs(y - h), x, h, FLAT_N if side > 0.0 else FLAT_M
    gap = math.sqrt((side * x - s) * (side * x - s) + (y - h) * (y - h))
    return gap, side * s, h, LIP_N if side > 0.0 else LIP_M


@formula
def sign(piece, x, y, s, h, half_angle):  # type: ignore[no-untyped-def]
    """Factor in [-1, 1] of a piece's distance for an axis at (x, y) inside the material, and its rates by x and y."""
    side = 1.0 if piece == 2 or (piece == 0 and x >= 0.0) else -1.0
    X = side * x - s
    Y = h - y
    n2 = X * X + Y * Y
    half = 0.5 * (math.pi - half_angle)  # half of the material's angle at the lip, from the flat face to the arc
    angle = math.atan2(Y, X)
    part = angle / half if piece == 0 else angle / half - 1.0
    flip = 1.0 if piece == 0 else -1.0
    if part <= 0.0 or n2 == 0.0:
        return flip, 0.0, 0.0
    if part >= 1.0:
        return -flip, 0.0, 0.0
    slope = -flip * math.sin(math.pi * part) * math.pi / half / n2
    return flip * math.cos(math.pi * part), slope * -Y * side, slope * -X


@formula
def put(row, distance, r, qx, qy, qz, ax, ay, az, feature, R, h):  # type: ignore[no-untyped-def]
    """Fill one piece that the axis is outside of: nearest points q on the piece, a on the axis."""
    nx = ax - qx
    ny = ay - qy
    nz = az - qz
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if n > 1e-13 * R:
        nx /= n
        ny /= n
        nz /= n
    elif feature == ARC:
        nx = -qx / R
        ny = -qy / R
        nz = 0.0
    elif feature in (FLAT_M, FLAT_N):
        nx = nz = 0.0
        ny = 1.0
    elif feature == END_FACE:
        nx = ny = 0.0
        nz = 1.0 if qz > 0.0 else -1.0
    else:
        nx, ny, nz = edge_normal(feature, R, h, qx, qy, qz)
    row[0] = distance - r
    row[1] = qx
    row[2] = qy
    row[3] = qz
    row[4] = nx
    row[5] = ny
    row[6] = nz
    row[7] = feature
    row[8] = nx
    row[9] = ny
    row[10] = nz
    row[11] = ax
    row[12] = ay
    row[13] = az


@formula
def side_pieces(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Arc surface and flat faces without regard to sign: rows 0 to 2."""
    e2 = dx * dx + dy * dy
    straight = is_parallel(R, l, dx, dy)
    for piece in range(3):
        side = 1.0 if piece == 2 else -1.0
        best = math.inf
        bx = by = bz = bt = 0.0
        feature = ARC
        for i in range(3 if straight else 2):
            if straight:  # one point in the middle of the stretch next to the groove, or the nearer end
                lo = max(cz - l, -H)
                hi = min(cz + l, H)
                t = (0.5 * (lo + hi) - cz if lo <= hi else (-l if hi == H else l)) * dz
            else:
                t = -l if i == 0 else l
            x = cx + t * dx
            y = cy + t * dy
            z = cz + t * dz
            if piece == 0:
                gap, qx, qy, f = arc_section(x, y, R, s, h)
            else:
                gap, qx, qy, f = flat_section(side, x, y, s, h)
            if abs(z) > H:
                end = abs(z) - H
                z = H if z > 0.0 else -H
                gap = math.sqrt(gap * gap + end * end)
                f = beyond_end(f)
            if gap < best:
                best, bx, by, bz, bt, feature = gap, qx, qy, z, t, f
            if straight:
                break
        if not straight:
            best2 = best * best
            if piece == 0:
                # From behind, the surface is convex: the axis' approach to the groove's own axis.
                t = -(cx * dx + cy * dy) / e2
                x = cx + t * dx
                y = cy + t * dy
                z = cz + t * dz
                rho = math.sqrt(x * x + y * y)
                if abs(t) <= l and abs(z) <= H and rho > R and abs(x) * -h + y * s <= 0.0 and rho - R < best:
                    best, bx, by, bz, bt, feature = rho - R, x / rho * R, y / rho * R, z, t, ARC
                    best2 = best * best
            for j in range(2):
                sx = -s if j == 0 else s
                if piece != 0 and piece != j + 1:
                    continue
                d2, t, z = lip_line(sx, h, H, cx, cy, cz, dx, dy, dz, e2, l, best2)
                if d2 < best2:
                    best2, bx, by, bz, bt, feature = d2, sx, h, z, t, LIP_M if j == 0 else LIP_N
                for i in range(2):
                    ez = -H if i == 0 else H
                    d2, t, _ = corner(sx, h, ez, cx, cy, cz, dx, dy, dz, l)
                    if d2 < best2:
                        best2, bx, by, bz, bt, feature = d2, sx, h, ez, t, CORNER_M if j == 0 else CORNER_N
            for i in range(2):
                ez = -H if i == 0 else H
                if piece == 0:
                    ex, ey, e, p, along = ellipse(R, cx, cy, dx, dy, e2)
                    v, _ = end_arc_reach(ez, R, cz, dz, e, p, along)
                    d2, x, y, t = end_arc(ez, R, s, h, cx, cy, cz, dx, dy, dz, e2, l, ex, ey, p, v)
                    if d2 < best2:
                        best2, bx, by, bz, bt, feature = d2, x, y, ez, t, END_ARC
                else:
                    d2, t, x = end_edge(ez, s, h, cx, cy, cz, dx, dy, dz, l, best2)
                    if d2 < best2 and side * x > 0.0:
                        best2, bx, by, bz, bt, feature = d2, x, h, ez, t, END_EDGE_M if side < 0.0 else END_EDGE_N
            if best2 < best * best:
                best = math.sqrt(best2)
        put(out[piece], best, r, bx, by, bz, cx + bt * dx, cy + bt * dy, cz + bt * dz, feature, R, h)


@formula
def end_piece(ez, R, s, h, H, r, l, cx, cy, cz, dx, dy, dz, row):  # type: ignore[no-untyped-def] # noqa: E741
    """End face in the plane z = ez; an axis through it counts by its way out: sideways, or back along z."""
    up = 1.0 if ez > 0.0 else -1.0
    high = up * cz + l * abs(dz) - H  # how far the axis reaches in front of the face, and behind it
    low = H - (up * cz - l * abs(dz))
    if high > 0.0 and low > 0.0 and dz != 0.0:
        t = (ez - cz) / dz
        x = cx + t * dx
        y = cy + t * dy
        gap, f = section(x, y, R, s, h)
        qx, qy, nx, ny = section_foot(f, x, y, R, s, h)
        if gap < 0.0:
            if min(high, low) < -gap:
                end = l if up * dz * (1.0 if low < high else -1.0) < 0.0 else -l
                put(row, 0.0, r, x, y, ez, x, y, ez, END_FACE, R, h)
                row[0] = -min(high, low) - r
                row[10] = up if low < high else -up
                row[11] = cx + end * dx
                row[12] = cy + end * dy
                row[13] = cz + end * dz
                return
            put(row, 0.0, r, qx, qy, ez, x, y, ez, beyond_end(f), R, h)
            row[0] = gap - r
            row[4] = row[8] = nx
            row[5] = row[9] = ny
            row[6] = 0.0
            row[10] = -(nx * dx + ny * dy) / dz  # the crossing point moves in the face's plane
            return
    best2 = math.inf
    bx = by = bt = 0.0
    feature = END_FACE
    for i in range(2):
        t = -l if i == 0 else l
        x = cx + t * dx
        y = cy + t * dy
        gap, f = section(x, y, R, s, h)
        qx, qy, _, _ = section_foot(f, x, y, R, s, h)
        end = cz + t * dz - ez
        if gap <= 0.0:
            d2, qx, qy, f = end * end, x, y, END_FACE
        else:
            d2, f = gap * gap + end * end, beyond_end(f)
        if d2 < best2:
            best2, bx, by, bt, feature = d2, qx, qy, t, f
    e2 = dx * dx + dy * dy
    if is_parallel(R, l, dx, dy):
        if high > 0.0 and low > 0.0:
            t = (ez - cz) / dz
            gap, f = section(cx, cy, R, s, h)
            qx, qy, _, _ = section_foot(f, cx, cy, R, s, h)
            best2, bx, by, bt, feature = gap * gap, qx, qy, t, beyond_end(f)
    else:
        d2, t, x = end_edge(ez, s, h, cx, cy, cz, dx, dy, dz, l, best2)
        if d2 < best2:
            best2, bx, by, bt, feature = d2, x, h, t, END_EDGE_M if x < 0.0 else END_EDGE_N
        for j in range(2):
            sx = -s if j == 0 else s
            d2, t, _ = corner(sx, h, ez, cx, cy, cz, dx, dy, dz, l)
            if d2 < best2:
                best2, bx, by, bt, feature = d2, sx, h, t, CORNER_M if j == 0 else CORNER_N
        ex, ey, e, p, along = ellipse(R, cx, cy, dx, dy, e2)
        v, _ = end_arc_reach(ez, R, cz, dz, e, p, along)
        d2, x, y, t = end_arc(ez, R, s, h, cx, cy, cz, dx, dy, dz, e2, l, ex, ey, p, v)
        if d2 < best2:
            best2, bx, by, bt, feature = d2, x, y, t, END_ARC
    put(row, math.sqrt(best2), r, bx, by, ez, cx + bt * dx, cy + bt * dy, cz + bt * dz, feature, R, h)


@formula
def enter(R, s, h, H, half_angle, r, l, cx, cy, cz, dx, dy, dz, lo, hi, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Sign the side pieces for an axis that is inside the material for lo <= t <= hi."""
    depth, t = deepest(R, h, 2.0 * (H + abs(cz) + l), cx, cy, cz, dx, dy, dz, lo, hi)
    if depth <= 0.0:
        return
    x = cx + t * dx
    y = cy + t * dy
    z = cz + t * dz
    for piece in range(3):
        row = out[piece]
        if piece == 0:
            gap, qx, qy, f = arc_section(x, y, R, s, h)
        else:
            gap, qx, qy, f = flat_section(1.0 if piece == 2 else -1.0, x, y, s, h)
        factor, fx, fy = sign(piece, x, y, s, h, half_angle)
        free = row[0] + r
        if factor > 0.0:
            row[0] = factor * free - r
            row[8] = factor * row[8] + free * fx
            row[9] = factor * row[9] + free * fy
            row[10] *= factor
            continue
        put(row, gap, r, qx, qy, z, x, y, z, f, R, h)
        row[0] = factor * gap - r
        ux = row[4]
        uy = row[5]
        row[4] = -ux if x * x + y * y > R * R and gap > 1e-13 * R else ux
        row[5] = -uy if x * x + y * y > R * R and gap > 1e-13 * R else uy
        row[8] = -factor * row[4] + gap * fx
        row[9] = -factor * row[5] + gap * fy
        row[10] = 0.0


@formula
def all_pieces(R, s, h, H, half_angle, r, l, cx, cy, cz, dx, dy, dz, out):  # type: ignore[no-untyped-def] # noqa: E741
    """All pieces into out (5, 14)."""
    side_pieces(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz, out)
    lo, hi = clip(h, H, cy, cz, dy, dz, l)
    if lo <= hi and abs(cz + 0.5 * (lo + hi) * dz) < H:  # an axis that only touches an end face is on it, not inside
        enter(R, s, h, H, half_angle, r, l, cx, cy, cz, dx, dy, dz, lo, hi, out)
    end_piece(-H, R, s, h, H, r, l, cx, cy, cz, dx, dy, dz, out[3])
    end_piece(H, R, s, h, H, r, l, cx, cy, cz, dx, dy, dz, out[4])
    for i in range(PIECES):  # moment of the rate, in place of the axis point
        row = out[i]
        gx, gy, gz, x, y, z = row[8], row[9], row[10], row[11], row[12], row[13]
        row[11] = y * gz - z * gy
        row[12] = z * gx - x * gz
        row[13] = x * gy - y * gx


def _pieces(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
    if not rigid(T, 0):
        return False
    dx, dy, dz = axis(T, 0)
    s = R * math.sin(half_angle)
    h = -R * math.cos(half_angle)
    all_pieces(R, s, h, H, half_angle, r, l, T[0, 0, 3], T[0, 1, 3], T[0, 2, 3], dx, dy, dz, out)
    return True


pieces = entry(_pieces)
"""Compiled entry point: one pose (1, 4, 4) into (5, 14); False for a pose that is not rigid."""
