"""Compiled entry points: one pose, and a run of poses. Import this module only when a distance is asked for."""

from __future__ import annotations

import math
from typing import Any

from clamp3d.geometry import kernel_pieces
from clamp3d.geometry.jit import entry, formula, source_stamp
from clamp3d.geometry.kernel_distance import nearest
from clamp3d.geometry.pose import RIGID_TOLERANCE

RECORD = 13
"""Numbers per answer: distance, point on groove (3), point on cylinder (3), normal (3), bound, feature, t on axis."""


@formula
def rigid(T):  # type: ignore[no-untyped-def]
    """Whether a 4x4 pose is finite and rigid within RIGID_TOLERANCE (same rule as ``pose.check_pose``)."""
    a, b, c = T[0, 0], T[0, 1], T[0, 2]
    d, e, f = T[1, 0], T[1, 1], T[1, 2]
    g, h, i = T[2, 0], T[2, 1], T[2, 2]
    worst = max(
        max(abs(a * a + b * b + c * c - 1.0), abs(d * d + e * e + f * f - 1.0)),
        max(abs(g * g + h * h + i * i - 1.0), abs(a * d + b * e + c * f)),
    )
    worst = max(worst, max(abs(a * g + b * h + c * i), abs(d * g + e * h + f * i)))
    det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    offset = abs(T[0, 3]) + abs(T[1, 3]) + abs(T[2, 3])
    last = T[3, 0] == 0.0 and T[3, 1] == 0.0 and T[3, 2] == 0.0 and T[3, 3] == 1.0
    # A NaN anywhere makes a comparison false.
    finite = abs(a) + abs(b) + abs(c) + abs(d) + abs(e) + abs(f) + abs(g) + abs(h) + abs(i) + offset < math.inf
    return finite and last and worst <= RIGID_TOLERANCE and det > 0.0


@formula
def axis(T):  # type: ignore[no-untyped-def]
    """Unit direction of a pose's z axis: the column as given, normalised."""
    x, y, z = T[0, 2], T[1, 2], T[2, 2]
    n = math.sqrt(x * x + y * y + z * z)
    return x / n, y / n, z / n


@formula
def record(T, R, s, h, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
    """Answer for one valid pose into out (13,)."""
    dx, dy, dz = axis(T)
    v, qx, qy, qz, nx, ny, nz, feature, t, bound = nearest(R, s, h, H, r, l, T[0, 3], T[1, 3], T[2, 3], dx, dy, dz)
    out[0] = v
    out[1] = qx
    out[2] = qy
    out[3] = qz
    out[4] = qx + v * nx
    out[5] = qy + v * ny
    out[6] = qz + v * nz
    out[7] = nx
    out[8] = ny
    out[9] = nz
    out[10] = bound
    out[11] = feature
    out[12] = t


_pieces = kernel_pieces.pieces


def _entries(stamp: str) -> tuple[Any, Any, Any, Any]:
    def single(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018  # part of the cache key
        if not rigid(T):
            return False
        record(T, R, R * math.sin(half_angle), -R * math.cos(half_angle), H, r, l, out)
        return True

    def distances(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        for i in range(T.shape[0]):
            pose = T[i]
            if not rigid(pose):
                return i
            dx, dy, dz = axis(pose)
            out[i] = nearest(R, s, h, H, r, l, pose[0, 3], pose[1, 3], pose[2, 3], dx, dy, dz)[0]
        return -1

    def records(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        for i in range(T.shape[0]):
            if not rigid(T[i]):
                return i
            record(T[i], R, s, h, H, r, l, out[i])
        return -1

    def pieces(T, R, half_angle, H, r, l, out):  # type: ignore[no-untyped-def] # noqa: E741
        stamp  # noqa: B018
        if not rigid(T):
            return False
        dx, dy, dz = axis(T)
        s = R * math.sin(half_angle)
        h = -R * math.cos(half_angle)
        _pieces(R, s, h, H, half_angle, r, l, T[0, 3], T[1, 3], T[2, 3], dx, dy, dz, out)
        return True

    return (
        entry(single, "b1(f8[:,::1],f8,f8,f8,f8,f8,f8[::1])"),
        entry(distances, "i8(f8[:,:,::1],f8,f8,f8,f8,f8,f8[::1])"),
        entry(records, "i8(f8[:,:,::1],f8,f8,f8,f8,f8,f8[:,::1])"),
        entry(pieces, "b1(f8[:,::1],f8,f8,f8,f8,f8,f8[:,::1])"),
    )


single, distances, records, pieces = _entries(source_stamp())
