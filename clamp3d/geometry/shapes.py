"""The two shapes whose contact is closed form: a swept arc (groove) and a cylinder (wire)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from clamp3d.errors import InputError

LARGEST = 1e100
"""Lengths from 1 / LARGEST to LARGEST mm: their squares neither overflow nor underflow."""


def _positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be a finite length > 0 mm, got {value}")
    if not 1.0 / LARGEST <= value <= LARGEST:
        raise InputError(f"{name} must be between {1.0 / LARGEST:g} and {LARGEST:g} mm, got {value}")


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
        _positive("groove radius", self.radius)
        _positive("groove length", self.length)
        if not 0.0 < self.half_angle < math.pi:
            raise InputError(f"groove half_angle must be between 0 and pi rad, got {self.half_angle}")


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A wire or pin: axis on z, centred, full ``length``; mm. Raises InputError for sizes that are not positive."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        _positive("cylinder radius", self.radius)
        _positive("cylinder length", self.length)
