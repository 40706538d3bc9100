"""Parts in motion, and parts at many poses: least distances with their instants, verdicts pose by pose."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose, inverse
from clamp3d.scene.bounds import Bounds, Verdict
from clamp3d.scene.broad import Boxes, box_gaps, near_pairs
from clamp3d.scene.check import Progress, Workshop, as_row
from clamp3d.scene.ladder import Answer, climb, verdict_of
from clamp3d.scene.model import Ledger, Model
from clamp3d.scene.motion import Motion
from clamp3d.scene.result import PairResult
from clamp3d.scene.scene import Scene

ACCURACY = 1e-4
"""A least distance on a way is found to within this (mm), or to what the models give."""
_STEPS = 5000


def check_motions(
    scene: Scene,
    models: list[Model],
    asked: list[tuple[int, int]] | None,
    ledger: Ledger,
    progress: Progress | None = None,
) -> tuple[PairResult, ...]:
    """Least distance of each moving part from each other part that it comes near, motion by motion.

    Each motion starts where the one before has left the parts. Between two instants no distance changes faster than
    the moving part's fastest point, so what lies between is bounded too: no thin part is stepped over.
    """
    poses = [part.T_world.copy() for part in scene.parts]
    rows: list[PairResult] = []
    keep = None if asked is None else set(asked)
    for motion in scene.motions:
        moving = [scene.index(name) for name in motion.parts]
        resolved = motion.from_pose(poses[moving[0]])
        near = [p for p in _near(scene, models, poses, moving, resolved) if keep is None or tuple(sorted(p)) in keep]
        for k, (i, j) in enumerate(near):
            if progress is not None:
                progress(f"motion {motion.name}", k, len(near))
            rows.append(_least(scene, models, poses, resolved, i, j, ledger))
        for i in moving:
            poses[i] = resolved.at(1.0) @ poses[i]
    return tuple(rows)


def _corners(model: Model, T: Array) -> Array:
    pick = np.indices((2, 2, 2)).reshape(3, -1).T
    points = np.where(pick == 0, model.bounds[0], model.bounds[1])
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def _near(
    scene: Scene, models: list[Model], poses: list[Array], moving: list[int], motion: Motion
) -> list[tuple[int, int]]:
    """Pairs (moving, standing) that come within reach: boxes around the ways against the standing boxes."""
    standing = [i for i in range(len(models)) if i not in moving]
    if not standing:
        return []
    bounds = np.array([models[i].bounds for i in standing])
    still = Boxes.of(bounds, np.array([poses[i] for i in standing]))
    found = []
    t = np.linspace(0.0, 1.0, 33)
    for i in moving:
        points = _corners(models[i], poses[i])
        way = np.concatenate([points @ motion.at(s)[:3, :3].T + motion.at(s)[:3, 3] for s in t])
        slack = 0.5 * motion.speed(points) / (len(t) - 1)
        low, high = way.min(axis=0) - slack, way.max(axis=0) + slack
        around = Boxes(
            np.vstack([0.5 * (low + high), still.centre]),
            np.vstack([0.5 * (high - low), still.half]),
            np.concatenate([np.eye(3)[None], still.R]),
        )
        pairs = near_pairs(around, scene.thresholds.reach)
        found += [(i, standing[j - 1]) for a, j in pairs.tolist() if a == 0]
    return found


def _least(
    scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int, ledger: Ledger
) -> PairResult:
    """Branch and bound over t: an interval is done when speed cannot bring it below the best distance found."""
    a, b = scene.parts[i].name, scene.parts[j].name
    thresholds, allowance = scene.thresholds, scene.allowance(a, b)
    speed = motion.speed(_corners(models[i], poses[i]))
    back = inverse(poses[j])
    best = Answer(Bounds(), "boxes", "bounding boxes")
    at, contact_at = 0.0, None
    floor = np.inf  # least lower bound of what has been given up

    def ask(t: float, half: float) -> tuple[Answer, float]:
        nonlocal best, at
        T = inverse(back @ motion.at(t) @ poses[i])
        slack = speed * half

        def enough(bounds: Bounds) -> bool:
            above = bounds.low - slack >= min(best.bounds.high, thresholds.reach + slack) - ACCURACY
            return above or bounds.high - bounds.low <= ACCURACY or verdict_of(bounds, thresholds, allowance) is Verdict.CLASH

        pair = Boxes.of(np.array([models[i].bounds, models[j].bounds]), np.array([np.eye(4), T]))
        start = Bounds(float(box_gaps(pair, np.array([[0, 1]]))[0]))
        answer = climb(models[i], models[j], T, start, thresholds, enough, ledger)
        if answer.bounds.high < best.bounds.high:
            best, at = answer, t
        return answer, answer.bounds.low - slack

    heap: list[tuple[float, float, float, float]] = []
    for t, half in ((0.0, 0.0), (1.0, 0.0), (0.5, 0.5)):
        answer, low = ask(t, half)
        heapq.heappush(heap, (low, t, half, answer.bounds.low))
    for _ in range(_STEPS):
        low, t, half, here = heap[0]
        verdict = verdict_of(Bounds(min(floor, low), best.bounds.high), thresholds, allowance)
        if verdict_of(best.bounds, thresholds, allowance) is Verdict.CLASH:
            break
        if min(floor, low) >= best.bounds.high - 2.0 * ACCURACY or (
            verdict is Verdict.CLEAR and low > thresholds.reach and best.bounds.high < np.inf and best.bounds.high - low < 0.05 * low
        ):
            break
        heapq.heappop(heap)
        if here <= low + ACCURACY:  # the model has no more to say at this instant
            floor = min(floor, low)
            if not heap:
                break
            continue
        for s in (t - 0.5 * half, t + 0.5 * half):
            answer, new = ask(s, 0.5 * half)
            heapq.heappush(heap, (max(new, low), s, 0.5 * half, answer.bounds.low))
    low = min([floor, *(item[0] for item in heap)])
    bounds = Bounds(min(low, best.bounds.high), best.bounds.high, best.bounds.point_a, best.bounds.point_b)
    verdict = verdict_of(bounds, thresholds, allowance)
    if bounds.high <= thresholds.contact:
        contact_at = _first(scene, models, poses, motion, i, j, ledger, at)
    row = as_row(a, b, verdict, Answer(bounds, best.rung, best.method), motion.at(at) @ poses[i])
    return replace(row, motion=motion.name, t=at, contact_at=contact_at)


def _first(
    scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int, ledger: Ledger, known: float
) -> float:
    """First instant at which the distance is contact, by steps that the speed makes safe; at most ``known``."""
    speed = max(motion.speed(_corners(models[i], poses[i])), 1e-12)
    contact = scene.thresholds.contact
    back, t = inverse(poses[j]), 0.0
    for _ in range(200):
        T = inverse(back @ motion.at(t) @ poses[i])
        answer = climb(
            models[i],
            models[j],
            T,
            Bounds(),
            scene.thresholds,
            lambda b: b.low > 2.0 * contact or b.high <= contact or b.high - b.low <= ACCURACY,
            ledger,
        )
        gap = answer.bounds.low - contact
        if gap <= ACCURACY:
            return t
        t += gap / speed
        if t >= known:
            return known
    return t


@dataclass(frozen=True, slots=True, eq=False)
class PoseSweep:
    """One part at n poses against the others it may meet: arrays (n, k) for k ``others``.

    ``low`` and ``high`` bound the signed distance in mm; ``verdict`` holds the verdicts' names.
    """

    part: str
    others: tuple[str, ...]
    verdict: Array
    low: Array
    high: Array

    @property
    def worst(self) -> Array:
        """Worst verdict (n,) of each pose."""
        order = {v.value: k for k, v in enumerate(Verdict)}
        ranks = np.vectorize(order.__getitem__, otypes=[np.int64])(self.verdict)
        return np.array([v.value for v in Verdict])[ranks.min(axis=1)]


def sweep_poses(
    scene: Scene,
    part: str,
    poses: ArrayLike,
    *,
    others: tuple[str, ...] | None = None,
    workshop: Workshop | None = None,
) -> PoseSweep:
    """Verdicts of ``part`` at ``poses`` (n, 4, 4) ``T_world`` against ``others`` (names; all by default).

    Raises InputError for unknown names or a pose that is not rigid.

    >>> from clamp3d.scene import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> scene = Scene().add("plate", shapes.box((50, 50, 4))).add("pin", shapes.cylinder(5, 20))
    >>> sweep_poses(scene, "pin", [translation(0, 0, z) for z in (12.0, 12.5, 0.0)]).worst.tolist()
    ['contact', 'clear', 'clash']
    """
    shop = workshop or Workshop()
    i = scene.index(part)
    rest = [scene.index(name) for name in others] if others is not None else [k for k in range(len(scene.parts)) if k != i]
    if i in rest:
        raise InputError(f"others must not hold {part!r} itself")
    try:
        T = np.asarray(poses, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("poses must be an (n, 4, 4) array of numbers") from None
    if T.ndim != 3 or T.shape[1:] != (4, 4):
        raise InputError(f"poses must have shape (n, 4, 4), got {T.shape}")
    for k, pose in enumerate(T):
        check_pose(pose, f"poses[{k}]")
    n = len(T)
    low, high = np.full((n, len(rest)), np.inf), np.full((n, len(rest)), np.inf)
    verdict = np.full((n, len(rest)), Verdict.CLEAR.value, dtype=object)
    model = shop.model(scene.parts[i].shape)
    for column, j in enumerate(rest):
        other = shop.model(scene.parts[j].shape)
        allowance = scene.allowance(part, scene.parts[j].name)
        T_other = scene.parts[j].T_world
        both = Boxes.of(
            np.concatenate([other.bounds[None], np.repeat(model.bounds[None], n, axis=0)]),
            np.concatenate([T_other[None], T]),
        )
        gaps = box_gaps(both, np.column_stack([np.zeros(n, dtype=np.int64), np.arange(1, n + 1)]))
        shop.ledger.queries["boxes"] += n
        low[:, column] = gaps
        local = inverse(T_other) @ T
        for k in np.flatnonzero(gaps < scene.thresholds.reach + 1e-6):
            answer = climb(
                other,
                model,
                local[k],
                Bounds(float(gaps[k])),
                scene.thresholds,
                lambda b, allowance=allowance: verdict_of(b, scene.thresholds, allowance) is not Verdict.UNCERTAIN,  # type: ignore[misc]
                shop.ledger,
            )
            low[k, column], high[k, column] = answer.bounds.low, answer.bounds.high
            verdict[k, column] = verdict_of(answer.bounds, scene.thresholds, allowance).value
    return PoseSweep(part, tuple(scene.parts[j].name for j in rest), verdict.astype(str), low, high)
