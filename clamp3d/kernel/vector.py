"""Vectors of three numbers for the compiled kernel."""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.geometry.pose import Array
from clamp3d.kernel.jit import inlined


class Vector(NamedTuple):
    """A point or a direction."""

    x: float
    y: float
    z: float


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@inlined
def length(a: Vector) -> float:
    """Length of a vector."""
    return math.sqrt(dot(a, a))


@inlined
def minus(a: Vector, b: Vector) -> Vector:
    """``a - b``."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@inlined
def plus(a: Vector, t: float, d: Vector) -> Vector:
    """``a + t d``."""
    return Vector(a.x + t * d.x, a.y + t * d.y, a.z + t * d.z)


@inlined
def times(t: float, a: Vector) -> Vector:
    """``t a``."""
    return Vector(t * a.x, t * a.y, t * a.z)


@inlined
def over(a: Vector, n: float) -> Vector:
    """``a / n``."""
    return Vector(a.x / n, a.y / n, a.z / n)


@inlined
def put(out: Array, a: Vector) -> None:
    """Write a vector into an array (3,)."""
    out[0], out[1], out[2] = a
