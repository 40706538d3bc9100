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

import numba
import numpy as np

from clamp3d.core.pose import Array


@numba.njit(cache=True)
def _own(x, y, z, c, d, r, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distance of a point from the flat-ended cylinder, a gradient of it, and the gradient's rounding error."""
    size = abs(x) + abs(y) + abs(z) + abs(c[0]) + abs(c[1]) + abs(c[2])
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
        return f, v * up * d[0], v * up * d[1], v * up * d[2], 0.0
    error = 1e-15 * u * size / w
    u /= w
    v *= up
    return f, u * x + v * d[0], u * y + v * d[1], u * z + v * d[2], error


@numba.njit(cache=True)
def _tangent(x, y, z, lx, ly, lz, hx, hy, hz, R, hollow, c, d, r, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Least value over the material in a box of the plane that is tangent to f at a point, and the gradient there."""
    f, gx, gy, gz, error = _own(x, y, z, c, d, r, l)
    mx, my, mz = 0.5 * (lx + hx), 0.5 * (ly + hy), 0.5 * (lz + hz)
    ax, ay, az = 0.5 * (hx - lx), 0.5 * (hy - ly), 0.5 * (hz - lz)
    error *= abs(mx - x) + abs(my - y) + abs(mz - z) + ax + ay + az
    at_middle = f - error + gx * (mx - x) + gy * (my - y) + gz * (mz - z)
    low = at_middle - abs(gx) * ax - abs(gy) * ay - abs(gz) * az
    rho = math.sqrt(mx * mx + my * my)
    if rho == 0.0:
        return low, gx, gy, gz
    ex, ey = mx / rho, my / rho
    k = gx * ex + gy * ey
    across = abs(ey) * ax + abs(ex) * ay
    chord = math.sqrt(max(R * R - across * across, 0.0)) if hollow else R
    if (k > 0.0) == hollow and (not hollow or rho - math.sqrt(ax * ax + ay * ay) > -chord):  # on this side of the axis
        rest = abs(gx - k * ex) * ax + abs(gy - k * ey) * ay + abs(gz) * az
        low = max(low, at_middle + k * (chord - rho) - rest)
    return low, gx, gy, gz


@numba.njit(cache=True)
def _point(x, y, z, R, hollow, lo, hi):  # type: ignore[no-untyped-def]
    """A point of the material near (x, y, z), and whether there is one: on the right side of the arc, in the block."""
    x, y, z = min(max(x, lo[0]), hi[0]), min(max(y, lo[1]), hi[1]), min(max(z, lo[2]), hi[2])
    rho = math.sqrt(x * x + y * y)
    if (rho < R) == hollow:
        if rho == 0.0:
            return x, y, z, not hollow
        x, y = x * (R / rho), y * (R / rho)
        if y > hi[1]:
            y = hi[1]
            x = math.copysign(math.sqrt(max(R * R - y * y, 0.0)), x)
    rho2, inside = x * x + y * y, lo[0] <= x <= hi[0] and lo[1] <= y <= hi[1]
    return x, y, z, inside and (rho2 >= R * R * (1.0 - 1e-15) if hollow else rho2 <= R * R * (1.0 + 1e-15))


@numba.njit(cache=True)
def _search(R, hollow, lo, hi, r, l, c, d, qx, qy, qz, tolerance, most):  # type: ignore[no-untyped-def] # noqa: E741
    """Interval [lower, upper] of the least f over the material, of which q is a point; how many boxes were looked at.

    The material is the block from ``lo`` to ``hi`` (3,) outside the circle of radius R if ``hollow``, else inside.
    The tangent planes are those at a box's middle, and at its point that is nearest to the best one so far.
    """
    best = _own(qx, qy, qz, c, d, r, l)[0]
    reach = math.sqrt(r * r + l * l) + max(best, 0.0)
    x0, x1 = max(c[0] - reach, lo[0]), min(c[0] + reach, hi[0])
    y0, y1 = max(c[1] - reach, lo[1]), min(c[1] + reach, hi[1])
    z0, z1 = max(c[2] - reach, lo[2]), min(c[2] + reach, hi[2])
    heap = [(-math.inf, x0, y0, z0, x1, y1, z1)]
    count = 0
    while heap:
        low, x0, y0, z0, x1, y1, z1 = heap[0]
        if low >= best - tolerance or count >= most:
            return min(low, best - tolerance), best, count
        heappop(heap)
        wx, wy, wz = x1 - x0, y1 - y0, z1 - z0
        for half in range(2):
            bx0, bx1, by0, by1, bz0, bz1 = x0, x1, y0, y1, z0, z1
            if wx >= wy and wx >= wz:
                cut = x0 + 0.5 * wx
                bx0, bx1 = (x0, cut) if half == 0 else (cut, x1)
            elif wy >= wz:
                cut = y0 + 0.5 * wy
                by0, by1 = (y0, cut) if half == 0 else (cut, y1)
            else:
                cut = z0 + 0.5 * wz
                bz0, bz1 = (z0, cut) if half == 0 else (cut, z1)
            count += 1
            if hollow and max(bx0 * bx0, bx1 * bx1) + max(by0 * by0, by1 * by1) < R * R:
                continue
            if not hollow and max(bx0, -bx1, 0.0) ** 2 + max(by0, -by1, 0.0) ** 2 > R * R * (1.0 + 1e-15):
                continue
            mx, my, mz = 0.5 * (bx0 + bx1), 0.5 * (by0 + by1), 0.5 * (bz0 + bz1)
            bound, gx, gy, gz = _tangent(mx, my, mz, bx0, by0, bz0, bx1, by1, bz1, R, hollow, c, d, r, l)
            bound = max(bound, low)
            # Points of the material to try: near the middle, and near where the tangent plane is lowest.
            for trial in range(2):
                if trial == 1:
                    mx, my, mz = bx0 if gx > 0.0 else bx1, by0 if gy > 0.0 else by1, bz0 if gz > 0.0 else bz1
                px, py, pz, is_one = _point(mx, my, mz, R, hollow, lo, hi)
                if is_one:
                    f = _own(px, py, pz, c, d, r, l)[0]
                    if f < best:
                        best, qx, qy, qz = f, px, py, pz
            nx, ny, nz = min(max(qx, bx0), bx1), min(max(qy, by0), by1), min(max(qz, bz0), bz1)
            bound = max(bound, _tangent(nx, ny, nz, bx0, by0, bz0, bx1, by1, bz1, R, hollow, c, d, r, l)[0])
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
    lips: list[tuple[float, float, float]] = [(x, h, z) for x in (-s, s) for z in (-H, min(max(float(c[2]), -H), H), H)]
    start = min(lips, key=lambda q: _own(q[0], q[1], q[2], c, d, r, 0.5 * length)[0])
    qx, qy, qz = start
    lo, hi = np.array([-np.inf, -np.inf, -H]), np.array([np.inf, h, H])
    low, high, _ = _search(R, True, lo, hi, r, 0.5 * length, c, d, qx, qy, qz, tolerance, most)
    return float(low), float(high)


def solid_truth(
    R: float, hollow: bool, half: Array, r: float, length: float, T: Array, tolerance: float, most: int = 200_000
) -> tuple[float, float]:
    """The same for a finite body in place of the groove: a box of half sizes (3,), and of it only one side of a circle.

    A ``hollow`` one has a hole of radius R (or none: 0) along z, any other is the cylinder of radius R in the box.
    """
    c, d = np.ascontiguousarray(T[:3, 3], np.float64), np.ascontiguousarray(T[:3, 2], np.float64)
    d = d / np.linalg.norm(d)
    qx, qy, qz = half.tolist() if hollow else (0.0, 0.0, 0.0)
    low, high, _ = _search(R, hollow, -half, half, r, 0.5 * length, c, d, qx, qy, qz, tolerance, most)
    return float(low), float(high)
