"""All equilibria of a clamp: the local minima of the distance between the splints."""

from __future__ import annotations

import numpy as np

from clamp3d.checks import instance
from clamp3d.clamp.dimensions import TITLES, PartName
from clamp3d.clamp.final_state import FinalState, solve_final_state
from clamp3d.clamp.landscape import initial_guesses
from clamp3d.clamp.section import EDGE, SIZE, WIRES, D, Section
from clamp3d.clamp.status import stop_words
from clamp3d.errors import SolverError

OFF_ARC = ("face ", "flat", "lip", "end", "corner", EDGE)
"""How the names of features begin that are not of a groove's arc."""
SAME = 1e-6
"""States whose distance, tilt and held wires agree to this many mm are one."""
_STRIDE = 0.004
"""Longest step of a path that begins just above an equilibrium, in parts of the down splint's half width."""


def equilibria(section: Section) -> tuple[FinalState, ...]:
    """All final states of a clamp that are found, each with its proof; the one closed furthest first.

    Starts are taken just above every local minimum of the sampled distance (`landscape`). A clamp in which a wire can
    rest on a lip as well as in its groove has more than one equilibrium; which one it ends in depends on how it is put
    together. A state that a wire has slipped out of is among them: the closing ends there too.
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
    instance("section", section, Section)
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
        kinds = {
            p: f"{'the face' if name.startswith('flat') else 'a lip'} of the {TITLES[p]}" for p, name in on.items()
        }
        if wire in slipped:
            words.append(f"{TITLES[wire]} slips out of its groove")
        elif kinds:
            words.append(f"{TITLES[wire]} on {' and '.join(kinds.values())}")
        elif wire in state.loose:
            words.append(f"{TITLES[wire]} loose")
    return ", ".join([*words, *stop_words(state.active)])
