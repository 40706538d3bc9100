"""The search of the paper's Table 5, with its counts: positions tried and contact tests.

The paper counts a search that moves ``a`` parts in ``n`` steps each and tests ``b`` grooves (of ``m`` chords each) at
every combination: M(n^a) C(b), for chords M(4 m^(a-1) n^a) C(bm). `grid_search` is that search. The solvers of
`clamp3d.clamp` need less: *stepped* moves along one way and lets the wires settle, *exact* follows gradients.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clamp3d.baselines.chords import Chords
from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.result import Assembly
from clamp3d.clamp.section import Section
from clamp3d.core.pose import Array, SectionPose, inverse
from clamp3d.core.profile import chord_count

_OPEN = 12.0
"""mm through which each moving part of the grid search goes."""


@dataclass(frozen=True, slots=True)
class Searched:
    """Answer of `grid_search`: least splint distance along the bolt (mm) without overlap, None if all overlap."""

    closing: float | None
    positions: int
    tests: int


def grid_search(run: Assembly, model: ContactModel, *, n: int, parts: int, grooves: int) -> Searched:
    """Try every combination of ``n`` positions for each of 1 to 3 moving parts; the paper's search.

    The parts are the down splint (along the bolt), the jumper and the line (both up and down), each within 12 mm of
    its place in ``run``; those that do not move stand at it, 1e-6 mm apart. ``grooves`` (1 to 4) are tested.
    """
    section = Section(run.clamp, model)
    up, down = run.poses["P1"], run.poses["P2"]
    ways = np.linspace(0.0, _OPEN, n)
    moves = [ways if i < parts else np.zeros(1) for i in range(3)]
    grid = np.array(list(itertools.product(*moves)))
    # Jumper and line rest in the up splint when all is closed; they come up into it from below.
    lower = grid[:, 0] + 1e-6
    T_down = _stack(down.x - up.x, down.y - up.y + lower, down.angle)
    free = np.ones(len(grid), dtype=bool)
    tests = 0
    keys = [("P1", "P6"), ("P2", "P6"), ("P1", "P7"), ("P2", "P7")][:grooves]
    for key in keys:
        wire = run.poses[key[1]]
        fall = grid[:, 2 if key[1] == "P6" else 1]
        T_wire = _stack(wire.x - up.x, wire.y - up.y + 0.5e-6 + fall, 0.0)
        pair = section.pairs[key]
        poses = T_wire if key[0] == "P1" else np.asarray(inverse(T_down) @ T_wire)
        free &= model.distances(pair, poses) >= -1e-9
        tests += len(grid) * _segments(model, pair.groove.half_angle)
    closing = down.y - up.y + float(lower[free].min()) if free.any() else None
    return Searched(closing, len(grid), tests)


def fitted(values: Sequence[float], counts: Sequence[float]) -> float:
    """Exponent p of ``counts ~ values^p``: least squares on the logarithms; 0 for constants and single values.

    >>> round(fitted([1, 2, 4], [3, 12, 48]), 12)
    2.0
    """
    if len(values) < 2 or min(counts) <= 0.0:
        return 0.0
    return float(np.polyfit(np.log(values), np.log(counts), 1)[0])


def _segments(model: ContactModel, half_angle: float) -> int:
    return chord_count(2.0 * half_angle, model.unit_angle) if isinstance(model, Chords) else 1


def _stack(x: float, y: Array, angle: float) -> Array:
    """Poses (n, 4, 4) of section poses that differ in y."""
    out = np.tile(SectionPose(x, 0.0, angle).T(), (len(y), 1, 1))
    out[:, 2, 3] = -y
    return out
