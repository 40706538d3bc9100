"""Tolerance of a wire's placement: how far it may be misplaced before the clamp no longer closes on it.

The wire is held where it is while the two splints, in the tilt they end in, close on it along the bolt until each
touches. What they then lack of the closed clamp is the opening. Lifting the wire lifts one splint and lowers the other,
so the clamp as a whole may float along the bolt; a real clamp also pulls the wire straight, so the tolerances are on
the safe side. The command is ``clamp3d sweep``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from clamp3d.checks import array, choice, instance, number, positive, whole
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.core.contact_model import GroovePair
from clamp3d.core.distance import Feature, signed_distances
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError, NotClampedError

Freedom = Literal["offset", "height", "yaw", "pitch"]
FREEDOMS: tuple[Freedom, ...] = ("offset", "height", "yaw", "pitch")
"""Across the wire (X, mm), along the bolt (Z, mm), about the bolt (Z, rad), about the cross axis (X, rad)."""

SEAT_TOLERANCE = 0.5
"""Opening in mm up to which a clamp counts as closed: what its bolt still draws together."""

_TOUCH = 1e-7
_FARTHEST = 1e6  # mm; a wire further off is not misplaced but elsewhere
_ITERATIONS = 400
_STRAIGHT = 1e-5
_ROUNDS, _STEPS = 5, 64
"""A limit is narrowed 64-fold in each round, to 1e-9 of its range."""


class Outcome(IntEnum):
    """What comes of closing a clamp on a misplaced wire."""

    CLOSES = 0
    TOUCHES_WRONGLY = 1
    CANNOT_SEAT = 2

    @property
    def label(self) -> str:
        """In words."""
        return self.name.lower().replace("_", " ")


_IN_GROOVE = (Feature.ARC, Feature.END_ARC)
_FACES = (Feature.FLAT_M, Feature.FLAT_N, Feature.END_EDGE_M, Feature.END_EDGE_N, Feature.END_FACE)


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """Outcomes of closing on n misplaced wires.

    Attributes
    ----------
    misplacement : ndarray (n, 4)
        Offset, height (mm), yaw, pitch (rad).
    outcome : ndarray (n,)
        Codes of `Outcome`.
    opening : ndarray (n,)
        What the splints lack of the closed clamp, mm; infinite where one never meets the wire.
    feature : ndarray (n, 2)
        Codes of the `Feature` of the up and the down splint that touches first.
    """

    misplacement: Array
    outcome: NDArray[np.int8]
    opening: Array
    feature: NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Limits:
    """Tolerance of one freedom, the others at nominal: the clamp closes from ``low`` to ``high`` (mm or rad).

    ``low_open``, ``high_open``: it still closed at the end of the range that was searched.
    """

    freedom: Freedom
    low: float
    high: float
    low_open: bool
    high_open: bool


@dataclass(frozen=True, slots=True, eq=False)
class PlacementTolerance:
    """How far a wire may be misplaced, in each freedom alone and in all at once.

    Attributes
    ----------
    wire : str
        The wire, P6 or P7.
    seat_tolerance : float
        Opening up to which the clamp counts as closed, mm.
    limits : tuple of Limits
        Each freedom alone.
    together : float
        The clamp still closes with every freedom anywhere within this share of its own limits at once, as tried at
        the corners and at ``samples`` random points of that box.
    samples : int
    """

    wire: PartName
    seat_tolerance: float
    limits: tuple[Limits, ...]
    together: float
    samples: int


def placement(
    clamp: Clamp | str | Path = "reference",
    ranges: Mapping[Freedom, float] | None = None,
    *,
    wire: PartName = "P6",
    seat_tolerance: float = SEAT_TOLERANCE,
    samples: int = 4000,
    seed: int = 0,
) -> PlacementTolerance:
    """How far a wire may be misplaced before a clamp no longer closes on it.

    Parameters
    ----------
    clamp : Clamp, str or Path
        A clamp, the name of a built-in one, or a clamp file.
    ranges : dict, optional
        Half range that is searched for each freedom: offset, height (mm), yaw, pitch (rad).
    wire : {"P6", "P7"}
        Power line or jumper.
    seat_tolerance : float
        Opening up to which the clamp counts as closed, mm.
    samples, seed : int
        Random points at which the share of the limits that holds at once is tried.

    Raises
    ------
    InputError
        For bad values.
    NotClampedError
        For a clamp that does not close on its wires at all.

    Examples
    --------
    >>> [limits] = placement(ranges={"yaw": 0.1}, samples=0).limits
    >>> round(math.degrees(limits.high), 2)
    2.18
    """
    closing = Placement(clamp, wire, seat_tolerance=seat_tolerance)
    chosen: Mapping[Freedom, float] = {"offset": 15.0, "yaw": 0.1, "pitch": 0.05} if ranges is None else ranges
    return closing.tolerance(chosen, samples=samples, seed=seed)


class Placement:
    """A clamp in its final state, ready to be closed on one of its wires in other poses; see `placement`."""

    def __init__(
        self, clamp: Clamp | str | Path, wire: PartName = "P6", *, seat_tolerance: float = SEAT_TOLERANCE
    ) -> None:
        choice("wire", wire, ("P6", "P7"))
        seat_tolerance = positive("seat tolerance", seat_tolerance)
        final = assemble(clamp)
        self.clamp, self.wire, self.seat_tolerance = final.clamp, wire, seat_tolerance
        if not final.clamped:
            wires = f"{self.clamp.line.label} and {self.clamp.jumper.label}"
            raise NotClampedError(f"clamp {self.clamp.name} with {wires}: {final.status}")
        self._nominal = final.T_world(wire)
        pairs = groove_pairs(self.clamp)
        self._splints: list[tuple[GroovePair, Array, Array]] = []
        for splint, up in (("P1", 1.0), ("P2", -1.0)):
            pair = pairs[splint, wire]
            world = final.T_world(splint) @ pair.T_a_groove
            self._splints.append((pair, inverse(world), np.array([0.0, 0.0, up])))

    def poses(self, misplacement: Array) -> Array:
        """World poses (n, 4, 4) of the wire for misplacements (n, 4): offset, height (mm), yaw, pitch (rad)."""
        m = array("misplacements", misplacement, (None, 4))
        if not np.abs(m[:, :2]).max(initial=0.0) <= _FARTHEST:
            raise InputError(f"misplacements must be up to {_FARTHEST:g} mm, got {np.abs(m[:, :2]).max():g}")
        T = np.tile(self._nominal, (len(m), 1, 1))
        # Rz(yaw) Rx(pitch), about the wire's middle.
        T[:, :3, :3] = Rotation.from_euler("ZX", m[:, 2:]).as_matrix() @ self._nominal[:3, :3]
        T[:, (0, 2), 3] += m[:, :2]
        return T

    def close(self, misplacement: Array) -> Outcomes:
        """Close the clamp on the wire at each misplacement (n, 4): offset, height (mm), yaw, pitch (rad)."""
        poses = self.poses(misplacement)
        opening = np.zeros(len(poses))
        features = np.empty((len(poses), 2), dtype=np.int8)
        beside = np.zeros(len(poses), dtype=bool)
        for k, (pair, T_groove_world, away) in enumerate(self._splints):
            travel, features[:, k], flat = _approach(pair, T_groove_world, poses @ pair.T_b_cylinder, away)
            opening += travel
            beside |= flat & ~np.isin(features[:, k], _IN_GROOVE)
        in_groove = np.isin(features, _IN_GROOVE).all(axis=1)
        outside = beside | ~np.isfinite(opening)
        closed = in_groove & (opening <= self.seat_tolerance)
        outcome = np.where(closed, Outcome.CLOSES, np.where(outside, Outcome.CANNOT_SEAT, Outcome.TOUCHES_WRONGLY))
        return Outcomes(np.asarray(misplacement, dtype=np.float64), outcome.astype(np.int8), opening, features)

    def cloud(self, ranges: Mapping[Freedom, float], count: int, *, seed: int = 0) -> Outcomes:
        """Outcomes of ``count`` misplacements spread evenly at random over half ``ranges`` (mm or rad)."""
        m = np.zeros((whole("count", count, least=1, most=10_000_000), 4))
        rng = np.random.default_rng(whole("seed", seed, least=0))
        for freedom, reach in _ranges(ranges).items():
            m[:, FREEDOMS.index(freedom)] = rng.uniform(-reach, reach, count)
        return self.close(m)

    def limits(self, freedom: Freedom, reach: float) -> Limits:
        """How far one freedom alone may go either way before the clamp does not close, searched up to ``reach``."""
        choice("freedom", freedom, FREEDOMS)
        ((freedom, reach),) = _ranges({freedom: reach}).items()
        column = FREEDOMS.index(freedom)

        def closes(values: Array) -> NDArray[np.bool_]:
            m = np.zeros((len(values), 4))
            m[:, column] = values
            return np.asarray(self.close(m).outcome == Outcome.CLOSES)

        low, high = (_limit(lambda steps, sign=sign: closes(sign * steps), reach) for sign in (-1.0, 1.0))  # type: ignore[misc]
        return Limits(freedom, 0.0 - low, high, low >= reach, high >= reach)

    def tolerance(self, ranges: Mapping[Freedom, float], *, samples: int = 4000, seed: int = 0) -> PlacementTolerance:
        """Limits of each freedom in ``ranges`` (half ranges, mm or rad), and the share of them that holds at once."""
        limits = tuple(self.limits(freedom, reach) for freedom, reach in _ranges(ranges).items())
        samples, rng = whole("samples", samples, least=0), np.random.default_rng(whole("seed", seed, least=0))
        unit = np.array(list(itertools.product((0.0, 1.0), repeat=len(limits))))
        unit = np.vstack([unit, rng.random((samples, len(limits)))])
        low, high = np.array([x.low for x in limits]), np.array([x.high for x in limits])
        columns = [FREEDOMS.index(x.freedom) for x in limits]

        def all_close(share: float) -> bool:
            m = np.zeros((len(unit), 4))
            m[:, columns] = share * (low + unit * (high - low))
            return bool((self.close(m).outcome == Outcome.CLOSES).all())

        inside, outside = (1.0, 1.0) if all_close(1.0) else (0.0, 1.0)
        while outside - inside > 1e-6:
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if all_close(middle) else (inside, middle)
        return PlacementTolerance(self.wire, self.seat_tolerance, limits, inside, samples)


def _limit(closes: Callable[[Array], NDArray[np.bool_]], reach: float) -> float:
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


def _ranges(ranges: Mapping[Freedom, float]) -> dict[Freedom, float]:
    """Half ranges, at least one, > 0; turns by less than a right angle."""
    instance("ranges", ranges, Mapping)
    if not ranges:
        raise InputError(f"ranges must hold at least one of {', '.join(FREEDOMS)}")
    checked: dict[Freedom, float] = {}
    for freedom, reach in ranges.items():
        choice("freedom", freedom, FREEDOMS)
        turn = freedom in ("yaw", "pitch")
        rule = "be > 0 and < 90 deg" if turn else f"be > 0 and up to {_FARTHEST:g} mm"
        checked[freedom] = number(f"{freedom}: half range", reach, rule=rule)
        if not 0.0 < checked[freedom] < (math.pi / 2 if turn else _FARTHEST):
            got = f"{math.degrees(checked[freedom]):g} deg" if turn else f"{checked[freedom]:g} mm"
            raise InputError(f"{freedom}: half range must {rule}, got {got}")
    return checked


def _approach(
    pair: GroovePair, T_groove_world: Array, poses: Array, away: Array
) -> tuple[Array, NDArray[np.int8], NDArray[np.bool_]]:
    """How far from its place (mm along ``away``) a splint touches wires at ``poses`` (n, 4, 4), with what, and whether
    that is a face beside the mouth, or its edge.

    The splint comes from afar. Each step is the distance that is left, which a straight motion cannot overrun.
    """
    groove, cylinder = pair.groove, pair.cylinder
    # Far enough for the thickest wire in the steepest pose; from there every step is safe.
    far = 4.0 * (groove.radius + cylinder.radius) + cylinder.length + float(np.abs(poses[:, :3, 3]).max(initial=0.0))
    travel = np.full(len(poses), far)
    local = np.ascontiguousarray(T_groove_world @ poses)
    step = T_groove_world[:3, :3] @ away
    home = local[:, :3, 3].copy()
    active = np.arange(len(poses))
    for _ in range(_ITERATIONS):
        local[active, :3, 3] = home[active] - travel[active, None] * step
        gap = signed_distances(groove, cylinder, local[active])
        travel[active] -= gap
        active = active[(gap > _TOUCH) & (travel[active] > -far)]
        if not len(active):
            break
    local[:, :3, 3] = home - travel[:, None] * step
    answer = signed_distances(groove, cylinder, local, full=True)
    d = local[:, :3, 2]
    straight = np.array([0.0, 1.0, 0.0]) - d[:, 1:2] * d
    straight /= np.maximum(np.linalg.norm(straight, axis=1), 1e-300)[:, None]
    # A wire flat on a face touches the corner of the lip as well: the normal tells which.
    flat = np.isin(answer.feature, _FACES) | (np.linalg.norm(answer.normal - straight, axis=1) < _STRAIGHT)
    return np.where(travel <= -far, np.inf, travel), answer.feature, flat
