"""Bodies in motion, and parts at many poses: least distances and first contacts with their times, verdicts by pose."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import array, instance, items
from clamp3d.collide.answer import Distance
from clamp3d.collide.body import kernel_distance
from clamp3d.collide.broad import Boxes, box_gaps, near_pairs
from clamp3d.collide.model import Model, ModelCache, Progress
from clamp3d.collide.refine import from_boxes, measured, refine, with_normal
from clamp3d.collide.result import PairResult
from clamp3d.collide.scene import Scene
from clamp3d.collide.surface import Surface, clearance_of_shells
from clamp3d.collide.swept import swept_lower
from clamp3d.collide.verdict import RESOLUTION, Thresholds, Verdict
from clamp3d.core.distance import SignedDistance
from clamp3d.core.motion import Motion, scene_pose
from clamp3d.core.motion_search import Search
from clamp3d.core.pose import Array, inverse
from clamp3d.core.primitives import Cylinder, SweptArc, place
from clamp3d.core.shapes import AnyShape, as_shape
from clamp3d.errors import InputError

ACCURACY = 1e-4
"""A least distance on a way is found to within this (mm), or to what the models give."""
MAX_STEPS = 2000
MAX_UNINFORMATIVE = 12
"""Answers in a row that told nothing, after which a method is not asked again."""
SHELL_ERROR = 0.064
"""Chord error (mm) of the meshes that a stretch of a motion is bounded with where closed forms say too little."""


def check_motions(
    scene: Scene,
    models: list[Model],
    asked: list[tuple[int, int]] | None,
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
        resolved = motion.resolved(poses[moving[0]])
        near = [p for p in _near(scene, models, poses, moving, resolved) if keep is None or tuple(sorted(p)) in keep]
        for k, (i, j) in enumerate(near):
            if progress is not None:
                progress(f"motion {motion.name}", k, len(near))
            rows.append(_row(scene, models, poses, resolved, i, j))
        for i in moving:
            poses[i] = resolved.at(1.0, poses[i])
    return tuple(rows)


def _row(scene: Scene, models: list[Model], poses: list[Array], motion: Motion, i: int, j: int) -> PairResult:
    a, b = scene.parts[i].name, scene.parts[j].name
    thresholds, allowance = scene.thresholds, scene.allowance(a, b)
    pair = _MovingPair(models[i], models[j], motion, poses[i], poses[j])
    least, t = _least(pair, thresholds, allowance)
    verdict = thresholds.verdict(least, allowance)
    contact_at = _first(pair, t, thresholds, thresholds.contact) if least.upper <= thresholds.contact else None
    return PairResult(a, b, verdict, with_normal(least.moved(motion.at(t, poses[i]))), motion.name, t, contact_at)


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


class _MovingPair:
    """A shape that moves against one that stands: bounds at a time t, and over a stretch of times."""

    def __init__(self, moving: Model, still: Model, motion: Motion, start: Array, T_still: Array) -> None:
        self.a, self.b = moving, still
        self.motion, self.start, self.back = motion, start, inverse(T_still)
        self.counters = moving.counters
        self.speed = motion.speed(_corners(moving, start))
        # How often in a row closed forms, and swept ones, had nothing to say: hulls in each other never have.
        self.n_uninformative = self.n_uninformative_swept = 0

    def pose(self, t: float) -> Array:
        """The standing shape in the moving shape's frame."""
        return inverse(self.back @ self.motion.at(t, self.start))

    def ask(self, t: float, enough: Callable[[Distance], bool], thresholds: Thresholds) -> Distance:
        """Distance at time ``t``, in the moving shape's frame."""
        T = self.pose(t)
        forms = self.n_uninformative < MAX_UNINFORMATIVE
        found = refine(self.a, self.b, T, from_boxes(self.a, self.b, T), thresholds, enough, forms=forms)
        self.n_uninformative = self.n_uninformative + 1 if found.level == "meshes" else 0
        return found

    def lower(self, t: float, half: float, here: float, wanted: float) -> float:
        """Lower bound from t - half to t + half, ``here`` being that at t; no better than ``wanted``."""
        plain = here - self.speed * half
        if plain >= wanted:
            return plain
        stretch = (self.pose(t - half), self.pose(t), self.pose(t + half))
        swept = plain
        if self.n_uninformative_swept < MAX_UNINFORMATIVE:
            self.counters.queries["swept"] += 1
            angle = self.motion.angle * half
            swept = max(plain, swept_lower(self.a, self.b, *stretch, angle=angle))
            self.n_uninformative_swept = 0 if swept > plain else self.n_uninformative_swept + 1
        if swept >= min(wanted, here) - ACCURACY or len(self.shells) < 2:
            return swept
        return max(swept, self._by_shells(half, stretch[1]))

    def _by_shells(self, half: float, T: Array) -> float:
        """Lower bound by meshes: what is near the axis of a rotation hardly moves."""
        self.counters.queries["swept meshes"] += 1
        mine, other = self.a.mesh(SHELL_ERROR), self.b.mesh(SHELL_ERROR)
        shells = tuple((tree, half * speed) for tree, speed in self.shells)
        if not shells:
            return -np.inf
        lower = clearance_of_shells(shells, other, inverse(T), mine.shell_points)
        outer = any(mine.contains(x) for x in other.shell_points @ T[:3, :3].T + T[:3, 3])
        return -np.inf if outer else lower - mine.error - other.error

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
                Surface(mesh.vertices, mesh.faces[ring == k], 0.0).bvh,
                straight + abs(self.motion.angle) * float(out[ring == k].max()),
            )
            for k in np.unique(ring)
        )


def _least(pair: _MovingPair, thresholds: Thresholds, allowance: float | None) -> tuple[Distance, float]:
    """Least distance on the way, in the moving shape's frame, and its t.

    Branch and bound over t: a stretch is done when nothing in it can come below the best distance found.
    """
    best, at = Distance(), 0.0

    def clash(known: Distance) -> bool:
        return thresholds.verdict(known, allowance) is Verdict.CLASH

    def look(t: float, half: float, above: float) -> tuple[float, float]:
        nonlocal best, at

        def enough(known: Distance) -> bool:
            sharp = known.upper - known.lower <= max(ACCURACY, 0.02 * abs(known.lower))
            return sharp or known.lower - pair.speed * half >= best.upper - ACCURACY or clash(known)

        found = pair.ask(t, enough, thresholds)
        if found.upper < best.upper:
            best, at = found, t
        lower = pair.lower(t, half, found.lower, best.upper - ACCURACY) if half else found.lower
        return max(lower, above), found.lower

    heap: list[tuple[float, float, float, float]] = []
    for t, half in ((0.0, 0.0), (1.0, 0.0), (0.5, 0.5)):
        heapq.heappush(heap, (*look(t, half, -np.inf), t, half))
    floor = np.inf  # of stretches that were given up
    for _ in range(MAX_STEPS):
        lower, here, t, half = heap[0]
        width = best.upper - min(floor, lower)
        limit = max(2.0 * ACCURACY, 0.02 * abs(best.upper), 2.0 * (best.upper - best.lower))
        verdict = thresholds.verdict(Distance(min(floor, lower), best.upper), allowance)
        if clash(best) or (width <= limit and verdict is not Verdict.UNCERTAIN) or width <= 2.0 * ACCURACY:
            break
        heapq.heappop(heap)
        if half * pair.speed <= 0.5 * ACCURACY or here <= lower + ACCURACY:  # the models have no more to say
            floor = min(floor, lower)
        else:
            for s in (t - 0.5 * half, t + 0.5 * half):
                heapq.heappush(heap, (*look(s, 0.5 * half, lower), s, 0.5 * half))
        if not heap:
            break
    lower = min([floor, *(item[0] for item in heap)])
    return replace(best, lower=min(lower, best.upper)), at


def _first(pair: _MovingPair, known: float, thresholds: Thresholds, margin: float) -> float:
    """Everything before this t, at most ``known``, is proven to be further apart than ``margin`` mm.

    It is the start of the leftmost stretch that can neither be cleared nor cut further, so it is never late; where
    the steps come to an end, of the leftmost one that is still open.
    """

    def enough(distance: Distance) -> bool:
        sharp = distance.upper - distance.lower <= ACCURACY
        return sharp or distance.lower > 2.0 * margin + ACCURACY or distance.upper <= margin

    todo = [(0.0, known)]
    for _ in range(MAX_STEPS):
        start, stop = todo[-1]
        middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
        if half * pair.speed <= 0.5 * ACCURACY:
            return start
        todo.pop()
        here = pair.ask(middle, enough, thresholds).lower
        if pair.lower(middle, half, here, margin + 0.5 * ACCURACY) <= margin:
            todo += [(middle, stop), (start, middle)]
        elif not todo:
            return known
    return todo[-1][0]


@dataclass(frozen=True, slots=True, eq=False)
class MotionDistance:
    """Answer of `first_contact` and `min_clearance`.

    Attributes
    ----------
    touches : bool
        Whether the bodies come within the margin (0 mm for `min_clearance`) of each other.
    t : float
        Normalised time from 0 to 1: of the first contact, or of the least distance.
    distance : Distance
        The distance at ``t``, points in a's frame; its ``lower`` holds for the whole motion where ``t`` is the time
        of the least distance.
    pose : ndarray (4, 4)
        Pose of b in a's frame at ``t``.
    resolution : float
        No contact deeper than this (mm) was missed before ``t``; no time has a distance lower by more.
    evaluations : int
        How many poses and stretches were looked at.
    contact : SignedDistance or None
        For a groove and a cylinder the kernel's own answer at ``t``, with the feature's name.
    """

    touches: bool
    t: float
    distance: Distance
    pose: Array
    resolution: float
    evaluations: int
    contact: SignedDistance | None = None


def first_contact(
    a: AnyShape,
    b: AnyShape,
    motion: Motion,
    T_a_b: ArrayLike | None = None,
    *,
    margin: float = 0.0,
    resolution: float | None = None,
) -> MotionDistance:
    """First time at which body ``b``, moving in the frame of ``a``, comes within ``margin`` mm of it.

    Branch and bound in the order of time: everything before the answer is proven to be free, so a contact is never
    reported late. If the margin is never reached the answer is the closest approach, with ``touches`` False.

    Parameters
    ----------
    a, b : Solid, MeshShape, Cylinder or SweptArc
        Two bodies. For a `SweptArc` and a `Cylinder` the kernel's search is used, to rounding; the cylinder's ends
        then are rounded. Any other pair is found to within 1e-4 mm of way.
    motion : Motion
        Moves b.
    T_a_b : array_like (4, 4), optional
        Pose of b at t = 0.
    margin : float
        Distance in mm that counts as contact.
    resolution : float, optional
        For groove and cylinder: depth in mm that may be missed, 1e-12 of the largest size by default.

    Raises
    ------
    InputError
        For anything that is no shape, motion, rigid pose or finite number.
    SolverError
        If the search takes too many steps, or the motion goes so far that rounding moves it by more than the bodies.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.core.pose import translation
    >>> from clamp3d.core.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> hit = first_contact(groove, wire, Motion.translate((0.0, -40.0, 0.0)), translation(0.0, 20.0, 0.0))
    >>> hit.touches, round(hit.t, 12), hit.distance.method
    (True, 0.5375, 'groove kernel')
    """
    margin = place("margin", margin)
    pair = _searched(a, b, motion, T_a_b, resolution)
    if isinstance(pair, Search):
        return _from_kernel(pair, *pair.first_contact(margin))
    thresholds = Thresholds(max(margin, 1e-6))
    least, t = _least(pair, thresholds, None)
    touches = least.upper <= margin + RESOLUTION
    if touches:
        t = _first(pair, t, thresholds, margin)
        least = pair.ask(t, measured, thresholds)
    return _from_search(pair, touches, t, least)


def min_clearance(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None = None, *, resolution: float | None = None
) -> MotionDistance:
    """Least signed distance of ``b``, moving in the frame of ``a``, on its whole way.

    Parameters and exceptions are those of `first_contact`.

    Examples
    --------
    >>> import numpy as np
    >>> from clamp3d.core.pose import translation
    >>> from clamp3d.core.primitives import Cylinder, SweptArc
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> least = min_clearance(groove, wire, Motion.translate((2.0, 0.0, 0.0)), translation(-1.0, -1.0, 0.0))
    >>> round(least.distance.value, 12), least.t
    (0.085786437627, 0.0)
    """
    pair = _searched(a, b, motion, T_a_b, resolution)
    if isinstance(pair, Search):
        return _from_kernel(pair, None, *pair.least())
    least, t = _least(pair, Thresholds(1e-6), None)
    return _from_search(pair, least.upper <= RESOLUTION, t, least)


def _searched(
    a: AnyShape, b: AnyShape, motion: Motion, T_a_b: ArrayLike | None, resolution: float | None
) -> Search | _MovingPair:
    instance("motion", motion, Motion)
    T = np.eye(4) if T_a_b is None else scene_pose(T_a_b, "T_a_b")
    motion = motion.resolved(T)
    if isinstance(a, SweptArc) and isinstance(b, Cylinder):
        return Search(a, b, motion, T, resolution)
    cache = ModelCache()
    return _MovingPair(cache.model(as_shape(b)), cache.model(as_shape(a)), motion, T, np.eye(4))


def _from_kernel(search: Search, touches: bool | None, t: float, slack: float) -> MotionDistance:
    contact = search.at(t)
    found = kernel_distance(contact)
    if touches is None:
        touches = found.upper <= 0.0
        found = replace(found, lower=found.lower - slack)
    return MotionDistance(touches, t, found, search.pose(t), slack, search.evaluations, contact)


def _from_search(pair: _MovingPair, touches: bool, t: float, found: Distance) -> MotionDistance:
    pose = pair.motion.at(t, pair.start)
    width = max(found.upper - found.lower, ACCURACY)
    return MotionDistance(
        touches, t, with_normal(found.moved(pose).swapped()), pose, width, sum(pair.counters.queries.values())
    )


@dataclass(frozen=True, slots=True, eq=False)
class PoseVerdicts:
    """One part at n poses against the others it may meet: arrays (n, k) for k ``others``.

    ``lower`` and ``upper`` bound the signed distance in mm; ``verdict`` holds the verdicts' names.
    """

    part: str
    others: tuple[str, ...]
    verdict: Array
    lower: Array
    upper: Array

    @property
    def worst(self) -> Array:
        """Worst verdict (n,) of each pose."""
        order = {v.value: k for k, v in enumerate(Verdict)}
        ranks = np.vectorize(order.__getitem__, otypes=[np.int64])(self.verdict)
        return np.asarray(np.array([v.value for v in Verdict])[ranks.min(axis=1)])


def check_poses(
    scene: Scene,
    part: str,
    poses: ArrayLike,
    *,
    others: tuple[str, ...] | None = None,
    cache: ModelCache | None = None,
) -> PoseVerdicts:
    """Verdicts of one part of a scene at many poses.

    Parameters
    ----------
    scene : Scene
        The other parts at their poses, and the thresholds.
    part : str
        Name of the part.
    poses : array_like (n, 4, 4)
        Its poses in the world, mm.
    others : tuple of str, optional
        Names of the parts it may meet; all others by default.
    cache : ModelCache, optional
        Keeps models from one call to the next.

    Returns
    -------
    PoseVerdicts
        Verdicts and bounds of the distances, one row per pose.

    Raises
    ------
    InputError
        For unknown names or a pose that is not rigid.

    Examples
    --------
    >>> from clamp3d.core import shapes
    >>> from clamp3d.core.pose import translation
    >>> scene = Scene().add("plate", shapes.box((50, 50, 4))).add("pin", shapes.cylinder(5, 20))
    >>> check_poses(scene, "pin", [translation(0, 0, z) for z in (12.0, 12.5, 0.0)]).worst.tolist()
    ['contact', 'clear', 'clash']
    """
    instance("scene", scene, Scene)
    if cache is not None:
        instance("cache", cache, ModelCache)
    shop = cache or ModelCache()
    i = scene.index(part)
    rest = (
        [scene.index(name) for name in items("others", others, "part names")]
        if others is not None
        else [k for k in range(len(scene.parts)) if k != i]
    )
    if i in rest:
        raise InputError(f"others must not hold {part!r} itself")
    given = array("poses", poses, (None, 4, 4), finite=False)
    T = np.array([scene_pose(pose, f"poses[{k}]") for k, pose in enumerate(given)]).reshape(-1, 4, 4)
    n = len(T)
    lower, upper = np.full((n, len(rest)), np.inf), np.full((n, len(rest)), np.inf)
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
        shop.counters.queries["boxes"] += n
        lower[:, column] = gaps
        local = inverse(T_other) @ T
        for k in np.flatnonzero(gaps < scene.thresholds.reach + 1e-6).tolist():
            found = refine(
                other,
                model,
                local[k],
                Distance(float(gaps[k])),
                scene.thresholds,
                lambda d, allowance=allowance: scene.thresholds.verdict(d, allowance) is not Verdict.UNCERTAIN,  # type: ignore[misc]
            )
            lower[k, column], upper[k, column] = found.lower, found.upper
            verdict[k, column] = scene.thresholds.verdict(found, allowance).value
    return PoseVerdicts(part, tuple(scene.parts[j].name for j in rest), verdict.astype(str), lower, upper)
