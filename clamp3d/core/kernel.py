"""Compiled entry points of the distance. Import this module only when a distance is asked for."""

from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula, inlined
from clamp3d.core.kernel_distance import Answer, Rate, inside_rate, nearest
from clamp3d.core.kernel_features import Groove, Rod
from clamp3d.core.kernel_flat import flat_nearest
from clamp3d.core.kernel_pose import rigid, rod_at
from clamp3d.core.pose import Array

# First columns of a record: vectors take three, the gradient six.
DISTANCE = 0
POINT_ON_GROOVE = 1
POINT_ON_CYLINDER = 4
NORMAL = 7
ERROR_BOUND = 10
FEATURE = 11
ALONG = 12
GRADIENT = 13
WIDTH = 19


@inlined
def groove_of(R: float, half_angle: float, H: float) -> Groove:
    """The groove of this radius, half angle and half length."""
    return Groove(R, half_angle, R * math.sin(half_angle), -R * math.cos(half_angle), H)


@inlined
def put(out: Array, column: int, x: float, y: float, z: float) -> None:
    """Write a vector into three columns."""
    out[column], out[column + 1], out[column + 2] = x, y, z


@formula
def record(answer: Answer, rate: Rate, inner: float, out: Array) -> None:
    """Write an answer into ``out`` (WIDTH,); what is deeper than ``inner`` moves with the axis, the rest stands."""
    a = answer
    out[DISTANCE], out[ERROR_BOUND], out[FEATURE], out[ALONG] = a.distance, a.bound, a.feature, a.t
    put(out, POINT_ON_GROOVE, a.x, a.y, a.z)
    put(out, POINT_ON_CYLINDER, a.x + a.distance * a.nx, a.y + a.distance * a.ny, a.z + a.distance * a.nz)
    put(out, NORMAL, a.nx, a.ny, a.nz)
    below = min(a.distance + inner, 0.0)
    x, y, z = a.x + below * a.nx, a.y + below * a.ny, a.z + below * a.nz
    put(out, GRADIENT, rate.x, rate.y, rate.z)
    put(out, GRADIENT + 3, y * rate.z - z * rate.y, z * rate.x - x * rate.z, x * rate.y - y * rate.x)


@formula
def capsule_nearest(groove: Groove, rod: Rod) -> tuple[Answer, Rate]:
    """Signed distance of a capsule, and its rate by a shift."""
    answer = nearest(groove, rod)
    if answer.distance < -rod.r:
        return answer, inside_rate(groove, rod, answer.t)
    return answer, Rate(answer.nx, answer.ny, answer.nz)


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
def records(T: Array, R: float, half_angle: float, H: float, r: float, half: float, flat: bool, out: Array) -> int:
    """The same with all that is known of an answer, into ``out`` (n, WIDTH)."""
    groove = groove_of(R, half_angle, H)
    for i in range(T.shape[0]):
        if not rigid(T, i):
            return i
        rod = rod_at(T, i, r, half)
        answer, rate = flat_nearest(groove, rod) if flat else capsule_nearest(groove, rod)
        record(answer, rate, min(r, half) if flat else r, out[i])
    return -1
