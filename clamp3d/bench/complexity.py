"""Table 5 measured: positions tried, contact tests and time as powers of steps, parts, grooves and segments.

The paper counts a search that moves ``a`` parts in ``n`` steps each and tests ``b`` grooves (of ``m`` chords each) at
every combination: M(n^a) C(b), for chords M(4 m^(a-1) n^a) C(bm). `grid_search` is that search. The solvers of
`clamp3d.clamp` need less: *stepped* moves along one way and lets the wires settle, *exact* follows gradients.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.chords import Chords
from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.assemble import STEP, TILT_STEP, assemble
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.features import wire_pairs
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.result import Assembly, Solver
from clamp3d.clamp.section import Section
from clamp3d.core.pose import Array, SectionPose, inverse
from clamp3d.core.profile import chord_count

_OPEN = 12.0
"""mm through which each moving part of the grid search goes."""


Run = Callable[[], tuple[int, int]]
"""A search, which answers how many positions and contact tests it took."""
Exponents = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Sweep:
    """One count varied: ``positions`` (M) and ``tests`` (C in all: a groove's arc or one of its chords against a
    wire) and CPU ``seconds`` at each of ``values``; ``exponents`` of the three fitted on logarithms.

    ``published`` are the exponents of M, of C in all and of their product in Table 5, None where it has none.
    """

    search: str
    method: str
    varied: str
    fixed: str
    values: tuple[float, ...]
    positions: tuple[int, ...]
    tests: tuple[int, ...]
    seconds: tuple[float, ...]
    exponents: tuple[float, float, float]
    published: tuple[float, float, float] | None


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
    found = np.ones(len(grid), dtype=bool)
    tests = 0
    keys = [("P1", "P6"), ("P2", "P6"), ("P1", "P7"), ("P2", "P7")][:grooves]
    for key in keys:
        wire = run.poses[key[1]]
        fall = grid[:, 2 if key[1] == "P6" else 1]
        T_wire = _stack(wire.x - up.x, wire.y - up.y + 0.5e-6 + fall, 0.0)
        pair = section.pairs[key]
        poses = T_wire if key[0] == "P1" else np.asarray(inverse(T_down) @ T_wire)
        found &= model.distances(pair, poses) >= -1e-9
        tests += len(grid) * _segments(model, pair.groove.half_angle)
    closing = down.y - up.y + float(lower[found].min()) if found.any() else None
    return Searched(closing, len(grid), tests)


def complexity(progress: Callable[[str], None] = lambda message: None, *, scale: float = 1.0) -> tuple[Sweep, ...]:
    """All sweeps on the reference clamp; ``scale`` below 1 makes the searches smaller."""
    clamp = load_clamp("reference")
    final = assemble(clamp, Cas())
    cas = Cas()

    def sized(*values: int) -> list[int]:
        return sorted({max(3, round(v * scale)) for v in values})

    def grid(model: ContactModel, n: int, a: int, b: int) -> Run:
        def run() -> tuple[int, int]:
            found = grid_search(final, model, n=n, parts=a, grooves=b)
            return found.positions, found.tests

        return run

    def solved(model: ContactModel, solver: Solver, step: float = STEP) -> Run:
        def run() -> tuple[int, int]:
            work = assemble(clamp, model, solver=solver, step=step, tilt_step=TILT_STEP).work
            return work.motion_steps, work.contact_queries * _mean_segments(model, clamp)

        return run

    chords = [Chords(math.radians(d)) for d in (20.0, 10.0, 5.0, 2.5, 1.25)]
    m = [model.segments(wire_pairs(clamp)) / 4.0 for model in chords]
    sweeps: list[Sweep] = []

    def sweep(what: tuple[str, str, str, str], at: Sequence[float], runs: list[Run], theirs: Exponents | None) -> None:
        search, method, varied, _ = what
        progress(f"Table 5: {search} search, {method}, {varied} varied")
        counts, seconds = zip(*map(_timed, runs), strict=True)
        positions, tests = zip(*counts, strict=True)
        exponents = (fitted(at, positions), fitted(at, tests), fitted(at, seconds))
        x = tuple(float(v) for v in at)
        sweeps.append(Sweep(*what, x, positions, tests, seconds, exponents, theirs))

    for a, steps in ((1, (3000, 10000, 30000, 100000)), (2, (56, 100, 180, 320)), (3, (15, 22, 32, 46))):
        values = sized(*steps)
        sweep(("grid", "cas", "n", f"a = {a}, b = 4"), values, [grid(cas, n, a, 4) for n in values], (a, a, a))
    (n,), parts = sized(46), [1, 2, 3]
    runs = [grid(cas, n, a, 4) for a in parts]
    sweep(("grid", "cas", "n^a", f"n = {n}, b = 4"), [n**a for a in parts], runs, (1.0, 1.0, 1.0))
    (n,), grooves = sized(30000), [1, 2, 3, 4]
    sweep(("grid", "cas", "b", f"n = {n}, a = 1"), grooves, [grid(cas, n, 1, b) for b in grooves], (0.0, 1.0, 1.0))
    for a, most, published in ((1, 300, (0.0, 1.0, 1.0)), (2, 17, (1.0, 2.0, 2.0))):
        (n,) = sized(most)
        sweep(("grid", "chords", "m", f"n = {n}, a = {a}, b = 4"), m, [grid(c, n, a, 4) for c in chords], published)
    finer = [1, 2, 4, 8] if scale >= 1.0 else [1, 2]
    way = Section(clamp, cas).open_distance() - final.closing
    runs = [solved(cas, "stepped", STEP / k) for k in finer]
    sweep(("stepped", "cas", "n", "a = 3, b = 4"), [way * k / STEP for k in finer], runs, (3.0, 3.0, 3.0))
    runs = [solved(model, "stepped") for model in chords]
    sweep(("stepped", "chords", "m", "a = 3, b = 4, step 1/3 mm"), m, runs, (2.0, 3.0, 3.0))
    sweep(("exact", "cas", "n", "no steps"), [1.0], [solved(cas, "exact")], None)
    sweep(("exact", "chords", "m", "no steps"), m, [solved(model, "exact") for model in chords], None)
    return tuple(sweeps)


def fitted(values: Sequence[float], counts: Sequence[float]) -> float:
    """Exponent p of ``counts ~ values^p``: least squares on the logarithms; 0 for constants and single values.

    >>> round(fitted([1, 2, 4], [3, 12, 48]), 12)
    2.0
    """
    if len(values) < 2 or min(counts) <= 0.0:
        return 0.0
    return float(np.polyfit(np.log(values), np.log(counts), 1)[0])


def _timed(run: Run) -> tuple[tuple[int, int], float]:
    """What a search answers, and its CPU time; of a quick one the least of three counts: load only adds."""
    times: list[float] = []
    while not times or (len(times) < 3 and sum(times) < 0.3):
        start = time.process_time()
        counted = run()
        times.append(time.process_time() - start)
    return counted, min(times)


def _segments(model: ContactModel, half_angle: float) -> int:
    return chord_count(2.0 * half_angle, model.unit_angle) if isinstance(model, Chords) else 1


def _mean_segments(model: ContactModel, clamp: Clamp) -> int:
    return round(model.segments(wire_pairs(clamp)) / 4.0) if isinstance(model, Chords) else 1


def _stack(x: float, y: Array, angle: float) -> Array:
    """Poses (n, 4, 4) of section poses that differ in y."""
    out = np.tile(SectionPose(x, 0.0, angle).T(), (len(y), 1, 1))
    out[:, 2, 3] = -y
    return out
