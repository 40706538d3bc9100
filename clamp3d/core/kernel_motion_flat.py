"""Least distance and first contact of a moving flat-ended cylinder: by the largest speed of its points.

The signed distance changes no faster than the fastest point of the cylinder moves. Between two times that bounds it
from below; the lowest stretch is looked into first, where the two bounds meet. What is left when the search ends is
told. Times at which the capsule about the cylinder is free are known already (`kernel_motion`).
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry
from clamp3d.core.kernel_flat import flat_nearest
from clamp3d.core.kernel_heap import pop, put
from clamp3d.core.kernel_motion import place

MOST = 100_000
"""Poses that are looked at; a search that needs more ends with a wider bound, which it tells."""


def _search(R, half_angle, H, r, l, m, speed, u0, u1, level, eps, pad, heap, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Least signed distance from u0 to u1, or (level finite) the first time when it is at most ``level``.

    Fills out with value, time and a lower bound of the value; of a first time (2 if there is none) up to when
    nothing is below level - eps. Returns how many poses were looked at: no more than ``heap`` (n, 5) has rows, which
    with ``pad`` (128, 5) is what it works in.
    """
    s, h = R * math.sin(half_angle), -R * math.cos(half_angle)
    a, b = u0, u1
    fa = fb = best = bound = math.inf
    at = u0
    n = count = 0
    u = u0
    while True:
        p = place(m, u)
        f = flat_nearest(R, half_angle, s, h, H, r, l, p[0], p[1], p[2], p[3], p[4], p[5], pad)[0]
        count += 1
        if f < best:
            best, at = f, u
        if level > -math.inf:
            if f <= level or u >= u1 or count >= len(heap):
                out[0], out[1], out[2] = f, u if f <= level else 2.0, u
                return count
            u = min(u1, u + max(f - level, eps) / speed) if speed > 0.0 else u1
            continue
        if count == 1:
            fa, u = f, u1
            continue
        if count == 2:
            fb = f
            n = put(heap, n, 0.5 * (fa + fb - speed * (b - a)), a, b, fa, fb)
        else:
            for half in range(2):
                p0, p1, g0, g1 = (a, u, fa, f) if half == 0 else (u, b, f, fb)
                low = 0.5 * (g0 + g1 - speed * (p1 - p0))
                if low >= best - eps or p1 - p0 <= 1e-16:
                    bound = min(bound, low)
                else:
                    n = put(heap, n, low, p0, p1, g0, g1)
        if n == 0:
            break
        low, a, b, fa, fb = heap[0, 0], heap[0, 1], heap[0, 2], heap[0, 3], heap[0, 4]
        if low >= best - eps or count >= len(heap):
            bound = min(bound, low)
            break
        n = pop(heap, n)
        u = min(max(0.5 * (a + b + (fa - fb) / speed), a), b) if speed > 0.0 else b
        if not a < u < b:
            u = 0.5 * (a + b)
    out[0], out[1], out[2] = best, at, min(bound, best)
    return count


search = entry(_search, "i8(f8,f8,f8,f8,f8,f8[::1],f8,f8,f8,f8,f8,f8[:,::1],f8[:,::1],f8[::1])")
"""Compiled entry point; see the function."""
