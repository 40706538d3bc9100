"""Signed distance of a point from a sum of segments and discs, to which that of two boxes or cylinders comes down.

A box is a sum of three segments, a cylinder one of a segment and a disc, and their Minkowski difference M, whose points
are the translations at which they overlap, a sum of all of these (a zonoid). With h the support function of M the
distance of a point c is the largest value of ``n . c - h(n)`` over unit vectors n: outside that is the distance
from M, inside minus the shortest way out. Its negative, ``width``, is made least over the sphere of directions: local
minima by Newton steps on the sphere, on the great circles square to a segment and at the cross products and axes,
where the surface of M is flat. Then cells of the sphere are halved until no direction can be better: each point p of
M - c bounds the width of a cell's directions from below by ``n . p``, and outside ``-|p|`` does it for all at once.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_heap import pop, put

CELLS = 4000
"""Cells that may wait, of 6 numbers each."""
_EPS = 2.0**-52


@formula
def across(U, j, x, y, z):  # type: ignore[no-untyped-def]
    """Tangent of a disc's rim where it lies furthest along a unit vector, and the sine between that and its normal."""
    a, b, d = U[j, 1] * z - U[j, 2] * y, U[j, 2] * x - U[j, 0] * z, U[j, 0] * y - U[j, 1] * x
    size = math.sqrt(a * a + b * b + d * d)
    k = 1.0 / size if size > 1e-300 else 0.0
    return k * a, k * b, k * d, size


@formula
def width(x, y, z, c, S, U):  # type: ignore[no-untyped-def]
    """Support of M - c along a unit vector: how far c must be moved along it to leave M, negative outside."""
    f = -(c[0] * x + c[1] * y + c[2] * z)
    for i in range(S.shape[0]):
        f += abs(S[i, 0] * x + S[i, 1] * y + S[i, 2] * z)
    for j in range(U.shape[0]):
        f += U[j, 3] * across(U, j, x, y, z)[3]
    return f


@formula
def polish(x, y, z, c, S, U, on, rounding):  # type: ignore[no-untyped-def]
    """A local minimum of the width near a unit vector; if ``on`` >= 0 on the circle square to that segment."""
    sx, sy, sz = 0.0, 0.0, 0.0
    if on >= 0:
        size = math.sqrt(S[on, 0] ** 2 + S[on, 1] ** 2 + S[on, 2] ** 2)
        sx, sy, sz = S[on, 0] / size, S[on, 1] / size, S[on, 2] / size
        d = x * sx + y * sy + z * sz
        x, y, z = x - d * sx, y - d * sy, z - d * sz
        size = math.sqrt(x * x + y * y + z * z)
        if size < 1e-6:
            return math.inf, x, y, z
        x, y, z = x / size, y / size, z / size
    f = width(x, y, z, c, S, U)
    last = math.inf  # below that steps are too small for the width to tell
    for _ in range(30):
        if on >= 0:
            ex, ey, ez = sx, sy, sz
        elif abs(x) < 0.6:
            size = math.sqrt(y * y + z * z)
            ex, ey, ez = 0.0, z / size, -y / size
        else:
            size = math.sqrt(x * x + y * y)
            ex, ey, ez = y / size, -x / size, 0.0
        gx, gy, gz = y * ez - z * ey, z * ex - x * ez, x * ey - y * ex  # the other tangent
        ve = -(c[0] * ex + c[1] * ey + c[2] * ez)
        vg = -(c[0] * gx + c[1] * gy + c[2] * gz)
        for i in range(S.shape[0]):
            if i != on:
                s = math.copysign(1.0, S[i, 0] * x + S[i, 1] * y + S[i, 2] * z)
                ve += s * (S[i, 0] * ex + S[i, 1] * ey + S[i, 2] * ez)
                vg += s * (S[i, 0] * gx + S[i, 1] * gy + S[i, 2] * gz)
        ee, eg, gg = -f, 0.0, -f
        for j in range(U.shape[0]):
            ux, uy, uz, r = U[j, 0], U[j, 1], U[j, 2], U[j, 3]
            tx, ty, tz, sine = across(U, j, x, y, z)
            if sine < 1e-12:
                return f, x, y, z
            k = -(ux * x + uy * y + uz * z) / sine * r
            ve += k * (ux * ex + uy * ey + uz * ez)
            vg += k * (ux * gx + uy * gy + uz * gz)
            te, tg = tx * ex + ty * ey + tz * ez, tx * gx + ty * gy + tz * gz
            k = r / sine
            ee += k * te * te
            eg += k * te * tg
            gg += k * tg * tg
        if on >= 0:
            ve, ee, eg = 0.0, 1.0, 0.0
        det = ee * gg - eg * eg
        if ee > 0.0 and gg > 0.0 and det > 1e-14 * ee * gg:
            a, b = -(ve * gg - vg * eg) / det, -(vg * ee - ve * eg) / det
        else:
            k = abs(f) + abs(ee) + abs(gg)
            a, b = -ve / k, -vg / k
        size = math.sqrt(a * a + b * b)
        if size > 0.5:
            a, b, size = 0.5 * a / size, 0.5 * b / size, 0.5
        better = False
        for _try in range(6):
            nx, ny, nz = x + a * ex + b * gx, y + a * ey + b * gy, z + a * ez + b * gz
            k = math.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / k, ny / k, nz / k
            new = width(nx, ny, nz, c, S, U)
            if new < f or (size < 1e-5 and size < 0.5 * last and new < f + rounding):
                better = True
                break
            a, b = 0.25 * a, 0.25 * b
        if not better:
            break
        f, x, y, z, last = new, nx, ny, nz, size
    return f, x, y, z


@formula
def support(x, y, z, rho, sweeps, least, c, S, U, X):  # type: ignore[no-untyped-def]
    """A point p of M - c that lies far along all directions within ``rho`` of a unit vector: along it, and across.

    The rows of X are what each segment and disc adds to it. Of those that turn over within ``rho`` the best part is
    taken, one after the other, ``sweeps`` times.
    """
    px, py, pz = -c[0], -c[1], -c[2]
    m, k = S.shape[0], U.shape[0]
    sine, cosine = math.sin(min(rho, 0.5 * math.pi)), math.cos(min(rho, 0.5 * math.pi))
    lines, rims = 0, 0  # that turn over in the cell, and that do not
    for i in range(m):
        d = S[i, 0] * x + S[i, 1] * y + S[i, 2] * z
        s = math.copysign(1.0, d)
        if d * d <= sine * sine * (S[i, 0] ** 2 + S[i, 1] ** 2 + S[i, 2] ** 2):
            lines += 1
        X[i, 0], X[i, 1], X[i, 2] = s * S[i, 0], s * S[i, 1], s * S[i, 2]
        px, py, pz = px + X[i, 0], py + X[i, 1], pz + X[i, 2]
    for j in range(k):
        X[m + j, 0], X[m + j, 1], X[m + j, 2] = 0.0, 0.0, 0.0
        if across(U, j, x, y, z)[3] > sine:
            rims += 1
    for _ in range(sweeps if lines + rims > 1 else 1):
        moved = 0.0
        for j in range(k):
            tx, ty, tz, size = across(U, j, x, y, z)
            if size > sine:  # along the rim, as far as other directions of the cell have their own point
                ux, uy, uz, r = U[j, 0], U[j, 1], U[j, 2], U[j, 3]
                px, py, pz = px - X[m + j, 0], py - X[m + j, 1], pz - X[m + j, 2]
                a = sine / size
                a = min(max(-(px * tx + py * ty + pz * tz) / r, -a), a)
                b = r * math.sqrt(1.0 - a * a)
                a *= r
                qx, qy, qz = (
                    b * (ty * uz - tz * uy) + a * tx,
                    b * (tz * ux - tx * uz) + a * ty,
                    b * (tx * uy - ty * ux) + a * tz,
                )
                moved += abs(X[m + j, 0] - qx) + abs(X[m + j, 1] - qy) + abs(X[m + j, 2] - qz)
                X[m + j, 0], X[m + j, 1], X[m + j, 2] = qx, qy, qz
                px, py, pz = px + qx, py + qy, pz + qz
        for i in range(m):
            d = S[i, 0] * x + S[i, 1] * y + S[i, 2] * z
            ss = S[i, 0] ** 2 + S[i, 1] ** 2 + S[i, 2] ** 2
            if d * d <= sine * sine * ss:
                px, py, pz = px - X[i, 0], py - X[i, 1], pz - X[i, 2]
                tx, ty, tz = S[i, 0] - d * x, S[i, 1] - d * y, S[i, 2] - d * z
                size = math.sqrt(tx * tx + ty * ty + tz * tz) + 1e-300
                along = px * x + py * y + pz * z
                qx, qy, qz = px - along * x, py - along * y, pz - along * z
                part = (qx * tx + qy * ty + qz * tz) / size
                qx, qy, qz = qx - part * tx / size, qy - part * ty / size, qz - part * tz / size
                a = d * cosine / (size * sine)
                s = math.copysign(1.0, d)
                if abs(a) < 1.0:
                    a *= math.sqrt((qx * qx + qy * qy + qz * qz) / (1.0 - a * a))
                    s = min(max((a - part) / size, -1.0), 1.0)
                qx, qy, qz = s * S[i, 0], s * S[i, 1], s * S[i, 2]
                moved += abs(X[i, 0] - qx) + abs(X[i, 1] - qy) + abs(X[i, 2] - qz)
                X[i, 0], X[i, 1], X[i, 2] = qx, qy, qz
                px, py, pz = px + qx, py + qy, pz + qz
        if moved <= least:
            break
    for i in range(m if lines > 1 else 0):  # lines that are nearly parallel must be moved together
        for j in range(i):
            px, py, pz = both(i, j, x, y, z, sine, cosine, S, X, px, py, pz)
    for j in range(k):
        if across(U, j, x, y, z)[3] <= sine:  # any point of the disc
            ux, uy, uz, r = U[j, 0], U[j, 1], U[j, 2], U[j, 3]
            along = px * x + py * y + pz * z
            qx, qy, qz = along * x - px, along * y - py, along * z - pz
            along = qx * ux + qy * uy + qz * uz
            qx, qy, qz = qx - along * ux, qy - along * uy, qz - along * uz
            size = math.sqrt(qx * qx + qy * qy + qz * qz)
            if size > r:
                qx, qy, qz = qx * r / size, qy * r / size, qz * r / size
            X[m + j, 0], X[m + j, 1], X[m + j, 2] = qx, qy, qz
            px, py, pz = px + qx, py + qy, pz + qz
    along = px * x + py * y + pz * z
    px, py, pz = px - along * x, py - along * y, pz - along * z
    return along, math.sqrt(px * px + py * py + pz * pz)


@formula
def both(i, j, x, y, z, sine, cosine, S, X, px, py, pz):  # type: ignore[no-untyped-def]
    """The point p with parts of two segments that leave nothing of it across the vector, if that is better."""
    d, e = S[i, 0] * x + S[i, 1] * y + S[i, 2] * z, S[j, 0] * x + S[j, 1] * y + S[j, 2] * z
    if d * d > sine * sine * (S[i, 0] ** 2 + S[i, 1] ** 2 + S[i, 2] ** 2):
        return px, py, pz
    if e * e > sine * sine * (S[j, 0] ** 2 + S[j, 1] ** 2 + S[j, 2] ** 2):
        return px, py, pz
    qx, qy, qz = px - X[i, 0] - X[j, 0], py - X[i, 1] - X[j, 1], pz - X[i, 2] - X[j, 2]
    det = triple(S[i, 0], S[i, 1], S[i, 2], S[j, 0], S[j, 1], S[j, 2], x, y, z)
    a = -triple(qx, qy, qz, S[j, 0], S[j, 1], S[j, 2], x, y, z)
    b = -triple(S[i, 0], S[i, 1], S[i, 2], qx, qy, qz, x, y, z)
    if abs(a) > abs(det) or abs(b) > abs(det) or det == 0.0:
        return px, py, pz
    a, b = a / det, b / det
    nx, ny, nz = qx + a * S[i, 0] + b * S[j, 0], qy + a * S[i, 1] + b * S[j, 1], qz + a * S[i, 2] + b * S[j, 2]
    old, new = px * x + py * y + pz * z, nx * x + ny * y + nz * z
    tx, ty, tz = px - old * x, py - old * y, pz - old * z
    if new * cosine <= old * cosine - math.sqrt(tx * tx + ty * ty + tz * tz) * sine:
        return px, py, pz
    X[i, 0], X[i, 1], X[i, 2] = a * S[i, 0], a * S[i, 1], a * S[i, 2]
    X[j, 0], X[j, 1], X[j, 2] = b * S[j, 0], b * S[j, 1], b * S[j, 2]
    return nx, ny, nz


@formula
def triple(ax, ay, az, bx, by, bz, x, y, z):  # type: ignore[no-untyped-def]
    """Triple product of three vectors."""
    return (ay * bz - az * by) * x + (az * bx - ax * bz) * y + (ax * by - ay * bx) * z


@formula
def middle(face, u, v, w):  # type: ignore[no-untyped-def]
    """Unit vector at the middle of a cell, a square of half width w on a side of the cube, and the cell's radius."""
    size = math.sqrt(1.0 + u * u + v * v)
    reach = math.sqrt(2.0) * w
    rho = reach / max(size - reach, 1.0)
    s = 1.0 / size if face < 3.0 else -1.0 / size
    axis = face if face < 3.0 else face - 3.0
    if axis == 0.0:
        return s, u / size, v / size, rho
    if axis == 1.0:
        return u / size, s, v / size, rho
    return u / size, v / size, s, rho


def _zonoid(c, S, U, tolerance, most, heap, X, out):  # type: ignore[no-untyped-def]
    """Lower and upper bound of the least width, and its direction, into ``out`` (5,); cells looked at.

    ``S`` (m, 3) are half segments, ``U`` (k, 4) the discs' unit normals and radii; ``X`` (m + k, 3) comes back
    with what each of them adds to the nearest point.
    """
    m, k = S.shape[0], U.shape[0]
    far = math.sqrt(c[0] ** 2 + c[1] ** 2 + c[2] ** 2)
    scale = far
    best, bx, by, bz = math.inf, 0.0, 0.0, 1.0
    for i in range(m):
        scale += math.sqrt(S[i, 0] ** 2 + S[i, 1] ** 2 + S[i, 2] ** 2)
    for j in range(k):
        scale += U[j, 3]
        for sign in (-1.0, 1.0):
            x, y, z = sign * U[j, 0], sign * U[j, 1], sign * U[j, 2]
            f = width(x, y, z, c, S, U)
            if f < best:
                best, bx, by, bz = f, x, y, z
    rounding = 16.0 * _EPS * scale
    tolerance = max(tolerance, 4.0 * rounding)
    for i in range(m):
        for j in range(i):
            x, y, z = (
                S[i, 1] * S[j, 2] - S[i, 2] * S[j, 1],
                S[i, 2] * S[j, 0] - S[i, 0] * S[j, 2],
                S[i, 0] * S[j, 1] - S[i, 1] * S[j, 0],
            )
            size = math.sqrt(x * x + y * y + z * z)
            if size > 1e-150:
                for sign in (-1.0, 1.0):
                    f = width(sign * x / size, sign * y / size, sign * z / size, c, S, U)
                    if f < best:
                        best, bx, by, bz = f, sign * x / size, sign * y / size, sign * z / size
    ox, oy, oz = (c[0] / far, c[1] / far, c[2] / far) if far > 0.0 else (0.6, 0.64, 0.48)
    for i in range(-1, m):
        if k or i < 0:
            f, x, y, z = polish(ox, oy, oz, c, S, U, i, rounding)
            if f < best:
                best, bx, by, bz = f, x, y, z
    count, n = 0, 0
    lower = -math.inf
    fresh, tilt = True, 0.0
    for face in range(6):
        n = put(heap, n, -math.inf, float(face), 0.0, 0.0, 1.0)
    while True:
        if fresh:
            fresh = False
            tilt, least = 0.0, math.inf
            for e in (1e-9, 1e-6, 1e-3):
                f, off = support(bx, by, bz, e, 60, 0.1 * rounding, c, S, U, X)
                size = math.sqrt(f * f + off * off)
                lower = max(lower, -size)
                if best > 0.0:  # the point to move out along the direction, not the nearest
                    size = off
                if size < least:
                    tilt, least = e, size
                if off <= rounding:
                    break
        if n == 0 or lower >= best - tolerance:
            break
        low, face, u, v, w = heap[0, 0], heap[0, 1], heap[0, 2], heap[0, 3], heap[0, 4]
        lower = max(lower, min(low, best - tolerance))
        if low >= best - tolerance or n + 4 > heap.shape[0] or count >= most:
            break
        n = pop(heap, n)
        w *= 0.5
        for q in range(4):
            cu, cv = u + (w if q & 1 else -w), v + (w if q & 2 else -w)
            x, y, z, rho = middle(face, cu, cv, w)
            count += 1
            if ox * x + oy * y + oz * z < -math.sin(min(rho, 0.5 * math.pi)) and far > 0.0:
                continue  # the opposite directions are better
            f, off = support(x, y, z, rho, 3, tolerance, c, S, U, X)
            at = width(x, y, z, c, S, U)
            if at < best:
                fresh = True
                best, bx, by, bz = at, x, y, z
                for i in range(-1, m):
                    if i < 0 or abs(S[i, 0] * x + S[i, 1] * y + S[i, 2] * z) < 2.0 * rho * math.sqrt(
                        S[i, 0] ** 2 + S[i, 1] ** 2 + S[i, 2] ** 2
                    ):
                        at, nx, ny, nz = polish(x, y, z, c, S, U, i, rounding)
                        if at < best:
                            best, bx, by, bz = at, nx, ny, nz
            size = math.sqrt(f * f + off * off)
            turned = math.atan2(off, f) + rho
            bound = size * math.cos(turned) if turned < math.pi else -size
            bound = max(bound, low)
            if bound < best - tolerance:
                n = put(heap, n, bound, face, cu, cv, w)
    if n == 0:
        lower = max(lower, best - tolerance)
    support(bx, by, bz, tilt, 60, 0.1 * rounding, c, S, U, X)
    out[0], out[1], out[2], out[3], out[4] = min(lower, best) - rounding, best + rounding, bx, by, bz
    return count


zonoid = entry(_zonoid, "i8(f8[::1],f8[:,::1],f8[:,::1],f8,i8,f8[:,::1],f8[:,::1],f8[::1])")
