"""Compiled entry points: one pose, and a run of poses. Import this module only when a distance is asked for."""

from __future__ import annotations

import math
from typing import Any

from clamp3d.geometry import kernel_pieces
from clamp3d.geometry.jit import entry, formula, inlined, source_stamp
from clamp3d.geometry.kernel_distance import is_parallel, nearest, parallel
from clamp3d.geometry.pose import RIGID_TOLERANCE

RECORD = 13
"""Numbers per answer: distance, point on groove (3), point on cylinder (3), normal (3), bound, feature, t on axis."""


@inlined
def rigid(T, k):  # type: ignore[no-untyped-def]
    """Whether pose k of (n, 4, 4) is finite and rigid within RIGID_TOLERANCE (same rule as ``pose.check_pose``)."""
    a, b, c = T[k, 0, 0], T[k, 0, 1], T[k, 0, 2]
    d, e, f = T[k, 1, 0], T[k, 1, 1], T[k, 1, 2]
    g, h, i = T[k, 2, 0], T[k, 2, 1], T[k, 2, 2]
    aa = abs(a * a + b * b + c * c - 1.0)
    bb = abs(d * d + e * e + f * f - 1.0)
    cc = abs(g * g + h * h + i * i - 1.0)
    ab = abs(a * d + b * e + c * f)
    ac = abs(a * g + b * h + c * i)
    bc = abs(d * g + e * h + f * i)
    # Every comparison is false for a NaN. The sum decides nearly always: it is no less than the largest.
    if not aa + bb + cc + ab + ac + bc <= RIGID_TOLERANCE:
        t = RIGID_TOLERANCE
        if not (aa <= t and bb <= t and cc <= t and ab <= t and ac <= t and bc <= t):
            return False
    if not a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0:
        return False
    offset = abs(T[k, 0, 3]) + abs(T[k, 1, 3]) + abs(T[k, 2, 3])
    last = abs(T[k, 3, 0]) + abs(T[k, 3, 1]) + abs(T[k, 3, 2]) + abs(T[k, 3, 3] - 1.0)
    return offset < math.inf and last == 0.0


@formula
def axis(T, k):  # type: ignore[no-untyped-def]
    """Unit direction of the z axis of pose k: the column as given, normalised."""
    x, y, z = T[k, 0, 2], T[k, 1, 2], T[k, 2, 2]
    n = math.sqrt(x * x + y * y + z * z)
    return x / n, y / n, z / n


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


_pieces = kernel_pieces.pieces


def _entries(stamp: str) -> tuple[Any, Any, Any]:
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

    def pieces(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018
        if not rigid(T, 0):
            return False
        dx, dy, dz = axis(T, 0)
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        _pieces(R, s, h, H, half_angle, r, l, T[0, 0, 3], T[0, 1, 3], T[0, 2, 3], dx, dy, dz, out)
        return True

    return (
        entry(distances, "i8(f8[:,:,::1],f8,f8,f8,f8,f8,f8[::1])"),
        entry(records, "i8(f8[:,:,::1],f8,f8,f8,f8,f8,f8[:,::1])"),
        entry(pieces, "b1(f8[:,:,::1],f8,f8,f8,f8,f8,f8[:,::1])"),
    )


distances, records, pieces = _entries(source_stamp())
