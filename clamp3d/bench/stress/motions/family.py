"""Families of hard motions: how their truths are found, and what is asked of the first contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clamp3d.bench.stress.family import Family
from clamp3d.bench.stress.motions.cases import Motions, poses
from clamp3d.bench.stress.motions.families import MAKERS
from clamp3d.bench.stress.motions.methods import METHODS, CasMethod
from clamp3d.bench.stress.motions.truth import TRUTH_ERROR, Least, truth
from clamp3d.bench.stress.outcome import REFERENCE, Outcome
from clamp3d.bench.stress.poses.cases import Cases
from clamp3d.bench.stress.poses.truth import truth_50_digits as pose_truth
from clamp3d.bench.stress.worker import Answers, run_here

_MOST_DECIDED = 500


@dataclass(frozen=True, slots=True)
class Truths:
    """The least distances of all cases, and what the reference method said: the truths look at its places too."""

    least: Least
    reference: CasMethod
    answers: Answers


class MotionFamily(Family):
    """A kind of difficulty of motions. The truth of a case is its least distance; a hit is one below 0."""

    methods = METHODS
    truth_error = TRUTH_ERROR

    def truths(self, cases: Motions) -> Truths:
        """Where `sweep` is lower, the pose that it names decides, at 50 digits: the search can miss a minimum."""
        reference = CasMethod()
        answers = run_here(reference, cases)
        named = reference.instants(len(cases))
        least = truth(cases, hints=named)
        for i in np.flatnonzero(answers.distance < least.distance - answers.bound)[:_MOST_DECIDED]:
            least.distance[i] = min(least.distance[i], _at(cases, int(i), float(named[i, 0])))
        return Truths(least, reference, answers)

    def difference(self, cases: Motions, truths: Truths, i: int) -> float:
        """See `Family`: at 50 digits of the pose at the instant that was found."""
        least = truths.least
        return abs(_at(cases, i, float(least.instant[i])) - float(least.distance[i])) / float(cases.scene()[i])

    def ask(self, name: str, cases: Motions, truths: Truths, time_limit: float) -> Answers:
        """See `Family`; the reference has answered already, and its first contacts are judged too."""
        if name != REFERENCE:
            return super().ask(name, cases, truths, time_limit)
        check_first_contacts(cases, truths.least, truths.reference, truths.answers)
        return truths.answers

    def judge(self, name: str, cases: Motions, truths: Truths, answers: Answers) -> Outcome:
        """See `Family`."""
        return super().judge(name, cases, truths.least.distance, answers)

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        least = truth(cases.take([i]))
        return (
            f"{cases.snippet(i)}\n# truth: least {float(least.distance[0])!r} mm at instant {float(least.instant[0])!r}"
        )


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
        until = truth(cases.take(rows), until=instant[rows], hints=instant[rows, None]).distance
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


MOTIONS = {name: MotionFamily(name, *made) for name, made in MAKERS.items()}
