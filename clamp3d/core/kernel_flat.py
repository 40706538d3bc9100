"""Signed distance of a flat-ended cylinder from a groove.

The distance is the least value over the material's points q of the cylinder's own signed distance
``f(q) = phi(w - r, |t| - l)`` (see `kernel_edges`). Outside that is the distance of the two bodies. In an overlap it is
minus the inset: by how much radius and both ends must shrink alike for the cylinder to come free. Where nothing is
left of the cylinder before that, minus the smaller of radius and half length, minus the depth of what is left (its
axis segment; of a disc, whose radius is the larger, the middle).

f is convex. So its least value over S is on an edge of S, or at the one point of a face's plane where f is least, or,
behind the arc surface, at a point of a rim that is locally farthest from the groove's axis. The capsule holds the
cylinder: its distance is a lower bound, and the answer where its nearest axis point is square to the axis.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import formula, inlined
from clamp3d.core.kernel_distance import UNIT, inside, inside_rate, is_parallel, nearest, parallel
from clamp3d.core.kernel_edges import from_axis, on_arc, on_line
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
    farther_root,
    nearer_root,
    phi,
    point_depth,
    section,
    section_foot,
)


@inlined
def note(rows, n, f, x, y, z, feature):  # type: ignore[no-untyped-def]
    """Keep a candidate: value, point of the groove, feature. Returns their number."""
    rows[n, 0] = f
    rows[n, 1] = x
    rows[n, 2] = y
    rows[n, 3] = z
    rows[n, 4] = feature
    return n + 1


@formula
def plane_point(a, dn, en, r, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Least f over a plane that lies ``a`` below the cylinder's middle, and where: multiples of axis and radius.

    A plane above the middle counts only if it cuts what is left last of a disc (inf otherwise): behind it f is less.

    ``dn``, ``en``: parts of the axis along and across the plane's normal. The point is the middle minus the first
    times the axis, minus the second times the unit vector across the axis that leads away from the plane.
    """
    if a < 0.0:
        return (-l, 0.0, a / en) if -a < (r - l) * en else (math.inf, 0.0, 0.0)
    up = 1.0 if dn >= 0.0 else -1.0
    reach = l * abs(dn) + r * en
    f = a - reach
    if f >= 0.0:
        return f, up * l, r if en > 0.0 else 0.0
    inset = -f / (abs(dn) + en)
    if inset <= min(r, l):
        return -inset, up * (l - inset), (r - inset) if en > 0.0 else 0.0
    if r <= l:
        return -r, a / dn if dn != 0.0 else 0.0, 0.0
    return -l, 0.0, a / en if en > 0.0 else 0.0


@formula
def rim_arc(which, r, l, cx, cy, cz, dx, dy, dz, e2, e, ex, ey, inset):  # type: ignore[no-untyped-def] # noqa: E741
    """Local maxima of the distance from the groove's axis on the rims of the cylinder less ``inset``.

    ``which``: 0, 1 the farthest points of the two rims, 2, 3 the other local maxima. Returns the point's distance from
    the groove's axis (-1 if there is none), the point, and the rates of that distance by radius and half length.
    Seen along the groove a rim is an ellipse; its farthest points are found like the nearest ones of `end_arc`. Its
    minor axis is (ex, ey), the direction of the axis' part across the groove, of length e; the major one (-ey, ex).
    """
    up = 1.0 if which % 2 == 0 else -1.0
    along = up * (l - inset)
    rim = r - inset
    x, y, z = cx + along * dx, cy + along * dy, cz + along * dz
    b = abs(dz)
    p = (ex * y - ey * x) / rim
    v = (ex * x + ey * y) / rim
    q, a = abs(p), abs(b * v)
    if q > TINY or a > e2:
        if which < 2:
            root = nearer_root(e2, a, q)
            C, S = p / root, b * v / (root + e2)
        else:
            root = farther_root(e2, a, q)
            if root <= 0.0:
                return -1.0, x, y, z, 0.0, 0.0
            C, S = -p / root, b * v / (e2 - root)
        n = 1.0 / math.sqrt(C * C + S * S)
        C *= n
        S *= n
    else:
        S = b * v / e2
        C = math.sqrt(max(0.0, 1.0 - S * S))
        if which >= 2:
            C = -C
    # The minor axis in space: across the cylinder's axis, (ex dz, ey dz, -e), with the sign that makes ex, ey rise.
    sign = 1.0 if dz >= 0.0 else -1.0
    ux, uy, uz = -ey * C + ex * b * S, ex * C + ey * b * S, -e * sign * S
    x += rim * ux
    y += rim * uy
    z += rim * uz
    rho = math.sqrt(x * x + y * y)
    if rho < TINY:
        return -1.0, x, y, z, 0.0, 0.0
    return rho, x, y, z, (x * ux + y * uy) / rho, up * (x * dx + y * dy) / rho


@formula
def candidates(R, half_angle, s, h, H, r, l, cx, cy, cz, dx, dy, dz, least, best, slack, eps, work, found, rows):  # type: ignore[no-untyped-def] # noqa: E741
    """Points of the groove where f may be least, into rows; only those below the best + ``slack`` are sure to be there.

    ``least`` is a lower bound: what reaches it ends the search. ``best`` is an upper one that the least f is below by
    more than rounding. Returns their number, and a lower bound of what a search that ended early may have left.
    """
    n = 0
    left = math.inf
    e2 = dx * dx + dy * dy
    e = math.sqrt(e2)
    flat_e = math.sqrt(dx * dx + dz * dz)
    lowest = -min(r, l)

    # Flat faces.
    if cy >= h or r > l:
        f, along, out = plane_point(cy - h, dy, flat_e, r, l)
        x, z = cx - along * dx, cz - along * dz
        if flat_e > 0.0:
            x -= out * (-dy * dx / flat_e)
            z -= out * (-dy * dz / flat_e)
        if f < math.inf and abs(z) <= H and abs(x) >= s:
            n = note(rows, n, f, x, h, z, FLAT_N if x >= 0.0 else FLAT_M)
            best = min(best, f)
    # End faces.
    for i in range(2):
        up = 1.0 if i == 0 else -1.0
        a = up * cz - H
        if (a >= 0.0 or r > l) and not (slack == 0.0 and a - l * abs(dz) - r * e >= best):
            f, along, out = plane_point(a, up * dz, e, r, l)
            x, y = cx - along * dx, cy - along * dy
            if e > 0.0:
                x += out * up * dz * dx / e
                y += out * up * dz * dy / e
            gap, _ = section(x, y, R, s, h)
            if gap <= 0.0 and f < math.inf:
                n = note(rows, n, f, x, y, up * H, END_FACE)
                best = min(best, f)
    # Arc surface: a rim from inside.
    if e > 0.0:
        ex, ey = dx / e, dy / e
        for k in range(4):
            which = k if cx * dx + cy * dy >= 0.0 else k ^ 1  # the end that is farther from the groove's axis first
            along = l if which % 2 == 0 else -l
            x, y = cx + along * dx, cy + along * dy
            if R - math.sqrt(x * x + y * y) - r > best + slack + 4.0 * eps:
                continue
            rho, x, y, z, by_r, by_l = rim_arc(which, r, l, cx, cy, cz, dx, dy, dz, e2, e, ex, ey, 0.0)
            if not (rho > 0.0 and R - rho <= best + slack):  # nor if a square has overflowed
                continue
            inset = 0.0
            if rho > R:
                if slack == 0.0 and best < 0.0 and which < 2:  # less than the best inset frees this rim, or it goes on
                    inset = -best
                    if inset < -lowest:
                        rho, x, y, z, by_r, by_l = rim_arc(which, r, l, cx, cy, cz, dx, dy, dz, e2, e, ex, ey, inset)
                    if inset == -lowest or rho <= R:
                        continue
                last = math.inf
                for _ in range(60):  # the rim of what is left just touches
                    rate = by_r + by_l
                    step = (rho - R) / rate if rate > 0.0 else math.inf
                    # Convex, so Newton's steps stay on this side of the root: what passes the bound is no candidate.
                    if which < 2 and inset + step > 64.0 * eps - least:
                        rho = -1.0
                        break
                    if not inset + step < -lowest:  # it never does: of a disc, what is left last
                        inset = -lowest
                        rho = -1.0
                        if r > l:
                            rho, x, y, z, _, _ = rim_arc(which, r, l, cx, cy, cz, dx, dy, dz, e2, e, ex, ey, inset)
                        break
                    inset += step
                    rho, x, y, z, by_r, by_l = rim_arc(which, r, l, cx, cy, cz, dx, dy, dz, e2, e, ex, ey, inset)
                    size = abs(step)
                    if rho <= 0.0 or abs(rho - R) <= 2.0 * UNIT * R:
                        break
                    if size <= 1e-12 * R or (size <= 1e-8 * R and size > 0.7 * last):
                        break
                    last = size
                if rho <= 0.0 or (inset == -lowest and rho < R):
                    continue
            if abs(z) > H:
                continue
            if inset < -lowest:
                x *= R / rho
                y *= R / rho
            if y > h or (h > 0.0 and abs(x) * -h + y * s > 0.0):
                continue
            if inset > 0.0:
                w, t = from_axis(x - cx, y - cy, z - cz, dx, dy, dz)
                f = phi(w - r, abs(t) - l)
            else:
                f = R - rho
            n = note(rows, n, f, x, y, z, ARC)
            best = min(best, f)
    if n > 0 and slack == 0.0 and best <= least:
        return n, left

    # Edges: lips, end edges, end arcs.
    high = l * abs(dy) + r * flat_e
    far = l * abs(dz) + r * e
    if n == 0 or cy + high >= h or h > 0.0:
        for i in range(2):
            kx = (-s if i == 0 else s) - cx
            f, at = on_line(r, l, kx, h - cy, 0.0, 0.0, 1.0, dx, dy, dz, -H - cz, H - cz, best + slack)
            if f <= best + slack:
                z = min(max(at + cz, -H), H)
                feature = LIP_M if i == 0 else LIP_N
                if abs(z) == H:
                    feature = CORNER_M if i == 0 else CORNER_N
                n = note(rows, n, f, -s if i == 0 else s, h, z, feature)
                best = min(best, f)
    for i in range(2):
        up = 1.0 if i == 0 else -1.0
        beyond = up * cz + far - H
        if beyond < 0.0:
            continue
        low = up * cz - far - H
        if low > 0.0 and low > best + slack:
            continue
        ez = up * H
        if cy + high >= h:
            for j in range(2):
                side = -1.0 if j == 0 else 1.0
                a, b = (-math.inf, -s - cx) if j == 0 else (s - cx, math.inf)
                f, at = on_line(r, l, 0.0, h - cy, ez - cz, 1.0, 0.0, dx, dy, dz, a, b, best + slack)
                if f <= best + slack:
                    x = side * max(side * (at + cx), s)
                    feature = END_EDGE_M if j == 0 else END_EDGE_N
                    if x == side * s:
                        feature = CORNER_M if j == 0 else CORNER_N
                    n = note(rows, n, f, x, h, ez, feature)
                    best = min(best, f)
        count, rest = on_arc(ez, R, half_angle, r, l, cx, cy, cz, dx, dy, dz, best, slack, eps, work, found)
        left = min(left, rest)
        for k in range(count):
            x, y = R * math.sin(found[k, 0]), -R * math.cos(found[k, 0])
            w, t = from_axis(x - cx, y - cy, ez - cz, dx, dy, dz)
            f = phi(w - r, abs(t) - l)
            n = note(rows, n, f, x, y, ez, END_ARC)
            best = min(best, f)
    return n, left


@formula
def witness(f, qx, qy, qz, feature, R, s, h, r, l, cx, cy, cz, dx, dy, dz, bound):  # type: ignore[no-untyped-def] # noqa: E741
    """Unit normal at a point q of the groove where f is least, and the rate of f by a shift of the cylinder."""
    x, y, z = qx - cx, qy - cy, qz - cz
    w, t = from_axis(x, y, z, dx, dy, dz)
    side = 1.0 if t >= 0.0 else -1.0
    g, e = w - r, abs(t) - l
    ex, ey, ez = -side * dx, -side * dy, -side * dz  # from q back to the end, and to the side
    sx, sy, sz = -(x - t * dx), -(y - t * dy), -(z - t * dz)
    if w > TINY:
        sx, sy, sz = sx / w, sy / w, sz / w
    else:
        sx, sy, sz = ex, ey, ez
        g = -math.inf
    # Normal of the face, or the edge's direction: what the mixture of the two is to be along, or square to.
    on_face = feature in (ARC, FLAT_M, FLAT_N, END_FACE)
    on_edge = feature in (LIP_M, LIP_N, END_EDGE_M, END_EDGE_N, END_ARC)
    mx = my = mz = 0.0
    if feature == ARC:
        mx, my = -qx / R, -qy / R
    elif feature in (FLAT_M, FLAT_N):
        my = 1.0
    elif feature == END_FACE:
        mz = 1.0 if qz > 0.0 else -1.0
    elif feature in (LIP_M, LIP_N):
        mz = 1.0
    elif feature in (END_EDGE_M, END_EDGE_N):
        mx = 1.0
    elif feature == END_ARC:
        mx, my = -qy / R, qx / R
    by_s = sx * mx + sy * my + sz * mz
    by_e = ex * mx + ey * my + ez * mz
    if f > 0.0:
        u, v = max(g, 0.0) / f, max(e, 0.0) / f
        if f <= 64.0 * bound:  # what the difference of nearly equal numbers has lost
            if on_face:
                u, v = max(by_s, 0.0), max(by_e, 0.0)
            elif on_edge and g > -bound and e > -bound and by_s * by_e < 0.0:
                u, v = abs(by_e), abs(by_s)
            elif g <= -bound or e <= -bound:
                u, v = (1.0, 0.0) if g > e else (0.0, 1.0)
        if u == 0.0 and v == 0.0:
            u = 1.0
        n = math.sqrt(u * u + v * v)
        u, v = u / n, v / n
        nx, ny, nz = u * sx + v * ex, u * sy + v * ey, u * sz + v * ez
        return nx, ny, nz, nx, ny, nz, t
    nx, ny, nz = (sx, sy, sz) if g >= e else (ex, ey, ez)
    u, v = (1.0, 0.0) if g >= e else (0.0, 1.0)
    if abs(g - e) <= 64.0 * bound:
        if on_face and max(by_s, 0.0) + max(by_e, 0.0) > 0.0:
            u, v = max(by_s, 0.0), max(by_e, 0.0)
        elif on_edge and by_s * by_e < 0.0:
            u, v = abs(by_e), abs(by_s)
        u, v = u / (u + v), v / (u + v)
    return nx, ny, nz, u * sx + v * ex, u * sy + v * ey, u * sz + v * ez, t


@formula
def way_out(x, y, z, R, s, h, H):  # type: ignore[no-untyped-def]
    """Depth of a point of the material, its nearest point of the boundary, the normal there, the feature."""
    depth, feature = point_depth(x, y, z, R, h, H)
    if feature == END_FACE:
        up = 1.0 if z > 0.0 else -1.0
        return depth, x, y, H * up, 0.0, 0.0, up, feature
    qx, qy, nx, ny = section_foot(feature, x, y, R, s, h)
    return depth, qx, qy, z, nx, ny, 0.0, feature


@inlined
def disc_gaps(R, s, h, H, r, l, x, y, z):  # type: ignore[no-untyped-def] # noqa: E741
    """Axis along z, as the plane problem of a disc and the section, and the gap along z.

    Gap of the axis to the section and its feature, gaps of the side and of an end, their distance; whether the groove
    goes on where nothing is left of the cylinder: then the distance is another.
    """
    gap, feature = section(x, y, R, s, h)
    beyond = abs(z) - H
    deep = gap < 0.0 and beyond <= max(l - r, 0.0)
    g = gap - r if gap > 0.0 else -r
    if feature == ARC and gap > 0.0:
        g = (R - r) - math.sqrt(x * x + y * y)
    e = max(beyond, 0.0) - l
    return gap, feature, g, e, phi(g, e), deep


@formula
def flat_parallel(R, s, h, H, r, l, x, y, z, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Axis along z: the plane problem of a disc and the section, and the gap along z."""
    gap, feature, g, e, f, deep = disc_gaps(R, s, h, H, r, l, x, y, z)
    bound = UNIT * (6.0 * (R + abs(x) + abs(y)) + 4.0 * (H + abs(z) + l) + r)
    if deep:
        if l >= r:
            return parallel(R, s, h, H, r, l - r, x, y, z, dz)
        depth, qx, qy, qz, nx, ny, nz, feature = way_out(x, y, z, R, s, h, H)
        return -l - depth, qx, qy, qz, nx, ny, nz, feature, 0.0, bound
    up = math.copysign(1.0, dz)
    qx, qy, nx, ny = section_foot(feature, x, y, R, s, h)
    if gap <= 0.0:
        qx, qy = x, y
    above = 1.0 if z > 0.0 else -1.0
    lo = max(z - l, -H)
    hi = min(z + l, H)
    qz = 0.5 * (lo + hi) if lo <= hi else above * H
    if g > 0.0 and e > 0.0:
        nx, ny, nz = nx * (g / f), ny * (g / f), above * (e / f)
        feature = beyond_end(feature)
    elif g >= e:
        nz = 0.0
        if g < 0.0 and abs(qz - z) - l > g:  # the middle of the line of contact is nearer to an end
            qz = min(max(z, -H), H)
    else:
        qz = min(max(z, -H), H)
        nx, ny, nz = 0.0, 0.0, above
        if abs(z) - H >= 0.0:
            feature = END_FACE if gap <= 0.0 else beyond_end(feature)
    return f, qx, qy, qz, nx, ny, nz, feature, (qz - z) * up, bound


@inlined
def is_beside(v, t, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Whether the capsule's distance v is the cylinder's: its axis point t is inside, where the normal is square."""
    return abs(t) < l and (v >= 0.0 or abs(t) - l <= v)


@formula
def flat_nearest(R, half_angle, s, h, H, r, l, cx, cy, cz, dx, dy, dz, pad):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distance of a flat-ended cylinder: distance, q, normal, feature, place on the axis, bound, rate.

    ``pad`` (128, 5) is what it works in.
    """
    work, found, rows = pad[:64], pad[64:80], pad[80:]
    if is_parallel(R, max(l, r), dx, dy):
        v, qx, qy, qz, nx, ny, nz, feature, t, bound = flat_parallel(R, s, h, H, r, l, cx, cy, cz, dz)
        gx, gy, gz = nx, ny, nz
        if l < r and abs(v + l) <= bound:  # nothing is left of a disc, and its middle is not in the material yet
            gx = gy = gz = 0.0
        elif l >= r and v < -r:
            gx, gy, gz = inside_rate(R, h, H, l - r, cx, cy, cz, 0.0, 0.0, math.copysign(1.0, dz), t)
        return v, qx, qy, qz, nx, ny, nz, feature, t, bound, gx, gy, gz
    v, qx, qy, qz, nx, ny, nz, feature, t, bound = nearest(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz)
    n = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    dx *= n
    dy *= n
    dz *= n
    least = v
    if v >= -r:
        if is_beside(v, t, l) or (abs(nx * dx + ny * dy + nz * dz) <= 8.0 * UNIT and (v >= 0.0 or abs(t) - l <= v)):
            return v, qx, qy, qz, nx, ny, nz, feature, t, bound, nx, ny, nz
    else:
        least = -math.inf
        left = l - r
        if left >= 0.0:
            lo, hi = clip(h, H, cy, cz, dy, dz, left)
            behind = False
            if lo <= hi:
                for i in range(2):
                    x, y = cx + (lo if i == 0 else hi) * dx, cy + (lo if i == 0 else hi) * dy
                    if x * x + y * y >= R * R and (h < 0.0 or abs(x) * -h + y * s <= 0.0):
                        behind = True
            if behind:
                v, qx, qy, qz, nx, ny, nz, feature, t, bound = inside(R, h, H, r, cx, cy, cz, dx, dy, dz, lo, hi, bound)
                gx, gy, gz = inside_rate(R, h, H, left, cx, cy, cz, dx, dy, dz, t)
                return v, qx, qy, qz, nx, ny, nz, feature, t, bound, gx, gy, gz
        elif section(cx, cy, R, s, h)[0] <= 0.0 and abs(cz) <= H:
            depth, qx, qy, qz, nx, ny, nz, feature = way_out(cx, cy, cz, R, s, h, H)
            return -l - depth, qx, qy, qz, nx, ny, nz, feature, 0.0, bound, nx, ny, nz
    bound = 2.0 * bound + 4.0 * UNIT * r
    eps = UNIT * (abs(cx) + abs(cy) + abs(cz) + l + H + R + r)
    # No more than where the capsule is nearest: what cannot be below that is not looked for.
    w, t = from_axis(qx - cx, qy - cy, qz - cz, dx, dy, dz)
    start = phi(w - r, abs(t) - l)
    count, rest = candidates(
        R, half_angle, s, h, H, r, l, cx, cy, cz, dx, dy, dz, least, start + bound, 0.0, eps, work, found, rows
    )
    if count == 0:
        count = note(rows, 0, start, qx, qy, qz, feature)
    k = 0
    for i in range(1, count):
        if rows[i, 0] < rows[k, 0]:
            k = i
    f, qx, qy, qz, feature = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], int(rows[k, 4])
    nx, ny, nz, gx, gy, gz, t = witness(f, qx, qy, qz, feature, R, s, h, r, l, cx, cy, cz, dx, dy, dz, bound)
    if l < r and f + l <= bound:  # nothing is left of a disc, and its middle is not in the material yet
        gx = gy = gz = 0.0
    bound += max(f - rest, 0.0)
    return f, qx, qy, qz, nx, ny, nz, feature, t, bound, gx, gy, gz
