"""Least distance and first contact of a moving cylinder, certain: branch and bound over its swept axis.

The axis sweeps the surface ``x(u, t) = p + turn(axis, u angle) (c + t d - p) + u v``, 0 <= u <= 1, |t| <= l.
Cells of (u, t) are halved until their lower bound decides, so nothing of the motion is sampled and hoped for, and the
work does not depend on how long the motion is or how thin the parts are.

``sdf = phi(G, |z| - H)``, G the signed distance in the section and phi that of a quadrant: convex, rising in both,
slope at most 1. A cell is its linear model about its centre a, with corners +-a +-b +-k, and what the turn takes off
that (``sag``). Lower bounds over a cell:

- ``G >= y - h`` and ``G >= R - rho`` everywhere; rho is convex, so it is largest in a corner;
- before a lip G is the distance from it, and ``sdf >= phi(y - h, |z| - H)``: distances of a patch from a point and from
  a quadrant, convex, so exact for a straight motion;
- G is that of a set of reach R on each side of x = 0 (Federer, Curvature measures, 1959), so
  ``G(y) >= G(a) + n.(y - a) - |y - a|^2 / (2 (R - largest G))``; above mouth and centre only the two rays are near,
  which are convex, and the last term is 0;
- ``sdf >= max(R - rho, y - h, |z| - H)``, so it is no less than any mixture of two of them;
- slope 1.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_features import FLAT_N, phi, section, section_foot
from clamp3d.core.kernel_heap import pop, put

CELLS = 200_000
"""Cells that may wait. A search that needs more ends with a wider bound, which it tells."""


@formula
def slope(x, y, R, s, h):  # type: ignore[no-untyped-def]
    """G and its gradient at a point of the section with x >= 0; last, whether the flat face is what is nearest."""
    g, feature = section(x, y, R, s, h)
    _, _, nx, ny = section_foot(feature, x, y, R, s, h)
    return g, nx, ny, feature == FLAT_N


@formula
def place(m, u):  # type: ignore[no-untyped-def]
    """Centre, direction, velocity of the centre and of the direction at u: 12 numbers."""
    angle = m[15]
    ux, uy, uz = m[9], m[10], m[11]
    x, y, z = m[0], m[1], m[2]
    dx, dy, dz = m[3], m[4], m[5]
    vx, vy, vz = m[12], m[13], m[14]
    wx = wy = wz = 0.0
    if angle != 0.0:
        sine, half = math.sin(u * angle), math.sin(0.5 * u * angle)
        versine = 2.0 * half * half
        ox, oy, oz = x - m[6], y - m[7], z - m[8]
        kx, ky, kz = uy * oz - uz * oy, uz * ox - ux * oz, ux * oy - uy * ox
        qx, qy, qz = uy * kz - uz * ky, uz * kx - ux * kz, ux * ky - uy * kx
        x, y, z = x + sine * kx + versine * qx, y + sine * ky + versine * qy, z + sine * kz + versine * qz
        ox, oy, oz = ox + sine * kx + versine * qx, oy + sine * ky + versine * qy, oz + sine * kz + versine * qz
        vx, vy, vz = (
            vx + angle * (uy * oz - uz * oy),
            vy + angle * (uz * ox - ux * oz),
            vz + angle * (ux * oy - uy * ox),
        )
        kx, ky, kz = uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx
        qx, qy, qz = uy * kz - uz * ky, uz * kx - ux * kz, ux * ky - uy * kx
        dx, dy, dz = dx + sine * kx + versine * qx, dy + sine * ky + versine * qy, dz + sine * kz + versine * qz
        wx, wy, wz = angle * (uy * dz - uz * dy), angle * (uz * dx - ux * dz), angle * (ux * dy - uy * dx)
    x, y, z = x + u * m[12], y + u * m[13], z + u * m[14]
    return x, y, z, dx, dy, dz, vx, vy, vz, wx, wy, wz


@formula
def value(R, s, h, H, m, u, t):  # type: ignore[no-untyped-def]
    """Signed distance of one point of the moving axis."""
    p = place(m, u)
    g = section(abs(p[0] + t * p[3]), p[1] + t * p[4], R, s, h)[0]
    return phi(g, abs(p[2] + t * p[5]) - H)


@formula
def ridge(f, fu, ft, fk, g, gu, gt, gk, curve):  # type: ignore[no-untyped-def]
    """Lower bound of max(f, g), both linear over a cell but for ``curve`` of f: of their best mixture."""
    low = -math.inf
    for i in range(2):
        a, b = (fu, gu) if i == 0 else (ft, gt)
        if a * b < 0.0:
            w = b / (b - a)
            v = 1.0 - w
            fall = abs(w * fu + v * gu) + abs(w * ft + v * gt) + abs(w * fk + v * gk)
            low = max(low, w * (f - curve) + v * g - fall)
    return low


@formula
def apart(x, y, ax, ay, bx, by, kx, ky, quadrant):  # type: ignore[no-untyped-def]
    """Lower bound of the distance of the patch (x, y) +- a +- b +- k from the origin, or from the quadrant x, y <= 0.

    The best of some separating lines: exact for a parallelogram, negative if none separates.
    """
    low = -math.inf
    for i in range(6):
        if i < 2:
            nx, ny = (-ay, ax) if i == 0 else (-by, bx)
            if nx * x + ny * y < 0.0:
                nx, ny = -nx, -ny
        else:
            p, q = 1.0 - 2.0 * (i % 2), 1.0 - 2.0 * (i // 4)
            nx, ny = x + p * ax + q * bx + p * q * kx, y + p * ay + q * by + p * q * ky
        n = math.sqrt(nx * nx + ny * ny)
        if n == 0.0 or (quadrant and (nx < 0.0 or ny < 0.0)):
            continue
        nx, ny = nx / n, ny / n
        a, b, k = nx * ax + ny * ay, nx * bx + ny * by, nx * kx + ny * ky
        fall = max(abs(a + b) - k, abs(a - b) + k)  # of -a-b+k, a+b+k, a-b-k, b-a-k the lowest
        low = max(low, nx * x + ny * y - fall)
    return low


@formula
def cell(R, s, h, H, m, bend, coaxial, u, t, hu, ht):  # type: ignore[no-untyped-def]
    """Value at a cell's centre, lower bound over the cell, whether to halve along u, corner where it seems lowest."""
    cx, cy, cz, dx, dy, dz, vx, vy, vz, wx, wy, wz = place(m, u)
    x, y, z = cx + t * dx, cy + t * dy, cz + t * dz
    if x < 0.0:  # mirrored: the material is symmetric
        x, dx, vx, wx = -x, -dx, -vx, -wx
    if z < 0.0:
        z, dz, vz, wz = -z, -dz, -vz, -wz
    vx, vy, vz = vx + t * wx, vy + t * wy, vz + t * wz
    g, nx, ny, flat = slope(x, y, R, s, h)
    e = z - H
    f = phi(g, e)
    # What a turn takes off a tangent is square to its axis.
    sag = 0.5 * bend * hu * hu
    sag_x, sag_y = sag * math.sqrt(max(0.0, 1.0 - m[9] * m[9])), sag * math.sqrt(max(0.0, 1.0 - m[10] * m[10]))
    sag_z = sag * math.sqrt(max(0.0, 1.0 - m[11] * m[11]))
    # Linear model: x + a u + b t + c u t; extents of its coordinates.
    ax, ay, az = hu * vx, hu * vy, hu * vz
    bx, by, bz = ht * dx, ht * dy, ht * dz
    kx, ky, kz = hu * ht * wx, hu * ht * wy, hu * ht * wz
    reach_x = abs(ax) + abs(bx) + abs(kx) + sag_x
    reach_y = abs(ay) + abs(by) + abs(ky) + sag_y
    reach_z = abs(az) + abs(bz) + abs(kz) + sag_z
    reach = 0.0
    rho = 0.0
    for i in range(2):
        p = 1.0 if i == 0 else -1.0
        for j in range(2):
            q = 1.0 if j == 0 else -1.0
            mx, my = p * ax + q * bx + p * q * kx, p * ay + q * by + p * q * ky
            reach = max(reach, math.sqrt(mx * mx + my * my))
            rho = max(rho, math.sqrt((x + mx) ** 2 + (y + my) ** 2))
    reach += sag
    if coaxial:  # a turn about the groove's own axis changes no rho
        rho = max(math.hypot(x + bx, y + by), math.hypot(x - bx, y - by)) - sag
    # Each coordinate for itself.
    low_g = max(y - reach_y - h, R - rho - sag, g - reach)
    low_e = e - reach_z
    if z - reach_z < 0.0:
        low_e = -H
    before = x >= reach_x and x + reach_x <= s
    before = before and (y - reach_y) * s - max(h * (x - reach_x), h * (x + reach_x)) >= 0.0
    if before and low_e < 0.0:  # all of it before the lip
        low_g = max(low_g, apart(x - s, y - h, ax, ay, bx, by, kx, ky, False) - sag)
    low = phi(low_g, low_e)
    if before and low_e >= 0.0:  # before a corner: across the axis, for a wire that moves almost along itself
        b2 = bx * bx + by * by + bz * bz
        w = ((x - s) * bx + (y - h) * by + e * bz) / b2 if b2 > 0.0 else 0.0
        qx, qy, qz = x - s - w * bx, y - h - w * by, e - w * bz
        q = math.sqrt(qx * qx + qy * qy + qz * qz)
        if q > 0.0:
            fall = abs(qx * ax + qy * ay + qz * az) + abs(qx * kx + qy * ky + qz * kz)
            fall += abs(qx * bx + qy * by + qz * bz)
            low = max(low, (qx * (x - s) + qy * (y - h) + qz * e - fall) / q - sag)
    if e + reach_z > 0.0:
        low = max(low, apart(y - h, e, ay, az, by, bz, ky, kz, True) - sag)  # sdf >= phi(y - h, |z| - H)
    # Both together, by the gradient of phi.
    if g <= 0.0 and e <= 0.0:
        fg, fe = (1.0, 0.0) if g >= e else (0.0, 1.0)
    elif f > 0.0:
        fg, fe = max(g, 0.0) / f, max(e, 0.0) / f
    else:
        fg, fe = 0.0, 0.0
    curve = math.inf
    if flat and g == y - h:
        curve = 0.0
        nx, ny = 0.0, 1.0
    elif y - reach_y >= max(h, 0.0):
        curve = 0.0
    elif g + reach < R:
        curve = 0.5 * reach * reach / (R - g - reach)
    gx, gy, gz = fg * nx, fg * ny, fe
    along_u, along_t = ax * gx + ay * gy + az * gz, bx * gx + by * gy + bz * gz
    if curve < math.inf:
        if x - reach_x < 0.0 and gx != 0.0:  # the mirrored part of the cell: x counts for itself
            fall = abs(gx) * reach_x + abs(ay * gy + az * gz) + abs(by * gy + bz * gz) + abs(ky * gy + kz * gz) + sag
        else:
            fall = abs(along_u) + abs(along_t) + abs(kx * gx + ky * gy + kz * gz) + sag
        if z - reach_z >= 0.0 or gz == 0.0:
            low = max(low, f - fall - fg * curve)
    # Where the axis is inside, the least is often at an edge between two of R - rho, y - h and |z| - H.
    if f < reach + reach_z:
        rho0 = math.sqrt(x * x + y * y)
        concave = math.inf
        ox = oy = 0.0
        if rho0 > reach:
            concave = 0.5 * reach * reach / (rho0 - reach)
            ox, oy = -x / rho0, -y / rho0
        low = max(low, ridge(y - h, ay, by, ky, e, az, bz, kz, 0.0) - sag)
        if concave < math.inf:
            out_u, out_t, out_k = ox * ax + oy * ay, ox * bx + oy * by, ox * kx + oy * ky
            low = max(low, ridge(R - rho0, out_u, out_t, out_k, y - h, ay, by, ky, concave) - sag)
            low = max(low, ridge(R - rho0, out_u, out_t, out_k, e, az, bz, kz, concave) - sag)
            if coaxial:
                b2 = bx * bx + by * by
                bent = 0.5 * b2 / (rho0 - math.sqrt(b2))
                low = max(low, ridge(R - rho0, 0.0, out_t, 0.0, e, az, bz, 0.0, bent))
    by_u = abs(along_u) + sag
    by_t = abs(along_t)
    bends = abs(gx * kx + gy * ky + gz * kz)
    if flat:  # bent by phi alone, across the edge
        k = 1.0 / max(f, 1e-3 * R) if fg * fe > 0.0 else 0.0
        by_u += 0.5 * k * (ay * ay + az * az) + bends
        by_t += 0.5 * k * (by * by + bz * bz)
    else:
        k = fg / max(R - g, 1e-3 * R)
        by_u += 0.5 * k * (ax * ax + ay * ay) + bends
        by_t += 0.5 * k * (bx * bx + by * by)
    if by_u == 0.0 and by_t == 0.0:  # nothing at the centre says which: by size
        by_u = math.sqrt(ax * ax + ay * ay + az * az)
        by_t = math.sqrt(bx * bx + by * by + bz * bz)
    return f, low, by_u >= by_t, -hu if along_u > 0.0 else hu, -ht if along_t > 0.0 else ht


@formula
def halve(heap, n, key, split_u, u, t, hu, ht, ordered):  # type: ignore[no-untyped-def]
    """Put the halves of a cell into the heap of n; by their beginning if it is ordered by that. Returns n + 2."""
    for sign in (-1.0, 1.0):
        if split_u:
            middle = u + 0.5 * sign * hu
            n = put(heap, n, middle - 0.5 * hu if ordered else key, middle, t, 0.5 * hu, ht)
        else:
            n = put(heap, n, key, u, t + 0.5 * sign * ht, hu, 0.5 * ht)
    return n


@formula
def max_acceleration(l, m):  # type: ignore[no-untyped-def] # noqa: E741
    """Largest acceleration of a point of the axis: that of an end."""
    far = 0.0
    for i in range(2):
        t = -l if i == 0 else l
        ox, oy, oz = m[0] + t * m[3] - m[6], m[1] + t * m[4] - m[7], m[2] + t * m[5] - m[8]
        kx, ky, kz = m[10] * oz - m[11] * oy, m[11] * ox - m[9] * oz, m[9] * oy - m[10] * ox
        far = max(far, math.sqrt(kx * kx + ky * ky + kz * kz))
    return far * m[15] * m[15]


@formula
def turns_about_the_groove(m):  # type: ignore[no-untyped-def]
    """Whether the motion is a turn about the groove's own axis, along which it may travel but not across."""
    return m[6] == m[7] == m[9] == m[10] == m[12] == m[13] == 0.0 and m[15] != 0.0


@formula
def seed_heap(heap, l, m, u0, u1, ordered):  # type: ignore[no-untyped-def] # noqa: E741
    """The motion from u0 to u1 as a heap of cells, half a radian at most to each; returns how many."""
    pieces = max(1, min(1024, int(abs(m[15]) * (u1 - u0) * 2.0) + 1))
    hu = 0.5 * (u1 - u0) / pieces
    n = 0
    for i in range(pieces):
        begin = u0 + 2.0 * i * hu
        n = put(heap, n, begin if ordered else -math.inf, begin + hu, 0.0, hu, l)
    return n


def _least(R, half_angle, H, l, m, u0, u1, eps, most, heap, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Least sdf from u0 to u1: fills out with value, u, t and a proven lower bound of it; cells looked at.

    ``heap`` (n, 5) holds the open cells: up to ``most``, and n is 1024 at least.
    """
    s, h = R * math.sin(half_angle), -R * math.cos(half_angle)
    bend = max_acceleration(l, m)
    coaxial = turns_about_the_groove(m)
    best, bu, bt = value(R, s, h, H, m, u0, 0.0), u0, 0.0  # of equals the start
    n = seed_heap(heap, l, m, u0, u1, False)
    count = 0
    bound = math.inf
    while n > 0:
        known, u, t, hu, ht = heap[0, 0], heap[0, 1], heap[0, 2], heap[0, 3], heap[0, 4]
        if known >= best - eps or n + 2 > most:
            bound = known
            break
        n = pop(heap, n)
        f, low, split_u, du, dt = cell(R, s, h, H, m, bend, coaxial, u, t, hu, ht)
        count += 1
        if f < best:
            best, bu, bt = f, u, t
        low = max(low, known)
        if low >= best - eps:
            bound = min(bound, low)
            continue
        # The corner that the gradient points to, and the two middles of sides: minima lie on the border as often.
        for i in range(3):
            cu = min(max(u + (0.0 if i == 2 else du), u0), u1)
            ct = min(max(t + (0.0 if i == 1 else dt), -l), l)
            f = value(R, s, h, H, m, cu, ct)
            if f < best:
                best, bu, bt = f, cu, ct
        n = halve(heap, n, low, split_u, u, t, hu, ht, False)
    out[0], out[1], out[2], out[3] = best, bu, bt, min(bound, best)
    return count


def _first(R, half_angle, H, l, m, level, eps, heap, out):  # type: ignore[no-untyped-def] # noqa: E741
    """First u with sdf <= level, 2 if none is found: out[0]; out[1]: up to where nothing is below level - eps."""
    s, h = R * math.sin(half_angle), -R * math.cos(half_angle)
    bend = max_acceleration(l, m)
    coaxial = turns_about_the_groove(m)
    hit = 2.0
    n = seed_heap(heap, l, m, 0.0, 1.0, True)
    count = 0
    out[1] = 1.0
    while n > 0:
        begin, u, t, hu, ht = heap[0, 0], heap[0, 1], heap[0, 2], heap[0, 3], heap[0, 4]
        if begin >= hit:
            out[1] = hit
            break
        if n + 2 > len(heap):
            out[1] = begin
            break
        n = pop(heap, n)
        f, low, split_u, _, dt = cell(R, s, h, H, m, bend, coaxial, u, t, hu, ht)
        count += 1
        if u < hit and f <= level:
            hit = u
        if low > level - eps and f > level:
            continue
        ct = min(max(t + dt, -l), l)
        for i in range(2):
            cu = u - hu if i == 0 else u
            if cu < hit and value(R, s, h, H, m, cu, ct) <= level:
                hit = cu
        if hu <= 2.0**-52:
            continue
        # Where it is below, what comes before is asked for: only a shorter time tells more.
        n = halve(heap, n, u - hu, split_u or f <= level, u, t, hu, ht, True)
    out[0] = hit
    return count


least = entry(_least, "i8(f8,f8,f8,f8,f8[::1],f8,f8,f8,i8,f8[:,::1],f8[::1])")
first = entry(_first, "i8(f8,f8,f8,f8,f8[::1],f8,f8,f8[:,::1],f8[::1])")
