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
from typing import NamedTuple

import numba
import numpy as np

from clamp3d.geometry.pose import Array

Point = tuple[float, float, float]


class Wire(NamedTuple):
    """A flat-ended cylinder: its ``middle`` (x, y, z) and unit ``axis``, ``radius`` and half its length, mm."""

    middle: Point
    axis: Point
    radius: float
    half: float


class Material(NamedTuple):
    """What of the box from ``low`` to ``high`` (x, y, z) is outside the groove's circle."""

    radius: float
    low: Point
    high: Point


@numba.njit(cache=True)
def _own(x: float, y: float, z: float, wire: Wire) -> tuple[float, Point, float]:
    """Signed distance of a point from the flat-ended cylinder, a gradient of it, and the gradient's rounding error."""
    c, d = wire.middle, wire.axis
    size = abs(x) + abs(y) + abs(z) + abs(c[0]) + abs(c[1]) + abs(c[2])
    x, y, z = x - c[0], y - c[1], z - c[2]
    t = x * d[0] + y * d[1] + z * d[2]
    x, y, z = x - t * d[0], y - t * d[1], z - t * d[2]
    across = math.sqrt(x * x + y * y + z * z)
    side, end = across - wire.radius, abs(t) - wire.half
    if side <= 0.0 and end <= 0.0:
        u, v, f = (1.0, 0.0, side) if side >= end else (0.0, 1.0, end)
    else:
        f = math.sqrt(max(side, 0.0) ** 2 + max(end, 0.0) ** 2)
        u, v = max(side, 0.0) / f, max(end, 0.0) / f
    v = v if t >= 0.0 else -v
    if across == 0.0:
        return f, (v * d[0], v * d[1], v * d[2]), 0.0
    error = 1e-15 * u * size / across
    u /= across
    return f, (u * x + v * d[0], u * y + v * d[1], u * z + v * d[2]), error


@numba.njit(cache=True)
def _tangent(point: Point, low: Point, high: Point, material: Material, wire: Wire) -> tuple[float, Point]:
    """Least value over the material in a box of the plane that is tangent to f at a point, and the gradient there."""
    x, y, z = point
    R = material.radius
    f, (gx, gy, gz), error = _own(x, y, z, wire)
    mx, my, mz = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
    ax, ay, az = 0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]), 0.5 * (high[2] - low[2])
    error *= abs(mx - x) + abs(my - y) + abs(mz - z) + ax + ay + az
    at_middle = f - error + gx * (mx - x) + gy * (my - y) + gz * (mz - z)
    least = at_middle - abs(gx) * ax - abs(gy) * ay - abs(gz) * az
    rho = math.sqrt(mx * mx + my * my)
    if rho == 0.0:
        return least, (gx, gy, gz)
    ex, ey = mx / rho, my / rho
    k = gx * ex + gy * ey
    across = abs(ey) * ax + abs(ex) * ay
    chord = math.sqrt(max(R * R - across * across, 0.0))
    if k > 0.0 and rho - math.sqrt(ax * ax + ay * ay) > -chord:  # on this side of the axis
        rest = abs(gx - k * ex) * ax + abs(gy - k * ey) * ay + abs(gz) * az
        least = max(least, at_middle + k * (chord - rho) - rest)
    return least, (gx, gy, gz)


@numba.njit(cache=True)
def _within(point: Point, low: Point, high: Point) -> Point:
    """The point of a box that is nearest to another one."""
    return (
        min(max(point[0], low[0]), high[0]),
        min(max(point[1], low[1]), high[1]),
        min(max(point[2], low[2]), high[2]),
    )


@numba.njit(cache=True)
def _point(point: Point, material: Material) -> tuple[Point, bool]:
    """A point of the material near another one, and whether there is one: on the right side of the arc, in the box."""
    R, low, high = material
    x, y, z = _within(point, low, high)
    rho = math.sqrt(x * x + y * y)
    if rho < R:
        if rho == 0.0:
            return (x, y, z), False
        x, y = x * (R / rho), y * (R / rho)
        if y > high[1]:
            y = high[1]
            x = math.copysign(math.sqrt(max(R * R - y * y, 0.0)), x)
    inside = low[0] <= x <= high[0] and low[1] <= y <= high[1]
    return (x, y, z), inside and x * x + y * y >= R * R * (1.0 - 1e-15)


@numba.njit(cache=True)
def _halves(low: Point, high: Point) -> tuple[tuple[Point, Point], tuple[Point, Point]]:
    """The two halves of a box, cut across its longest side."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    wx, wy, wz = x1 - x0, y1 - y0, z1 - z0
    if wx >= wy and wx >= wz:
        cut = x0 + 0.5 * wx
        return (low, (cut, y1, z1)), ((cut, y0, z0), high)
    if wy >= wz:
        cut = y0 + 0.5 * wy
        return (low, (x1, cut, z1)), ((x0, cut, z0), high)
    cut = z0 + 0.5 * wz
    return (low, (x1, y1, cut)), ((x0, y0, cut), high)


@numba.njit(cache=True)
def _is_empty(low: Point, high: Point, material: Material) -> bool:
    """Whether a box holds nothing of the material."""
    R = material.radius
    return max(low[0] ** 2, high[0] ** 2) + max(low[1] ** 2, high[1] ** 2) < R * R


@numba.njit(cache=True)
def _search(material: Material, wire: Wire, start: Point, tolerance: float, most: int) -> tuple[float, float]:
    """Interval [lower, upper] of the least f over the material, of which ``start`` is a point, by ``most`` boxes.

    The tangent planes are those at a box's middle, and at its point that is nearest to the best one so far.
    """
    best, best_point = _own(start[0], start[1], start[2], wire)[0], start
    reach = math.sqrt(wire.radius * wire.radius + wire.half * wire.half) + max(best, 0.0)
    c = wire.middle
    first = _within((c[0] - reach, c[1] - reach, c[2] - reach), material.low, material.high)
    last = _within((c[0] + reach, c[1] + reach, c[2] + reach), material.low, material.high)
    heap = [(-math.inf, first, last)]
    count = 0
    while heap:
        least, lowest, highest = heap[0]
        if least >= best - tolerance or count >= most:
            return min(least, best - tolerance), best
        heappop(heap)
        for low, high in _halves(lowest, highest):
            count += 1
            if _is_empty(low, high, material):
                continue
            middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
            bound, slope = _tangent(middle, low, high, material, wire)
            # Points of the material to try: near the middle, and near where the tangent plane is lowest.
            corner = (
                low[0] if slope[0] > 0.0 else high[0],
                low[1] if slope[1] > 0.0 else high[1],
                low[2] if slope[2] > 0.0 else high[2],
            )
            for trial in (middle, corner):
                point, is_one = _point(trial, material)
                if is_one:
                    f = _own(point[0], point[1], point[2], wire)[0]
                    if f < best:
                        best, best_point = f, point
            near = _within(best_point, low, high)
            bound = max(bound, least, _tangent(near, low, high, material, wire)[0])
            if bound < best - tolerance:
                heappush(heap, (bound, low, high))
    return best - tolerance, best


def flat_truth(
    R: float, half_angle: float, L: float, r: float, length: float, T: Array, tolerance: float, most: int = 200_000
) -> tuple[float, float]:
    """Interval [lower, upper] of the signed distance of one flat-ended cylinder; T (4, 4) in the groove's frame.

    It is at most ``tolerance`` mm wide, or as wide as ``most`` boxes left it. No less than minus the smaller of radius
    and half length: what goes deeper is not the inset any more.
    """
    axis = T[:3, 2] / np.linalg.norm(T[:3, 2])
    x, y, z = T[:3, 3].tolist()
    u, v, w = axis.tolist()
    wire = Wire((x, y, z), (u, v, w), float(r), 0.5 * float(length))
    s, h, H = R * math.sin(half_angle), -R * math.cos(half_angle), 0.5 * L
    lips = [(x, h, end) for x in (-s, s) for end in (-H, min(max(z, -H), H), H)]
    start = min(lips, key=lambda q: _own(q[0], q[1], q[2], wire)[0])
    material = Material(float(R), (-math.inf, -math.inf, -H), (math.inf, h, H))
    low, high = _search(material, wire, start, tolerance, most)
    return float(low), float(high)
