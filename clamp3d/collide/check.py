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
from clamp3d.collide.check_motions import check_motions
from clamp3d.collide.depth import penetration
from clamp3d.collide.judge import judge
from clamp3d.collide.model import Model, ModelCache, Progress
from clamp3d.collide.reasons import failure, undecided
from clamp3d.collide.refine import accuracy_for, measured, with_normal
from clamp3d.collide.result import BAD, CheckResult, PairResult, Work
from clamp3d.collide.scene import Scene, name_pairs
from clamp3d.collide.verdict import Verdict
from clamp3d.collide.where import Locator
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError, MissingLibraryError, SolverError

_SAME = 9
"""Digits (of mm, or of a rotation) to which relative poses agree that one measurement serves."""


def check(
    scene: Scene,
    *,
    pairs: Sequence[tuple[str, str]] | None = None,
    full: bool = False,
    distances: bool = False,
    depths: bool = True,
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
        Ask every pair at every level down to the finest meshes: slow, for comparison.
    distances : bool
        Measure every pair to `clamp3d.collide.refine.ACCURACY`, not only until its verdict is certain.
    depths : bool
        Measure the penetration depth of clashes, as `clamp3d.collide.distance.distance` does; without, "at least".
    progress : callable, optional
        Is told (stage, done, of).
    cache : ModelCache, optional
        Keeps models from one check to the next.

    Returns
    -------
    CheckResult
        Rows with verdict and distance; pairs that never came near are clear and have no row, unless ``distances``. A
        pair whose models contradict each other or cannot be made has the verdict failed, and its reason.

    Raises
    ------
    InputError
        For unknown names.
    MissingLibraryError
        If a part needs a library that is not installed.

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
    full, distances, depths = flag("full", full), flag("distances", distances), flag("depths", depths)
    function("progress", progress)
    shop = cache or ModelCache()
    counters = shop.counters
    built, queries = counters.built.copy(), counters.queries.copy()
    times = [time.perf_counter()]
    placed = scene.placed
    of_shape = [shop.model(shape) for shape in placed.shapes]
    models = [of_shape[k] for k in placed.which.tolist()]
    n = len(models)
    boxes = Boxes.of(np.array([m.bounds for m in of_shape]).reshape(-1, 2, 3)[placed.which], placed.poses)
    named = None if pairs is None else _numbered(scene, pairs)
    every = n * (n - 1) // 2 if named is None else len(named)
    chosen = _candidates(boxes, scene.thresholds.reach, named, everything=full or distances)
    gaps = box_gaps(boxes, chosen)
    counters.queries["boxes"] += len(chosen)
    times.append(time.perf_counter())
    rows, decided = [], Counter({"broad phase": every - len(chosen)})
    questions = _Questions(scene, models, full=full, distances=distances, depths=depths)
    for k, ((i, j), gap) in enumerate(zip(chosen.tolist(), gaps.tolist(), strict=True)):
        if progress is not None:
            progress("pairs", k, len(chosen))
        row = questions.row(i, j, gap)
        if row.verdict not in (Verdict.FAILED, Verdict.UNCERTAIN):
            decided[row.distance.level] += 1
        rows.append(row)
    times.append(time.perf_counter())
    moved = check_motions(scene, models, named, progress)
    times.append(time.perf_counter())
    stages = ("broad phase", "pairs", "motions") if scene.motions else ("broad phase", "pairs")
    work = Work(
        parts=n,
        shapes=len(set(models)),
        pairs=every,
        candidates=len(chosen),
        **{name: counters.built[name] - built[name] for name in ("meshes", "triangles", "hulls", "fits")},
        queries=dict(counters.queries - queries),
        decided=dict(+decided),
        seconds={name: round(end - start, 6) for name, start, end in zip(stages, times, times[1:], strict=False)},
        full=full,
    )
    names = None if named is None else tuple((scene.parts[i].name, scene.parts[j].name) for i, j in named)
    return CheckResult(scene, tuple(rows), moved, names, work)


def check_full(scene: Scene, result: CheckResult, *, progress: Progress | None = None) -> CheckResult:
    """Every pair asked at every level, whatever the first ones say, and compared with ``result``.

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


def _numbered(scene: Scene, pairs: Sequence[tuple[str, str]]) -> list[tuple[int, int]]:
    """Pairs of names as sorted pairs of numbers, each once. Raises InputError for unknown names."""
    numbers = set()
    for a, b in name_pairs("pairs", pairs):
        i, j = sorted((scene.index(a), scene.index(b)))
        if i == j:
            raise InputError(f"pair {a}:{b} must name two different parts")
        numbers.add((i, j))
    return sorted(numbers)


def _candidates(
    boxes: Boxes, reach: float, named: list[tuple[int, int]] | None, *, everything: bool
) -> NDArray[np.int64]:
    """Pairs (m, 2) that may be within ``reach`` mm, of those ``named``; ``everything``: all of them."""
    n = len(boxes.centre)
    if everything:
        rows = list(itertools.combinations(range(n), 2)) if named is None else named
        return np.array(rows, dtype=np.int64).reshape(-1, 2)
    near = near_pairs(boxes, reach)
    if named is None:
        return near
    keep = set(named)
    return np.array([pair for pair in near.tolist() if tuple(pair) in keep], dtype=np.int64).reshape(-1, 2)


class _Questions:
    """What is asked of each pair of a scene; one answer serves pairs of equal shapes in equal relative poses."""

    def __init__(self, scene: Scene, models: list[Model], *, full: bool, distances: bool, depths: bool) -> None:
        self.scene, self.models = scene, models
        self.full, self.distances, self.depths = full, distances, depths
        self._answers: dict[tuple[object, ...], tuple[Verdict, Distance]] = {}

    def row(self, i: int, j: int, gap: float) -> PairResult:
        """The row of parts ``i`` and ``j``, whose boxes keep ``gap`` mm."""
        first, second = self.scene.parts[i], self.scene.parts[j]
        a, b = self.models[i], self.models[j]
        allowance = self.scene.allowance(first.name, second.name)
        T = inverse(first.T_world) @ second.T_world
        key = (a, b, allowance, tuple((T[:3] + 0.0).round(_SAME).ravel().tolist()))
        if key not in self._answers:
            start = Distance(gap, level="boxes", method="bounding boxes")
            try:
                self._answers[key] = self._measured(a, b, T, start, allowance)
            except MissingLibraryError:
                raise
            except Exception as error:  # one pair that fails is a finding, not the end of all others
                return PairResult(first.name, second.name, Verdict.FAILED, start, reason=failure(error))
        verdict, distance = self._answers[key]
        row = PairResult(first.name, second.name, verdict, distance.moved(first.T_world))
        if verdict in BAD:
            return replace(row, locator=Locator(a, b, first.T_world, T))
        if verdict is Verdict.UNCERTAIN:
            models = {first.name: a, second.name: b}
            return replace(row, reason=undecided(models, distance, self.scene.thresholds, allowance))
        return row

    def _measured(
        self, a: Model, b: Model, T: Array, start: Distance, allowance: float | None
    ) -> tuple[Verdict, Distance]:
        """Verdict and distance of ``b`` at ``T`` (4, 4) in a's frame."""
        accuracy = accuracy_for(a, b)

        def enough(distance: Distance) -> bool:
            return not self.full and (not self.distances or measured(distance, accuracy))

        verdict, distance = judge(a, b, T, start, self.scene.thresholds, allowance, enough)
        distance = with_normal(distance)
        if verdict in BAD:
            distance = penetration(a, b, T, distance) if self.depths else distance.of_overlap()
        return verdict, distance
