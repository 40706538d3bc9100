"""Check a scene: near pairs from the broad phase, each refined until its verdict is certain."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clamp3d.checks import flag, function, instance
from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes, box_gaps, near_pairs
from clamp3d.collide.model import FINEST, Model, ModelCache, Progress
from clamp3d.collide.motions import check_motions
from clamp3d.collide.refine import contained, every_level, measured, refine, with_normal
from clamp3d.collide.result import CheckResult, PairResult, Work
from clamp3d.collide.scene import Scene, name_pairs
from clamp3d.collide.verdict import Verdict
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError, SolverError


def check(
    scene: Scene,
    *,
    pairs: Sequence[tuple[str, str]] | None = None,
    full: bool = False,
    distances: bool = False,
    progress: Progress | None = None,
    cache: ModelCache | None = None,
) -> CheckResult:
    """Verdicts of all pairs of a scene, at rest and in its motions.

    Parameters
    ----------
    scene : Scene
        Parts, thresholds, allowed contacts and motions.
    pairs : sequence of (str, str), optional
        Names of the pairs to look at; all by default.
    full : bool
        Ask every model at its finest for every pair, none left out: slow, for comparison.
    distances : bool
        Measure every pair to `clamp3d.collide.distance.ACCURACY`, not only until its verdict is certain.
    progress : callable, optional
        Is told (stage, done, of).
    cache : ModelCache, optional
        Keeps models from one check to the next.

    Returns
    -------
    CheckResult
        Rows with verdict and distance; pairs that never came near are clear and have no row, unless ``distances``.

    Raises
    ------
    InputError
        For unknown names.
    SolverError
        If two models contradict each other (``full``).

    Examples
    --------
    >>> from clamp3d.core import shapes
    >>> from clamp3d.core.pose import translation
    >>> scene = Scene().add("a", shapes.box((10, 10, 10))).add("b", shapes.cylinder(3, 10), translation(0, 0, 9))
    >>> check(scene)
    CheckResult('scene': not clean; 1 clash)
    """
    instance("scene", scene, Scene)
    if cache is not None:
        instance("cache", cache, ModelCache)
    full, distances = flag("full", full), flag("distances", distances)
    function("progress", progress)
    shop = cache or ModelCache()
    began = time.perf_counter()
    models = [shop.model(part.shape) for part in scene.parts]
    n = len(models)
    T = np.array([part.T_world for part in scene.parts]).reshape(n, 4, 4)
    boxes = Boxes.of(np.array([m.bounds for m in models]).reshape(n, 2, 3), T)
    asked = None if pairs is None else _asked(scene, pairs)
    every = n * (n - 1) // 2 if asked is None else len(asked)
    if full or distances:
        chosen = np.array(list(itertools.combinations(range(n), 2)) if asked is None else asked, dtype=np.int64)
    else:
        chosen = near_pairs(boxes, scene.thresholds.reach)
        if asked is not None:
            keep = set(asked)
            chosen = np.array([p for p in chosen.tolist() if tuple(p) in keep], dtype=np.int64)
    chosen = chosen.reshape(-1, 2)
    gaps = box_gaps(boxes, chosen)
    counters = shop.counters
    counters.queries["boxes"] += len(chosen)
    counters.seconds["broad phase"] += time.perf_counter() - began
    began = time.perf_counter()
    rows, decided = [], Counter({"broad phase": every - len(chosen)})
    for k, ((i, j), gap) in enumerate(zip(chosen.tolist(), gaps.tolist(), strict=True)):
        if progress is not None:
            progress("pairs", k, len(chosen))
        start = Distance(gap, level="boxes", method="bounding boxes")
        row = _pair(scene, i, j, models, T, start, full, distances)
        decided[row.distance.level] += 1
        rows.append(row)
    counters.seconds["pairs"] += time.perf_counter() - began
    moved: tuple[PairResult, ...] = ()
    if scene.motions:
        began = time.perf_counter()
        moved = check_motions(scene, models, asked, counters, progress)
        counters.seconds["motions"] += time.perf_counter() - began
    work = _work(shop, scene, every, len(chosen), decided, full)
    names = None if asked is None else tuple((scene.parts[i].name, scene.parts[j].name) for i, j in asked)
    return CheckResult(scene, tuple(rows), moved, names, work)


def check_full(scene: Scene, result: CheckResult, *, progress: Progress | None = None) -> CheckResult:
    """Everything modelled at one fixed fidelity, every pair asked, compared with ``result``.

    Raises SolverError naming the first pair whose verdict is not the same.
    """
    complete = check(replace(scene, motions=()), pairs=result.asked, full=True, progress=progress)
    seen = {(row.a, row.b): row.verdict for row in result.pairs}
    for row in complete.pairs:
        verdict = seen.get((row.a, row.b), Verdict.CLEAR)
        if verdict is not row.verdict:
            raise SolverError(
                f"pair {row.a}:{row.b}: the check says {verdict.value}, the full model {row.verdict.value} "
                f"({row.distance.lower:.9g} to {row.distance.upper:.9g} mm)"
            )
    return complete


def _asked(scene: Scene, pairs: Sequence[tuple[str, str]]) -> list[tuple[int, int]]:
    found = set()
    for a, b in name_pairs("pairs", pairs):
        i, j = sorted((scene.index(a), scene.index(b)))
        if i == j:
            raise InputError(f"pair {a}:{b} must name two different parts")
        found.add((i, j))
    return sorted(found)


def _pair(
    scene: Scene, i: int, j: int, models: list[Model], T: Array, start: Distance, full: bool, distances: bool
) -> PairResult:
    a, b = scene.parts[i].name, scene.parts[j].name
    allowance, thresholds = scene.allowance(a, b), scene.thresholds
    T_ab = inverse(T[i]) @ T[j]

    def certain(known: Distance) -> bool:
        return thresholds.verdict(known, allowance) is not Verdict.UNCERTAIN and (not distances or measured(known))

    if full:
        found = every_level(models[i], models[j], T_ab, start, thresholds)
    else:
        found = refine(models[i], models[j], T_ab, start, thresholds, certain)
    verdict = thresholds.verdict(found, allowance)
    if verdict is Verdict.CLASH and contained(models[i], models[j], T_ab, thresholds):
        verdict = Verdict.CONTAINED
    return PairResult(a, b, verdict, with_normal(found).moved(T[i]))


def _work(shop: ModelCache, scene: Scene, pairs: int, candidates: int, decided: Counter[str], full: bool) -> Work:
    counters = shop.counters
    used: NDArray[np.int64] = np.array([m.triangles_at(FINEST) for m in shop.models], dtype=np.int64)
    return Work(
        parts=len(scene.parts),
        shapes=len(shop.models),
        pairs=pairs,
        candidates=candidates,
        meshes=counters.meshes,
        triangles=counters.triangles,
        hulls=counters.hulls,
        fits=counters.fits,
        queries=dict(counters.queries),
        decided={k: v for k, v in decided.items() if v},
        seconds={k: round(v, 6) for k, v in counters.seconds.items()},
        fixed_error=FINEST,
        fixed_meshes=len(shop.models),
        fixed_triangles=int(used.sum()),
        fixed_queries=pairs,
        full=full,
    )
