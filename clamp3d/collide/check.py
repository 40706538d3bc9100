"""Check a scene: near pairs from the broad phase, each up the ladder until its verdict is certain."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clamp3d.checks import flag, function, instance
from clamp3d.collide.bounds import Bounds, Verdict
from clamp3d.collide.broad import Boxes, box_gaps, near_pairs
from clamp3d.collide.ladder import as_row, climb, contained, every_rung, verdict_of
from clamp3d.collide.model import FINEST, Ledger, Model, Progress, Workshop
from clamp3d.collide.result import CheckResult, PairResult, Work
from clamp3d.collide.scene import Scene, name_pairs
from clamp3d.collide.sweep import check_motions
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError, SolverError


def check(
    scene: Scene,
    *,
    pairs: Sequence[tuple[str, str]] | None = None,
    full: bool = False,
    progress: Progress | None = None,
    workshop: Workshop | None = None,
) -> CheckResult:
    """Verdicts of all pairs of ``scene``, or of ``pairs`` (names), at rest and in its motions.

    ``full`` asks every model at its finest for every pair, none left out: slow, for comparison; it raises SolverError
    should two of them contradict each other. ``progress(stage, done, of)`` is told what happens. A ``workshop`` keeps
    models from one check to the next. Raises InputError for unknown names.
    """
    instance("scene", scene, Scene)
    if workshop is not None:
        instance("workshop", workshop, Workshop)
    full = flag("full", full)
    function("progress", progress)
    shop = workshop or Workshop()
    began = time.perf_counter()
    models = [shop.model(part.shape) for part in scene.parts]
    n = len(models)
    T = np.array([part.T_world for part in scene.parts]).reshape(n, 4, 4)
    boxes = Boxes.of(np.array([m.bounds for m in models]).reshape(n, 2, 3), T)
    asked = None if pairs is None else _asked(scene, pairs)
    every = n * (n - 1) // 2 if asked is None else len(asked)
    if full:
        chosen = np.array(list(itertools.combinations(range(n), 2)) if asked is None else asked, dtype=np.int64)
    else:
        chosen = near_pairs(boxes, scene.thresholds.reach)
        if asked is not None:
            keep = set(asked)
            chosen = np.array([p for p in chosen.tolist() if tuple(p) in keep], dtype=np.int64)
    chosen = chosen.reshape(-1, 2)
    gaps = box_gaps(boxes, chosen)
    ledger = shop.ledger
    ledger.queries["boxes"] += len(chosen)
    ledger.seconds["broad phase"] += time.perf_counter() - began
    began = time.perf_counter()
    rows, decided = [], Counter({"broad phase": every - len(chosen)})
    for k, ((i, j), gap) in enumerate(zip(chosen.tolist(), gaps.tolist(), strict=True)):
        if progress is not None:
            progress("pairs", k, len(chosen))
        row = _pair(scene, i, j, models, T, Bounds(gap), full, ledger)
        decided[row.rung] += 1
        rows.append(row)
    ledger.seconds["pairs"] += time.perf_counter() - began
    moved: tuple[PairResult, ...] = ()
    if scene.motions:
        began = time.perf_counter()
        moved = check_motions(scene, models, asked, ledger, progress)
        ledger.seconds["motions"] += time.perf_counter() - began
    work = _work(shop, scene, every, len(chosen), decided, full)
    names = None if asked is None else tuple((scene.parts[i].name, scene.parts[j].name) for i, j in asked)
    return CheckResult(scene, tuple(rows), moved, names, work)


def check_full(scene: Scene, ladder: CheckResult, *, progress: Progress | None = None) -> CheckResult:
    """Everything modelled at one fixed fidelity, every pair asked, compared with the ladder's result.

    Raises SolverError naming the first pair whose verdict is not the same.
    """
    result = check(replace(scene, motions=()), pairs=ladder.asked, full=True, progress=progress)
    seen = {(row.a, row.b): row.verdict for row in ladder.pairs}
    for row in result.pairs:
        verdict = seen.get((row.a, row.b), Verdict.CLEAR)
        if verdict is not row.verdict:
            raise SolverError(
                f"pair {row.a}:{row.b}: the ladder says {verdict.value}, the full model {row.verdict.value} "
                f"({row.low:.9g} to {row.high:.9g} mm)"
            )
    return result


def _asked(scene: Scene, pairs: Sequence[tuple[str, str]]) -> list[tuple[int, int]]:
    found = set()
    for a, b in name_pairs("pairs", pairs):
        i, j = sorted((scene.index(a), scene.index(b)))
        if i == j:
            raise InputError(f"pair {a}:{b} must name two different parts")
        found.add((i, j))
    return sorted(found)


def _pair(
    scene: Scene, i: int, j: int, models: list[Model], T: Array, start: Bounds, full: bool, ledger: Ledger
) -> PairResult:
    a, b = scene.parts[i].name, scene.parts[j].name
    allowance, thresholds = scene.allowance(a, b), scene.thresholds
    T_ab = inverse(T[i]) @ T[j]

    def certain(bounds: Bounds) -> bool:
        return verdict_of(bounds, thresholds, allowance) is not Verdict.UNCERTAIN

    if full:
        answer = every_rung(models[i], models[j], T_ab, start, thresholds, ledger)
    else:
        answer = climb(models[i], models[j], T_ab, start, thresholds, certain, ledger)
    verdict = verdict_of(answer.bounds, thresholds, allowance)
    if verdict is Verdict.CLASH and contained(models[i], models[j], T_ab, thresholds, ledger):
        verdict = Verdict.CONTAINED
    return as_row(a, b, verdict, answer, T[i])


def _work(shop: Workshop, scene: Scene, pairs: int, candidates: int, decided: Counter[str], full: bool) -> Work:
    ledger = shop.ledger
    used: NDArray[np.int64] = np.array([m.triangles_at(FINEST) for m in shop.models], dtype=np.int64)
    return Work(
        parts=len(scene.parts),
        shapes=len(shop.models),
        pairs=pairs,
        candidates=candidates,
        meshes=ledger.meshes,
        triangles=ledger.triangles,
        hulls=ledger.hulls,
        fits=ledger.fits,
        queries=dict(ledger.queries),
        decided={k: v for k, v in decided.items() if v},
        seconds={k: round(v, 6) for k, v in ledger.seconds.items()},
        fixed_error=FINEST,
        fixed_meshes=len(shop.models),
        fixed_triangles=int(used.sum()),
        fixed_queries=pairs,
        full=full,
    )
