"""All equilibria of a clamp: the local minima of the distance between the splints.

Closing begins just above each local minimum of the feasible distance, sampled over tilts and positions of the wires.
For each groove the curve on which the wire's centre runs when it touches is found point by point, moving the wire by
its distance until that is small (conservative advancement: no step can pass through). The two curves of a wire,
turned against each other, tell how close the splints can come with the wire at a position. The feasible distance is the
maximum over both wires and the faces; its grid-local minima are the initial guesses.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from clamp3d.clamp.dimensions import TITLES, PartName
from clamp3d.clamp.final_state import FinalState, open_up, solve_final_state
from clamp3d.clamp.section import EDGE, SIZE, WIRES, D, S, Section, U
from clamp3d.clamp.status import stop_words
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import Array
from clamp3d.kernel.contact_model import GroovePair

OFF_ARC = ("face ", "flat", "lip", "end", "corner", EDGE)
"""How the names of features begin that are not of a groove's arc."""
SAME = 1e-6
"""States whose distance, tilt and held wires agree to this many mm are one: a proof leaves 1e-9."""
_STRIDE = 0.004
"""Longest step of a path that begins just above an equilibrium, in parts of the down splint's half width."""
_TILTS, _POSITIONS = 481, 961  # chosen: 0.06 deg and 0.06 mm apart for the reference clamp
_ADVANCES = 80  # each leaves 1 - cos(slope) of the way to the groove: 1e-6 of it at 80 degrees
_LEVEL = 1e-9
"""Distances that differ by this part of the wire's radius are level: between two faces a wire rests anywhere."""
_CLEAR = 1e-3
"""Moves in parts of the wire's radius by which a start is opened: less than the samples are apart."""


def equilibria(section: Section) -> tuple[FinalState, ...]:
    """All final states of a clamp that are found, each with its proof; the one closed furthest first.

    Starts are taken just above every local minimum of the sampled distance (`initial_guesses`). A clamp in which a
    wire can rest on a lip as well as in its groove has more than one equilibrium; which one it ends in depends on how
    it is put together. A state that a wire has slipped out of is among them: the closing ends there too.
    A minimum so shallow that opening by 1.5e-4 of the down splint's half width (0.01 mm of the reference clamp) lets
    the clamp slide on may be missing.

    Parameters
    ----------
    section : Section
        The clamp and how its grooves are measured.

    Returns
    -------
    tuple of FinalState

    Raises
    ------
    SolverError
        If no start leads to a proven state.

    Examples
    --------
    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.baselines.cas import Cas
    >>> section = Section(load_clamp(), Cas())
    >>> [round(section.splint_distance(state.q), 3) for state in equilibria(section)]
    [31.638, 31.53]
    """
    states: list[FinalState] = []
    last: SolverError | None = None
    for start in initial_guesses(section):
        try:
            state = solve_final_state(section, start, stride=_STRIDE)
        except SolverError as error:
            last = error
            continue
        if not any(same(state, other) for other in states):
            states.append(state)
    if not states:
        if last is not None:
            raise SolverError(f"no equilibrium could be proven; the last start says: {last}")
        states.append(solve_final_state(section))
    return tuple(sorted(states, key=lambda state: float(state.q[D])))


def same(a: FinalState, b: FinalState) -> bool:
    """Whether two final states are one. Loose wires lie where gravity leaves them: they do not tell states apart."""
    if a.loose != b.loose:
        return False
    held = [k for i, wire in enumerate(WIRES) if wire not in a.loose for k in (2 * i, 2 * i + 1)]
    return bool(np.abs((a.q - b.q)[[*held, *range(D, SIZE)]]).max() <= SAME)


def describe(state: FinalState, slipped: tuple[PartName, ...]) -> str:
    """What holds a state beside the grooves' arcs: 'jumper on a lip of the down splint, faces meet'.

    ``slipped`` are the wires that have left the clamp (`Section.escaped`).
    """
    words = []
    for wire in WIRES:
        on = {pair[0]: feature for pair, feature in state.active if pair[1] == wire and feature.startswith(OFF_ARC)}
        if wire in slipped:
            words.append(f"{TITLES[wire]} slips out of its groove")
        elif on:
            kinds = {part: "the face" if feature.startswith("flat") else "a lip" for part, feature in on.items()}
            words.append(
                f"{TITLES[wire]} on " + " and ".join(f"{kind} of the {TITLES[part]}" for part, kind in kinds.items())
            )
        elif wire in state.loose:
            words.append(f"{TITLES[wire]} loose")
    return ", ".join([*words, *stop_words(state.active)])


def initial_guesses(section: Section) -> list[Array]:
    """Open states q (10,), each just above a local minimum of the feasible distance."""
    limit, lever = section.clamp.tilt_stops["the slot"], section.lever
    tilts = np.linspace(-limit, limit, _TILTS)
    lifted = section.clamp.lifted(tilts)
    faces = [-section.face_gap(lever * tilt * np.eye(SIZE)[S]) for tilt in tilts]  # least d without an overlap
    line, jumper = (_Landscape(section, i, tilts) for i in range(len(WIRES)))

    def height(k: int, a: int, b: int) -> float:
        return float(max(faces[k], line.least[k][a], jumper.least[k][b]) + lifted[k])

    guesses: list[Array] = []
    for k, tilt in enumerate(tilts):
        for a, b in itertools.product(line.minima(k), jumper.minima(k)):
            here = height(k, a, b)
            sides = [height(j, line.slide(j, a), jumper.slide(j, b)) for j in (k - 1, k + 1) if 0 <= j < _TILTS]
            if min(sides) < here or (k and sides[0] == here):  # the first tilt of a level stretch stands for all
                continue
            q = np.zeros(SIZE)
            q[D], q[S], q[U] = here, lever * tilt, lifted[k]
            q[:2], q[2:4] = line.place(k, a, here - lifted[k]), jumper.place(k, b, here - lifted[k])
            guesses.append(q)
    step = _CLEAR * min(section.clamp.line.radius, section.clamp.jumper.radius)
    return [opened for q in guesses if (opened := open_up(section, q, step)) is not None]


class _Landscape:
    """How close a wire lets the splints come: ``least`` (t, n) mm at all tilts and positions ``x`` (n,).

    Its centre is then ``over`` (n,) deep in the up splint's groove, ``under`` (t, n) in the down splint's. A wire at
    position ``outside`` leaves the clamp.
    """

    def __init__(self, section: Section, i: int, tilts: Array) -> None:
        wire, bolt = WIRES[i], section.bolt_x
        up, down = section.pairs["P1", wire], section.pairs["P2", wire]
        r, (low, high) = up.cylinder.radius, section.reach(wire)
        face = section.clamp.down_splint.face_depth
        self.x, self.outside = np.linspace(low, high, _POSITIONS), 0 if i == 0 else _POSITIONS - 1
        self.over = _curve(section, up, self.x, section.clamp.up_splint.thickness + 1.01 * r, -1.0)
        deep = max(abs(face - 1.01 * r), abs(-float(down.T_a_groove[2, 3]) + down.groove.radius))
        aside, c = deep * math.sin(tilts[-1]), math.cos(tilts[-1])
        u = np.linspace((low - bolt - aside) / c, (high - bolt + aside) / c, _POSITIONS)
        v = _curve(section, down, u, face - 1.01 * r, 1.0)
        self.under = np.array([_turned(u, v, tilt, bolt, self.x) for tilt in tilts])
        least = np.round((self.over - self.under) / (_LEVEL * r)) * (_LEVEL * r)
        self.least: list[list[float]] = least.tolist()

    def minima(self, k: int) -> list[int]:
        """Positions of the local minima at tilt k, but for where the wire leaves the clamp; the first of level ones."""
        row = np.array(self.least[k])
        starts = np.flatnonzero(np.diff(row, prepend=np.inf))
        level = np.concatenate([[np.inf], row[starts], [np.inf]])
        is_low = (level[1:-1] < level[:-2]) & (level[1:-1] < level[2:])
        return [position for position in starts[is_low].tolist() if position != self.outside]

    def slide(self, k: int, position: int) -> int:
        """Where a wire at a position slides to when the splint has tilt k."""
        row = self.least[k]
        while True:
            beside = min(max(position - 1, 0), min(position + 1, len(row) - 1), key=row.__getitem__)
            if row[beside] >= row[position]:
                return position
            position = beside

    def place(self, k: int, position: int, d: float) -> tuple[float, float]:
        """The wire's centre with the down splint at d: in the middle of its room."""
        return self.x[position], 0.5 * (self.over[position] + d + self.under[k, position])


def _curve(section: Section, pair: GroovePair, u: Array, start: float, sign: float) -> Array:
    """How deep (n,) a wire's centre gets into a groove at positions u (n,), from depth ``start`` in sense ``sign``."""
    T = np.tile(np.eye(4), (len(u), 1, 1))
    T[:, 0, 3], T[:, 2, 3] = u, -start
    for _ in range(_ADVANCES):
        way = section.model.distances(pair, T)
        T[:, 2, 3] -= sign * np.maximum(way, 0.0)
        if way.max() <= 1e-5 * pair.cylinder.radius:
            break
    return -T[:, 2, 3]


def _turned(u: Array, v: Array, tilt: float, bolt: float, x: Array) -> Array:
    """Depth (m,) at places x (m,) of a curve (u, v), n points by rising u, turned by a tilt about ``bolt``.

    Linear between the points; of what the turned curve has over itself the first counts, and its ends beyond them.
    """
    c, s = math.cos(tilt), math.sin(tilt)
    along = np.maximum.accumulate(bolt + u * c + v * s)
    return np.interp(x, along, v * c - u * s)
