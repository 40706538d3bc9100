"""Compiled entry point of `Surface.winding_numbers`: triangles straight above a point, counted by the side they show.

libigl's winding numbers are sums over a tree of the boxes of triangles; its version 2.6 errs by up to 1.7, differently
from call to call, for points some 1e-12 of the part's size or less beside a plane of symmetry.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import entry


def _crossings(corners, low, widest, points, scale, found):  # type: ignore[no-untyped-def]
    """Winding numbers (k,) into ``found`` at ``points`` (k, 3); NaN where a line meets an edge, or a point a triangle.

    ``corners`` (m, 9) are triangles in the order of their least x, ``low`` (m,); none is wider in x than ``widest``.
    """
    tiny = 1e-13 * scale * scale
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        first, last = 0, low.shape[0]
        while first < last:
            middle = (first + last) // 2
            if low[middle] < x - widest:
                first = middle + 1
            else:
                last = middle
        count = 0.0
        for j in range(first, low.shape[0]):
            if low[j] > x:
                break
            ay, by, cy = corners[j, 1] - y, corners[j, 4] - y, corners[j, 7] - y
            if (ay > 0.0 and by > 0.0 and cy > 0.0) or (ay < 0.0 and by < 0.0 and cy < 0.0):
                continue
            ax, bx, cx = corners[j, 0] - x, corners[j, 3] - x, corners[j, 6] - x
            # Twice the signed areas that each edge spans with the point, seen from above; together the triangle's.
            u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
            if (u > tiny and v > tiny and w > tiny) or (u < -tiny and v < -tiny and w < -tiny):
                above = u * (corners[j, 2] - z) + v * (corners[j, 5] - z) + w * (corners[j, 8] - z)
                if abs(above) <= tiny * scale:
                    count = math.nan
                    break
                side = 1.0 if u > 0.0 else -1.0
                if above * side > 0.0:
                    count += side
            elif (u >= -tiny and v >= -tiny and w >= -tiny) or (u <= tiny and v <= tiny and w <= tiny):
                count = math.nan
                break
        found[k] = count
    return 0


crossings = entry(_crossings, "i8(f8[:,::1],f8[::1],f8,f8[:,::1],f8,f8[::1])")
