"""Shortest translation that brings a flat-ended cylinder, a pin, wholly into the hole of a plate, with a proof.

Frame of the hole: its axis is z, the plate is |z| <= H, the pin's axis leans to x. A pin moved by t = (x, y, z) is in
the hole if all its points between the plate's faces are: its part there, seen along z, lies in the circle of radius R.
For one z that is a convex condition on (x, y): ``n . (x, y) + h(n, z) <= R`` for all directions n across, h being the
support of the part. Pairs (z, point of the part) are a convex set, so h is concave in z: over a stretch of z it is no
less than its chord, and any few directions with their chords leave a convex polyhedron that holds all answers of the
stretch. Its point nearest to the origin, whose multipliers prove it, bounds them from below. Directions are added
where that point breaks the condition most, and stretches halved, the lowest first, until one is attained.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_heap import pop, put
from clamp3d.core.kernel_nonnegative import nonnegative

CUTS = 64
"""Directions of one stretch."""
_EPS = 2.0**-52
_FAN = 8


@formula
def furthest(a, b, low, high, pin):  # type: ignore[no-untyped-def]
    """The point of the pin with z from ``low`` to ``high`` that is furthest along (a, b, 0): height along it, x, y.

    ``pin``: its middle (3), the sine and cosine of its lean, radius and half length. Minus infinity: no such point.
    """
    cx, cy, cz, s, k, r, l = pin  # noqa: E741
    m = math.sqrt(a * a * k * k + b * b)
    t = math.copysign(l, a * s)
    u, v = (r * a * k / m, r * b / m) if m > 0.0 else (0.0, 0.0)
    if low <= cz + t * k - u * s <= high:
        x, y = cx + t * s + u * k, cy + v
        return a * x + b * y, x, y
    best, bx, by = -math.inf, 0.0, 0.0
    for side in range(2):  # else it is where one of the planes cuts the pin
        h = (low if side == 0 else high) - cz
        first, last = -r, r
        if s > 0.0:
            first, last = max(first, (-l * k - h) / s), min(last, (l * k - h) / s)
        elif abs(h) > l * k:
            continue
        if first > last:
            continue
        m = math.sqrt(a * a + b * b * k * k)
        u = min(max(r * a / m if m > 0.0 else 0.0, first), last)
        v = math.copysign(math.sqrt(max(r * r - u * u, 0.0)), b)
        t = min(max((h + u * s) / k, -l), l) if k > 1e-14 else math.copysign(l, a)
        x, y = cx + t * s + u * k, cy + v
        if a * x + b * y > best:
            best, bx, by = a * x + b * y, x, y
    return best, bx, by


@formula
def outward(angle, x, y, low, high, pin):  # type: ignore[no-untyped-def]
    """The point of the part, moved by (x, y), that is furthest along an angle: how far from the hole's axis, its angle.

    The second is from -pi to pi off the first.
    """
    a, b = math.cos(angle), math.sin(angle)
    _, px, py = furthest(a, b, low, high, pin)
    px, py = px + x, py + y
    return math.sqrt(px * px + py * py), math.atan2(a * py - b * px, a * px + b * py)


@formula
def outermost(angle, x, y, low, high, pin):  # type: ignore[no-untyped-def]
    """A point of the part, moved by (x, y), that is locally furthest from the hole's axis: how far, its angle.

    The point furthest along the angle of another point is no nearer to the axis than that; Steffensen's steps.
    """
    far, turn = outward(angle, x, y, low, high, pin)
    for _ in range(12):
        new, more = outward(angle + turn, x, y, low, high, pin)
        if not new > far:
            break
        far, angle = new, angle + turn
        if abs(more) < abs(turn):
            jump = turn * more / (turn - more) + more
            new, after = outward(angle + jump, x, y, low, high, pin)
            if new > far:
                far, angle, more = new, angle + jump, after
        turn = more
    return far, angle + turn


@formula
def corner(k, far, best, at, H, pin):  # type: ignore[no-untyped-def]
    """How far the outermost point is from the hole's axis and its angle, if corner ``k`` is further than ``far``."""
    cx, cy, cz, s, c, r, l = pin  # noqa: E741
    end, plane = l if k & 1 else -l, H if k & 2 else -H
    h = cz + at[2] + end * c - plane
    if abs(h) >= r * s:
        return far, best
    u = h / s
    v = math.sqrt(r * r - u * u)
    x, y = cx + at[0] + end * s + u * c, cy + at[1] + (v if k & 4 else -v)
    if x * x + y * y <= far * far:
        return far, best
    return outermost(math.atan2(y, x), at[0], at[1], -H - at[2], H - at[2], pin)


@formula
def cut(j, a, b, start, stop, R, H, pin, size, A):  # type: ignore[no-untyped-def]
    """Column j of A: the half-space of all translations, z from ``start`` to ``stop``, that direction (a, b) leaves."""
    h = furthest(a, b, -H - start, H - start, pin)[0]
    i = furthest(a, b, -H - stop, H - stop, pin)[0]
    slope = (i - h) / (stop - start) if stop > start else 0.0
    long = math.sqrt(1.0 + slope * slope)
    A[0, j], A[1, j], A[2, j] = -a / long, -b / long, -slope / long
    A[3, j] = (min(h - slope * start, i - slope * stop) - R) / (long * size)


@formula
def stretch(start, stop, most, R, H, pin, size, slack, A, f, x, w, order, y, Q, at):  # type: ignore[no-untyped-def]
    """Lower bound of the translations into the hole with z from ``start`` to ``stop``; that point into ``at`` (4,).

    Its fourth number is how far the point leaves the circle. Bounds above ``most`` are not made better.
    """
    n = 2
    at[2] = 0.5 * (start + stop)
    A[0, 0], A[1, 0], A[2, 0], A[3, 0] = 0.0, 0.0, 1.0, start / size
    A[0, 1], A[1, 1], A[2, 1], A[3, 1] = 0.0, 0.0, -1.0, -stop / size
    for k in range(_FAN):
        angle = (2.0 * math.pi / _FAN) * k
        cut(n, math.cos(angle), math.sin(angle), start, stop, R, H, pin, size, A)
        n += 1
    low = 0.0
    f[0], f[1], f[2], f[3] = 0.0, 0.0, 0.0, 1.0
    while True:
        if nonnegative(A, n, f, x, w, order, y, Q) < 0:
            at[3] = math.inf
            return low
        total, tx, ty, tz, left = 0.0, 0.0, 0.0, 0.0, 1.0
        for j in range(n):
            total += x[j]
            tx, ty, tz, left = tx + x[j] * A[0, j], ty + x[j] * A[1, j], tz + x[j] * A[2, j], left - x[j] * A[3, j]
        length = math.sqrt(tx * tx + ty * ty + tz * tz)
        proven = 1.0 - left - 16.0 * _EPS * total
        if proven > 0.0:
            low = max(low, size * proven / max(length, 1e-300))
        if low >= most or left <= 1e-14:
            at[3] = math.inf
            return low
        at[0], at[1] = tx / left * size, ty / left * size
        at[2] = min(max(tz / left * size, start), stop)
        far, best = 0.0, 0.0
        for k in range(_FAN):
            e, angle = outermost((2.0 * math.pi / _FAN) * (k + 0.5), at[0], at[1], -H - at[2], H - at[2], pin)
            if e > far:
                far, best = e, angle
        for k in range(8):  # a corner may be furthest between two of them: where a face of the plate cuts a rim
            far, best = corner(k, far, best, at, H, pin)
        at[3] = far - R
        if at[3] <= slack or n == A.shape[1]:
            return low
        cut(n, math.cos(best), math.sin(best), start, stop, R, H, pin, size, A)
        if size * A[3, n] - (A[0, n] * at[0] + A[1, n] * at[1] + A[2, n] * at[2]) <= 0.5 * slack:
            return low  # the chords allow it: only shorter stretches tell more
        n += 1


def _hole(c, R, H, limit, tolerance, most, heap, A, f, x, w, order, y, Q, at, out):  # type: ignore[no-untyped-def]
    """Lower and upper bound of the length, and the translation (3,), into ``out`` (5,); stretches looked at.

    ``c`` (7,): the pin's middle, the sine and cosine of its lean, its radius and half length. Translations longer than
    ``limit`` mm are not looked for: then both bounds are that.
    """
    cx, cy, cz, s, k, r, l = c[0], c[1], c[2], c[3], c[4], c[5], c[6]  # noqa: E741
    pin = (cx, cy, cz, s, k, r, l)
    size = abs(cx) + abs(cy) + abs(cz) + r + l + R + H
    clear = 64.0 * _EPS * size
    inner = H - clear  # that points on the planes are between them
    reach = l * k + r * s
    first, last = max(-limit, -inner - cz - reach + clear), min(limit, inner - cz + reach - clear)
    best = limit
    out[0], out[1], out[2], out[3], out[4] = limit, limit, 0.0, 0.0, 0.0
    if first >= last:
        return 0
    slack = 1e-11 * size
    n, count, lower, floor = 0, 0, math.inf, math.inf
    low = stretch(first, last, best, R, inner, pin, size, slack, A, f, x, w, order, y, Q, at)
    n = put(heap, n, low, first, last, at[2], 0.0)
    while n:
        low, first, last, z = heap[0, 0], heap[0, 1], heap[0, 2], heap[0, 3]
        if low >= best - tolerance or n + 2 > heap.shape[0] or count >= most:
            lower = low
            break
        n = pop(heap, n)
        off = 0.0  # where the pin only just fits, it does a little further along the hole
        while True:
            at_z = z if off == 0.0 else min(max(z + off, first), last)
            stretch(at_z, at_z, best, R - 2.0 * slack, inner, pin, size, slack, A, f, x, w, order, y, Q, at)
            count += 1
            if at[3] <= slack:
                length = math.sqrt(at[0] ** 2 + at[1] ** 2 + at[2] ** 2)
                if length < best:
                    best = length
                    out[2], out[3], out[4] = at[0], at[1], at[2]
                break
            off = -off if off > 0.0 else max(tolerance, -100.0 * off)
            if off > 0.1 * (last - first) or last - first > 1e-2 * size:
                break
        if last - first <= tolerance:
            floor = min(floor, low)
            continue
        middle = z if min(z - first, last - z) > 0.1 * (last - first) else 0.5 * (first + last)
        for side in range(2):
            u, v = (first, middle) if side == 0 else (middle, last)
            below = stretch(u, v, best, R, inner, pin, size, slack, A, f, x, w, order, y, Q, at)
            count += 1
            below = max(below, low)
            if below < best - tolerance:
                n = put(heap, n, below, u, v, at[2], 0.0)
            else:
                floor = min(floor, below)
    out[0], out[1] = max(min(lower, floor, best) - clear, 0.0), best
    return count


_WORK = "f8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[:,::1]"
hole = entry(_hole, f"i8(f8[::1],f8,f8,f8,f8,i8,{_WORK},f8[::1],f8[::1])")
