"""All equilibria of a clamp: the local minima of the distance between the splints."""

from __future__ import annotations

import numpy as np

from clamp3d.checks import instance
from clamp3d.clamp.dimensions import TITLES, PartName
from clamp3d.clamp.final_state import FinalState, solve_final_state
from clamp3d.clamp.landscape import initial_guesses
from clamp3d.clamp.section import MOUTH, WIRES, D, S, Section
from clamp3d.errors import SolverError

OFF_ARC = ("face ", "flat", "lip", "end", "corner")
"""How the names of features begin that are not of a groove's arc."""
SAME = 1e-6
"""States whose distance, tilt and held wires agree to this many mm are one."""
_TRUST_RADIUS = 0.004
"""Longest move of a descent that begins just above an equilibrium, in parts of the down splint's half width."""


def equilibria(section: Section) -> tuple[FinalState, ...]:
    """All final states of a clamp that are found, each with its proof; the one closed furthest first.

    Starts are taken just above every local minimum of the sampled distance (`landscape`). A clamp in which a wire can
    rest on a lip as well as in its groove has more than one equilibrium; which one it ends in depends on how it is put
    together. States in which a wire is about to slip out of its mouth are among them, for there the closing ends too.
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
    [31.53, 34.05, 30.499, 34.033]
    """
    instance("section", section, Section)
    found: list[FinalState] = []
    last: SolverError | None = None
    for start in initial_guesses(section):
        try:
            state = solve_final_state(section, start, _TRUST_RADIUS)
        except SolverError as error:
            last = error
            continue
        if not any(same(state, other) for other in found):
            found.append(state)
    if not found:
        if last is not None:
            raise SolverError(f"no equilibrium could be proven; the last start says: {last}")
        found.append(solve_final_state(section))
    return tuple(sorted(found, key=lambda state: float(state.q[D])))


def same(a: FinalState, b: FinalState) -> bool:
    """Whether two final states are one. Loose wires lie where gravity leaves them: they do not tell states apart."""
    if a.loose != b.loose:
        return False
    held = [k for i, wire in enumerate(WIRES) if wire not in a.loose for k in (2 * i, 2 * i + 1)]
    return bool(np.abs((a.q - b.q)[[*held, D, S]]).max() <= SAME)


def describe(state: FinalState) -> str:
    """What holds a state beside the grooves' arcs: 'jumper on a lip of the down splint, at the tilt limit'."""
    words = []
    for wire in WIRES:
        lips = [TITLES[pair[0]] for pair, feature in state.active if pair[1] == wire and feature.startswith(OFF_ARC)]
        if wire in slipping(state):
            words.append(f"{TITLES[wire]} slips out of its groove")
        elif lips:
            words.append(f"{TITLES[wire]} on a lip of the {' and the '.join(dict.fromkeys(lips))}")
        elif wire in state.loose:
            words.append(f"{TITLES[wire]} loose")
    if any(pair == ("P1", "P2") for pair, _ in state.active):
        words.append("faces meet")
    if any(feature == "tilt limit" for _, feature in state.active):
        words.append("at the tilt limit")
    return ", ".join(words)


def slipping(state: FinalState) -> tuple[PartName, ...]:
    """The wires that nothing but the end of the mouth keeps in it: closing ends there, but it is no equilibrium."""
    out = {pair[1] for pair, feature in state.active if feature == MOUTH}
    return tuple(wire for wire in WIRES if wire in out)
