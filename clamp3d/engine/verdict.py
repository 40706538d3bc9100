"""What a distance means for a pair of parts: verdicts from absolute thresholds, given once they are certain."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from clamp3d.checks import number, positive
from clamp3d.engine.answer import Distance
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array

RESOLUTION = 1e-6
"""Bounds closer than this (mm) count as one number, and a gap that misses a threshold by less as meeting it."""


class Verdict(StrEnum):
    """How a pair of parts stands, from worst to best."""

    DUPLICATE = "duplicate"
    CONTAINED = "contained"
    CLASH = "clash"
    FAILED = "failed"
    UNCERTAIN = "uncertain"
    CONTACT = "contact"
    CLEARANCE = "clearance"
    ALLOWED = "allowed"
    CLEAR = "clear"


VERDICTS = tuple(Verdict)
"""Verdicts by number, as arrays keep them."""


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
        return max(self.contact, self.clearance) + RESOLUTION

    def verdict(self, distance: Distance, allowance: float | None = None) -> Verdict:
        """The verdict that all distances between the bounds of ``distance`` share, else uncertain.

        Parameters
        ----------
        distance : Distance
            The bounds of the pair's signed distance, mm.
        allowance : float, optional
            Overlap in mm up to which the pair's contact is meant; None if contact is not meant.

        Examples
        --------
        >>> Thresholds(clearance=1.0).verdict(Distance(0.2, 0.9)).value
        'clearance'
        >>> Thresholds(clearance=1.0).verdict(Distance(0.9, 1.1)).value
        'uncertain'
        >>> Thresholds().verdict(Distance(-0.3, -0.2), allowance=0.5).value
        'allowed'
        """
        lower, upper = distance.lower, distance.upper
        if upper - lower <= 2.0 * RESOLUTION:
            lower = upper = 0.5 * (lower + upper)
        marks, verdicts = self._scale(allowance)
        place = bisect_left(marks, lower)
        return verdicts[place] if place == bisect_left(marks, upper) else Verdict.UNCERTAIN

    def verdicts(self, lower: Array, upper: Array, allowance: float | None = None) -> NDArray[np.int8]:
        """The places in VERDICTS of many distances by their bounds (n,), each as `verdict` gives it."""
        sharp = upper - lower <= 2.0 * RESOLUTION
        middle = np.where(sharp, upper, 0.0) + 0.5 * np.where(sharp, lower - upper, 0.0)
        marks, verdicts = self._scale(allowance)
        low, high = (np.searchsorted(marks, np.where(sharp, middle, bound)) for bound in (lower, upper))
        places = np.array([VERDICTS.index(verdict) for verdict in verdicts], dtype=np.int8)
        return np.where(low == high, places[low], np.int8(VERDICTS.index(Verdict.UNCERTAIN)))

    def _scale(self, allowance: float | None) -> tuple[tuple[float, ...], tuple[Verdict, ...]]:
        """Distances (mm) at which the verdict changes, and the verdicts below, between and above them."""
        touching = self.contact + RESOLUTION
        clear = max(touching, self.clearance - RESOLUTION)
        if allowance is None:
            return (-touching, touching, clear), (Verdict.CLASH, Verdict.CONTACT, Verdict.CLEARANCE, Verdict.CLEAR)
        return (-max(allowance, self.contact) - RESOLUTION, clear), (Verdict.CLASH, Verdict.ALLOWED, Verdict.CLEAR)

    def between(self, distance: Distance, allowance: float | None = None) -> list[str]:
        """The thresholds that lie between the bounds of a distance, in words: why its verdict is uncertain."""
        marks = [(self.contact, f"a gap of {self.contact:g} mm (contact)")]
        if self.clearance > 0.0:
            marks.append((self.clearance, f"a gap of {self.clearance:g} mm (clearance)"))
        depth = self.contact if allowance is None else max(allowance, self.contact)
        marks.append((-depth, f"an overlap of {depth:g} mm ({'contact' if allowance is None else 'allowed'})"))
        return [words for mark, words in marks if distance.lower <= mark <= distance.upper]
