"""Compiled entry points of the distance. Import this module only when a distance is asked for."""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula
from clamp3d.core.kernel_batch import (
    AT_ONCE,
    CX,
    CY,
    CZ,
    DX,
    DY,
    DZ,
    PARALLEL,
    ROWS,
    SURE,
    VALUE,
    outside_soon,
    parallel_soon,
)
from clamp3d.core.kernel_distance import (
    inside_rate,
    is_parallel,
    nearest,
)
from clamp3d.core.kernel_flat import flat_nearest
from clamp3d.core.kernel_pose import axis, place, rigid

RECORD = 19
"""Numbers per answer: distance, point on groove (3), point on cylinder (3), normal (3), bound, feature, t on axis,
rate of the distance by the cylinder's twist (6)."""

WORK = ROWS * AT_ONCE
"""Numbers that `distances` works in."""


@formula
def put(answer, rate, inner, out, k):  # type: ignore[no-untyped-def]
    """Write an answer into out (n, 19); what is deeper than ``inner`` moves with the axis, the rest stands."""
    v, qx, qy, qz, nx, ny, nz, feature, t, bound = answer
    out[k, 0] = v
    out[k, 1] = qx
    out[k, 2] = qy
    out[k, 3] = qz
    out[k, 4] = qx + v * nx
    out[k, 5] = qy + v * ny
    out[k, 6] = qz + v * nz
    out[k, 7] = nx
    out[k, 8] = ny
    out[k, 9] = nz
    out[k, 10] = bound
    out[k, 11] = feature
    out[k, 12] = t
    gx, gy, gz = rate
    below = min(v + inner, 0.0)
    x, y, z = qx + below * nx, qy + below * ny, qz + below * nz
    out[k, 13] = gx
    out[k, 14] = gy
    out[k, 15] = gz
    out[k, 16] = y * gz - z * gy
    out[k, 17] = z * gx - x * gz
    out[k, 18] = x * gy - y * gx


@formula
def record(T, k, R, half_angle, s, h, H, r, l, flat, pad, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Answer for the valid pose k into out (n, 19); ``flat`` ends or those of a capsule."""
    cx, cy, cz, dx, dy, dz = place(T, k)
    if flat:
        answer = flat_nearest(R, half_angle, s, h, H, r, l, cx, cy, cz, dx, dy, dz, pad)
        put(answer[:10], answer[10:], min(r, l), out, k)
        return
    answer = nearest(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz)
    rate = (answer[4], answer[5], answer[6])
    if answer[0] < -r:
        dx, dy, dz = axis(T, k)
        rate = inside_rate(R, h, H, l, cx, cy, cz, dx, dy, dz, answer[8])
    put(answer, rate, r, out, k)


def _distances(T, R, half_angle, H, r, l, flat, pad, w, out):  # type: ignore[no-untyped-def] # noqa: E741
    """The distances of `record` to the bit; ``w`` (WORK,) and ``pad`` are what it works in."""
    s = R * math.sin(half_angle)
    h = -R * math.cos(half_angle)
    reach = max(l, r) if flat else l
    for start in range(0, T.shape[0], AT_ONCE):
        count = min(AT_ONCE, T.shape[0] - start)
        parallel = 0
        for i in range(count):
            if not rigid(T, start + i):
                return start + i
            x, y, z, dx, dy, dz = place(T, start + i)
            alone = is_parallel(R, reach, dx, dy)
            w[CX + i], w[CY + i], w[CZ + i], w[DX + i], w[DY + i], w[DZ + i] = x, y, z, dx, dy, dz
            w[PARALLEL + i] = 1.0 if alone else 0.0
            parallel += 1 if alone else 0
        if parallel < count:
            outside_soon(w, count, R, s, h, H, r, l, flat, False)
        if parallel > 0:
            parallel_soon(w, count, R, s, h, H, r, l, flat)
        left = 0
        for i in range(count):
            out[start + i] = w[VALUE + i]
            left += 0 if w[SURE + i] > 0.0 else 1
        for i in range(count if left > 0 else 0):
            if not w[SURE + i] > 0.0:
                x, y, z, dx, dy, dz = place(T, start + i)
                if flat:
                    out[start + i] = flat_nearest(R, half_angle, s, h, H, r, l, x, y, z, dx, dy, dz, pad)[0]
                else:
                    out[start + i] = nearest(R, s, h, H, r, l, x, y, z, dx, dy, dz)[0]
    return -1


def _records(T, R, half_angle, H, r, l, flat, pad, out):  # type: ignore[no-untyped-def] # noqa: E741
    s = R * math.sin(half_angle)
    h = -R * math.cos(half_angle)
    for i in range(T.shape[0]):
        if not rigid(T, i):
            return i
        record(T, i, R, half_angle, s, h, H, r, l, flat, pad, out)
    return -1


distances = entry(_distances)
records = entry(_records)
