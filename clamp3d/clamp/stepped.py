"""Final states found by trying positions: for any contact model, also one without smooth gradients.

It is done as by the paper's program: the down splint's distance along the bolt takes multiples of ``step``, its tilt
multiples of ``tilt_step``, the wires settle freely, and the first position without overlap counts. Bisection goes on
from there with moves halved until they are below a resolution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.section import WIRES, D, Gaps, S, Section
from clamp3d.errors import InputError, SolverError
from clamp3d.geometry.pose import Array

FREE = 1e-9
"""Overlap up to this many mm is rounding, not overlap."""
_MOVES = 100_000
"""The most moves of one kind from one end to the other: at some 10 ms each they take a quarter of an hour."""


@dataclass(frozen=True, slots=True)
class SteppedState:
    """Last free position ``q`` (10,) of `section`, its gaps, and ``motion_steps``: positions tried (M of Table 5)."""

    q: Array
    gaps: Gaps
    motion_steps: int


@dataclass
class _Search:
    """Positions ``tried`` so far; ``progress`` is told of each move, with how many these are and d in mm."""

    section: Section
    progress: Callable[[int, float], None] | None
    tried: int = 0

    def lower(self, q: Array, d: float, tilts: Iterable[float], settle: bool) -> Array | None:
        """The state with the down splint at ``d`` and the first tilt that is free, or None."""
        for tilt in tilts:
            self.tried += 1
            state = _place(self.section, q, d, tilt, settle)
            if state is not None:
                if self.progress is not None:
                    self.progress(self.tried, d)
                return state
        return None

    def in_steps(self, step: float, tilt_step: float) -> Array:
        """The last free state of moves down by ``step``, each to the free tilt that is nearest."""
        section, limit = self.section, int(self.section.clamp.tilt_stop / tilt_step + 1e-9)
        tilts, tilt, first = range(-limit, limit + 1), 0, math.ceil(self.section.open_distance() / step)
        q = section.open_state(first * step)
        for k in range(first, -_MOVES, -1):
            nearest = sorted(tilts, key=lambda i: (abs(i - tilt), abs(i)))
            lower = self.lower(q, k * step, (i * tilt_step for i in nearest), settle=False)
            if lower is None:
                break
            q, tilt = lower, round(float(lower[S]) / section.lever / tilt_step)
        if k == first:
            raise SolverError(f"the open clamp overlaps at a distance of {k * step:.4g} mm: nothing to close")
        # Of the tilts that are free at the last distance, the one that leaves the wires the widest gaps.
        free = [p for i in tilts if (p := _place(section, q, q[D], i * tilt_step, settle=True)) is not None]
        return max(free, key=lambda p: min(float(section.wire_gaps(p, wire).value.min()) for wire in WIRES), default=q)

    def by_halves(self, q: Array, step: float, tilt_step: float, resolution: float) -> Array:
        """The last free state from q on, of moves that are halved until ``step`` is at most ``resolution``."""
        limit = self.section.clamp.tilt_stop
        while step > resolution:
            step, tilt_step = 0.5 * step, 0.5 * tilt_step
            # A move down may need a turn of many tilt steps: those of twice the size are next.
            turns = [0.0, *(tilt_step * 2.0**k for k in range(math.floor(math.log2(2.0 * limit / tilt_step)) + 1))]
            lower: Array | None = q
            while lower is not None:
                q, tilt = lower, float(lower[S]) / self.section.lever
                tilts = dict.fromkeys(tilt + side * turn for turn in turns for side in (1.0, -1.0))
                allowed = [candidate for candidate in tilts if abs(candidate) <= limit]
                lower = self.lower(q, float(q[D]) - step, allowed, settle=True)
        return q


def solve_stepped(
    section: Section,
    *,
    step: float,
    tilt_step: float,
    resolution: float = math.inf,
    progress: Callable[[int, float], None] | None = None,
) -> SteppedState:
    """Close the clamp in moves of ``step`` mm and ``tilt_step`` rad; ``progress`` is told the moves made and d in mm.

    Then both are halved until the step is at most ``resolution`` mm. No move of one step is free from the state found,
    as far as tilts were tried: its distance d is at least the least one there is. How much more is not bounded.

    Raises InputError for moves that are not positive, SolverError if the open clamp already overlaps.
    """
    for name, value, reach, unit in (
        ("step", step, section.open_distance(), "mm"),
        ("tilt step", math.degrees(tilt_step), math.degrees(section.clamp.tilt_stop), "deg"),
    ):
        if not value > 0.0:
            raise InputError(f"{name} must be > 0 {unit}, got {value:g}")
        if not value * _MOVES >= reach:
            raise InputError(f"{name} must be >= {reach / _MOVES:.4g} {unit} here, got {value:g}")
    search = _Search(section, progress)
    q = section.seated(search.in_steps(step, tilt_step))
    if step > resolution:
        q = section.seated(search.by_halves(q, step, tilt_step, resolution))
    return SteppedState(q, section.gaps(q), search.tried)


def _place(section: Section, q: Array, d: float, tilt: float, settle: bool) -> Array | None:
    """State with the down splint at (d, tilt) and the wires in a free place, or None; ``settle`` seeks the widest."""
    new = q.copy()
    new[D], new[S] = d, section.lever * tilt
    if section.face_gap(new) < -FREE:
        return None
    for wire in WIRES:
        if not _settle(section, new, wire, settle):
            return None
    return new


class _FreeError(Exception):
    """Found a free place: no need to look for a better one."""


def _settle(section: Section, q: Array, wire: PartName, widest: bool) -> bool:
    """Move one wire of ``q`` in place to where its least gap is largest; whether it is free there."""
    from scipy.optimize import minimize  # takes long to import, and the exact solver needs none of it

    i = 2 * WIRES.index(wire)
    # Parts of finite size are free behind their grooves too: the wire stays between the bottoms of both.
    up, down = section.arc_centres(q, wire)
    top = float(up[1]) - section.pairs["P1", wire].groove.radius
    bottom = float(down[1]) + section.pairs["P2", wire].groove.radius

    @lru_cache(maxsize=1)  # the optimiser asks for values and derivatives one after the other
    def gaps(x: float, y: float) -> Gaps:
        q[i : i + 2] = x, y
        rows = section.wire_gaps(q, wire)
        if not widest and rows.value.min() >= -FREE:
            raise _FreeError
        return rows

    def slack_gradient(x: Array) -> Array:
        gradient = gaps(x[0], x[1]).gradient[:, i : i + 2]
        return np.column_stack([gradient, -np.ones(len(gradient))])

    try:
        end = minimize(
            lambda x: -x[2],
            np.array([*q[i : i + 2], gaps(q[i], q[i + 1]).value.min()]),
            jac=lambda x: np.array([0.0, 0.0, -1.0]),
            bounds=[section.mouth(wire), (top, bottom), (None, None)],
            constraints={"type": "ineq", "fun": lambda x: gaps(x[0], x[1]).value - x[2], "jac": slack_gradient},
            method="SLSQP",
            options={"maxiter": 60, "ftol": 1e-12},
        ).x
        return bool(gaps(end[0], end[1]).value.min() >= -FREE)
    except _FreeError:
        return True
