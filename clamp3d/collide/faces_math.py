"""Compiled formulas for faces: heights over surfaces, their extremes over triangles, distances of flat pieces.

The height of a point over a surface is its signed distance from the whole, untrimmed surface: that of points, lines and
circles less a radius. It is never more than the distance from the trimmed face, and it has slope 1. Below a surface it
is the way out of all that lies below, except beyond the tip of a conical hole: see `off_cone`.
"""

# ruff: noqa: E741
from __future__ import annotations

import math

import numpy as np

from clamp3d.core.jit import formula

PLANE, CYLINDER, CONE, SPHERE, TORUS, OTHER = range(6)


@formula
def height(kind, a, b, x, y, z):  # type: ignore[no-untyped-def]
    """Height of a point, in the surface's own frame, over a surface with sizes a, b."""
    if kind == PLANE:
        return z
    h = math.sqrt(x * x + y * y)
    if kind == CYLINDER:
        return h - a
    if kind == CONE:
        return (h - a) * math.cos(b) - z * math.sin(b)
    if kind == SPHERE:
        return math.sqrt(h * h + z * z) - a
    return math.sqrt((h - a) * (h - a) + z * z) - b


@formula
def off_cone(a, b, h, z):  # type: ignore[no-untyped-def]
    """Distance of a point at distance h from the axis from the solid cone; inside it is the height, below zero.

    Beyond the tip the height over the slanted line is less: of the point D beyond it on the axis, D times a sine.
    """
    up, along = (h - a) * math.cos(b) - z * math.sin(b), (h - a) * math.sin(b) + z * math.cos(b)
    past = -a / math.sin(b) - along
    if b < 0.0:
        past = -past
    return math.sqrt(up * up + past * past) if past > 0.0 else up


@formula
def _line_to_origin(x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Squared distance of the origin from a segment in the plane."""
    dx, dy = x1 - x0, y1 - y0
    s = dx * dx + dy * dy
    t = 0.0
    if s > 0.0:
        t = min(1.0, max(0.0, -(x0 * dx + y0 * dy) / s))
    x, y = x0 + t * dx, y0 + t * dy
    return x * x + y * y


@formula
def _flat_to_axis(V):  # type: ignore[no-untyped-def]
    """Distance of the z axis from the triangle V (3, 3)."""
    x0, y0, x1, y1, x2, y2 = V[0, 0], V[0, 1], V[1, 0], V[1, 1], V[2, 0], V[2, 1]
    c0, c1, c2 = x0 * y1 - x1 * y0, x1 * y2 - x2 * y1, x2 * y0 - x0 * y2
    if (c0 > 0.0 and c1 > 0.0 and c2 > 0.0) or (c0 < 0.0 and c1 < 0.0 and c2 < 0.0):
        return 0.0
    d = min(_line_to_origin(x0, y0, x1, y1), _line_to_origin(x1, y1, x2, y2), _line_to_origin(x2, y2, x0, y0))
    return math.sqrt(d)


@formula
def _tangent(kind, a, b, V, x, y, z):  # type: ignore[no-untyped-def]
    """Least value over the triangle of the height's linear form at a point of it."""
    h = math.sqrt(x * x + y * y)
    if h < 1e-12:
        return -np.inf
    if kind == CONE:
        gx, gy, gz = x / h * math.cos(b), y / h * math.cos(b), -math.sin(b)
    else:
        g = math.sqrt((h - a) * (h - a) + z * z)
        if g < 1e-12:
            return -np.inf
        gx, gy, gz = (h - a) / g * x / h, (h - a) / g * y / h, z / g
    low = np.inf
    for i in range(3):
        low = min(low, gx * (V[i, 0] - x) + gy * (V[i, 1] - y) + gz * (V[i, 2] - z))
    return height(kind, a, b, x, y, z) + low


@formula
def least_height(kind, a, b, sense, V):  # type: ignore[no-untyped-def]
    """Lower bound over the flat triangle V (3, 3), in the surface's own frame, of the distance from what is below.

    Above the surface that of sense * height, below it less the way out.
    """
    if kind == PLANE:
        return min(sense * V[0, 2], sense * V[1, 2], sense * V[2, 2])
    top = -np.inf
    for i in range(3):
        top = max(top, height(kind, a, b, V[i, 0], V[i, 1], V[i, 2]))
    if kind == CYLINDER:
        return _flat_to_axis(V) - a if sense > 0.0 else -top
    cx, cy, cz = (V[0, 0] + V[1, 0] + V[2, 0]) / 3, (V[0, 1] + V[1, 1] + V[2, 1]) / 3, (V[0, 2] + V[1, 2] + V[2, 2]) / 3
    if kind == SPHERE:
        if sense < 0.0:
            return -top
        d, _, _ = point_triangle(0.0, 0.0, 0.0, V)
        return d - a
    if kind == CONE:
        if sense < 0.0:  # the distance from a cone is convex
            top = -np.inf
            for i in range(3):
                top = max(top, off_cone(a, b, math.sqrt(V[i, 0] * V[i, 0] + V[i, 1] * V[i, 1]), V[i, 2]))
            return -top
        low = _tangent(kind, a, b, V, cx, cy, cz)
        for i in range(3):
            low = max(low, _tangent(kind, a, b, V, V[i, 0], V[i, 1], V[i, 2]))
        return low
    # Torus: the distance from a circle is convex where it is outside, elsewhere its curvature is at least -1 / (its
    # distance from the axis).
    w = 0.0
    for i in range(3):
        w = max(w, (V[i, 0] - cx) ** 2 + (V[i, 1] - cy) ** 2 + (V[i, 2] - cz) ** 2)
    near = _flat_to_axis(V)
    bend = 0.0
    if near < a:
        bend = 0.5 * w / near if near > 0.0 else np.inf
    middle = height(kind, a, b, cx, cy, cz)
    if sense < 0.0:
        return max(-top - bend, -middle - math.sqrt(w))
    return max(_tangent(kind, a, b, V, cx, cy, cz) - bend, middle - math.sqrt(w))


@formula
def raise_by(kind, a, b, sense, t):  # type: ignore[no-untyped-def]
    """First size of the surface raised by t to its outer side, and what is left to take off a height over it.

    A conical hole's tip moves further than t, so that hole is made narrower; of the others the height is less by t.
    """
    if kind == CONE and sense < 0.0:
        return a - t / math.cos(b), 0.0
    return a, t


@formula
def point_triangle(x, y, z, V):  # type: ignore[no-untyped-def]
    """Distance of a point from the triangle V (3, 3), and the weights of its second and third corner at the foot.

    Ericson, Real-Time Collision Detection (2005), 5.1.5.
    """
    abx, aby, abz = V[1, 0] - V[0, 0], V[1, 1] - V[0, 1], V[1, 2] - V[0, 2]
    acx, acy, acz = V[2, 0] - V[0, 0], V[2, 1] - V[0, 1], V[2, 2] - V[0, 2]
    px, py, pz = x - V[0, 0], y - V[0, 1], z - V[0, 2]
    d1, d2 = abx * px + aby * py + abz * pz, acx * px + acy * py + acz * pz
    v, w = 0.0, 0.0
    if not (d1 <= 0.0 and d2 <= 0.0):
        bx, by, bz = x - V[1, 0], y - V[1, 1], z - V[1, 2]
        d3, d4 = abx * bx + aby * by + abz * bz, acx * bx + acy * by + acz * bz
        cx, cy, cz = x - V[2, 0], y - V[2, 1], z - V[2, 2]
        d5, d6 = abx * cx + aby * cy + abz * cz, acx * cx + acy * cy + acz * cz
        va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
        if d3 >= 0.0 and d4 <= d3:
            v = 1.0
        elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
            v = d1 / (d1 - d3) if d1 != d3 else 0.0
        elif d6 >= 0.0 and d5 <= d6:
            w = 1.0
        elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            w = d2 / (d2 - d6) if d2 != d6 else 0.0
        elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
            w = (d4 - d3) / ((d4 - d3) + (d5 - d6)) if (d4 - d3) + (d5 - d6) > 0.0 else 0.0
            v = 1.0 - w
        else:
            s = va + vb + vc
            if s != 0.0:
                v, w = vb / s, vc / s
    fx, fy, fz = px - v * abx - w * acx, py - v * aby - w * acy, pz - v * abz - w * acz
    return math.sqrt(fx * fx + fy * fy + fz * fz), v, w


@formula
def _segments(V, i, W, j):  # type: ignore[no-untyped-def]
    """Squared distance of side i of one triangle from side j of another (Ericson 5.1.9)."""
    k, l = (i + 1) % 3, (j + 1) % 3
    ax, ay, az = V[k, 0] - V[i, 0], V[k, 1] - V[i, 1], V[k, 2] - V[i, 2]
    bx, by, bz = W[l, 0] - W[j, 0], W[l, 1] - W[j, 1], W[l, 2] - W[j, 2]
    rx, ry, rz = V[i, 0] - W[j, 0], V[i, 1] - W[j, 1], V[i, 2] - W[j, 2]
    a, e, f = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, bx * rx + by * ry + bz * rz
    c, b = ax * rx + ay * ry + az * rz, ax * bx + ay * by + az * bz
    d = a * e - b * b
    s = min(1.0, max(0.0, (b * f - c * e) / d)) if d > 1e-14 * a * e else 0.0
    t = (b * s + f) / e if e > 0.0 else 0.0
    if t < 0.0:
        t = 0.0
        s = min(1.0, max(0.0, -c / a)) if a > 0.0 else 0.0
    elif t > 1.0:
        t = 1.0
        s = min(1.0, max(0.0, (b - c) / a)) if a > 0.0 else 0.0
    x, y, z = rx + s * ax - t * bx, ry + s * ay - t * by, rz + s * az - t * bz
    return x * x + y * y + z * z


@formula
def _pierces(V, W):  # type: ignore[no-untyped-def]
    """Whether a side of the triangle V goes through the triangle W."""
    ux, uy, uz = W[1, 0] - W[0, 0], W[1, 1] - W[0, 1], W[1, 2] - W[0, 2]
    vx, vy, vz = W[2, 0] - W[0, 0], W[2, 1] - W[0, 1], W[2, 2] - W[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    for i in range(3):
        k = (i + 1) % 3
        p = nx * (V[i, 0] - W[0, 0]) + ny * (V[i, 1] - W[0, 1]) + nz * (V[i, 2] - W[0, 2])
        q = nx * (V[k, 0] - W[0, 0]) + ny * (V[k, 1] - W[0, 1]) + nz * (V[k, 2] - W[0, 2])
        if (p > 0.0 and q > 0.0) or (p < 0.0 and q < 0.0) or p == q:
            continue
        t = p / (p - q)
        x, y, z = (
            V[i, 0] + t * (V[k, 0] - V[i, 0]),
            V[i, 1] + t * (V[k, 1] - V[i, 1]),
            V[i, 2] + t * (V[k, 2] - V[i, 2]),
        )
        inside = True
        for j in range(3):
            l = (j + 1) % 3
            ex, ey, ez = W[l, 0] - W[j, 0], W[l, 1] - W[j, 1], W[l, 2] - W[j, 2]
            gx, gy, gz = x - W[j, 0], y - W[j, 1], z - W[j, 2]
            if (ey * gz - ez * gy) * nx + (ez * gx - ex * gz) * ny + (ex * gy - ey * gx) * nz < 0.0:
                inside = False
                break
        if inside:
            return True
    return False


@formula
def triangles(V, W):  # type: ignore[no-untyped-def]
    """Distance of two triangles (3, 3)."""
    low = np.inf
    for i in range(3):
        d, _, _ = point_triangle(V[i, 0], V[i, 1], V[i, 2], W)
        low = min(low, d)
        d, _, _ = point_triangle(W[i, 0], W[i, 1], W[i, 2], V)
        low = min(low, d)
    square = low * low
    for i in range(3):
        for j in range(3):
            square = min(square, _segments(V, i, W, j))
    if square > 0.0 and (_pierces(V, W) or _pierces(W, V)):
        return 0.0
    return math.sqrt(square)


@formula
def surface_point(kind, a, b, F, u, v, out):  # type: ignore[no-untyped-def]
    """Point of a surface with frame F (12: origin, x, y, z) at parameters u, v, into out (3)."""
    if kind == PLANE or kind == OTHER:
        x, y, z = u, v, 0.0
    else:
        if kind == CYLINDER:
            h, z = a, v
        elif kind == CONE:
            h, z = a + v * math.tan(b), v
        elif kind == SPHERE:
            h, z = a * math.cos(v), a * math.sin(v)
        else:
            h, z = a + b * math.cos(v), b * math.sin(v)
        x, y = h * math.cos(u), h * math.sin(u)
    for i in range(3):
        out[i] = F[i] + x * F[3 + i] + y * F[6 + i] + z * F[9 + i]


@formula
def to_frame(F, P, out):  # type: ignore[no-untyped-def]
    """A triangle P (3, 3) in the axes of the frame F (12)."""
    for i in range(3):
        x, y, z = P[i, 0] - F[0], P[i, 1] - F[1], P[i, 2] - F[2]
        for j in range(3):
            out[i, j] = x * F[3 + 3 * j] + y * F[4 + 3 * j] + z * F[5 + 3 * j]


@formula
def height_at(kind, a, b, F, x, y, z):  # type: ignore[no-untyped-def]
    """Height of a point over a surface with frame F (12)."""
    x, y, z = x - F[0], y - F[1], z - F[2]
    return height(
        kind,
        a,
        b,
        x * F[3] + y * F[4] + z * F[5],
        x * F[6] + y * F[7] + z * F[8],
        x * F[9] + y * F[10] + z * F[11],
    )


@formula
def slope_at(kind, a, b, F, axis, x, y, z):  # type: ignore[no-untyped-def]
    """Rate of the height over a surface with frame F (12) along a coordinate axis: a part of its normal there."""
    eps = 1e-6
    dx, dy, dz = (eps if axis == 0 else 0.0), (eps if axis == 1 else 0.0), (eps if axis == 2 else 0.0)
    rise = height_at(kind, a, b, F, x + dx, y + dy, z + dz) - height_at(kind, a, b, F, x - dx, y - dy, z - dz)
    return rise / (2.0 * eps)


@formula
def way_out(kind, a, b, sense, F, t, x, y, z):  # type: ignore[no-untyped-def]
    """How far a point is from all that is above a surface with frame F (12) lowered by t; below zero if it is above."""
    if kind == CONE and sense < 0.0:
        x, y, z = x - F[0], y - F[1], z - F[2]
        X, Y = x * F[3] + y * F[4] + z * F[5], x * F[6] + y * F[7] + z * F[8]
        return off_cone(a + t / math.cos(b), b, math.sqrt(X * X + Y * Y), x * F[9] + y * F[10] + z * F[11])
    return -sense * height_at(kind, a, b, F, x, y, z) - t


@formula
def _sine(F, G):  # type: ignore[no-untyped-def]
    """Sine of the angle between the axes of two frames."""
    x, y, z = F[10] * G[11] - F[11] * G[10], F[11] * G[9] - F[9] * G[11], F[9] * G[10] - F[10] * G[9]
    return math.sqrt(x * x + y * y + z * z)


@formula
def _round_over(a, b, F, c, d, G, sense, v):  # type: ignore[no-untyped-def]
    """What `band_over` says of the circle at v of one cylinder or cone over another."""
    tilt = _sine(F, G)
    x, y, z = F[0] - G[0] + v * F[9], F[1] - G[1] + v * F[10], F[2] - G[2] + v * F[11]
    up = x * G[9] + y * G[10] + z * G[11]
    off = math.sqrt((x - up * G[9]) ** 2 + (y - up * G[10]) ** 2 + (z - up * G[11]) ** 2)
    radius = a + v * math.tan(b)
    across = radius * math.sqrt(max(0.0, 1.0 - tilt * tilt)) - off if sense > 0.0 else radius + off
    if sense < 0.0 and d != 0.0:
        return -off_cone(c, d, across, up) - radius * tilt
    return sense * ((across - c) * math.cos(d) - up * math.sin(d)) - radius * tilt * abs(math.sin(d))


@formula
def band_over(kind, a, b, F, v0, v1, other, c, d, G, sense):  # type: ignore[no-untyped-def]
    """Lower bound, as `least_height`, over a round surface (other, c, d, G) of a band of one (kind, a, b, F), v0 to v1.

    For cylinders and cones, two balls and two tori; minus infinity for others. It is as good as their axes are near.
    """
    # A circle square to an axis that turns by t shrinks to cos t across the other axis and rises by sin t of its
    # radius; all this is concave along the axis, so the ends of the band are lowest.
    if (kind == CYLINDER or kind == CONE) and (other == CYLINDER or other == CONE):
        one, two = b if kind == CONE else 0.0, d if other == CONE else 0.0
        return min(_round_over(a, one, F, c, two, G, sense, v0), _round_over(a, one, F, c, two, G, sense, v1))
    if kind != other or (kind != SPHERE and kind != TORUS):
        return -np.inf
    move = math.sqrt((F[0] - G[0]) ** 2 + (F[1] - G[1]) ** 2 + (F[2] - G[2]) ** 2)
    if kind == SPHERE:
        return sense * (a - c) - move
    turn = _sine(F, G)  # an axis has two directions: below pi / 2 the chord is below sin (1 + sin^2)
    return sense * (b - d) - move - abs(a - c) - a * turn * (1.0 + turn * turn)


@formula
def bend(kind, a, b, du, dv, v0, v1):  # type: ignore[no-untyped-def]
    """Bound of the distance between a surface and a flat piece over spans du, dv of its parameters, v in [v0, v1]."""
    if kind == CYLINDER:
        return a * du * du / 8.0
    if kind == CONE:
        s = abs(math.tan(b))
        h = max(abs(a + v0 * math.tan(b)), abs(a + v1 * math.tan(b)))
        return (h * du * du + 2.0 * s * du * dv) / 8.0
    if kind == SPHERE:
        c = 1.0 if v0 <= 0.0 <= v1 else max(math.cos(v0), math.cos(v1))
        s = max(abs(math.sin(v0)), abs(math.sin(v1)))
        return a * (c * du * du + 2.0 * s * du * dv + dv * dv) / 8.0
    if kind == TORUS:
        return ((a + b) * du * du + 2.0 * b * du * dv + b * dv * dv) / 8.0
    return 0.0


@formula
def bend_over(kind, a, b, F, du, dv, v0, v1, other, G):  # type: ignore[no-untyped-def]
    """Bound of how much higher or lower over another surface (other, G) a piece is than its flat triangle.

    At the same parameters the two differ by at most the bend; of a cylinder or cone square to its axis, so that over a
    plane it counts by the sine of the angle between axis and normal.
    """
    e = bend(kind, a, b, du, dv, v0, v1)
    return e * _sine(F, G) if other == PLANE and (kind == CYLINDER or kind == CONE) else e


@formula
def spans(uv):  # type: ignore[no-untyped-def]
    """Span of u and the range of v over a triangle of parameters, and its middle."""
    lu, hu, su, n = np.inf, -np.inf, 0.0, 0
    for i in range(3):
        if not np.isnan(uv[i, 0]):
            lu, hu = min(lu, uv[i, 0]), max(hu, uv[i, 0])
            su += uv[i, 0]
            n += 1
    lv, hv = min(uv[0, 1], uv[1, 1], uv[2, 1]), max(uv[0, 1], uv[1, 1], uv[2, 1])
    return (hu - lu if n > 1 else 0.0), lv, hv, (su / n if n else 0.0), (uv[0, 1] + uv[1, 1] + uv[2, 1]) / 3.0


@formula
def longest(V, uv, kind, a, b, bent):  # type: ignore[no-untyped-def]
    """The side that a piece is cut at: the one that bends most, or the longest."""
    best, worst = 0, -1.0
    for i in range(3):
        k = (i + 1) % 3
        d = 0.0
        if bent:
            du = 0.0 if np.isnan(uv[i, 0]) or np.isnan(uv[k, 0]) else abs(uv[k, 0] - uv[i, 0])
            v0, v1 = min(uv[i, 1], uv[k, 1]), max(uv[i, 1], uv[k, 1])
            d = bend(kind, a, b, du, v1 - v0, v0, v1)
        else:
            for c in range(3):
                d += (V[k, c] - V[i, c]) ** 2
        if d > worst:
            best, worst = i, d
    return best


@formula
def cut(V, uv, i, kind, a, b, F, V2, uv2):  # type: ignore[no-untyped-def]
    """Cut a piece at the middle of its side i: it keeps the half at corner i, the other goes to the second place."""
    j = (i + 1) % 3
    u, v = 0.5 * (uv[i, 0] + uv[j, 0]), 0.5 * (uv[i, 1] + uv[j, 1])
    if np.isnan(uv[i, 0]):
        u = uv[j, 0]
    elif np.isnan(uv[j, 0]):
        u = uv[i, 0]
    for c in range(3):
        for k in range(3):
            V2[c, k] = V[c, k]
        uv2[c, 0], uv2[c, 1] = uv[c, 0], uv[c, 1]
    middle = V2[i]
    if kind == OTHER:
        for c in range(3):
            middle[c] = 0.5 * (V[i, c] + V[j, c])
    else:
        surface_point(kind, a, b, F, u, v, middle)
    uv2[i, 0], uv2[i, 1] = u, v
    for c in range(3):
        V[j, c] = middle[c]
    uv[j, 0], uv[j, 1] = u, v
