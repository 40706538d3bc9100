"""The connection matrix: what it declares (Table 1 of the paper) beside what is measured."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from clamp3d.clamp.dimensions import PARTS, TITLES, ConnectionType, PartName
from clamp3d.geometry.pose import Array

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


def millimetres(gap: float) -> str:
    """A gap in mm for people: three digits, more where it is smaller than they show, and 0 for rounding.

    >>> [millimetres(gap) for gap in (1.0, 0.0012, -9.876e-4, 6e-10, 4e-10)]
    ['1.000', '0.001', '-0.000988', '6e-10', '0']
    """
    return "0" if abs(gap) < 5e-10 else f"{gap:.3g}" if abs(gap) < 1e-3 else f"{gap:.3f}"


def plain(item: Any, **names: str) -> dict[str, Any]:
    """Fields of a dataclass as data for JSON; ``names`` are the keys of fields that are not called the same there.

    A field whose key ends in ``_deg`` is an angle in rad.
    """
    values = {names.get(f.name, f.name): _plain_value(getattr(item, f.name)) for f in fields(item)}
    return {key: math.degrees(value) if key.endswith("_deg") else value for key, value in values.items()}


def _plain_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [_plain_value(part) for part in value]
    if is_dataclass(value):
        return value.to_dict() if hasattr(value, "to_dict") else plain(value)
    return value


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """A pair whose measured contact is not the declared one.

    Attributes
    ----------
    a, b : str
        The two parts.
    declared, measured : int
        Types of the connection matrix; 0 is no contact.
    gap : float or None
        Signed distance of the two in the final state, mm; None for a meeting on the way.
    place : ndarray (3,) or None
        Where it is measured, on part a in the world, mm.
    where : str
        When it was seen: "the final state", or a step of the sequence.
    """

    a: PartName
    b: PartName
    declared: ConnectionType
    measured: ConnectionType
    gap: float | None
    place: Array | None
    where: str = "the final state"

    def __str__(self) -> str:
        pair = f"{self.a}-{self.b} ({TITLES[self.a]}, {TITLES[self.b]})"
        declared = f"declared {self.declared} ({TYPES[self.declared]})"
        if self.gap is not None and self.measured == 0:
            return f"{pair} {declared} but does not touch: {millimetres(self.gap)} mm apart in {self.where}"
        return f"{pair} {declared} but met as {self.measured} ({TYPES[self.measured]}) in {self.where}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return plain(self, gap="gap_mm", place="point") | {"text": str(self)}
