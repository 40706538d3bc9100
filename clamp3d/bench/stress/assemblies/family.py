"""A family of clamps: where they come to rest by `minima`, and what the solvers make of them.

An answer's error is how far it is from rest. Of the exact solver that is the larger of what it overlaps and what it
can still fall by `Envelope`; of the others, which are not at rest by construction, how far the distance is from that
of the nearest place of rest. A false hit is an answer that is no place of rest within the method's bound; a false miss
a clamp of which the exact solver did not name every firm place of rest (`Minimum`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.bench.stress.assemblies.clamps import MAKERS, snippet
from clamp3d.bench.stress.assemblies.envelope import Envelope
from clamp3d.bench.stress.assemblies.methods import METHODS, Assemblies, Rest, Solver, method
from clamp3d.bench.stress.assemblies.minima import Minimum, minima
from clamp3d.bench.stress.family import generator
from clamp3d.bench.stress.outcome import EXAMPLES, OWN, Example, Outcome
from clamp3d.bench.stress.worker import Answers, run_here

COUNTS = (
    "one clamp for 100 cases; a false hit is an answer that is no place of rest within the method's bound, a false "
    "miss a clamp of which the exact solver did not name every firm place of rest, the error how far in mm an answer "
    "overlaps or can fall (of chords and steps: is from the nearest place of rest)"
)
"""What the counts mean for these families."""

SAME = 1.5e-6
"""Up to this part of the half width (1e-4 mm for the reference clamp) a place of rest counts as named: twins nanometres
apart are one to a user."""

_AS_PYTHON = """
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import Section
from clamp3d.baselines.cas import Cas

section = Section(clamp, Cas())
print("comes to rest at d =", solve_final_state(section, start).q[4], "mm")
print("places of rest, d in mm:", [float(state.q[4]) for state in equilibria(section)])
"""


@dataclass(frozen=True, slots=True)
class AssemblyFamily:
    """A kind of clamps that are hard to close. See `Family`."""

    name: str
    about: str
    part: float = 0.01
    truth_error: float = 0.0

    @property
    def methods(self) -> Mapping[str, str]:
        """See `Family`."""
        return {name: about for name, (about, _) in METHODS.items()}

    def cases(self, n: int, seed: int) -> Assemblies:
        """The n cases of a seed: always the same ones."""
        rng = generator(self.name, seed)
        return Assemblies([MAKERS[self.name][1](rng) for _ in range(n)], np.arange(n))

    def run(
        self, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
    ) -> tuple[list[Outcome], float]:
        """See `Family`. No truth is worked out twice here: the difference is 0."""
        cases = self.cases(n, seed)
        truths = _Truths(cases)
        outcomes = []
        for name in methods:
            asked = method(name)
            answers = run_here(asked, cases, None if name == OWN else time_limit)
            outcomes.append(self._judge(name, asked, answers, truths))
        return outcomes, 0.0

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        truth = ", ".join(repr(m.d) + ("" if m.firm else " (shallow)") for m in _Truths(cases)[i])
        return f"{snippet(cases.cases[i])}\n{_AS_PYTHON}# truth: places of rest at d = {truth} mm"

    def _judge(self, name: str, asked: Solver, answers: Answers, truths: _Truths) -> Outcome:
        n = len(answers.distance)
        error, missed = np.full(n, np.nan), np.full(n, np.nan)
        for i, rest in asked.rests.items():
            error[i], missed[i] = _error(truths, i, rest), _missed(truths, i, rest)
        have = np.isfinite(error)
        no_rest = have & (error > answers.bound)
        miss = np.isfinite(missed)
        examples = [
            Example(i, "no place of rest", truths.nearest(i, float(asked.rests[i].q[4])), float(asked.rests[i].q[4]))
            for i in np.flatnonzero(no_rest)[:EXAMPLES].tolist()
        ]
        examples += [
            Example(i, "place of rest not named", float(missed[i]), float(asked.rests[i].q[4]))
            for i in np.flatnonzero(miss)[:EXAMPLES].tolist()
        ]
        examples += [
            Example(int(i), "exception", float("nan"), float("nan")) for i in np.flatnonzero(answers.failed)[:EXAMPLES]
        ]
        size = np.array([case.clamp.down_splint.width for case in truths.cases.cases])
        bounded = have & np.isfinite(answers.bound)
        return Outcome(
            family=self.name,
            method=name,
            cases=n,
            asked=int(answers.asked.sum()),
            answered=int(have.sum()),
            refused=int(answers.refused.sum()),
            false_hits=int(no_rest.sum()),
            false_misses=int(miss.sum()),
            beyond_bound=int(no_rest.sum()),
            worst_error=_of(max, error[have]),
            median_error=_of(np.median, error[have]),
            worst_relative=_of(max, (error / size)[have]),
            worst_ratio=_of(max, (error / answers.bound)[bounded]),
            exceptions=int(answers.failed.sum()),
            crashes=0,
            late=0,
            seconds=answers.seconds,
            notes=tuple(answers.notes),
            examples=tuple(examples),
        )


class _Truths:
    """Places of rest of each case, worked out when first asked for."""

    def __init__(self, cases: Assemblies) -> None:
        self.cases = cases
        self.envelopes: dict[int, Envelope] = {}
        self._found: dict[int, list[Minimum]] = {}

    def envelope(self, i: int) -> Envelope:
        if i not in self.envelopes:
            self.envelopes[i] = Envelope(self.cases.cases[i].clamp)
        return self.envelopes[i]

    def __getitem__(self, i: int) -> list[Minimum]:
        if i not in self._found:
            self._found[i] = minima(self.envelope(i))
        return self._found[i]

    def nearest(self, i: int, d: float) -> float:
        return min((found.d for found in self[i]), key=lambda found: abs(found - d), default=float("nan"))


def _error(truths: _Truths, i: int, rest: Rest) -> float:
    if rest.others is None:
        return abs(truths.nearest(i, float(rest.q[4])) - float(rest.q[4]))
    envelope = truths.envelope(i)
    return max(max(envelope.overlap(q), envelope.falls(q)) for q in (rest.q, *rest.others))


def _missed(truths: _Truths, i: int, rest: Rest) -> float:
    """The lowest place of rest that a solver that is to name all did not; NaN if there is none."""
    if rest.others is None:
        return float("nan")
    named, same = np.array([q[4] for q in rest.others]), SAME * truths.envelope(i).lever
    return next((m.d for m in truths[i] if m.firm and np.abs(named - m.d).min() > same), float("nan"))


def _of(what: Any, values: Any) -> float | None:
    return float(what(values)) if len(values) else None


ASSEMBLIES: dict[str, AssemblyFamily] = {name: AssemblyFamily(name, about) for name, (about, _) in MAKERS.items()}
