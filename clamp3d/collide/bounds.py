"""What a rung of the ladder knows of a pair, and the verdict that follows once it is certain.

The signed distance of two solids is their distance where they are apart. Where they overlap it is minus the depth:
the greatest distance that a point of one lies inside the other. For a groove and a cylinder whose axis is outside
the material this is the kernel's signed distance. Every rung gives bounds of it, none a guess.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from clamp3d.checks import number, positive
from clamp3d.core.pose import Array
from clamp3d.errors import InputError

RESOLUTION = 1e-6
"""Bounds closer than this (mm) count as one number, and a gap that misses a threshold by less as meeting it."""


FARTHEST = 1e9
"""Largest coordinate in a scene, mm: beyond, rounding of positions comes near to `RESOLUTION`."""


class Verdict(StrEnum):
    """How a pair of parts stands, from worst to best."""

    CONTAINED = "contained"
    CLASH = "clash"
    UNCERTAIN = "uncertain"
    CONTACT = "contact"
    CLEARANCE = "clearance"
    ALLOWED = "allowed"
    CLEAR = "clear"


@dataclass(frozen=True, slots=True)
class Bounds:
    """The signed distance lies between ``low`` and ``high`` mm; infinite where nothing is known.

    ``point_a``, ``point_b`` (3,), in the frame the question was asked in: witnesses of ``high``. ``normal`` (3,): unit
    from a to b, of the planes that part the two by ``low``; None where nothing did.
    """

    low: float = -math.inf
    high: float = math.inf
    point_a: Array | None = None
    point_b: Array | None = None
    normal: Array | None = None

    def meet(self, other: Bounds) -> Bounds:
        """Both at once: the tighter of the bounds on either side."""
        best = self if self.high <= other.high else other
        normal = (self if self.low >= other.low else other).normal
        return Bounds(max(self.low, other.low), best.high, best.point_a, best.point_b, normal)

    def union(self, other: Bounds) -> Bounds:
        """Bounds for the nearer of two pieces."""
        best = self if self.high <= other.high else other
        normal = (self if self.low <= other.low else other).normal
        return Bounds(min(self.low, other.low), best.high, best.point_a, best.point_b, normal)

    def widened(self, error: float) -> Bounds:
        """The same with ``error`` mm more doubt on either side."""
        return Bounds(self.low - error, self.high + error, self.point_a, self.point_b, self.normal)


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Overlap or gap up to ``contact`` mm is contact; a larger gap below ``clearance`` mm is too small a clearance.

    Raises InputError unless 0 < contact and clearance is 0 (not asked for) or more than contact.
    """

    contact: float = 0.01
    clearance: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "contact", positive("contact", self.contact))
        rule = f"be 0 or > contact = {self.contact:g} mm"
        object.__setattr__(self, "clearance", number("clearance", self.clearance, rule=rule))
        if not (self.clearance == 0.0 or self.clearance > self.contact):
            raise InputError(f"clearance must be 0 or > contact = {self.contact:g} mm, got {self.clearance}")

    @property
    def reach(self) -> float:
        """Pairs further apart than this (mm) are clear."""
        return max(self.contact, self.clearance)

    def verdict(self, bounds: Bounds) -> Verdict:
        """The verdict that all distances within ``bounds`` share, else uncertain.

        >>> Thresholds(clearance=1.0).verdict(Bounds(0.2, 0.9)).value
        'clearance'
        >>> Thresholds(clearance=1.0).verdict(Bounds(0.9, 1.1)).value
        'uncertain'
        """
        low, high = bounds.low, bounds.high
        if high - low <= 2.0 * RESOLUTION:
            low = high = 0.5 * (low + high)
        at_low = self._of(low)
        return at_low if at_low is self._of(high) else Verdict.UNCERTAIN

    def _of(self, distance: float) -> Verdict:
        if distance < -self.contact - RESOLUTION:
            return Verdict.CLASH
        if distance <= self.contact + RESOLUTION:
            return Verdict.CONTACT
        return Verdict.CLEARANCE if distance < self.clearance - RESOLUTION else Verdict.CLEAR

    def margin(self, distance: float) -> float:
        """How far ``distance`` is from the nearest threshold, mm."""
        marks = [-self.contact, self.contact]
        if self.clearance > 0.0:
            marks.append(self.clearance)
        return min(abs(distance - mark) for mark in marks)
