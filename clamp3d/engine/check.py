"""Check a scene: near pairs from the broad phase, each refined until its verdict is certain."""

from __future__ import annotations

import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.checks import flag, function, instance
from clamp3d.engine.answer import Distance
from clamp3d.engine.broad import Boxes, box_gaps, near_pairs
from clamp3d.engine.check_motions import check_motions
from clamp3d.engine.depth import penetration
from clamp3d.engine.judge import judge
from clamp3d.engine.model import Counters, Model, ModelCache, Progress, ignore
from clamp3d.engine.reasons import failure, undecided
from clamp3d.engine.refine import accuracy_for, boxes_distance, measured, with_normal
from clamp3d.engine.result import BAD, CheckResult, PairResult, Work
from clamp3d.engine.scene import Scene, name_pairs
from clamp3d.engine.verdict import Verdict
from clamp3d.engine.where import Locator
from clamp3d.errors import InputError, MissingLibraryError
from clamp3d.geometry.pose import Array, inverse

OnRow = Callable[[PairResult], None]

_SAME = np.array([1e13, 1e13, 1e13, 1e9])
"""To one part in this of a rotation, and of a mm, relative poses agree that one measurement serves."""


def check(
    scene: Scene,
    *,
    pairs: Sequence[tuple[str, str]] | None = None,
    distances: bool = False,
    depths: bool = True,
    progress: Progress | None = None,
    on_row: OnRow | None = None,
    cache: ModelCache | None = None,
) -> CheckResult:
    """Verdicts of all pairs of a scene, at rest and in its motions.

    Parameters
    ----------
    scene : Scene
        Parts, thresholds, allowed contacts and motions.
    pairs : sequence of (str, str), optional
        Names of the pairs to look at; all by default.
    distances : bool
        Measure every pair to `clamp3d.engine.refine.ACCURACY`, not only until its verdict is certain, and spend more
        work on the depths and volumes of clashes.
    depths : bool
        Measure the penetration depth of clashes, as `clamp3d.engine.distance.distance` does; without, "at least".
    progress : callable, optional
        Called with (stage, done, of).
    on_row : callable, optional
        Is called with each row at rest: first with the verdict of every pair, then with the depth of each clash, the
        deepest overlap that is certain first.
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
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> scene = Scene().add("a", shapes.box((10, 10, 10))).add("b", shapes.cylinder(3, 10), translation(0, 0, 9))
    >>> check(scene)
    CheckResult('scene': not clean; 1 clash)
    """
    instance("scene", scene, Scene)
    if cache is not None:
        instance("cache", cache, ModelCache)
    distances, depths = flag("distances", distances), flag("depths", depths)
    function("progress", progress)
    function("on_row", on_row)
    cache = cache or ModelCache()
    log = _Log(cache.counters)
    of_shape = {id(shape): cache.model(shape) for shape in {id(p.shape): p.shape for p in scene.parts}.values()}
    models = [of_shape[id(part.shape)] for part in scene.parts]
    poses = np.array([part.T_world for part in scene.parts]).reshape(-1, 4, 4)
    boxes = Boxes.of(np.array([model.bounds for model in models]).reshape(-1, 2, 3), poses)
    named = None if pairs is None else _numbered(scene, pairs)
    every = math.comb(len(models), 2) if named is None else len(named)
    near = _candidates(boxes, scene.thresholds.reach, named, everything=distances)
    cache.counters.queries["boxes"] += len(near)
    log.end("broad phase")
    progress, on_row = progress or ignore, on_row or ignore
    questions = _Questions(scene, models, distances, depths)
    rows = questions.rows(_Pair.of(near, box_gaps(boxes, near), poses), progress, on_row)
    log.end("pairs")
    moved = check_motions(scene, models, named, progress)
    if scene.motions:
        log.end("motions")
    names = None if named is None else tuple((scene.parts[i].name, scene.parts[j].name) for i, j in named)
    work = log.work(rows, parts=len(models), shapes=len(set(models)), pairs=every, candidates=len(near))
    return CheckResult(scene, tuple(rows), moved, names, work)


class _Log:
    """What a check builds and asks, and the seconds of each of its stages."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self._built, self._queries = counters.built.copy(), counters.queries.copy()
        self._seconds: dict[str, float] = {}
        self._start = time.perf_counter()

    def end(self, stage: str) -> None:
        """The stage that began when the one before ended is over."""
        now = time.perf_counter()
        self._seconds[stage], self._start = round(now - self._start, 6), now

    def work(self, rows: Sequence[PairResult], *, parts: int, shapes: int, pairs: int, candidates: int) -> Work:
        """All of it, with how many pairs each level decided."""
        decided = Counter(row.distance.level for row in rows if row.verdict not in (Verdict.FAILED, Verdict.UNCERTAIN))
        decided["broad phase"] = pairs - candidates
        built, queries = self._counters.built - self._built, dict(self._counters.queries - self._queries)
        counts = {name: built[name] for name in ("meshes", "triangles", "hulls", "fits")}
        totals = {"parts": parts, "shapes": shapes, "pairs": pairs, "candidates": candidates}
        return Work(**totals, **counts, queries=queries, decided=dict(+decided), seconds=self._seconds)


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


class _Pair(NamedTuple):
    """Parts ``i`` and ``j``, whose boxes keep ``gap`` mm; ``T`` (4, 4) is j in i's frame, ``place`` it rounded."""

    i: int
    j: int
    gap: float
    T: Array
    place: bytes

    @classmethod
    def of(cls, near: NDArray[np.int64], gaps: Array, poses: Array) -> list[_Pair]:
        """Pairs ``near`` (m, 2) of parts at ``poses`` (n, 4, 4), whose boxes keep ``gaps`` (m,)."""
        T = inverse(poses[near[:, 0]]) @ poses[near[:, 1]]
        places = map(bytes, (T[:, :3] * _SAME).round() + 0.0)
        return list(map(cls, near[:, 0].tolist(), near[:, 1].tolist(), gaps.tolist(), T, places))


@dataclass(frozen=True)
class _Questions:
    """What is asked of each pair of a scene; one answer serves pairs of equal shapes in equal relative poses."""

    scene: Scene
    models: list[Model]
    distances: bool
    depths: bool
    _answers: dict[tuple[object, ...], tuple[Verdict, Distance]] = field(default_factory=dict)

    def rows(self, pairs: list[_Pair], progress: Progress, on_row: OnRow) -> list[PairResult]:
        """The rows of pairs of parts: all verdicts first, then the depths."""
        rows: list[PairResult] = []
        for k, pair in enumerate(pairs):
            progress("pairs", k, len(pairs))
            rows.append(self._row(pair))
            on_row(rows[k])
        overlaps = [k for k, row in enumerate(rows) if row.verdict in BAD] if self.depths else []
        for n, k in enumerate(sorted(overlaps, key=lambda k: rows[k].distance.upper)):
            progress("depths", n, len(overlaps))
            rows[k] = self._row(pairs[k], depth=True)
            on_row(rows[k])
        return rows

    def _row(self, pair: _Pair, *, depth: bool = False) -> PairResult:
        first, second = self.scene.parts[pair.i], self.scene.parts[pair.j]
        a, b, T = self.models[pair.i], self.models[pair.j], pair.T
        allowance = self.scene.allowance(first.name, second.name)
        key = (a, b, allowance, pair.place)
        start = boxes_distance(pair.gap)
        try:
            if key not in self._answers:
                self._answers[key] = self._answer(a, b, T, start, allowance)
            verdict, distance = self._answers[key]
            if depth and (*key, depth) not in self._answers:
                self._answers[*key, depth] = verdict, penetration(a, b, T, distance, thorough=self.distances)
        except MissingLibraryError:
            raise
        except Exception as error:  # one pair that fails is a finding, not the end of all others
            return PairResult(first.name, second.name, Verdict.FAILED, start, reason=failure(error))
        if verdict in BAD:
            distance = self._answers[*key, depth][1] if depth else distance.of_overlap()
        row = PairResult(first.name, second.name, verdict, distance.moved(first.T_world))
        if verdict in BAD:
            attested = distance.point_a if distance.upper < 0.0 else None
            return replace(row, locator=Locator(a, b, first.T_world, T, self.distances, attested))
        if verdict is Verdict.UNCERTAIN:
            models = {first.name: a, second.name: b}
            return replace(row, reason=undecided(models, distance, self.scene.thresholds, allowance))
        return row

    def _answer(
        self, a: Model, b: Model, T: Array, start: Distance, allowance: float | None
    ) -> tuple[Verdict, Distance]:
        """Verdict and distance of ``b`` at ``T`` (4, 4) in a's frame."""
        accuracy = accuracy_for(a, b)

        def enough(distance: Distance) -> bool:
            return not self.distances or measured(distance, accuracy)

        verdict, distance = judge(a, b, T, start, self.scene.thresholds, allowance, enough)
        return verdict, with_normal(distance)
