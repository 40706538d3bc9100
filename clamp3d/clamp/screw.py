"""The screw joint of bolt and nut (type 1 of the paper): turning one moves the other along the axis by the pitch."""

from __future__ import annotations

import math
from dataclasses import dataclass

from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True)
class ScrewJoint:
    """Single start thread: ``pitch`` mm of travel a turn. Raises InputError unless 0 < pitch < infinity."""

    pitch: float

    def __post_init__(self) -> None:
        if not 0.0 < self.pitch < math.inf:
            raise InputError(f"pitch must be > 0 mm, got {self.pitch}")

    def travel(self, turn: float) -> float:
        """Travel in mm of a turn in rad."""
        return self.pitch * turn / (2.0 * math.pi)

    def turn(self, travel: float) -> float:
        """Turn in rad that a travel in mm takes.

        >>> round(math.degrees(ScrewJoint(2.5).turn(1 / 3)), 9)
        48.0
        """
        return 2.0 * math.pi * travel / self.pitch
