"""The solvers of the final state that whole clamps are put to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines import Cas, Chords
from clamp3d.bench.stress.assemblies.clamps import Case
from clamp3d.bench.stress.worker import Measured, Measures, Rows
from clamp3d.clamp.assemble import STEP, TILT_STEP
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import Section
from clamp3d.clamp.stepped import solve_stepped
from clamp3d.core.pose import Array
from clamp3d.core.profile import chord_count, sagitta

EXACT = 1e-8
"""Bound in mm of the exact solver's answers: ten times the residuals that it proves, and of a clamp of usual size."""

_UNIT = math.radians(5.0)


@dataclass(frozen=True, slots=True)
class Rest:
    """What a solver says of a clamp: the state ``q`` that it comes to, and all states that it can come to, if told."""

    q: Array
    others: tuple[Array, ...] | None


@dataclass(frozen=True)
class Assemblies(Rows):
    """Cases, each of a shape of its own: ``shape`` (n,) are their places in the family."""

    cases: Sequence[Case]
    shape: NDArray[np.intp]


class Solver:
    """A method that keeps what it found: ``rests``, by the number of the case."""

    measures: Measures = "depth"

    def __init__(self, solve: Callable[[Case], Rest], bound: Callable[[Clamp], float]) -> None:
        self._solve, self._bound = solve, bound
        self.rests: dict[int, Rest] = {}

    def measure(self, cases: Assemblies) -> Measured:
        """Distances between the splints."""
        distance, bound = np.empty(len(cases)), np.empty(len(cases))
        for k, number in enumerate(cases.shape):
            case = cases.cases[number]
            self.rests[int(number)] = rest = self._solve(case)
            distance[k] = Section(case.clamp, Cas()).splint_distance(rest.q)
            bound[k] = self._bound(case.clamp)
        return Measured(distance, bound)


def _exact(case: Case) -> Rest:
    section = Section(case.clamp, Cas())
    state = solve_final_state(section, case.start)
    return Rest(state.q, tuple(other.q for other in equilibria(section)))


def _chords(case: Case) -> Rest:
    return Rest(solve_final_state(Section(case.clamp, Chords(_UNIT)), case.start).q, None)


def _stepped(case: Case) -> Rest:
    return Rest(solve_stepped(Section(case.clamp, Cas()), step=STEP, tilt_step=TILT_STEP).q, None)


def _chord_bound(clamp: Clamp) -> float:
    """Sagittas of the two grooves of a wire over the cosine of the steepest contact: forces add up to the bolt's."""
    up, down = clamp.up_splint, clamp.down_splint
    worst = 0.0
    for key in ("line_groove", "jumper_groove"):
        error, steepest = 0.0, 0.0
        for part, face, tilt in ((up, up.thickness, 0.0), (down, down.face_depth, down.max_tilt)):
            groove = getattr(part, key)
            half = math.acos(min(1.0, abs(groove.centre_depth - face) / groove.radius))
            error += sagitta(groove.radius, 2.0 * half / chord_count(2.0 * half, _UNIT))
            steepest = max(steepest, half + tilt)
        worst = max(worst, error / math.cos(steepest) if steepest < 0.5 * math.pi else math.inf)
    return worst


METHODS: dict[str, tuple[str, Callable[[], Solver]]] = {
    "cas": (
        "closed forms of the arc groove; its bound is that of rounding; of a clamp the exact solver, 1e-8 mm",
        lambda: Solver(_exact, lambda clamp: EXACT),
    ),
    "chords 5 deg": (
        "convex partitioning in the section, chords of 5 degrees; its bound is the chord error",
        lambda: Solver(_chords, _chord_bound),
    ),
    "stepped": (
        "of a clamp the paper's search: the down splint moves by 1/3 mm and 1 degree; its bound is the step",
        lambda: Solver(_stepped, lambda clamp: STEP),
    ),
}
