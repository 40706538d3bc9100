"""Compiled entry points of the distance. Import this module only when a distance is asked for."""

from __future__ import annotations

import math
from typing import Any

from clamp3d.core.jit import entry, formula, source_stamp
from clamp3d.core.kernel_distance import is_parallel, nearest, parallel
from clamp3d.core.kernel_pose import rigid

RECORD = 13
"""Numbers per answer: distance, point on groove (3), point on cylinder (3), normal (3), bound, feature, t on axis."""


@formula
def record(T, k, R, s, h, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Answer for the valid pose k into out (n, 13)."""
    v, qx, qy, qz, nx, ny, nz, feature, t, bound = nearest(
        R, s, h, H, r, l, T[k, 0, 3], T[k, 1, 3], T[k, 2, 3], T[k, 0, 2], T[k, 1, 2], T[k, 2, 2]
    )
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


def _entries(stamp: str) -> tuple[Any, Any]:
    def distances(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        for i in range(T.shape[0]):
            if not rigid(T, i):
                return i
            x, y, z = T[i, 0, 3], T[i, 1, 3], T[i, 2, 3]
            dx, dy, dz = T[i, 0, 2], T[i, 1, 2], T[i, 2, 2]
            if is_parallel(R, l, dx, dy):  # inlined here it is free of what only the witnesses need
                answer = parallel(R, s, h, H, r, l, x, y, z, dz)
            else:
                answer = nearest(R, s, h, H, r, l, x, y, z, dx, dy, dz)
            out[i] = answer[0]
        return -1

    def records(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        for i in range(T.shape[0]):
            if not rigid(T, i):
                return i
            record(T, i, R, s, h, H, r, l, out)
        return -1

    return (
        entry(distances, "i8(f8[:,:,::1],f8,f8,f8,f8,f8,f8[::1])"),
        entry(records, "i8(f8[:,:,::1],f8,f8,f8,f8,f8,f8[:,::1])"),
    )


distances, records = _entries(source_stamp())
