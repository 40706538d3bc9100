"""The pose as the kernel takes it: checked, and read as a place and an axis direction."""

from __future__ import annotations

from clamp3d.geometry.pose import RIGID_TOLERANCE, Array
from clamp3d.geometry.primitives import LARGEST
from clamp3d.kernel.features import Rod, inverse_root
from clamp3d.kernel.jit import inlined
from clamp3d.kernel.vector import Vector, cross, dot, times


@inlined
def row(T: Array, k: int, i: int) -> Vector:
    """First three numbers of row i of pose k."""
    return Vector(T[k, i, 0], T[k, i, 1], T[k, i, 2])


@inlined
def place(T: Array, k: int) -> tuple[Vector, Vector]:
    """Position and axis as given, of pose k of (n, 4, 4) or of (n, 2, 3), which is these two alone."""
    if T.shape[1] == 2:
        return row(T, k, 0), row(T, k, 1)
    return Vector(T[k, 0, 3], T[k, 1, 3], T[k, 2, 3]), Vector(T[k, 0, 2], T[k, 1, 2], T[k, 2, 2])


@inlined
def rigid(T: Array, k: int) -> bool:
    """Whether pose k of (n, 4, 4) is rigid by the rule of ``pose.check_pose``, and its offset below LARGEST.

    Of (n, 2, 3): whether the axis is of unit length to the same tolerance.
    """
    p, d = place(T, k)
    is_near = abs(p.x) + abs(p.y) + abs(p.z) < LARGEST
    if T.shape[1] == 2:
        return abs(dot(d, d) - 1.0) <= RIGID_TOLERANCE and is_near
    a, b, c = row(T, k, 0), row(T, k, 1), row(T, k, 2)
    # Every comparison is false for a NaN.
    t = RIGID_TOLERANCE
    is_unit = abs(dot(a, a) - 1.0) <= t and abs(dot(b, b) - 1.0) <= t and abs(dot(c, c) - 1.0) <= t
    is_square = abs(dot(a, b)) <= t and abs(dot(a, c)) <= t and abs(dot(b, c)) <= t
    last = abs(T[k, 3, 0]) + abs(T[k, 3, 1]) + abs(T[k, 3, 2]) + abs(T[k, 3, 3] - 1.0)
    return bool(is_unit and is_square and dot(a, cross(b, c)) > 0.0 and is_near and last == 0.0)


@inlined
def rod_at(T: Array, k: int, r: float, half: float) -> Rod:
    """The cylinder of this radius and half length at the valid pose k: its axis as given, normalised."""
    centre, axis = place(T, k)
    d = times(inverse_root(dot(axis, axis)), axis)
    return Rod(centre, d, d.x * d.x + d.y * d.y, r, half)
