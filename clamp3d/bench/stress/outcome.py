"""Score of one method on one family: verdicts, errors, failures, and the worst cases.

A verdict is the sign of the distance: below 0 is a hit. It is wrong where the truth has the other sign; truths nearer
to 0 than 1e-12 of the scene (for the reference method: than its own bound) touch, and no verdict on them is wrong.
Errors are taken over all distances of methods that give depths, over the clearances of those that do not, and not at
all of methods that only say whether there is a hit. What the counts mean for whole clamps, `assemblies.family` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.bench.stress.worker import Answers, Measures
from clamp3d.geometry.pose import Array

Mask = NDArray[np.bool_]

TOUCHING = 1e-12
"""Distance from 0, in parts of the scene, up to which a case touches."""

REFERENCE = "cas"
"""The exact method of this package."""

EXAMPLES = 3


@dataclass(frozen=True, slots=True)
class Example:
    """A case that went wrong: its number in the family, what is wrong, the truth and the answer in mm."""

    case: int
    what: str
    truth: float
    answer: float


def examples(what: str, rows: ArrayLike, truth: ArrayLike, answer: ArrayLike = np.nan) -> list[Example]:
    """The first few of ``rows``, with ``truth`` and ``answer`` of all cases, or one number for all."""
    rows = np.asarray(rows, np.intp)[:EXAMPLES]
    n = int(rows.max(initial=0)) + 1
    truths, answers = (np.broadcast_to(x, n) if np.ndim(x) == 0 else np.asarray(x) for x in (truth, answer))
    return [Example(int(i), what, float(truths[i]), float(answers[i])) for i in rows]


@dataclass(frozen=True, slots=True)
class Wrong:
    """Which answers (n,) are wrong, by kind: verdicts, and errors beyond the method's own bound."""

    false_hit: Mask
    false_miss: Mask
    beyond: Mask

    def examples(self, error: Array, truth: ArrayLike, answer: Array) -> list[Example]:
        """The worst of each kind by ``error`` (n,)."""
        worst = []
        for what, mask in (
            ("false hit", self.false_hit),
            ("false miss", self.false_miss),
            ("beyond bound", self.beyond),
        ):
            rows = np.flatnonzero(mask)
            worst += examples(what, rows[np.argsort(-error[rows], kind="stable")], truth, answer)
        return worst


@dataclass(frozen=True, slots=True)
class Outcome:
    """Score of one method on one family; counts of cases, errors in mm, ``worst_relative`` in parts of the scene.

    ``refused``: the method says in words that it cannot; ``exceptions``, ``crashes`` (interpreter ended) and
    ``timeouts`` are failures. ``beyond_bound`` counts errors larger than the method's own bound (None without one) and
    ``worst_ratio`` is the largest error in parts of it.
    """

    family: str
    method: str
    cases: int
    asked: int
    answered: int
    refused: int
    false_hits: int
    false_misses: int
    beyond_bound: int | None
    worst_error: float | None
    median_error: float | None
    worst_relative: float | None
    worst_ratio: float | None
    exceptions: int
    crashes: int
    timeouts: int
    seconds: float
    notes: tuple[str, ...]
    examples: tuple[Example, ...]

    @property
    def failures(self) -> dict[str, int]:
        """What can go wrong, in words, with how often it did."""
        return {
            "false hits": self.false_hits,
            "false misses": self.false_misses,
            "exceptions": self.exceptions,
            "crashes of the interpreter": self.crashes,
            "without an answer in time": self.timeouts,
        }

    @property
    def wrong(self) -> int:
        """False hits, false misses, exceptions, crashes and questions without an answer in time."""
        return sum(self.failures.values())

    @property
    def failure_rate(self) -> float | None:
        """Share of the cases that went wrong among those it took on; None if it took on none."""
        taken = self.asked - self.refused
        return self.wrong / taken if taken else None


def score(
    family: str,
    method: str,
    answers: Answers,
    error: Array,
    size: Array,
    wrong: Wrong,
    worst: list[Example],
) -> Outcome:
    """Add up what is ``wrong``, and ``error`` (n,) mm, NaN where it does not count."""
    bounded = np.isfinite(error) & np.isfinite(answers.bound)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative, ratio = error / size, np.where(bounded, error / answers.bound, np.nan)
    return Outcome(
        family=family,
        method=method,
        cases=len(error),
        asked=int(answers.tried.sum()),
        answered=int(np.isfinite(answers.distance).sum()),
        refused=int(answers.refused.sum()),
        false_hits=int(wrong.false_hit.sum()),
        false_misses=int(wrong.false_miss.sum()),
        beyond_bound=int(wrong.beyond.sum()) if bounded.any() else None,
        worst_error=_of(np.max, error),
        median_error=_of(np.median, error),
        worst_relative=_of(np.max, relative),
        worst_ratio=_of(np.max, ratio),
        exceptions=int(answers.failed.sum()),
        crashes=len(answers.crashed),
        timeouts=len(answers.timeouts),
        seconds=answers.seconds,
        notes=tuple(answers.notes),
        examples=tuple(worst),
    )


def judge(
    family: str,
    name: str,
    size: Array,
    exact: NDArray[Any],
    answers: Answers,
    measures: Measures,
) -> Outcome:
    """Score distances; ``exact`` (n,) are long doubles, ``size`` (n,) the size of each scene in mm."""
    have = np.isfinite(answers.distance)
    # An answer that is not a number is no answer and no refusal.
    answers.failed |= answers.tried & ~have & ~answers.refused
    answers.failed[answers.crashed + answers.timeouts] = False
    error = np.abs(np.asarray(answers.distance - exact, np.float64))
    band = answers.bound if name == REFERENCE else TOUCHING * size
    decided = have & (np.abs(np.asarray(exact, np.float64)) > band)
    hit, overlap = answers.distance < 0.0, np.asarray(exact < 0, bool)
    counts = have & (measures != "verdict") & (np.asarray(exact >= 0, bool) | (measures == "depth"))
    wrong = Wrong(decided & hit & ~overlap, decided & ~hit & overlap, counts & (error > answers.bound))
    worst = wrong.examples(error, exact, answers.distance)
    worst += examples("crash", answers.crashed, exact) + examples("no answer in time", answers.timeouts, exact)
    worst += examples("exception", np.flatnonzero(answers.failed), exact)
    error = np.where(counts, error, np.nan)
    return score(family, name, answers, error, size, wrong, worst)


def _of(what: Any, values: Array) -> float | None:
    values = values[~np.isnan(values)]
    return float(what(values)) if len(values) else None
