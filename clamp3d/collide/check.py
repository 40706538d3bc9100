"""Check a scene: near pairs from the broad phase, each refined until its verdict is certain."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clamp3d.checks import flag, function, instance
from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes, box_gaps, near_pairs
from clamp3d.collide.check_motions import check_motions
from clamp3d.collide.depth import is_quick, penetration
from clamp3d.collide.faces_depth import faces_depth
from clamp3d.collide.judge import judge
from clamp3d.collide.model import Model, ModelCache, Progress
from clamp3d.collide.reasons import failure, undecided
from clamp3d.collide.refine import measured, with_normal
from clamp3d.collide.repeats import Repeats
from clamp3d.collide.result import BAD, CheckResult, PairResult, Work
from clamp3d.collide.scene import Scene, name_pairs
from clamp3d.collide.touching import is_box, touching_boxes
from clamp3d.collide.verdict import Verdict
from clamp3d.collide.where import locator
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError, MissingLibraryError, SolverError


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
        Measure every pair to `clamp3d.collide.distance.ACCURACY`, not only until its verdict is certain.
    depths : bool
        Measure the penetration depth of clashes, as `clamp3d.collide.distance.distance` does; without, "at least", as
        between two solids from CAD that no short move parts: a pin in a hole that is too narrow.
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
    n, T = len(models), placed.poses
    boxes = Boxes.of(np.array([m.bounds for m in of_shape]).reshape(-1, 2, 3)[placed.which], T)
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
    counters.queries["boxes"] += len(chosen)
    times.append(time.perf_counter())
    rows, decided, repeats = [], Counter({"broad phase": every - len(chosen)}), Repeats(models)
    box = {model: is_box(model) for model in set(models)}
    known = {} if full else touching_boxes(boxes, np.array([box[m] for m in models], dtype=bool), chosen, gaps)
    for k, ((i, j), gap) in enumerate(zip(chosen.tolist(), gaps.tolist(), strict=True)):
        if progress is not None:
            progress("pairs", k, len(chosen))
        row = _touching(scene, i, j, known[k]) if k in known else None
        if row is None:
            start = Distance(gap, level="boxes", method="bounding boxes")
            row = _pair(scene, i, j, models, T, start, full, distances, depths, repeats)
        if row.verdict not in (Verdict.FAILED, Verdict.UNCERTAIN):
            decided[row.distance.level] += 1
        rows.append(row)
    times.append(time.perf_counter())
    moved = check_motions(scene, models, asked, progress, depths)
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
    names = None if asked is None else tuple((scene.parts[i].name, scene.parts[j].name) for i, j in asked)
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


def _asked(scene: Scene, pairs: Sequence[tuple[str, str]]) -> list[tuple[int, int]]:
    found = set()
    for a, b in name_pairs("pairs", pairs):
        i, j = sorted((scene.index(a), scene.index(b)))
        if i == j:
            raise InputError(f"pair {a}:{b} must name two different parts")
        found.add((i, j))
    return sorted(found)


def _touching(scene: Scene, i: int, j: int, known: Distance) -> PairResult | None:
    """The row of a pair that touches, if that decides it; ``known`` in the world."""
    a, b = scene.parts[i].name, scene.parts[j].name
    verdict = scene.thresholds.verdict(known, scene.allowance(a, b))
    return None if verdict is Verdict.UNCERTAIN or verdict in BAD else PairResult(a, b, verdict, known)


def _pair(
    scene: Scene,
    i: int,
    j: int,
    models: list[Model],
    T: Array,
    start: Distance,
    full: bool,
    distances: bool,
    depths: bool,
    repeats: Repeats,
) -> PairResult:
    a, b = scene.parts[i].name, scene.parts[j].name
    allowance, thresholds = scene.allowance(a, b), scene.thresholds
    x, y, T_ab = models[i], models[j], dot(inverse(T[i]), T[j])

    def enough(known: Distance) -> bool:
        return not full and (not distances or measured(known))

    pair = x, y, T_ab
    known = repeats.find(*pair)
    if known is not None and thresholds.verdict(known[1], allowance) is known[0] and enough(known[1]):
        return _row(scene, i, j, pair, T[i], *known)
    try:
        verdict, found = judge(*pair, start, thresholds, allowance, enough)
        deep = with_normal(found)
        if verdict in BAD:
            deep = penetration(*pair, deep) if depths and is_quick(x, y) else deep.of_overlap()
            if depths and not is_quick(x, y) and x.faces is not None and y.faces is not None:
                deep = faces_depth(x.faces, y.faces, T_ab, deep)
    except MissingLibraryError:
        raise
    except Exception as error:  # one pair that fails is a finding, not the end of all others
        return PairResult(a, b, Verdict.FAILED, start, reason=failure(error))
    repeats.keep(*pair, verdict, deep)
    return _row(scene, i, j, pair, T[i], verdict, deep)


def _row(
    scene: Scene, i: int, j: int, pair: tuple[Model, Model, Array], T: Array, verdict: Verdict, found: Distance
) -> PairResult:
    """The row of two parts, the first one placed by ``T`` (4, 4), from what is known in its frame."""
    a, b = scene.parts[i].name, scene.parts[j].name
    x, y, T_ab = pair
    row = PairResult(a, b, verdict, found.moved(T))
    if verdict in BAD:
        return replace(row, locate=locator(x, y, T, T_ab))
    if verdict is Verdict.UNCERTAIN:
        return replace(row, reason=undecided({a: x, b: y}, found, scene.thresholds, scene.allowance(a, b)))
    return row
