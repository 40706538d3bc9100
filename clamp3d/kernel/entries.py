"""Compiled entry points, compiled or loaded together. Import this module only when a distance is asked for."""

from __future__ import annotations

import math
from typing import Any

from numba import boolean, float64, from_dtype, int64

from clamp3d.geometry.pose import RIGID_TOLERANCE, Array
from clamp3d.geometry.primitives import LARGEST
from clamp3d.kernel.distance import RECORD
from clamp3d.kernel.features import Rod, groove_of, inverse_root
from clamp3d.kernel.flat_ends import with_flat_ends
from clamp3d.kernel.jit import entry, formula, inlined
from clamp3d.kernel.nearest import Answer, inside_rate, nearest
from clamp3d.kernel.piece_gaps import END_BELOW, end_gap, free_gap, gap_inside, place_inside
from clamp3d.kernel.vector import Vector, cross, dot, plus, put, times


@inlined
def vector_of(numbers: Array) -> Vector:
    """The first three numbers of a row."""
    return Vector(numbers[0], numbers[1], numbers[2])


@inlined
def place(T: Array) -> tuple[Vector, Vector]:
    """Position and axis as given, of a pose (4, 4) or (2, 3), which is these two alone."""
    if len(T) == 2:
        return vector_of(T[0]), vector_of(T[1])
    return Vector(T[0, 3], T[1, 3], T[2, 3]), Vector(T[0, 2], T[1, 2], T[2, 2])


@inlined
def rigid(T: Array) -> bool:
    """Whether a pose (4, 4) is rigid by the rule of ``pose.check_pose``, and its offset below LARGEST.

    Of (2, 3): whether the axis is of unit length to the same tolerance.
    """
    p, d = place(T)
    is_near = abs(p.x) + abs(p.y) + abs(p.z) < LARGEST
    if len(T) == 2:
        return abs(dot(d, d) - 1.0) <= RIGID_TOLERANCE and is_near
    a, b, c = vector_of(T[0]), vector_of(T[1]), vector_of(T[2])
    # Every comparison is false for a NaN.
    t = RIGID_TOLERANCE
    is_unit = abs(dot(a, a) - 1.0) <= t and abs(dot(b, b) - 1.0) <= t and abs(dot(c, c) - 1.0) <= t
    is_square = abs(dot(a, b)) <= t and abs(dot(a, c)) <= t and abs(dot(b, c)) <= t
    last = abs(T[3, 0]) + abs(T[3, 1]) + abs(T[3, 2]) + abs(T[3, 3] - 1.0)
    return bool(is_unit and is_square and dot(a, cross(b, c)) > 0.0 and is_near and last == 0.0)


@inlined
def rod_at(T: Array, r: float, half: float) -> Rod:
    """The cylinder of this radius and half length at a valid pose: its axis as given, normalised."""
    centre, axis = place(T)
    d = times(inverse_root(dot(axis, axis)), axis)
    return Rod(centre, d, d.x * d.x + d.y * d.y, r, half)


@formula
def record(answer: Answer, rate: Vector, inner: float, out: Any) -> None:
    """Write an answer into a record; what is deeper than ``inner`` moves with the axis, the rest stands."""
    a = answer
    out.distance, out.error_bound, out.feature, out.along = a.distance, a.bound, a.feature, a.t
    out.axis_inside = a.distance < -inner
    put(out.point_on_groove, a.point)
    put(out.point_on_cylinder, plus(a.point, a.distance, a.normal))
    put(out.normal, a.normal)
    put(out.gradient[:3], rate)
    put(out.gradient[3:], cross(plus(a.point, min(a.distance + inner, 0.0), a.normal), rate))


_SIZES = (float64, float64, float64, float64, float64)


@entry(int64(float64[:, :, ::1], *_SIZES, boolean, float64[::1], from_dtype(RECORD)[::1]))
def measure(
    T: Array, R: float, half_angle: float, H: float, r: float, half: float, flat: bool, distances: Array, out: Any
) -> int:
    """Measure the poses T, with ``flat`` ends or a capsule. The first invalid pose, or -1.

    All that is known of each answer goes into the records ``out`` (n,), or if there are none the distance alone
    into ``distances`` (n,).
    """
    groove = groove_of(R, half_angle, H)
    for i in range(T.shape[0]):
        if not rigid(T[i]):
            return i
        rod = rod_at(T[i], r, half)
        answer = nearest(groove, rod)
        rate = answer.normal
        if flat:
            answer, rate = with_flat_ends(groove, rod, answer)
        elif answer.distance < -r:
            rate = inside_rate(groove, rod, answer.t)
        if len(out) == 0:
            distances[i] = answer.distance
        else:
            record(answer, rate, min(r, half) if flat else r, out[i])
    return -1


@entry(boolean(float64[:, ::1], *_SIZES, from_dtype(RECORD)[::1]))
def pieces(T: Array, R: float, half_angle: float, H: float, r: float, half: float, out: Any) -> bool:
    """The five pieces at one pose (4, 4) into records (5,); False for a pose that is not rigid."""
    if not rigid(T):
        return False
    groove, rod = groove_of(R, half_angle, H), rod_at(T, r, half)
    t = place_inside(groove, rod)
    for piece in range(5):
        gap = end_gap(groove, rod, piece) if piece >= END_BELOW else free_gap(groove, rod, piece)
        if piece < END_BELOW and not math.isnan(t):
            gap = gap_inside(groove, rod, piece, t, gap)
        record = out[piece]
        record.distance, record.feature = gap.distance, gap.feature
        put(record.point_on_groove, gap.point)
        put(record.normal, gap.normal)
        put(record.gradient[:3], gap.rate)
        put(record.gradient[3:], cross(gap.axis_point, gap.rate))
    return True
