"""Compiled entry points of the distance. Import this module only when a distance is asked for."""

from __future__ import annotations

from typing import Any

from clamp3d.geometry.pose import Array
from clamp3d.kernel.features import Groove, Rod, groove_of
from clamp3d.kernel.flat_ends import flat_nearest
from clamp3d.kernel.jit import entry, formula
from clamp3d.kernel.nearest import Answer, inside_rate, nearest
from clamp3d.kernel.pose_rows import rigid, rod_at
from clamp3d.kernel.vector import Vector, cross, plus, put


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


@formula
def capsule_nearest(groove: Groove, rod: Rod) -> tuple[Answer, Vector]:
    """Signed distance of a capsule, and its rate by a shift."""
    answer = nearest(groove, rod)
    return answer, inside_rate(groove, rod, answer.t) if answer.distance < -rod.r else answer.normal


@entry
def distances(T: Array, R: float, half_angle: float, H: float, r: float, half: float, flat: bool, out: Array) -> int:
    """Distances of the poses T into ``out`` (n,); ``flat`` ends or a capsule. The first invalid pose, or -1."""
    groove = groove_of(R, half_angle, H)
    for i in range(T.shape[0]):
        if not rigid(T, i):
            return i
        rod = rod_at(T, i, r, half)
        out[i] = flat_nearest(groove, rod)[0].distance if flat else nearest(groove, rod).distance
    return -1


@entry
def records(T: Array, R: float, half_angle: float, H: float, r: float, half: float, flat: bool, out: Any) -> int:
    """The same with all that is known of an answer, into records (n,)."""
    groove = groove_of(R, half_angle, H)
    for i in range(T.shape[0]):
        if not rigid(T, i):
            return i
        rod = rod_at(T, i, r, half)
        answer, rate = flat_nearest(groove, rod) if flat else capsule_nearest(groove, rod)
        record(answer, rate, min(r, half) if flat else r, out[i])
    return -1
