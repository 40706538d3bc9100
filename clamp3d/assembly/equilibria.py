"""All the states a clamp can come to rest in: local minima of the distance between the splints, from many starts."""

from __future__ import annotations

import itertools

import numpy as np

from clamp3d.assembly.final_state import FinalState, solve_final_state
from clamp3d.assembly.section import WIRES, D, S, Section
from clamp3d.errors import SolverError
from clamp3d.geometry.pose import Array

SAME = 1e-6
"""States whose distance, tilt and held wires agree to this many mm are one."""


def equilibria(section: Section) -> tuple[FinalState, ...]:
    """Every final state found from open starts of all kinds, each with its proof; the one closed furthest first.

    The starts combine five tilts with each wire in the middle of its mouth and near its lips. A clamp in which a wire
    can rest on a lip as well as in its groove has more than one; which one it comes to depends on how it is put
    together. Raises SolverError if no start leads to a proven state.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.contact.cas import Cas
    >>> [round(section.splint_distance(state.q), 3) for section in [Section(load_clamp(), Cas())]
    ...  for state in equilibria(section)]
    [31.53, 34.042]
    """
    found: list[FinalState] = []
    last: SolverError | None = None
    for start in open_starts(section):
        try:
            state = solve_final_state(section, start)
        except SolverError as error:
            last = error
            continue
        if not any(_same(state, other) for other in found):
            found.append(state)
    if not found:
        raise SolverError(f"no equilibrium could be proven; the last start says: {last}")
    return tuple(sorted(found, key=lambda state: float(state.q[D])))


def open_starts(section: Section) -> list[Array]:
    """Open states: five tilts, each wire in the middle, left and right of its mouth, where nothing overlaps."""
    limit = section.clamp.down_splint.max_tilt
    d, bounds = section.open_distance(), section.bounds()
    out = []
    for tilt, *places in itertools.product((0.0, 0.5, -0.5, 1.0, -1.0), (0.0, -0.8, 0.8), (0.0, -0.8, 0.8)):
        q = section.open_state(d, tilt * limit)
        for i, place in enumerate(places):
            low, high = bounds[2 * i]
            if place:
                q[2 * i] = 0.5 * (low + high) + 0.5 * place * (high - low)
        if section.gaps(q).value.min() >= 0.0:
            out.append(q)
    return out


def _same(a: FinalState, b: FinalState) -> bool:
    """Loose wires lie where gravity leaves them: they do not tell states apart."""
    if a.loose != b.loose:
        return False
    held = [k for i, wire in enumerate(WIRES) if wire not in a.loose for k in (2 * i, 2 * i + 1)]
    return bool(np.abs((a.q - b.q)[[*held, D, S]]).max() <= SAME)
