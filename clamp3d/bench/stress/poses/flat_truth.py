"""The truth for flat-ended cylinders: branch and bound over the points of the material, from the definition alone.

The signed distance is the least value over the material's points q of the cylinder's own signed distance f(q). Boxes of
space are halved until their lower bound decides, lowest first. f is convex, so over a box it is no less than its
tangent plane at the middle; the box is cut to the block {y <= h, |z| <= H} that holds the groove, and of what is left
only points behind the arc count, which lie beyond a chord of it: the tangent plane is taken over that half space too
(any multiplier gives a bound). No feature, edge or stationary point is named, and nothing of the kernel is used.
"""

from __future__ import annotations

import math
from heapq import heappop, heappush
from typing import Any

import numba
import numpy as np

from clamp3d.core.pose import Array


@numba.njit(cache=True)
def _own(x, y, z, c, d, r, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distance of a point from the flat-ended cylinder, and a gradient of it."""
    x, y, z = x - c[0], y - c[1], z - c[2]
    t = x * d[0] + y * d[1] + z * d[2]
    x, y, z = x - t * d[0], y - t * d[1], z - t * d[2]
    w = math.sqrt(x * x + y * y + z * z)
    side, end = w - r, abs(t) - l
    up = 1.0 if t >= 0.0 else -1.0
    if side <= 0.0 and end <= 0.0:
        u, v, f = (1.0, 0.0, side) if side >= end else (0.0, 1.0, end)
    else:
        f = math.sqrt(max(side, 0.0) ** 2 + max(end, 0.0) ** 2)
        u, v = max(side, 0.0) / f, max(end, 0.0) / f
    if w == 0.0:
        return f, v * up * d[0], v * up * d[1], v * up * d[2]
    u /= w
    v *= up
    return f, u * x + v * d[0], u * y + v * d[1], u * z + v * d[2]


@numba.njit(cache=True)
def _box(lx, ly, lz, hx, hy, hz, R, s, h, c, d, r, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Lower bound of f over the material in a box (inf if there is none), and f at a point of the material (or inf)."""
    mx, my, mz = 0.5 * (lx + hx), 0.5 * (ly + hy), 0.5 * (lz + hz)
    ax, ay, az = 0.5 * (hx - lx), 0.5 * (hy - ly), 0.5 * (hz - lz)
    rho = math.sqrt(mx * mx + my * my)
    reach = math.sqrt(ax * ax + ay * ay)
    if rho + reach < R:
        return math.inf, math.inf, mx, my, mz
    ex, ey = (mx / rho, my / rho) if rho > 0.0 else (0.0, -1.0)
    f, gx, gy, gz = _own(mx, my, mz, c, d, r, l)
    low = f - abs(gx) * ax - abs(gy) * ay - abs(gz) * az
    k = gx * ex + gy * ey
    if k > 0.0 and rho > 0.0:
        across = abs(ey) * ax + abs(ex) * ay
        chord = math.sqrt(max(R * R - across * across, 0.0))
        if rho - reach > -chord:  # on this side of the axis
            low = max(low, f + k * (chord - rho) - abs(gx - k * ex) * ax - abs(gy - k * ey) * ay - abs(gz) * az)
    # A point of the material near the middle: pushed behind the arc, then below the flat faces.
    px, py = mx, my
    if rho < R:
        px, py = ex * R, ey * R
        if py > hy:
            py = hy
            px = math.copysign(math.sqrt(max(R * R - py * py, 0.0)), mx)
    if py <= h and px * px + py * py >= R * R * (1.0 - 1e-15):
        return low, _own(px, py, mz, c, d, r, l)[0], px, py, mz
    return low, math.inf, px, py, mz


@numba.njit(cache=True)
def _search(R, s, h, H, r, l, c, d, start, tolerance, most):  # type: ignore[no-untyped-def] # noqa: E741
    """Interval [lower, upper] of the least f over the material, and how many boxes were looked at."""
    best = start
    reach = math.sqrt(r * r + l * l) + max(start, 0.0)
    x0, x1 = c[0] - reach, c[0] + reach
    y0, y1 = c[1] - reach, min(c[1] + reach, h)
    z0, z1 = max(c[2] - reach, -H), min(c[2] + reach, H)
    heap = [(-math.inf, x0, y0, z0, x1, y1, z1)]
    count = 0
    while heap:
        low, x0, y0, z0, x1, y1, z1 = heap[0]
        if low >= best - tolerance or count >= most:
            return min(low, best - tolerance), best, count
        heappop(heap)
        wx, wy, wz = x1 - x0, y1 - y0, z1 - z0
        m = 0.5
        for half in range(2):
            bx0, bx1, by0, by1, bz0, bz1 = x0, x1, y0, y1, z0, z1
            if wx >= wy and wx >= wz:
                cut = x0 + m * wx
                bx0, bx1 = (x0, cut) if half == 0 else (cut, x1)
            elif wy >= wz:
                cut = y0 + m * wy
                by0, by1 = (y0, cut) if half == 0 else (cut, y1)
            else:
                cut = z0 + m * wz
                bz0, bz1 = (z0, cut) if half == 0 else (cut, z1)
            count += 1
            bound, value, _, _, _ = _box(bx0, by0, bz0, bx1, by1, bz1, R, s, h, c, d, r, l)
            if value < best:
                best = value
            bound = max(bound, low)
            if bound < best - tolerance:
                heappush(heap, (bound, bx0, by0, bz0, bx1, by1, bz1))
    return best - tolerance, best, count


def flat_truth(
    R: float, half_angle: float, L: float, r: float, length: float, T: Array, tolerance: float, most: int = 200_000
) -> tuple[float, float]:
    """Interval [lower, upper] of the signed distance of one flat-ended cylinder; T (4, 4) in the groove's frame.

    It is at most ``tolerance`` mm wide, or as wide as ``most`` boxes left it. No less than minus the smaller of radius
    and half length: what goes deeper is not the inset any more.
    """
    c = np.ascontiguousarray(T[:3, 3], np.float64)
    d = np.ascontiguousarray(T[:3, 2], np.float64)
    d = d / np.linalg.norm(d)
    s, h, H = R * math.sin(half_angle), -R * math.cos(half_angle), 0.5 * L
    start = math.inf
    for x in (-s, s):
        for z in (-H, min(max(c[2], -H), H), H):
            start = min(start, _own(x, h, z, c, d, r, 0.5 * length)[0])
    found: tuple[float, float, Any] = _search(R, s, h, H, r, 0.5 * length, c, d, start, tolerance, most)
    return found[0], found[1]
