"""From where the open clamp catches a wire: start places in the section, and what the closing ends in from each.

The clamp stands open as every closing begins (`open_start`), the other wire in its groove. The wire is put somewhere
between the splints, and the closing path is followed from there: the wire is free, as if its robot let it give way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.closing import descend, open_start
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.final_state import TOLERANCE, solve_final_state
from clamp3d.clamp.section import SIZE, WIRES, Section
from clamp3d.clamp.status import closing_status
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import Array

FLAT = 4
"""Columns of the map for each of its rows: a splint is that much wider than its opening is high."""


class Outcome(IntEnum):
    """What a closing ends in."""

    SEATED = 0
    ON_A_LIP = 1
    NOT_CLAMPED = 2
    NOT_PROVEN = 3
    NO_ROOM = 4

    @property
    def label(self) -> str:
        """In words."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True, eq=False)
class CaptureMap:
    """Outcomes of closing from m x n start places of a wire.

    Attributes
    ----------
    sideways : ndarray (n,)
        Start of the wire's centre to the right of its place in the up splint's groove, mm.
    height : ndarray (m,)
        The same upwards, mm: negative, below its place in the groove.
    outcome : ndarray (m, n)
        Codes of `Outcome`; where the wire would overlap the open clamp there is no room.
    """

    sideways: Array
    height: Array
    outcome: NDArray[np.int8]

    @property
    def captured(self) -> tuple[float, float] | None:
        """The widest range of columns, mm, from all of whose places with room the clamp ends seated; None if none."""
        room = self.outcome != Outcome.NO_ROOM
        seated = ((self.outcome == Outcome.SEATED) | ~room).all(axis=0) & room.any(axis=0)
        ends = np.flatnonzero(np.diff(np.concatenate([[False], seated, [False]]).astype(np.int8)))
        if not len(ends):
            return None
        first, after = max(zip(ends[::2], ends[1::2], strict=True), key=lambda run: run[1] - run[0])
        return float(self.sideways[first]), float(self.sideways[after - 1])

    def count(self, outcome: Outcome) -> int:
        """From how many places the closing ends so."""
        return int((self.outcome == outcome).sum())


def capture_map(
    clamp: Clamp, wire: PartName, columns: int, progress: Callable[[int, int], None] | None = None
) -> CaptureMap:
    """Close ``clamp`` from ``columns`` places across and a quarter as many in height; ``progress(done, of)``."""
    section = Section(clamp, Cas())
    seat = open_start(section)
    x = 2 * WIRES.index(wire)
    low, high = section.reach(wire)
    bottom = descend(section, seat, -np.eye(SIZE)[x + 1], free=(x + 1,))[x + 1]  # in the down splint's groove
    across, down = np.linspace(low, high, columns), np.linspace(seat[x + 1], bottom, columns // FLAT + 2)[1:-1]
    outcome = np.empty((len(down), columns), dtype=np.int8)
    for k, (i, j) in enumerate(np.ndindex(outcome.shape)):
        if progress is not None:
            progress(k, outcome.size)
        start = seat.copy()
        start[[x, x + 1]] = across[j], down[i]
        outcome[i, j] = close_from(section, start)
    return CaptureMap(across - seat[x], seat[x + 1] - down, outcome)


def close_from(section: Section, start: Array) -> Outcome:
    """What the closing from a state (10,) ends in."""
    if section.gaps(start).value.min() < -1e3 * TOLERANCE:
        return Outcome.NO_ROOM
    try:
        status = closing_status(section, solve_final_state(section, start))
    except SolverError:
        return Outcome.NOT_PROVEN
    if not status.clamped:
        return Outcome.NOT_CLAMPED
    return Outcome.ON_A_LIP if status.warnings else Outcome.SEATED
