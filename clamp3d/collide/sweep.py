"""Parts in motion, and parts at many poses: least distances with their instants, verdicts pose by pose."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import array, instance, items
from clamp3d.collide.bounds import Bounds, Verdict
from clamp3d.collide.broad import Boxes, box_gaps, near_pairs
from clamp3d.collide.ladder import Answer, as_row, climb, verdict_of
from clamp3d.collide.model import Ledger, Model, Progress, Workshop
from clamp3d.collide.motion import Motion, scene_pose
from clamp3d.collide.result import PairResult
from clamp3d.collide.scene import Scene
from clamp3d.collide.swept import swept_low
from clamp3d.collide.trimodel import TriModel, clearance_of_shells
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError

ACCURACY = 1e-4
"""A least distance on a way is found to within this (mm), or to what the models give."""
_STEPS = 2000
_PATIENCE = 12
SHELL_ERROR = 0.064
"""Chord error (mm) of the meshes that a stretch of a motion is bounded with where closed forms say too little."""


def check_motions(
    scene: Scene,
    models: list[Model],
    asked: list[tuple[int, int]] | None,
    ledger: Ledger,
    progress: Progress | None = None,
) -> tuple[PairResult, ...]:
    """Least distance of each moving part from each other part that it comes near, motion by motion.

    Each motion starts where the one before has left the parts. What lies between two instants is bounded too, by the
    speed of the part's fastest point and by swept shapes: no thin part is stepped over.
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


class _Way:
    """One moving part ``i`` against one standing part ``j``: bounds at an instant, and over a stretch around it."""

    def __init__(
        self, scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int, ledger: Ledger
    ) -> None:
        self.a, self.b = models[i], models[j]
        self.motion, self.start, self.back = motion, poses[i], inverse(poses[j])
        self.thresholds, self.ledger = scene.thresholds, ledger
        self.speed = motion.speed(_corners(self.a, poses[i]))
        # How often in a row closed forms, and swept ones, had nothing to say: hulls in each other never have.
        self.mute = self.mute_swept = 0

    def pose(self, t: float) -> Array:
        """The standing part in the moving part's frame."""
        return inverse(self.back @ self.motion.at(t) @ self.start)

    def ask(self, t: float, enough: Callable[[Bounds], bool]) -> Answer:
        """Bounds at the instant ``t``."""
        T = self.pose(t)
        pair = Boxes.of(np.array([self.a.bounds, self.b.bounds]), np.array([np.eye(4), T]))
        start = Bounds(float(box_gaps(pair, np.array([[0, 1]]))[0]))
        answer = climb(self.a, self.b, T, start, self.thresholds, enough, self.ledger, forms=self.mute < _PATIENCE)
        self.mute = self.mute + 1 if answer.rung == "meshes" else 0
        return answer

    def low(self, t: float, half: float, here: float, wanted: float) -> float:
        """Lower bound from t - half to t + half, ``here`` being that at t; no better than ``wanted``."""
        plain = here - self.speed * half
        if plain >= wanted:
            return plain
        stretch = (self.pose(t - half), self.pose(t), self.pose(t + half))
        swept = plain
        if self.mute_swept < _PATIENCE:
            self.ledger.queries["swept"] += 1
            angle = self.motion.angle * half
            swept = max(plain, swept_low(self.a, self.b, *stretch, angle=angle))
            self.mute_swept = 0 if swept > plain else self.mute_swept + 1
        if swept >= min(wanted, here) - ACCURACY or len(self.shells) < 2:
            return swept
        return max(swept, self._by_shells(half, stretch[1]))

    def _by_shells(self, half: float, T: Array) -> float:
        """Lower bound by meshes: what is near the axis of a rotation hardly moves."""
        self.ledger.queries["swept meshes"] += 1
        mine, other = self.a.mesh(SHELL_ERROR), self.b.mesh(SHELL_ERROR)
        shells = tuple((tree, half * speed) for tree, speed in self.shells)
        if not shells:
            return -np.inf
        low = clearance_of_shells(shells, other, inverse(T), mine.heads)
        outer = any(mine.contains(x) for x in other.heads @ T[:3, :3].T + T[:3, 3])
        return -np.inf if outer else low - mine.error - other.error

    @cached_property
    def shells(self) -> tuple[tuple[Any, float], ...]:
        """The moving mesh's triangles by their distance from the motion's axis: (tree, speed mm per unit of t)."""
        mesh = self.a.mesh(SHELL_ERROR)
        world = mesh.vertices @ self.start[:3, :3].T + self.start[:3, 3] - self.motion.point
        out = np.linalg.norm(world - np.outer(world @ self.motion.axis, self.motion.axis), axis=1)[mesh.faces].max(
            axis=1
        )
        straight = float(np.linalg.norm(self.motion.travel))
        if not self.motion.angle:
            return ((mesh.bvh, straight),)
        ring = np.ceil(4.0 * np.log2(np.maximum(out / max(float(out.min()), 1e-3), 1.0))).astype(int)
        return tuple(
            (
                TriModel(mesh.vertices, mesh.faces[ring == k], 0.0).bvh,
                straight + abs(self.motion.angle) * float(out[ring == k].max()),
            )
            for k in np.unique(ring)
        )


def _least(
    scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int, ledger: Ledger
) -> PairResult:
    """Branch and bound over t: a stretch is done when nothing in it can come below the best distance found."""
    a, b = scene.parts[i].name, scene.parts[j].name
    thresholds, allowance = scene.thresholds, scene.allowance(a, b)
    way = _Way(scene, models, poses, motion, i, j, ledger)
    best, at = Answer(Bounds(), "boxes", "bounding boxes"), 0.0

    def clash(bounds: Bounds) -> bool:
        return verdict_of(bounds, thresholds, allowance) is Verdict.CLASH

    def look(t: float, half: float, above: float) -> tuple[float, float]:
        nonlocal best, at

        def enough(bounds: Bounds) -> bool:
            sharp = bounds.high - bounds.low <= max(ACCURACY, 0.02 * abs(bounds.low))
            return sharp or bounds.low - way.speed * half >= best.bounds.high - ACCURACY or clash(bounds)

        answer = way.ask(t, enough)
        if answer.bounds.high < best.bounds.high:
            best, at = answer, t
        low = way.low(t, half, answer.bounds.low, best.bounds.high - ACCURACY) if half else answer.bounds.low
        return max(low, above), answer.bounds.low

    heap: list[tuple[float, float, float, float]] = []
    for t, half in ((0.0, 0.0), (1.0, 0.0), (0.5, 0.5)):
        heapq.heappush(heap, (*look(t, half, -np.inf), t, half))
    floor = np.inf  # of stretches that were given up
    for _ in range(_STEPS):
        low, here, t, half = heap[0]
        width = best.bounds.high - min(floor, low)
        limit = max(2.0 * ACCURACY, 0.02 * abs(best.bounds.high), 2.0 * (best.bounds.high - best.bounds.low))
        verdict = verdict_of(Bounds(min(floor, low), best.bounds.high), thresholds, allowance)
        if clash(best.bounds) or (width <= limit and verdict is not Verdict.UNCERTAIN) or width <= 2.0 * ACCURACY:
            break
        heapq.heappop(heap)
        if half * way.speed <= 0.5 * ACCURACY or here <= low + ACCURACY:  # the models have no more to say
            floor = min(floor, low)
        else:
            for s in (t - 0.5 * half, t + 0.5 * half):
                heapq.heappush(heap, (*look(s, 0.5 * half, low), s, 0.5 * half))
        if not heap:
            break
    low = min([floor, *(item[0] for item in heap)])
    bounds = Bounds(min(low, best.bounds.high), best.bounds.high, best.bounds.point_a, best.bounds.point_b)
    verdict = verdict_of(bounds, thresholds, allowance)
    contact_at = _first(way, at) if bounds.high <= thresholds.contact else None
    row = as_row(a, b, verdict, Answer(bounds, best.rung, best.method), motion.at(at) @ poses[i])
    return replace(row, motion=motion.name, t=at, contact_at=contact_at)


def _first(way: _Way, known: float) -> float:
    """First instant of contact, at most ``known``: the leftmost stretch that can be neither cleared nor cut further."""
    contact = way.thresholds.contact

    def enough(bounds: Bounds) -> bool:
        return bounds.low > 2.0 * contact or bounds.high <= contact or bounds.high - bounds.low <= ACCURACY

    todo = [(0.0, known)]
    for _ in range(_STEPS):
        if not todo:
            break
        start, stop = todo.pop()
        middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
        if half * way.speed <= ACCURACY:
            return start
        here = way.ask(middle, enough).bounds.low
        if way.low(middle, half, here, contact) > contact:
            continue
        todo += [(middle, stop), (start, middle)]
    return known


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
        return np.asarray(np.array([v.value for v in Verdict])[ranks.min(axis=1)])


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

    >>> from clamp3d.core import shapes
    >>> from clamp3d.core.pose import translation
    >>> scene = Scene().add("plate", shapes.box((50, 50, 4))).add("pin", shapes.cylinder(5, 20))
    >>> sweep_poses(scene, "pin", [translation(0, 0, z) for z in (12.0, 12.5, 0.0)]).worst.tolist()
    ['contact', 'clear', 'clash']
    """
    instance("scene", scene, Scene)
    if workshop is not None:
        instance("workshop", workshop, Workshop)
    shop = workshop or Workshop()
    i = scene.index(part)
    rest = (
        [scene.index(name) for name in items("others", others, "part names")]
        if others is not None
        else [k for k in range(len(scene.parts)) if k != i]
    )
    if i in rest:
        raise InputError(f"others must not hold {part!r} itself")
    T = array("poses", poses, (None, 4, 4), finite=False)
    for k, pose in enumerate(T):
        scene_pose(pose, f"poses[{k}]")
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
        for k in np.flatnonzero(gaps < scene.thresholds.reach + 1e-6).tolist():
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
