"""A family of hard motions: how its truths are found, and how methods are put to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from clamp3d.bench.stress.family import generator
from clamp3d.bench.stress.motions.cases import Motions, poses
from clamp3d.bench.stress.motions.methods import METHODS, CasMethod, method
from clamp3d.bench.stress.motions.truth import TRUTH_ERROR, Least, truth, truth_50_digits
from clamp3d.bench.stress.outcome import OWN, Outcome, judge
from clamp3d.bench.stress.poses.cases import Cases
from clamp3d.bench.stress.poses.truth import truth_50_digits as pose_truth
from clamp3d.bench.stress.worker import Answers, run_here, run_isolated

Generator = Callable[[np.random.Generator, int], Motions]

_MOST_DECIDED = 500


@dataclass(frozen=True, slots=True)
class MotionFamily:
    """A kind of difficulty of motions: ``make(rng, n)`` builds n cases. See `Family`.

    The truth of a case is its least distance; a hit is one below 0.
    """

    name: str
    about: str
    make: Generator
    part: float = 1.0
    truth_error: float = TRUTH_ERROR

    @property
    def methods(self) -> Mapping[str, str]:
        """See `Family`."""
        return {name: about for name, (about, _) in METHODS.items()}

    def cases(self, n: int, seed: int) -> Motions:
        """The n cases for a seed: always the same ones.

        >>> from clamp3d.bench.stress.motions.families import MOTIONS
        >>> bool((MOTIONS["motion: grazing"].cases(3, 0).start == MOTIONS["motion: grazing"].cases(3, 0).start).all())
        True
        """
        return self.make(generator(self.name, seed), n)

    def run(
        self, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
    ) -> tuple[list[Outcome], float]:
        """See `Family`. `cas` answers in this process, its first contacts are judged too; others work in children."""
        cases = self.cases(n, seed)
        # What the project's own method takes for the lowest instant is looked at by the truth's own means.
        own = CasMethod()
        answers = run_here(own, cases)
        exact = _exact(cases, own, answers)
        size = cases.scene()
        worst = 0.0
        for i in np.linspace(0, n - 1, min(check, n)).astype(int):
            difference = float(truth_50_digits(cases, int(i), exact) - exact.distance[i])
            worst = max(worst, abs(difference) / float(size[i]))
        outcomes = []
        for name in methods:
            if name == OWN:
                check_first_contacts(cases, exact, own, answers)
            else:
                answers = run_isolated(partial(method, name), cases, time_limit=time_limit)
            outcomes.append(judge(self.name, name, size, exact.distance, answers, method(name).measures))
        return outcomes, worst

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        one = cases.take([i])
        found = truth(one)
        least = float(truth_50_digits(one, 0, found))
        return f"{cases.snippet(i)}\n# truth: least {least!r} mm at instant {float(found.instant[0])!r}"


def _exact(cases: Motions, own: CasMethod, answers: Answers) -> Least:
    """Truths. Where `sweep` is lower, the pose that it names decides, at 50 digits: the search can miss a minimum."""
    named = own.instants(len(cases))
    exact = truth(cases, hints=named)
    for i in np.flatnonzero(answers.distance < exact.distance - answers.bound)[:_MOST_DECIDED]:
        exact.distance[i] = min(exact.distance[i], _at(cases, int(i), float(named[i, 0])))
    return exact


def _at(cases: Motions, i: int, instant: float) -> float:
    """Distance of case i at an instant, at 50 digits of the pose there, which is rounded."""
    k = cases.shape[i : i + 1]
    return float(pose_truth(Cases(cases.shapes, k, poses(cases, i, np.array([instant])), np.full(1, np.nan)), 0))


def check_first_contacts(cases: Motions, exact: Least, asked: CasMethod, answers: Answers) -> None:
    """Count each wrong answer of `first_contact` as a failure of its case.

    It must touch if and only if the truth does (unless that is within the bound of 0); the instant that it names must
    be one of contact, with no contact before it: the least distance of the motion that ends there is 0, within the
    bound, or the start is in contact.
    """
    touches, instant, at = asked.first_contacts(len(cases))
    bound = answers.bound
    have = np.isfinite(answers.distance)
    decided = have & (np.abs(exact.distance) > bound)
    flaws = {
        "first_contact: a hit that is none": decided & touches & (exact.distance > 0),
        "first_contact: a hit missed": decided & ~touches & (exact.distance < 0),
        "first_contact and sweep differ": have & ~touches & ~(np.abs(at - answers.distance) <= bound),
    }
    rows = np.flatnonzero(have & touches)
    if len(rows):
        until = truth(cases.take(rows), until=instant[rows], hints=instant[rows, None], cells=300).distance
        moved = instant[rows] > 0.0
        late, early = np.zeros(len(cases), bool), np.zeros(len(cases), bool)
        late[rows] = moved & (until < -bound[rows])
        for i in rows[until > bound[rows]]:
            early[i] = _at(cases, int(i), float(instant[i])) > bound[i]
        flaws["first_contact: in contact before"] = late
        flaws["first_contact: not yet in contact"] = early
    for what, mask in flaws.items():
        if mask.any():
            answers.failed |= mask
            answers.note(f"{what}: {int(mask.sum())}, first case {int(np.flatnonzero(mask)[0])}")
