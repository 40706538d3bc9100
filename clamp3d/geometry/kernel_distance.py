"""The signed distance of a cylinder's axis segment from a groove, with witnesses: one formula for single and batch.

Where nothing else is said a result is the tuple ``(distance, qx, qy, qz, nx, ny, nz, feature, t, bound)``: signed
distance of the cylinder's surface, point on the groove, unit normal from groove to cylinder, code of the feature, place
on the axis, bound on the rounding error of the distance.
"""

from __future__ import annotations

import math

from clamp3d.geometry.jit import formula
from clamp3d.geometry.kernel_features import (
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
    beyond_end,
    clip,
    corner,
    deepest,
    end_arc,
    end_edge,
    lip_line,
    point_depth,
    section,
)

UNIT = 2.0**-53
"""Unit roundoff of float64."""

PARALLEL = 2.0**-60
"""An axis that leaves the groove's direction by less than this part of R over its length counts as parallel: the
deviation is smaller than the rounding of R itself, and it is part of the error bound."""


@formula
def parallel(R, s, h, H, r, l, x, y, z):  # type: ignore[no-untyped-def] # noqa: E741
    """Axis along z, centred at (x, y, z): the plane problem of a point and the section, and the gap along z."""
    gap, qx, qy, nx, ny, feature = section(x, y, R, s, h)
    lo = max(z - l, -H)
    hi = min(z + l, H)
    bound = UNIT * (6.0 * (R + abs(x) + abs(y)) + r)
    if lo <= hi:
        middle = 0.5 * (lo + hi)
        if gap < 0.0:
            inside = lo if lo > 0.0 else (hi if hi < 0.0 else 0.0)
            end = H - abs(inside)
            if end < -gap:
                face = -H if inside < 0.0 else H
                nz = -1.0 if inside < 0.0 else 1.0
                return -end - r, x, y, face, 0.0, 0.0, nz, END_FACE, inside - z, bound + UNIT * 4.0 * (H + abs(z) + l)
        if feature == ARC:
            # R - r first: exact for nearly equal radii, and rho is what is left.
            return (R - r) - math.sqrt(x * x + y * y), qx, qy, middle, nx, ny, 0.0, ARC, middle - z, bound
        return gap - r, qx, qy, middle, nx, ny, 0.0, feature, middle - z, bound
    above = hi == H
    face = H if above else -H
    nz = 1.0 if above else -1.0
    t = -l if above else l
    end = lo - hi
    bound += UNIT * 4.0 * (H + abs(z) + l)
    if gap <= 0.0:
        return end - r, x, y, face, 0.0, 0.0, nz, END_FACE, t, bound
    distance = math.sqrt(gap * gap + end * end)
    return (
        distance - r,
        qx,
        qy,
        face,
        nx * (gap / distance),
        ny * (gap / distance),
        nz * (end / distance),
        beyond_end(feature),
        t,
        bound,
    )


@formula
def inside(R, h, H, r, cx, cy, cz, dx, dy, dz, lo, hi, bound):  # type: ignore[no-untyped-def]
    """Axis that enters S: minus the depth of its deepest point, minus r."""
    depth, t = deepest(R, h, H, cx, cy, cz, dx, dy, dz, lo, hi)
    x = cx + t * dx
    y = cy + t * dy
    z = cz + t * dz
    depth, feature = point_depth(x, y, z, R, h, H)
    if feature == ARC:
        rho = math.sqrt(x * x + y * y)
        return -depth - r, x / rho * R, y / rho * R, z, -x / rho, -y / rho, 0.0, ARC, t, bound
    if feature == END_FACE:
        side = 1.0 if z >= 0.0 else -1.0
        return -depth - r, x, y, side * H, 0.0, 0.0, side, END_FACE, t, bound
    return -depth - r, x, h, z, 0.0, 1.0, 0.0, feature, t, bound


@formula
def edge_normal(feature, R, h, qx, qy, qz):  # type: ignore[no-untyped-def]
    """A unit normal in the middle of the normal cone of an edge, for an axis that passes through the edge itself."""
    x = -qx / R
    y = -qy / R
    z = 0.0
    if feature != END_ARC and feature != LIP_M and feature != LIP_N:
        x = 0.0 if feature in (END_EDGE_M, END_EDGE_N) else x
        y = 1.0
    elif feature != END_ARC:
        y += 1.0
    if feature != LIP_M and feature != LIP_N:
        z = 1.0 if qz > 0.0 else -1.0
    n = math.sqrt(x * x + y * y + z * z)
    return x / n, y / n, z / n


@formula
def nearest(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distance of any cylinder; (dx, dy, dz) is a unit vector."""
    e2 = dx * dx + dy * dy
    if e2 * (l * l) <= (PARALLEL * R) * (PARALLEL * R):
        return parallel(R, s, h, H, r, l, cx, cy, cz)

    bound = UNIT * (12.0 * (abs(cx) + abs(cy) + abs(cz) + 2.0 * l + H + R) + r)
    lo, hi = clip(h, H, cy, cz, dy, dz, l)
    if lo <= hi:
        x = cx + lo * dx
        y = cy + lo * dy
        rho2 = x * x + y * y
        x = cx + hi * dx
        y = cy + hi * dy
        # rho is convex along the axis: if any point of the part in the block is behind the arc, one of its ends is.
        if max(rho2, x * x + y * y) >= R * R:
            return inside(R, h, H, r, cx, cy, cz, dx, dy, dz, lo, hi, bound)

    best2 = math.inf
    bt = bx = by = bz = 0.0
    feature = ARC
    top = False
    bottom = False

    # Ends of the axis against S.
    for i in range(2):
        t = -l if i == 0 else l
        x = cx + t * dx
        y = cy + t * dy
        z = cz + t * dz
        gap, qx, qy, _, _, f = section(x, y, R, s, h)
        end = abs(z) - H
        if end > 0.0:
            if z > 0.0:
                top = True
            else:
                bottom = True
            z = H if z > 0.0 else -H
            if gap <= 0.0:
                d2 = end * end
                qx = x
                qy = y
                f = END_FACE
            else:
                d2 = gap * gap + end * end
                f = beyond_end(f)
        else:
            d2 = gap * gap
        if d2 < best2:
            best2 = d2
            bt = t
            bx = qx
            by = qy
            bz = z
            feature = f

    # Inside of the axis against the lips.
    for i in range(2):
        sx = -s if i == 0 else s
        d2, t, z = lip_line(sx, h, H, cx, cy, cz, dx, dy, dz, e2, l)
        if d2 < best2:
            best2 = d2
            bt = t
            bx = sx
            by = h
            bz = z
            feature = LIP_M if i == 0 else LIP_N

    # Inside of the axis against the edges and corners of the ends it passes.
    for i in range(2):
        if not (bottom if i == 0 else top):
            continue
        ez = -H if i == 0 else H
        d2, t, x = end_edge(ez, s, h, cx, cy, cz, dx, dy, dz, l)
        if d2 < best2:
            best2 = d2
            bt = t
            bx = x
            by = h
            bz = ez
            feature = END_EDGE_M if x < 0.0 else END_EDGE_N
        for j in range(2):
            sx = -s if j == 0 else s
            d2, t = corner(sx, h, ez, cx, cy, cz, dx, dy, dz, l)
            if d2 < best2:
                best2 = d2
                bt = t
                bx = sx
                by = h
                bz = ez
                feature = CORNER_M if j == 0 else CORNER_N
    for i in range(2):
        if not (bottom if i == 0 else top):
            continue
        ez = -H if i == 0 else H
        d2, x, y, t = end_arc(ez, R, h, cx, cy, cz, dx, dy, dz, e2, l, best2)
        if d2 < best2:
            best2 = d2
            bt = t
            bx = x
            by = y
            bz = ez
            feature = END_ARC

    if feature == ARC:
        x = cx + bt * dx
        y = cy + bt * dy
        rho = math.sqrt(x * x + y * y)
        if rho > 0.0:
            return (R - r) - rho, bx, by, bz, -x / rho, -y / rho, 0.0, ARC, bt, bound
        return R - r, bx, by, bz, 0.0, 1.0, 0.0, ARC, bt, bound
    distance = math.sqrt(best2)
    if feature in (FLAT_M, FLAT_N):
        return distance - r, bx, by, bz, 0.0, 1.0, 0.0, feature, bt, bound
    if feature == END_FACE:
        return distance - r, bx, by, bz, 0.0, 0.0, math.copysign(1.0, bz), feature, bt, bound
    nx = cx + bt * dx - bx
    ny = cy + bt * dy - by
    nz = cz + bt * dz - bz
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if n <= bound:
        nx, ny, nz = edge_normal(feature, R, h, bx, by, bz)
    else:
        nx /= n
        ny /= n
        nz /= n
    return distance - r, bx, by, bz, nx, ny, nz, feature, bt, bound
