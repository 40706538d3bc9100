"""What one method made of one family: counts of right and wrong, errors, and the worst cases.

A verdict is the sign of the distance: below 0 is a hit. It is wrong where the truth has the other sign; truths nearer
to 0 than 1e-12 of the scene (for the project's own method: than its own bound) touch, and no verdict on them is wrong.
Errors are taken over all distances of methods that give depths, over the clearances of those that do not, and not at
all of methods that only say whether there is a hit. What the counts mean for whole clamps, `assemblies.family` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.worker import Answers, Measures
from clamp3d.core.pose import Array

TOUCHING = 1e-12
"""Distance from 0, in parts of the scene, up to which a case touches."""

OWN = "cas"
"""The project's own method."""

EXAMPLES = 3


@dataclass(frozen=True, slots=True)
class Example:
    """A case that went wrong: its number in the family, what is wrong, the truth and the answer in mm."""

    case: int
    what: str
    truth: float
    answer: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """One method on one family; counts of cases, errors in mm, ``worst_relative`` in parts of the scene's size.

    ``refused``: the method says in words that it cannot; ``exceptions``, ``crashes`` (interpreter ended) and ``late``
    are failures. ``beyond_bound`` counts errors larger than the method's own bound (None without one) and
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
    late: int
    seconds: float
    notes: tuple[str, ...]
    examples: tuple[Example, ...]

    @property
    def wrong(self) -> int:
        """False hits, false misses, exceptions, crashes and questions without an answer in time."""
        return self.false_hits + self.false_misses + self.exceptions + self.crashes + self.late

    @property
    def failure_rate(self) -> float | None:
        """Share of the cases that went wrong among those it took on; None if it took on none."""
        taken = self.asked - self.refused
        return self.wrong / taken if taken else None


def judge(
    family: str,
    name: str,
    size: Array,
    exact: NDArray[Any],
    answers: Answers,
    measures: Measures,
    *,
    band: Array | None = None,
) -> Outcome:
    """Count what ``answers`` has of right and wrong; ``exact`` (n,) long doubles, ``size`` (n,) of each scene in mm.

    ``band`` (n,) mm is the distance from 0 up to which a case touches; by default as the module says.
    """
    have = np.isfinite(answers.distance)
    # An answer that is not a number is no answer and no refusal.
    failed = answers.failed | (answers.asked & ~have & ~answers.refused)
    failed[answers.crashed + answers.late] = False
    signed = np.asarray(answers.distance - exact, np.float64)
    error = np.abs(signed)
    if band is None:
        band = answers.bound if name == OWN else TOUCHING * size
    decided = have & (np.abs(np.asarray(exact, np.float64)) > band)
    hit, overlap = answers.distance < 0.0, np.asarray(exact < 0, bool)
    false_hit, false_miss = decided & hit & ~overlap, decided & ~hit & overlap
    numbers = have & (measures != "verdict") & (np.asarray(exact >= 0, bool) | (measures == "depth"))
    bounded = numbers & np.isfinite(answers.bound)
    over = bounded & (error > answers.bound)
    examples: list[Example] = []
    for what, mask in (("false hit", false_hit), ("false miss", false_miss), ("beyond bound", over)):
        rows = np.flatnonzero(mask)
        for i in rows[np.argsort(-error[rows], kind="stable")][:EXAMPLES]:
            examples.append(Example(int(i), what, float(exact[i]), float(answers.distance[i])))
    for what, lost in (("crash", answers.crashed), ("no answer in time", answers.late)):
        examples += [Example(i, what, float(exact[i]), float("nan")) for i in lost[:EXAMPLES]]
    rows = np.flatnonzero(failed)[:EXAMPLES]
    examples += [Example(int(i), "exception", float(exact[i]), float("nan")) for i in rows]
    some = bool(numbers.any())
    return Outcome(
        family=family,
        method=name,
        cases=len(exact),
        asked=int(answers.asked.sum()),
        answered=int(have.sum()),
        refused=int(answers.refused.sum()),
        false_hits=int(false_hit.sum()),
        false_misses=int(false_miss.sum()),
        beyond_bound=int(over.sum()) if bounded.any() else None,
        worst_error=float(error[numbers].max()) if some else None,
        median_error=float(np.median(error[numbers])) if some else None,
        worst_relative=float((error / size)[numbers].max()) if some else None,
        worst_ratio=float((error / answers.bound)[bounded].max()) if bounded.any() else None,
        exceptions=int(failed.sum()),
        crashes=len(answers.crashed),
        late=len(answers.late),
        seconds=answers.seconds,
        notes=tuple(answers.notes),
        examples=tuple(examples),
    )
