"""How a robot may place a wire: from where the open clamp catches it, and how far it may lean.

To be caught, the wire is put somewhere between the splints of the clamp that stands open as every closing begins
(`open_start`), the other wire in its groove, and the closing path is followed from there: the wire is straight and
free, as if its robot let it give way. Leaning needs space: the wire is held at its place in the closed clamp, turned
about its middle, while the two splints, in the tilt they end in, close on it along the bolt until each touches. What
they then lack of the closed clamp is the opening. A real clamp also pulls the wire straight, so the limits are on the
safe side. The command is ``clamp3d sweep``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from clamp3d.baselines.cas import Cas
from clamp3d.checks import choice, function, number, positive, whole
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.closing import descend, open_start
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.final_state import TOLERANCE, solve_final_state
from clamp3d.clamp.parts import groove_pairs
from clamp3d.clamp.result import Assembly
from clamp3d.clamp.section import SIZE, SPLINTS, WIRES, Section
from clamp3d.clamp.status import closing_status
from clamp3d.errors import InputError, NotClampedError, SolverError
from clamp3d.geometry.pose import Array, inverse
from clamp3d.kernel.contact_model import GroovePair
from clamp3d.kernel.distance import Feature, signed_distances

Turn = Literal["yaw", "pitch"]
TURNS: tuple[Turn, ...] = ("yaw", "pitch")
"""About the bolt (Z) and about the cross axis (X), rad."""

FLAT = 4
"""Columns of the map for each of its rows: a splint is that much wider than its opening is high."""
_TOUCH = 1e-7  # mm: far below any seat tolerance
_ITERATIONS = 400  # chosen: a splint that grazes a wire takes many steps
_ROUNDS, _STEPS = 5, 64
"""A limit is narrowed 64-fold in each round, to 1e-9 of its range."""
_IN_GROOVE = (Feature.ARC, Feature.END_ARC)


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


@dataclass(frozen=True, slots=True)
class Limits:
    """The clamp closes on a wire that is turned by ``low`` to ``high`` rad, as searched up to ``reach``."""

    turn: Turn
    low: float
    high: float
    reach: float


@dataclass(frozen=True, slots=True)
class Placement:
    """How a wire of a clamp may be placed.

    Attributes
    ----------
    clamp : Clamp
    wire : str
        The wire, P6 or P7.
    capture : CaptureMap
        What the closing ends in from where.
    seat_tolerance : float
        Opening in mm up to which the clamp counts as closed on a leaning wire.
    limits : tuple of Limits
        How far it may lean: yaw and pitch, each alone.
    """

    clamp: Clamp
    wire: PartName
    capture: CaptureMap
    seat_tolerance: float
    limits: tuple[Limits, ...]


def placement(
    clamp: Clamp | str | Path = "reference",
    *,
    wire: PartName = "P6",
    columns: int = 40,
    yaw: float = 0.1,
    pitch: float = 0.05,
    seat_tolerance: float = 0.5,
    progress: Callable[[int, int], None] | None = None,
) -> Placement:
    """From where a clamp catches one of its wires, and how far that may lean before the clamp no longer closes on it.

    Parameters
    ----------
    clamp : Clamp, str or Path
        A clamp, the name of a built-in one, or a clamp file.
    wire : {"P6", "P7"}
        Power line or jumper.
    columns : int
        Start places across, with a quarter as many in height; at least 4.
    yaw, pitch : float
        Up to which turn the limits are searched, rad.
    seat_tolerance : float
        Opening in mm up to which the clamp counts as closed on a leaning wire: what its bolt still draws together.
    progress : callable, optional
        Called with the number of start places tried, and of how many.

    Raises
    ------
    InputError
        For bad values.
    NotClampedError
        For a clamp that does not close on its wires at all.

    Examples
    --------
    >>> placed = placement(wire="P7", columns=4)
    >>> [round(math.degrees(limit.high), 2) for limit in placed.limits]
    [5.4, 0.48]
    """
    choice("wire", wire, ("P6", "P7"))
    columns = whole("columns", columns, least=FLAT, most=1000)
    seat_tolerance = positive("seat tolerance", seat_tolerance)
    function("progress", progress)
    reach = {turn: _checked_turn(turn, value) for turn, value in zip(TURNS, (yaw, pitch), strict=True)}
    final = assemble(clamp)
    clamp = final.clamp
    if not final.clamped:
        raise NotClampedError(f"clamp {clamp.name} with {clamp.line.label} and {clamp.jumper.label}: {final.status}")
    limits = tuple(_limits(final, wire, turn, reach[turn], seat_tolerance) for turn in TURNS)
    return Placement(clamp, wire, capture_map(clamp, wire, columns, progress), seat_tolerance, limits)


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


def _checked_turn(turn: Turn, value: float) -> float:
    rule = "be > 0 and < 90 deg"
    value = number(turn, value, rule=rule)
    if not 0.0 < value < 0.5 * math.pi:
        raise InputError(f"{turn} must {rule}, got {math.degrees(value):g} deg")
    return value


def _limits(final: Assembly, wire: PartName, turn: Turn, reach: float, seat_tolerance: float) -> Limits:
    """How far one turn alone may go either way before the clamp does not close."""

    def closes(angles: Array) -> NDArray[np.bool_]:
        turns = np.zeros((len(angles), 2))
        turns[:, TURNS.index(turn)] = angles
        opening, in_grooves = close_on(final, wire, turns)
        return in_grooves & (opening <= seat_tolerance)

    return Limits(turn, -_last(lambda angles: closes(-angles), reach), _last(closes, reach), reach)


def close_on(final: Assembly, wire: PartName, turns: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Opening (n,) mm of a clamp that closes on a wire with yaw and pitch (n, 2) rad; whether both touch in grooves."""
    poses = np.tile(final.T_world(wire), (len(turns), 1, 1))
    # Rz(yaw) Rx(pitch), about the wire's middle.
    poses[:, :3, :3] = Rotation.from_euler("ZX", turns).as_matrix() @ poses[0, :3, :3]
    opening, in_grooves = np.zeros(len(turns)), np.ones(len(turns), dtype=bool)
    pairs = groove_pairs(final.clamp)
    for splint, up in zip(SPLINTS, (1.0, -1.0), strict=True):
        pair = pairs[splint, wire]
        T_groove_world = inverse(final.T_world(splint) @ pair.T_a_groove)
        travel, feature = _approach(pair, T_groove_world @ poses @ pair.T_b_cylinder, up * T_groove_world[:3, 2])
        opening += travel
        in_grooves &= np.isin(feature, _IN_GROOVE)
    return opening, in_grooves


def _approach(pair: GroovePair, poses: Array, away: Array) -> tuple[Array, NDArray[np.int8]]:
    """How far from its place (mm along ``away``) a splint touches wires at ``poses`` (n, 4, 4), and with what.

    All in the groove's frame. The splint comes from afar; each step is the distance that is left, which a straight
    motion cannot overrun.
    """
    groove, cylinder = pair.groove, pair.cylinder
    # Far enough for the thickest wire in the steepest pose; from there every step is safe.
    far = 4.0 * (groove.radius + cylinder.radius) + cylinder.length + float(np.abs(poses[:, :3, 3]).max())
    local, travel = np.array(poses), np.full(len(poses), far)
    for _ in range(_ITERATIONS):
        local[:, :3, 3] = poses[:, :3, 3] - travel[:, None] * away
        measured = signed_distances(groove, cylinder, local, full=True)
        travel = np.maximum(travel - measured.distance, -far)
        if not ((measured.distance > _TOUCH) & (travel > -far)).any():
            break
    return np.where(travel <= -far, np.inf, travel), measured.feature


def _last(closes: Callable[[Array], NDArray[np.bool_]], reach: float) -> float:
    """The largest value up to ``reach`` below which all values close."""
    low, high = 0.0, reach
    for _ in range(_ROUNDS):
        steps = np.linspace(low, high, _STEPS + 1)
        failing = np.flatnonzero(~closes(steps))
        if not len(failing):
            return high
        if failing[0] == 0:
            return low
        low, high = float(steps[failing[0] - 1]), float(steps[failing[0]])
    return low
