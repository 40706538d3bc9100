"""The shapes whose contact is closed form: a swept arc (groove), and a cylinder (wire) or capsule."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from clamp3d.checks import instance, number, positive
from clamp3d.errors import InputError

LARGEST = 1e100
"""Lengths from 1 / LARGEST to LARGEST mm: their squares neither overflow nor underflow."""


def size(name: str, value: object) -> float:
    """A length > 0 mm whose square neither overflows nor underflows, as a float. Raises InputError for any other."""
    x = positive(name, value)
    if not 1.0 / LARGEST <= x <= LARGEST:
        raise InputError(f"{name} must be between {1.0 / LARGEST:g} and {LARGEST:g} mm, got {x}")
    return x


def place(name: str, value: object) -> float:
    """A coordinate in mm whose square does not overflow, as a float. Raises InputError for any other."""
    x = number(name, value)
    if not abs(x) <= LARGEST:
        raise InputError(f"{name} must be between {-LARGEST:g} and {LARGEST:g} mm, got {x}")
    return x


def arc_angle(name: str, value: object) -> float:
    """Half the angle of an arc in rad, as a float. Raises InputError unless it is between 0 and pi."""
    x = number(name, value, rule="be between 0 and pi rad")
    if not 0.0 < x < math.pi:
        raise InputError(f"{name} must be between 0 and pi rad, got {x}")
    return x


@dataclass(frozen=True, slots=True)
class SweptArc:
    """A groove: an arc swept along z, the material behind it unbounded in x and -y.

    Frame: axis of the arc on z, arc centre on the axis, deepest line at -y, mouth to +y. The material is
    ``{y <= -radius cos(half_angle)}`` without the open disk of ``radius``, for ``|z| <= length / 2``.
    ``radius`` and ``length`` in mm; ``half_angle`` in rad, 0 < half_angle < pi (major arcs included).
    Raises InputError for any other value.
    """

    radius: float
    half_angle: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", size("groove radius", self.radius))
        object.__setattr__(self, "length", size("groove length", self.length))
        object.__setattr__(self, "half_angle", arc_angle("groove half_angle", self.half_angle))


@dataclass(frozen=True, slots=True)
class _Round:
    """What is round about z, centred; mm."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        for name in ("radius", "length"):
            object.__setattr__(self, name, size(f"{type(self).__name__.lower()} {name}", getattr(self, name)))


@dataclass(frozen=True, slots=True)
class Cylinder(_Round):
    """A wire, pin or bolt with flat ends: axis on z, centred, full ``length``; mm.

    Raises InputError for sizes that are not positive.
    """


@dataclass(frozen=True, slots=True)
class Capsule(_Round):
    """All points within ``radius`` of an axis segment of ``length`` on z, centred; mm.

    It is longer than the segment by the radius at either end. Raises InputError for sizes that are not positive.
    """


AnyCylinder: TypeAlias = Cylinder | Capsule
"""What the kernel measures against a groove: flat-ended or rounded."""


def check_shapes(groove: object, cylinder: object) -> None:
    """Raise InputError unless the two are a groove and a cylinder or capsule, in this order."""
    instance("groove", groove, SweptArc)
    instance("cylinder", cylinder, Cylinder, Capsule)
