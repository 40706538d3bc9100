"""Straight motions that end at a contact, for any contact model: conservative advancement on its gaps."""

from __future__ import annotations

import math

from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.section import Section
from clamp3d.core.pose import Array
from clamp3d.errors import SolverError

_TOUCH = 1e-10
_MAX_ADVANCES = 100_000


def travel_to_contact(
    section: Section, q: Array, wire: PartName, direction: Array, splint: PartName, *, limit: float = math.inf
) -> tuple[float, tuple[PartName, PartName] | None]:
    """Travel in mm of the unit ``direction`` (10,) from state ``q`` until ``splint`` and ``wire`` touch.

    Returns the travel and the pair that touches, or ``limit`` and None. No gap can close faster than the motion goes,
    so advancing by the least gap never passes a contact, however thin. Raises SolverError if the start overlaps or
    nothing ends the motion.
    """
    travel = 0.0
    for _ in range(_MAX_ADVANCES):
        gaps = section.wire_gaps(q + travel * direction, wire)
        gap = min(float(v) for v, pair in zip(gaps.value, gaps.pair, strict=True) if pair[0] == splint)
        if gap <= _TOUCH:
            if travel == 0.0 and gap < -_TOUCH:
                raise SolverError(f"{splint} and {wire} overlap by {-gap:.3g} mm before the motion starts")
            return float(travel), (splint, wire)
        travel += gap
        if travel >= limit:
            return limit, None
        if gap > 1e6:
            break
    raise SolverError(f"{wire} never reaches {splint} on its way in; do the grooves face the wires?")
