"""The pose as the kernel takes it: checked, and read as a place and an axis direction."""

from __future__ import annotations

import math

from clamp3d.core.jit import inlined
from clamp3d.core.kernel_features import Rod
from clamp3d.core.kernel_vector import Vector, dot, times
from clamp3d.core.pose import RIGID_TOLERANCE, Array
from clamp3d.core.primitives import LARGEST


@inlined
def place(T: Array, k: int) -> tuple[Vector, Vector]:
    """Position and axis as given, of pose k of (n, 4, 4) or of (n, 2, 3), which is these two alone."""
    if T.shape[1] == 2:
        return Vector(T[k, 0, 0], T[k, 0, 1], T[k, 0, 2]), Vector(T[k, 1, 0], T[k, 1, 1], T[k, 1, 2])
    return Vector(T[k, 0, 3], T[k, 1, 3], T[k, 2, 3]), Vector(T[k, 0, 2], T[k, 1, 2], T[k, 2, 2])


@inlined
def rigid(T: Array, k: int) -> bool:
    """Whether pose k of (n, 4, 4) is rigid by the rule of ``pose.check_pose``, and its offset below LARGEST.

    Of (n, 2, 3): whether the axis is of unit length to the same tolerance.
    """
    if T.shape[1] == 2:
        p, d = place(T, k)
        return abs(dot(d, d) - 1.0) <= RIGID_TOLERANCE and abs(p.x) + abs(p.y) + abs(p.z) < LARGEST
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
    return bool(offset < LARGEST and last == 0.0)


@inlined
def rod_at(T: Array, k: int, r: float, half: float) -> Rod:
    """The cylinder of this radius and half length at the valid pose k: its axis as given, normalised."""
    centre, axis = place(T, k)
    g = dot(axis, axis)
    n = 1.5 - 0.5 * g if abs(g - 1.0) <= 1e-8 else 1.0 / math.sqrt(g)  # by its series near 1: no root to wait for
    d = times(n, axis)
    return Rod(centre, d, d.x * d.x + d.y * d.y, r, half)
