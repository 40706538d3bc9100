"""The stress suite: every family of hard cases put to every contact method, and what is counted.

A verdict is the sign of the distance: below 0 is a hit. It is wrong where the truth has the other sign; truths nearer
to 0 than 1e-12 of the scene (for `cas`: than its own bound) touch, and no verdict on them is wrong. Errors are taken
over all answers of `cas`, and over the clearances of methods that give no depth.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import cache
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.errors import InputError, SolverError
from clamp3d.study.stress_cases import Cases
from clamp3d.study.stress_families import FAMILIES, cases_of
from clamp3d.study.stress_methods import METHODS, method
from clamp3d.study.stress_oracle import EXTENDED_ERROR, truth, truth_50_digits
from clamp3d.study.stress_worker import Answers, run_here, run_isolated

TOUCHING = 1e-12
"""Distance from 0, in parts of the scene, up to which a case touches."""

_BLOCK = 5000
_EXAMPLES = 3
_MOST_DECIDED = 500


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


@dataclass(frozen=True, slots=True)
class StressRun:
    """A run of the suite: ``checked_50_digits`` truths per family were worked out a second time with mpmath."""

    seed: int
    n: int
    checked_50_digits: int
    worst_truth_difference: float
    machine: dict[str, str]
    outcomes: tuple[Outcome, ...]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        out = asdict(self)
        out["families"] = {o.family: FAMILIES[o.family].about for o in self.outcomes}
        out["methods"] = {o.method: METHODS[o.method][0] for o in self.outcomes}
        for row, outcome in zip(out["outcomes"], self.outcomes, strict=True):
            row["failure_rate"] = outcome.failure_rate
        return out


def machine() -> dict[str, str]:
    """What the figures were taken on."""
    from importlib.metadata import PackageNotFoundError, version

    found = {"system": f"{platform.system()} {platform.machine()}", "processor": _processor()}
    found |= {"cores": str(os.cpu_count()), "python": platform.python_version()}
    for name in ("numpy", "numba", "scipy", "python-fcl", "coacd", "mpmath"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def judge(family: str, name: str, cases: Cases, exact: NDArray[Any], answers: Answers) -> Outcome:
    """Count what ``answers`` has of right and wrong; ``exact`` (n,) long doubles."""
    have = np.isfinite(answers.distance)
    # An answer that is not a number is no answer and no refusal.
    failed = answers.failed | (answers.asked & ~have & ~answers.refused)
    failed[answers.crashed + answers.late] = False
    signed = np.asarray(answers.distance - exact, np.float64)
    error = np.abs(signed)
    size = cases.scene()
    band = answers.bound if name == "cas" else TOUCHING * size
    decided = have & (np.abs(np.asarray(exact, np.float64)) > band)
    hit, overlap = answers.distance < 0.0, np.asarray(exact < 0, bool)
    false_hit, false_miss = decided & hit & ~overlap, decided & ~hit & overlap
    numbers = have & (np.asarray(exact >= 0, bool) | _has_depth(name))
    bounded = numbers & np.isfinite(answers.bound)
    over = bounded & (error > answers.bound)
    examples: list[Example] = []
    for what, mask in (("false hit", false_hit), ("false miss", false_miss), ("beyond bound", over)):
        rows = np.flatnonzero(mask)
        for i in rows[np.argsort(-error[rows], kind="stable")][:_EXAMPLES]:
            examples.append(Example(int(i), what, float(exact[i]), float(answers.distance[i])))
    for what, lost in (("crash", answers.crashed), ("no answer in time", answers.late)):
        examples += [Example(i, what, float(exact[i]), float("nan")) for i in lost[:_EXAMPLES]]
    rows = np.flatnonzero(failed)[:_EXAMPLES]
    examples += [Example(int(i), "exception", float(exact[i]), float("nan")) for i in rows]
    some = bool(numbers.any())
    return Outcome(
        family=family,
        method=name,
        cases=len(cases),
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


@cache
def _has_depth(name: str) -> bool:
    return method(name).depth


def _exact(cases: Cases) -> NDArray[Any]:
    """Truths (n,). Where the quick search and the kernel differ, 50 digits decide: the search can miss a minimum."""
    n = len(cases)
    exact = np.concatenate([truth(cases.take(np.arange(i, min(i + _BLOCK, n)))) for i in range(0, n, _BLOCK)])
    kernel = run_here("cas", cases)
    differ = np.flatnonzero(~(np.abs(np.asarray(kernel.distance - exact, np.float64)) <= kernel.bound))
    for i in differ[:_MOST_DECIDED]:
        high = truth_50_digits(cases, int(i))
        exact[i] = np.longdouble(float(high)) + np.longdouble(float(high - float(high)))
    return exact


def run_family(
    family: str, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
) -> tuple[list[Outcome], float]:
    """All methods on one family, and the worst difference of ``check`` truths from their 50 digits, by scene.

    `cas` is the project's own and answers in this process; the others work in children.
    """
    cases = cases_of(family, n, seed)
    exact = _exact(cases)
    size = cases.scene()
    worst = 0.0
    for i in np.linspace(0, n - 1, min(check, n)).astype(int):
        high = float(exact[i])  # the long double as the sum of two floats, which mpmath takes to the last bit
        difference = truth_50_digits(cases, int(i)) - high - float(exact[i] - np.longdouble(high))
        worst = max(worst, abs(float(difference)) / float(size[i]))
    outcomes = []
    for name in methods:
        if name == "cas":
            answers = run_here(name, cases)
        else:
            answers = run_isolated(name, family, cases, seed, time_limit=time_limit)
        outcomes.append(judge(family, name, cases, exact, answers))
    return outcomes, worst


def run_stress(
    families: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    *,
    n: int = 1000,
    seed: int = 0,
    check: int = 20,
    time_limit: float = 60.0,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> StressRun:
    """Put ``families`` (all by default) to ``methods`` (all by default), n cases each.

    ``check`` truths per family are worked out again at 50 digits; ``time_limit`` seconds are given to each other
    method per family; ``workers`` processes share the families. ``progress`` is told the family that is done, how many
    are, and of how many. The result does not depend on ``workers``, up to times.
    Raises InputError for unknown names and numbers that are not positive.
    """
    families = list(FAMILIES if families is None else families)
    methods = list(METHODS if methods is None else methods)
    for given, known, what in ((families, FAMILIES, "family"), (methods, METHODS, "method")):
        for name in given:
            if name not in known:
                raise InputError(f"unknown {what} {name!r}; available: {', '.join(known)}")
    for label, value, least in (("n", n, 1), ("seed", seed, 0), ("check", check, 0), ("workers", workers, 1)):
        if value < least:
            raise InputError(f"{label} must be at least {least}, got {value}")
    found: dict[str, tuple[list[Outcome], float]] = {}

    def done(family: str, result: tuple[list[Outcome], float]) -> None:
        found[family] = result
        if progress is not None:
            progress(family, len(found), len(families))

    if workers == 1:
        for family in families:
            done(family, run_family(family, methods, n, seed, time_limit, check))
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            waiting = {pool.submit(run_family, f, methods, n, seed, time_limit, check): f for f in families}
            try:
                for future in as_completed(waiting):
                    done(waiting[future], future.result())
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    outcomes = tuple(o for family in families for o in found[family][0])
    worst = max(difference for _, difference in found.values())
    if worst > EXTENDED_ERROR:
        raise SolverError(f"the truth itself is off by {worst:.3g} of the scene, must be <= {EXTENDED_ERROR:.3g}")
    return StressRun(seed, n, check, worst, machine(), outcomes)
