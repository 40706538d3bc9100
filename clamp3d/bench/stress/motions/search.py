"""Compiled part of `truth`: least signed distance of a moving axis from a groove by brute force.

Cells of (instant, place on the axis) are halved, lowest bound first, by the one bound that needs no thought: ``sdf``
has slope 1. That finds where it is low; golden section within golden section finds how low.
"""

from __future__ import annotations

import math

import numpy as np

from clamp3d.core.jit import entry
from clamp3d.core.jit import formula as _compiled
from clamp3d.core.kernel_heap import pop, push
from clamp3d.core.pose import Array

_GOLDEN = 0.6180339887498949
_STARTS = 4


@_compiled
def sdf(x, y, z, R, s, h, H):  # type: ignore[no-untyped-def]
    """Signed distance of a point: from the boundary pieces of the section, and the prism rule."""
    x = abs(x)
    rho = math.sqrt(x * x + y * y)
    lip = math.sqrt((x - s) * (x - s) + (y - h) * (y - h))
    arc = abs(R - rho) if x * -h + y * s <= 0.0 else lip
    ray = abs(y - h) if x >= s else lip
    g = min(arc, ray)
    if y <= h and rho >= R:
        g = -g
    e = abs(z) - H
    if g <= 0.0 and e <= 0.0:
        return max(g, e)
    g, e = max(g, 0.0), max(e, 0.0)
    return math.sqrt(g * g + e * e)


@_compiled
def frame(m, u, p):  # type: ignore[no-untyped-def]
    """Centre and direction at u into p (6,): turned by the matrix of a rotation."""
    for k in range(3):
        p[k] = m[k] + u * m[12 + k]
        p[3 + k] = m[3 + k]
    if m[15] != 0.0:
        half = math.sin(0.5 * u * m[15])
        sine, versine = math.sin(u * m[15]), 2.0 * half * half
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            a, b, c = m[9 + k], m[9 + i], m[9 + j]
            own, one, two = -versine * (b * b + c * c), a * b * versine - c * sine, a * c * versine + b * sine
            p[k] += own * (m[k] - m[6 + k]) + one * (m[i] - m[6 + i]) + two * (m[j] - m[6 + j])
            p[3 + k] += own * m[3 + k] + one * m[3 + i] + two * m[3 + j]


@_compiled
def on_axis(p, t, g):  # type: ignore[no-untyped-def]
    """Value at t on the axis p; g: R, s, h, H."""
    return sdf(p[0] + t * p[3], p[1] + t * p[4], p[2] + t * p[5], g[0], g[1], g[2], g[3])


@_compiled
def along_axis(m, u, lo, hi, g, p):  # type: ignore[no-untyped-def]
    """Lowest value at instant u between lo and hi on the axis, and its place."""
    frame(m, u, p)
    best, place = on_axis(p, lo, g), lo
    f = on_axis(p, hi, g)
    if f < best:
        best, place = f, hi
    x, y = hi - _GOLDEN * (hi - lo), lo + _GOLDEN * (hi - lo)
    fx, fy = on_axis(p, x, g), on_axis(p, y, g)
    for _ in range(52):
        if fx < fy:
            hi, y, fy = y, x, fx
            x = hi - _GOLDEN * (hi - lo)
            fx = on_axis(p, x, g)
        else:
            lo, x, fx = x, y, fy
            y = lo + _GOLDEN * (hi - lo)
            fy = on_axis(p, y, g)
    if fx < best:
        best, place = fx, x
    if fy < best:
        best, place = fy, y
    return best, place


@_compiled
def polish(m, u, t, wu, wt, u0, u1, l, g, p, speed, limit):  # type: ignore[no-untyped-def] # noqa: E741
    """Lowest value within wu, wt of u, t; followed where it leads out of there."""
    best, bu, bt = math.inf, u, t
    for _ in range(12):
        lo, hi = max(u0, bu - wu), min(u1, bu + wu)
        tl, th = max(-l, bt - wt), min(l, bt + wt)
        a, b = lo, hi
        old, ou, ot = best, bu, bt
        for i in range(3):
            e = lo if i == 0 else hi if i == 1 else bu
            f, place = along_axis(m, e, tl, th, g, p)
            if f < best:
                best, bu, bt = f, e, place
        x, y = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
        fx, px = along_axis(m, x, tl, th, g, p)
        fy, py = along_axis(m, y, tl, th, g, p)
        for _ in range(52):
            if min(fx, fy) - speed * (b - a) > limit:  # cannot become the lowest any more
                break
            if fx < fy:
                b, y, fy, py = y, x, fx, px
                x = b - _GOLDEN * (b - a)
                fx, px = along_axis(m, x, tl, th, g, p)
            else:
                a, x, fx, px = x, y, fy, py
                y = a + _GOLDEN * (b - a)
                fy, py = along_axis(m, y, tl, th, g, p)
        if fx < best:
            best, bu, bt = fx, x, px
        if fy < best:
            best, bu, bt = fy, y, py
        inside = (bu - ou < 0.99 * wu and ou - bu < 0.99 * wu) or bu == u0 or bu == u1
        if (inside and abs(bt - ot) < 0.99 * wt) or not best < old:
            break
    return best, bu, bt


@_compiled
def wait(waiting, n, a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    """Six numbers join the heap of n rows; returns n + 1."""
    row = waiting[n]
    row[0], row[1], row[2], row[3], row[4], row[5] = a, b, c, d, e, f
    return push(waiting, n)


@_compiled
def least(g, l, m, u0, u1, hints, size, cells, p, waiting, started):  # type: ignore[no-untyped-def] # noqa: E741
    """Least value for u0 <= u <= u1, |t| <= l with u and t; last, how much lower it could be by slope alone.

    ``waiting`` (cells + 1, 6) and ``started`` (_STARTS, 4) are what it works in.
    """
    far = 0.0
    for i in range(2):
        t = -l if i == 0 else l
        ox, oy, oz = m[0] + t * m[3] - m[6], m[1] + t * m[4] - m[7], m[2] + t * m[5] - m[8]
        kx, ky, kz = m[10] * oz - m[11] * oy, m[11] * ox - m[9] * oz, m[9] * oy - m[10] * ox
        far = max(far, math.sqrt(kx * kx + ky * ky + kz * kz))
    speed = math.sqrt((far * m[15]) ** 2 + m[12] ** 2 + m[13] ** 2 + m[14] ** 2)
    wide = 1e-3 * size / speed if speed > 0.0 else 0.0
    best, bu, bt = math.inf, u0, 0.0
    for hint in hints:
        if u0 <= hint <= u1:
            frame(m, hint, p)
            low, place, near = math.inf, 0.0, l / 512.0
            before, here = math.inf, on_axis(p, -l, g)
            for j in range(1025):
                t = near * (j - 512)
                after = on_axis(p, t + near, g) if j < 1024 else math.inf
                if here <= before and here <= after:
                    f, t = along_axis(m, hint, max(-l, t - near), min(l, t + near), g, p)
                    if f < low:
                        low, place = f, t
                before, here = here, after
            if low < best:
                best, bu, bt = low, hint, place
            f, u, t = polish(m, hint, place, wide, min(l, max(near, 1e-3 * size)), u0, u1, l, g, p, speed, best)
            if f < best:
                best, bu, bt = f, u, t
    # Cells wait as (least that the slope allows, u, t, half widths of both, value in the middle).
    frame(m, 0.5 * (u0 + u1), p)
    n = wait(waiting, 0, -math.inf, 0.5 * (u0 + u1), 0.0, 0.5 * (u1 - u0), l, on_axis(p, 0.0, g))
    for _ in range(cells):
        if waiting[0, 0] >= best - 1e-9 * size:
            break
        n = pop(waiting, n)
        row = waiting[n]
        low, u, t, hu, ht, f = row[0], row[1], row[2], row[3], row[4], row[5]
        if f < best:
            best, bu, bt = f, u, t
        by_u = speed * hu > ht
        hu, ht = (0.5 * hu, ht) if by_u else (hu, 0.5 * ht)
        for sign in (-1.0, 1.0):
            cu, ct = (u + sign * hu, t) if by_u else (u, t + sign * ht)
            frame(m, cu, p)
            f = on_axis(p, ct, g)
            n = wait(waiting, n, max(low, f - (speed * hu + ht)), cu, ct, hu, ht, f)
    slack = max(0.0, best - waiting[0, 0])
    # From the lowest cells, no two of them side by side: the same heap, by the value in the middle.
    for i in range(n):
        row = waiting[i]
        wait(waiting, i, row[5], row[1], row[2], row[3], row[4], row[0])
    starts = 0
    while n > 0 and starts < _STARTS:
        n = pop(waiting, n)
        row = waiting[n]
        u, t, hu, ht, low = row[1], row[2], row[3], row[4], row[5]
        beside = False
        for i in range(starts):
            su, st, du, dt = started[i, 0], started[i, 1], started[i, 2], started[i, 3]
            beside = beside or (abs(u - su) <= 6.0 * du and abs(t - st) <= 6.0 * dt)
        if low < best and not beside:
            started[starts, 0], started[starts, 1], started[starts, 2], started[starts, 3] = u, t, hu, ht
            starts += 1
            f, pu, pt = polish(m, u, t, 3.0 * hu, 3.0 * ht, u0, u1, l, g, p, speed, best)
            if f < best:
                best, bu, bt = f, pu, pt
    return best, bu, bt, slack


def _least_of(shapes, motions, u0, u1, hints, sizes, cells, work, waiting, started, out):  # type: ignore[no-untyped-def]
    """`least` of n motions (n, 16) and shapes (n, 4): R, half angle, H, half length; out (n, 4)."""
    p, g = work[0], work[1]
    for i in range(len(motions)):
        R, a = shapes[i, 0], shapes[i, 1]
        g[0], g[1], g[2], g[3] = R, R * math.sin(a), -R * math.cos(a), shapes[i, 2]
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = least(
            g, shapes[i, 3], motions[i], u0[i], u1[i], hints[i], sizes[i], cells, p, waiting, started
        )


_compiled_least_of = entry(
    _least_of,
    "void(f8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[:,::1],f8[::1],i8,f8[:,::1],f8[:,::1],f8[:,::1],f8[:,::1])",
)


def least_of(shapes: Array, motions: Array, u0: Array, u1: Array, hints: Array, sizes: Array, cells: int) -> Array:
    """`least` of n motions (n, 16) and shapes (n, 4): R, half angle, H, half length; returns (n, 4)."""
    out, work = np.empty((len(motions), 4)), (np.empty((2, 6)), np.empty((cells + 1, 6)), np.empty((_STARTS, 4)))
    _compiled_least_of(shapes, motions, u0, u1, hints, sizes, cells, *work, out)
    return out
