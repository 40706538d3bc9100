"""The stress suite: every family of hard cases put to every contact method, and what is counted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from typing import Any

from clamp3d.bench.machine import Machine, machine
from clamp3d.bench.stress.assemblies.family import ASSEMBLIES
from clamp3d.bench.stress.family import Family
from clamp3d.bench.stress.motions import MOTIONS
from clamp3d.bench.stress.outcome import Outcome
from clamp3d.bench.stress.poses.family import POSES
from clamp3d.bench.stress.poses.flat import FLATS
from clamp3d.errors import InputError, SolverError
from clamp3d.files.child import end_with_parent

LIBRARIES = ("numpy", "numba", "scipy", "python-fcl", "coacd", "mpmath")

KINDS: dict[str, Mapping[str, Family]] = {
    "pose": POSES,
    "flat": FLATS,
    "motion": MOTIONS,
    "assembly": ASSEMBLIES,
}
"""Kind -> its families by name."""

FAMILIES: dict[str, Family] = {name: family for kind in KINDS.values() for name, family in kind.items()}

METHODS: dict[str, str] = {name: about for f in FAMILIES.values() for name, (about, _) in f.methods.items()}
"""Name -> what it is."""


def expand(names: list[str]) -> list[str]:
    """Families by name; ``pose``, ``flat``, ``motion`` and ``assembly`` stand for their kind.

    >>> expand(["ties", "motion"])[:2]
    ['ties', 'motion: grazing']
    """
    return [family for name in names for family in KINDS.get(name, [name])]


@dataclass(frozen=True, slots=True)
class StressRun:
    """A run of the suite: ``checked_50_digits`` truths per family were worked out a second time with mpmath."""

    seed: int
    n: int
    checked_50_digits: int
    worst_truth_difference: float
    machine: Machine
    outcomes: tuple[Outcome, ...]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        out = asdict(self)
        out["families"] = {o.family: FAMILIES[o.family].about for o in self.outcomes}
        out["methods"] = {o.method: METHODS[o.method] for o in self.outcomes}
        for row, outcome in zip(out["outcomes"], self.outcomes, strict=True):
            row["failure_rate"] = outcome.failure_rate
            for example in row["examples"]:  # a number that is none is null in JSON
                example |= {key: None for key in ("truth", "answer") if not math.isfinite(example[key])}
        return out


def run_family(
    family: str, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
) -> tuple[list[Outcome], float]:
    """Those of ``methods`` that it can be put to on one family, and the worst difference of ``check`` truths."""
    chosen = FAMILIES[family]
    return chosen.run(
        [m for m in methods if m in chosen.methods], max(1, int(n * chosen.part)), seed, time_limit, check
    )


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
    """Put ``families`` (all by default, see `expand`) to ``methods`` (all by default), n cases each.

    ``check`` truths per family are worked out again at 50 digits; ``time_limit`` seconds are given to each other
    method per family; ``workers`` processes share the families. ``progress`` gets the family that is done, how many
    are, and of how many. The result does not depend on ``workers``, up to times.
    Raises InputError for unknown names and numbers that are not positive.
    """
    families = list(FAMILIES) if families is None else expand(list(families))
    methods = list(METHODS if methods is None else methods)
    for names, available, what in ((families, {**KINDS, **FAMILIES}, "family"), (methods, METHODS, "method")):
        for name in names:
            if name not in available:
                raise InputError(f"unknown {what} {name!r}; available: {', '.join(available)}")
    for label, value, least in (("n", n, 1), ("seed", seed, 0), ("check", check, 0), ("workers", workers, 1)):
        if value < least:
            raise InputError(f"{label} must be at least {least}, got {value}")
    results: dict[str, tuple[list[Outcome], float]] = {}

    def done(family: str, result: tuple[list[Outcome], float]) -> None:
        results[family] = result
        if progress is not None:
            progress(family, len(results), len(families))

    if workers == 1:
        for family in families:
            done(family, run_family(family, methods, n, seed, time_limit, check))
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=end_with_parent) as pool:
            waiting = {pool.submit(run_family, f, methods, n, seed, time_limit, check): f for f in families}
            try:
                for future in as_completed(waiting):
                    done(waiting[future], future.result())
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    outcomes = tuple(o for family in families for o in results[family][0])
    for family, (_, off) in results.items():
        allowed = FAMILIES[family].truth_error
        if off > allowed:
            raise SolverError(f"{family}: the truth itself is off by {off:.3g} of the scene, must be <= {allowed:.3g}")
    worst = max(difference for _, difference in results.values())
    return StressRun(seed, n, check, worst, machine(LIBRARIES), outcomes)
