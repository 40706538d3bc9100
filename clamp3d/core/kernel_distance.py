"""The signed distance of a cylinder's axis segment from a groove, with witnesses: one formula for single and batch.

Where nothing else is said a result is the tuple ``(distance, qx, qy, qz, nx, ny, nz, feature, t, bound)``: signed
distance of the cylinder's surface, point on the groove, unit normal from groove to cylinder, code of the feature, place
on the axis, bound on the rounding error of the distance.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import formula, inlined
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
    beyond_end,
    clip,
    corner,
    deepest,
    ellipse,
    end_arc,
    end_arc_reach,
    end_edge,
    inverse_root,
    lip_line,
    point_depth,
    section,
    section_foot,
)

UNIT = 2.0**-53
"""Unit roundoff of float64."""

PARALLEL = 2.0**-60
"""An axis that leaves the groove's direction by less than this part of R over its length counts as parallel: the
deviation is smaller than the rounding of R itself, and it is part of the error bound."""


@inlined
def is_parallel(R, l, dx, dy):  # type: ignore[no-untyped-def] # noqa: E741
    """Whether an axis counts as parallel to the groove."""
    return (dx * dx + dy * dy) * (l * l) <= (PARALLEL * R) * (PARALLEL * R)


@inlined
def parallel(R, s, h, H, r, l, x, y, z, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Axis along z, centred at (x, y, z): the plane problem of a point and the section, and the gap along z."""
    gap, feature = section(x, y, R, s, h)
    qx, qy, nx, ny = section_foot(feature, x, y, R, s, h)
    up = math.copysign(1.0, dz)
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
                return (
                    -end - r,
                    x,
                    y,
                    face,
                    0.0,
                    0.0,
                    nz,
                    END_FACE,
                    (inside - z) * up,
                    bound + UNIT * 4.0 * (H + abs(z) + l),
                )
        if feature == ARC:
            # R - r first: exact for nearly equal radii, and rho is what is left.
            return (R - r) - math.sqrt(x * x + y * y), qx, qy, middle, nx, ny, 0.0, ARC, (middle - z) * up, bound
        return gap - r, qx, qy, middle, nx, ny, 0.0, feature, (middle - z) * up, bound
    above = hi == H
    face = H if above else -H
    nz = 1.0 if above else -1.0
    t = -l * up if above else l * up
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
def inside_rate(R, h, H, l, cx, cy, cz, dx, dy, dz, t):  # type: ignore[no-untyped-def] # noqa: E741
    """Rate of the depth's negative by a shift of an axis inside S whose deepest point is at t.

    At an end of the axis that is the normal of the face it is nearest to. Between its ends the deepest point is as near
    to a second face, towards which the axis leads the other way: the depth falls by that mixture of both normals that
    is square to the axis.
    """
    x = cx + t * dx
    y = cy + t * dy
    z = cz + t * dz
    rho = math.sqrt(x * x + y * y)
    up = 1.0 if z >= 0.0 else -1.0
    best = first = math.inf
    nx = ny = nz = 0.0
    for second in range(2):
        least = math.inf
        mx = my = mz = 0.0
        for face in range(4):
            if face == 0:
                depth, ux, uy, uz = rho - R, -x / rho, -y / rho, 0.0
            elif face == 1:
                depth, ux, uy, uz = h - y, 0.0, 1.0, 0.0
            elif face == 2:
                depth, ux, uy, uz = H - abs(z), 0.0, 0.0, up
            else:
                depth, ux, uy, uz = H + abs(z), 0.0, 0.0, -up
            if depth < least and (second == 0 or (ux * dx + uy * dy + uz * dz) * best < 0.0):
                least, mx, my, mz = depth, ux, uy, uz
        if second == 0:
            first, nx, ny, nz = least, mx, my, mz
            best = nx * dx + ny * dy + nz * dz
            if abs(t) >= l or best == 0.0:
                return nx, ny, nz
        elif least - first <= 1e-9 * (R + H + first):
            other = mx * dx + my * dy + mz * dz
            u = other / (other - best)
            v = 1.0 - u
            return u * nx + v * mx, u * ny + v * my, u * nz + v * mz
    return nx, ny, nz


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


@inlined
def unit(dx, dy, dz, near):  # type: ignore[no-untyped-def]
    """A direction that is not parallel to the groove, of length 1, and the square of its part across the groove."""
    e2 = dx * dx + dy * dy
    n = inverse_root(e2 + dz * dz, near)
    return dx * n, dy * n, dz * n, e2 * (n * n)


@inlined
def is_behind(R, s, h, cx, cy, dx, dy, t, falls):  # type: ignore[no-untyped-def]
    """Whether a point of the axis in the block is in S; ``falls``: whether it may be where the axis passes y = h."""
    x = cx + t * dx
    y = cy + t * dy
    behind = x * x + y * y >= R * R and (h < 0.0 or abs(x) * -h + y * s <= 0.0)
    return behind or (abs(x) >= s and falls and t == (h - cy) / dy)


@inlined
def enters(R, s, h, H, l, cx, cy, cz, dx, dy, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Whether an axis enters S, and its part lo <= t <= hi in the block."""
    lo, hi = clip(h, H, cy, cz, dy, dz, l)
    # rho is convex along the axis: if any point of the part in the block is behind the arc, an end of it is.
    behind = is_behind(R, s, h, cx, cy, dx, dy, lo, dy < 0.0) or is_behind(R, s, h, cx, cy, dx, dy, hi, dy > 0.0)
    return lo <= hi and behind, lo, hi


@inlined
def from_outside(R, r, best2, feature, x, y):  # type: ignore[no-untyped-def]
    """Signed distance where the axis is outside S: of what `outside` found, the axis point at (x, y)."""
    if feature == ARC:
        # R - r first: exact for nearly equal radii, and rho is what is left.
        return (R - r) - math.sqrt(x * x + y * y)
    return math.sqrt(best2) - r


@inlined
def end_point(R, s, h, H, l, cx, cy, cz, dx, dy, dz, t):  # type: ignore[no-untyped-def] # noqa: E741
    """Squared distance of an end of the axis from S, the place along the groove there, the feature."""
    z = cz + t * dz
    gap, f = section(cx + t * dx, cy + t * dy, R, s, h)
    d2 = gap * gap
    end = abs(z) - H
    if end > 0.0:
        z = math.copysign(H, z)
        if gap <= 0.0:
            return end * end, z, END_FACE
        return d2 + end * end, z, beyond_end(f)
    if gap < 0.0 and end * end < d2:
        # In the material by the rounding of z alone (an axis in the plane of an end face): it is on the face.
        return end * end, math.copysign(H, z), END_FACE
    return d2, z, f


@inlined
def beyond(R, h, H, x, y, z):  # type: ignore[no-untyped-def]
    """Lower bound on the squared distance of a point beyond an end from S.

    That of all that is behind the arc's circle, below the flats and within the ends. The point's distance from the
    groove's axis is taken by the octagon around the circle, at most 1.09 times too large, in place of a root.
    """
    rho = max(abs(x), abs(y)) + 0.41421357 * min(abs(x), abs(y))  # more than tan(pi / 8)
    g = max(R - rho, y - h, 0.0)
    e = abs(z) - H
    return g * g + e * e


@inlined
def corners(ez, s, h, cx, cy, cz, dx, dy, dz, l, best2, bt, bz, feature):  # type: ignore[no-untyped-def] # noqa: E741
    """The best so far (its first four), or a corner of an end; whether the distance falls from one into the end arc."""
    d2, t, first = corner(-s, h, ez, cx, cy, cz, dx, dy, dz, l)
    if d2 < best2:
        best2, bt, bz, feature = d2, t, ez, CORNER_M
    d2, t, second = corner(s, h, ez, cx, cy, cz, dx, dy, dz, l)
    if d2 < best2:
        best2, bt, bz, feature = d2, t, ez, CORNER_N
    return best2, bt, bz, feature, first or second


@formula
def outside(R, s, h, H, l, cx, cy, cz, dx, dy, dz, e2):  # type: ignore[no-untyped-def] # noqa: E741
    """Nearest feature of an axis that does not enter S: squared distance, place on the axis, z, feature, x and y.

    The last two are of an end arc that the axis' inside is nearest to, else 0. A feature whose line, or whose end's
    plane, is no nearer than the best so far is not looked at.
    """
    best2 = math.inf
    bt = bz = bx = by = 0.0
    feature = ARC
    # Top and bottom: whether the axis reaches beyond the end faces, or level with them: an axis in the plane of an end
    # face leaves it by less than rounding.
    half = l * abs(dz)
    top, bottom = cz + half >= H, cz - half <= -H
    through = top and bottom  # then its ends are far from S
    if not through:
        best2, bz, feature = end_point(R, s, h, H, l, cx, cy, cz, dx, dy, dz, -l)
        bt = -l
        d2, z, f = end_point(R, s, h, H, l, cx, cy, cz, dx, dy, dz, l)
        if d2 < best2:
            best2, bt, bz, feature = d2, l, z, f
    low_falls = top_falls = False
    if bottom:
        best2, bt, bz, feature, low_falls = corners(-H, s, h, cx, cy, cz, dx, dy, dz, l, best2, bt, bz, feature)
    if top:
        best2, bt, bz, feature, top_falls = corners(H, s, h, cx, cy, cz, dx, dy, dz, l, best2, bt, bz, feature)
    # Inside of the axis against the lips, and the edges of the ends that it passes.
    d2, t, z = lip_line(-s, h, H, cx, cy, cz, dx, dy, dz, e2, l, best2)
    if d2 < best2:
        best2, bt, bz, feature = d2, t, z, LIP_M
    d2, t, z = lip_line(s, h, H, cx, cy, cz, dx, dy, dz, e2, l, best2)
    if d2 < best2:
        best2, bt, bz, feature = d2, t, z, LIP_N
    above = cy + l * abs(dy) >= h
    if above and bottom:
        d2, t, x = end_edge(-H, s, h, cx, cy, cz, dx, dy, dz, l, best2)
        if d2 < best2:
            best2, bt, bz, feature = d2, t, -H, END_EDGE_M if x < 0.0 else END_EDGE_N
    if above and top:
        d2, t, x = end_edge(H, s, h, cx, cy, cz, dx, dy, dz, l, best2)
        if d2 < best2:
            best2, bt, bz, feature = d2, t, H, END_EDGE_M if x < 0.0 else END_EDGE_N
    # End arcs: where the distance from the circle has one minimum and falls from no corner into the arc, none is on it.
    if top or bottom:
        ex, ey, e, p, along = ellipse(R, cx, cy, dx, dy, e2)
        low_v, low_reach = end_arc_reach(-H, R, cz, dz, e, p, along)
        top_v, top_reach = end_arc_reach(H, R, cz, dz, e, p, along)
        top_first = top and (not bottom or top_reach < low_reach)
        for i in range(2):
            at_top = top_first if i == 0 else not top_first
            least = top_reach if at_top else low_reach
            v = top_v if at_top else low_v
            falls = top_falls if at_top else low_falls
            if not (top if at_top else bottom) or least * least >= best2:
                continue
            if not falls and (abs(p) >= e2 or abs(dz * v) >= e2):
                continue
            ez = H if at_top else -H
            d2, x, y, t = end_arc(ez, R, s, h, cx, cy, cz, dx, dy, dz, e2, l, ex, ey, p, v)
            if d2 < best2:
                best2, bt, bz, feature, bx, by = d2, t, ez, END_ARC, x, y
    if through:
        for i in range(2):
            t = -l if i == 0 else l
            if beyond(R, h, H, cx + t * dx, cy + t * dy, cz + t * dz) < best2:
                d2, z, f = end_point(R, s, h, H, l, cx, cy, cz, dx, dy, dz, t)
                if d2 < best2:
                    best2, bt, bz, feature, bx, by = d2, t, z, f, 0.0, 0.0
    return best2, bt, bz, feature, bx, by


@inlined
def rounding(R, H, r, l, cx, cy, cz):  # type: ignore[no-untyped-def] # noqa: E741
    """Bound on the rounding error of the distance of an axis.

    A direction is normalised to 3 units, a point of the axis (a product and a sum, |t| <= l) known to 5 units of
    |c| + l, s and h to 3 units of R, a difference of these and its norm to 3 more: 11, rounded up, and r's own.
    """
    return UNIT * (12.0 * (abs(cx) + abs(cy) + abs(cz) + 2.0 * l + H + R) + r)


@inlined
def across(nx, ny, nz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """The part of a vector across a unit axis, and its length."""
    along = nx * dx + ny * dy + nz * dz
    nx -= along * dx
    ny -= along * dy
    nz -= along * dz
    return nx, ny, nz, math.sqrt(nx * nx + ny * ny + nz * nz)


@formula
def nearest(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distance of a cylinder centred at c with its axis along d (of any length but zero)."""
    if is_parallel(R, l, dx, dy):
        return parallel(R, s, h, H, r, l, cx, cy, cz, dz)
    dx, dy, dz, e2 = unit(dx, dy, dz, False)
    bound = rounding(R, H, r, l, cx, cy, cz)
    if cy - l * abs(dy) <= h:
        behind, lo, hi = enters(R, s, h, H, l, cx, cy, cz, dx, dy, dz)
        if behind:
            return inside(R, h, H, r, cx, cy, cz, dx, dy, dz, lo, hi, bound)
    best2, bt, bz, feature, bx, by = outside(R, s, h, H, l, cx, cy, cz, dx, dy, dz, e2)
    x = cx + bt * dx
    y = cy + bt * dy
    value = from_outside(R, r, best2, feature, x, y)
    if feature == ARC:
        bx, by, nx, ny = section_foot(ARC, x, y, R, s, h)
        return value, bx, by, bz, nx, ny, 0.0, ARC, bt, bound
    if feature in (FLAT_M, FLAT_N):
        return value, x, h, bz, 0.0, 1.0, 0.0, feature, bt, bound
    if feature == END_FACE:
        return value, x, y, bz, 0.0, 0.0, math.copysign(1.0, bz), feature, bt, bound
    if feature == END_ARC:
        if bx == 0.0 and by == 0.0:  # an end of the axis
            bx, by, nx, ny = section_foot(ARC, x, y, R, s, h)
    else:
        by = h
        if feature in (LIP_M, CORNER_M):
            bx = -s
        elif feature in (LIP_N, CORNER_N):
            bx = s
        else:
            bx = x
    nx = x - bx
    ny = y - by
    nz = cz + bt * dz - bz
    if nx * nx + ny * ny + nz * nz <= bound * bound:
        nx, ny, nz = edge_normal(feature, R, h, bx, by, bz)
    # Inside the axis the normal is across it, at an end it points back from it: with the axis close to the edge itself
    # the difference above knows that to few digits only.
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if abs(bt) < l or (nx * dx + ny * dy + nz * dz) * bt > 0.0:
        nx, ny, nz, n = across(nx, ny, nz, dx, dy, dz)
    if n == 0.0:
        nx, ny, nz, n = -dy, dx, 0.0, math.sqrt(e2)
    return value, bx, by, bz, nx / n, ny / n, nz / n, feature, bt, bound
