"""A family of clamps: where they come to rest by `minima`, and what the solvers make of them.

An answer's error is how far it is from rest. Of the exact solver that is the larger of what it overlaps and what it
can still fall by `Envelope`; of the others, which are not at rest by construction, how far the distance is from that
of the nearest equilibrium. A false hit is an answer that is not an equilibrium within the method's bound; a false miss
a clamp of which the exact solver did not name every firm equilibrium (`Minimum`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines import Cas
from clamp3d.bench.stress.assemblies.clamps import MAKERS, Case, snippet
from clamp3d.bench.stress.assemblies.envelope import Envelope
from clamp3d.bench.stress.assemblies.minima import Minimum, minima
from clamp3d.bench.stress.family import Family
from clamp3d.bench.stress.outcome import REFERENCE, Outcome, Wrong, examples, score
from clamp3d.bench.stress.worker import Answers, Measured, Measures, Rows, run_here
from clamp3d.clamp.assemble import STEP, TILT_STEP
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import Section
from clamp3d.clamp.stepped import solve_stepped
from clamp3d.geometry.pose import Array

EXACT = 1e-8
"""Bound in mm of the exact solver's answers: ten times the residuals that it proves, and of a clamp of usual size."""


@dataclass(frozen=True, slots=True)
class Rest:
    """A solver's answer for a clamp: the final state ``q``, and all final states where it reports them."""

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

    def __init__(self, solve: Callable[[Case], Rest], bound: float) -> None:
        self._solve, self._bound = solve, bound
        self.rests: dict[int, Rest] = {}

    def measure(self, cases: Assemblies) -> Measured:
        """Distances between the splints."""
        distance = np.empty(len(cases))
        for k, number in enumerate(cases.shape):
            case = cases.cases[number]
            self.rests[int(number)] = rest = self._solve(case)
            distance[k] = Section(case.clamp, Cas()).splint_distance(rest.q)
        return Measured(distance, np.full(len(cases), self._bound))


def _exact(case: Case) -> Rest:
    section = Section(case.clamp, Cas())
    state = solve_final_state(section, case.start)
    return Rest(state.q, tuple(other.q for other in equilibria(section)))


def _stepped(case: Case) -> Rest:
    return Rest(solve_stepped(Section(case.clamp, Cas()), step=STEP, tilt_step=TILT_STEP).q, None)


METHODS: dict[str, tuple[str, Callable[[], Solver]]] = {
    "cas": (
        "closed forms of the arc groove; its bound is that of rounding; of a clamp the exact solver, 1e-8 mm",
        lambda: Solver(_exact, EXACT),
    ),
    "stepped": (
        "of a clamp the paper's search: the down splint moves by 1/3 mm and 1 degree; its bound is the step",
        lambda: Solver(_stepped, STEP),
    ),
}


COUNTS = (
    "one clamp for 100 cases; a false hit is an answer that is not an equilibrium within the method's bound, a false "
    "miss a clamp of which the exact solver did not name every firm equilibrium, the error how far in mm an answer "
    "overlaps or can fall (of steps: is from the nearest equilibrium)"
)
"""What the counts mean for these families."""

SAME = 1.5e-6
"""Up to this part of the half width (1e-4 mm for the reference clamp) an equilibrium counts as named: twins nanometres
apart are one to a user."""

_AS_PYTHON = """
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import Section
from clamp3d.baselines.cas import Cas

section = Section(clamp, Cas())
print("closes to d =", solve_final_state(section, start).q[4], "mm")
print("equilibria, d in mm:", [float(state.q[4]) for state in equilibria(section)])
"""


class AssemblyFamily(Family):
    """A kind of clamps that are hard to close."""

    methods = METHODS
    part = 0.01

    def __init__(self, name: str, about: str, make: Callable[[np.random.Generator], Case]) -> None:
        super().__init__(name, about, lambda rng, n: Assemblies([make(rng) for _ in range(n)], np.arange(n)))

    def truths(self, cases: Assemblies) -> Truths:
        """See `Family`."""
        return Truths(cases)

    def difference(self, cases: Assemblies, truths: Truths, i: int) -> float:
        """No truth is worked out twice here."""
        return 0.0

    def ask(self, name: str, cases: Assemblies, truths: Truths, time_limit: float) -> Answers:
        """See `Family`; all solvers work in this process, and their states are kept."""
        solver = METHODS[name][1]()
        truths.rests = solver.rests
        return run_here(solver, cases, None if name == REFERENCE else time_limit)

    def judge(self, name: str, cases: Assemblies, truths: Truths, answers: Answers) -> Outcome:
        """See the module; ``answers`` are those of the last solver."""
        n = len(cases)
        d, error, missed, near = (np.full(n, np.nan) for _ in range(4))
        for i, rest in truths.rests.items():
            d[i] = rest.q[4]
            error[i], missed[i], near[i] = truths.error(i, rest), truths.missed(i, rest), truths.nearest(i, d[i])
        no_rest, miss = error > answers.bound, np.isfinite(missed)
        worst = examples("no equilibrium", np.flatnonzero(no_rest), near, d)
        worst += examples("equilibrium not named", np.flatnonzero(miss), missed, d)
        worst += examples("exception", np.flatnonzero(answers.failed), np.nan)
        size = np.array([case.clamp.down_splint.width for case in cases.cases])
        return score(self.name, name, answers, error, size, Wrong(no_rest, miss, no_rest), worst)

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        truth = ", ".join(
            repr(m.d) + (" (shallow)" if not m.firm else " (a wire slips out)" if m.slipped else "")
            for m in Truths(cases)[i][1]
        )
        return f"{snippet(cases.cases[i])}\n{_AS_PYTHON}# truth: equilibria at d = {truth} mm"


class Truths(dict[int, tuple[Envelope, list[Minimum]]]):
    """Envelope and equilibria of each case, computed on first use; ``rests`` are the answers to judge."""

    def __init__(self, cases: Assemblies) -> None:
        super().__init__()
        self.cases = cases
        self.rests: dict[int, Rest] = {}

    def __missing__(self, i: int) -> tuple[Envelope, list[Minimum]]:
        envelope = Envelope(self.cases.cases[i].clamp)
        self[i] = envelope, minima(envelope)
        return self[i]

    def nearest(self, i: int, d: float) -> float:
        """The distance of the equilibrium that is nearest to ``d``; NaN if there is none."""
        return min((rest.d for rest in self[i][1]), key=lambda other: abs(other - d), default=float("nan"))

    def error(self, i: int, rest: Rest) -> float:
        """How far an answer is from rest, mm."""
        if rest.others is None:
            return abs(self.nearest(i, float(rest.q[4])) - float(rest.q[4]))
        return max(max(self[i][0].overlap(q), self[i][0].falls(q)) for q in (rest.q, *rest.others))

    def missed(self, i: int, rest: Rest) -> float:
        """The lowest equilibrium that a solver that is to name all did not; NaN if there is none."""
        if rest.others is None:
            return float("nan")
        (envelope, rests), named = self[i], np.array([q[4] for q in rest.others])
        far = (m.d for m in rests if m.firm and not m.slipped and np.abs(named - m.d).min() > SAME * envelope.lever)
        return next(far, float("nan"))


ASSEMBLIES = {name: AssemblyFamily(name, *maker) for name, maker in MAKERS.items()}
