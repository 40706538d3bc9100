"""The connection matrix: what it declares (Table 1 of the paper) beside what is measured."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp, ConnectionType, PartName
from clamp3d.core.pose import Array

TYPES: dict[ConnectionType, str] = {
    0: "no connection",
    1: "screw joint",
    2: "convex object collision",
    3: "concave arc surface collision",
}
"""Eq. 1 of the paper."""

Pair = tuple[PartName, PartName]

PAIRS: tuple[Pair, ...] = tuple(itertools.combinations(PARTS, 2))
"""All pairs of parts, in the order of the matrix."""

ARC_PAIRS: tuple[Pair, ...] = (("P1", "P6"), ("P1", "P7"), ("P2", "P3"), ("P2", "P6"), ("P2", "P7"))
"""The pairs in which a cylinder lies in a concave arc (Fig. 5)."""

SCREW: Pair = ("P4", "P5")


def contact_type(pair: Pair) -> ConnectionType:
    """Type of a contact of two parts, by their shapes.

    >>> contact_type(("P1", "P6")), contact_type(("P4", "P5")), contact_type(("P1", "P2"))
    (3, 1, 2)
    """
    return 3 if pair in ARC_PAIRS else 1 if pair == SCREW else 2


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """A pair whose measured contact is not the declared one.

    Attributes
    ----------
    a, b : str
        The two parts.
    declared, measured : int
        Types of the connection matrix; 0 is no contact.
    gap : float
        Signed distance of the two, mm.
    place : ndarray (3,) or None
        Where it is measured, on part a in the world, mm.
    where : str
        When it was seen: "the final state", or a step of the sequence.
    """

    a: PartName
    b: PartName
    declared: ConnectionType
    measured: ConnectionType
    gap: float
    place: Array | None
    where: str = "the final state"

    def __str__(self) -> str:
        pair = f"{self.a}-{self.b} ({TITLES[self.a]}, {TITLES[self.b]})"
        declared = f"declared {self.declared} ({TYPES[self.declared]})"
        if self.measured == 0:
            return f"{pair} {declared} but does not touch: {self.gap:.3f} mm apart in {self.where}"
        return f"{pair} {declared} but met as {self.measured} ({TYPES[self.measured]}) in {self.where}"


def differences(clamp: Clamp, contacts: Iterable[object], tolerance: float) -> tuple[Difference, ...]:
    raise NotImplementedError
