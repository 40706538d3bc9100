"""One part at many poses against the others of its scene: verdicts and bounds by pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import array, instance, items
from clamp3d.collide.answer import Distance
from clamp3d.collide.batch import by_kernel
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.model import Model, ModelCache
from clamp3d.collide.refine import refine
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
from clamp3d.core.motion import scene_pose
from clamp3d.core.pose import Array, inverse
from clamp3d.errors import InputError, MissingLibraryError

_FEW = 32
"""Other parts up to which all of their boxes are compared with those of all poses."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseVerdicts:
    """One part at n poses against the others it may meet: arrays (n, k) for k ``others``.

    ``lower`` and ``upper`` bound the signed distance in mm, no more closely than the verdict needs; ``verdict`` holds
    the verdicts' names.
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
    verdict = np.full((n, len(rest)), Verdict.CLEAR.value, dtype=f"<U{max(len(v.value) for v in Verdict)}")
    model = shop.model(scene.parts[i].shape)
    models = [shop.model(scene.parts[j].shape) for j in rest]
    poses_of = np.array([scene.parts[j].T_world for j in rest]).reshape(-1, 4, 4)
    moving = Boxes.of(np.repeat(model.bounds[None], n, axis=0), T)
    lower[:] = reach = scene.thresholds.reach + 1e-6
    rows, columns = _near(moving, Boxes.of(np.array([m.bounds for m in models]).reshape(-1, 2, 3), poses_of), reach)
    for column in np.unique(columns).tolist():
        other, near = models[column], rows[columns == column]
        allowance = scene.allowance(part, scene.parts[rest[column]].name)
        still = Boxes.of(other.bounds[None], poses_of[column][None])
        gaps = box_gaps(still.joined(moving), np.column_stack([np.zeros(len(near), dtype=np.int64), 1 + near]))
        shop.counters.queries["boxes"] += len(near)
        lower[near, column] = gaps
        near = near[gaps < reach]
        local = inverse(poses_of[column]) @ T[near]
        for row, place, known in zip(near.tolist(), local, by_kernel(other, model, local), strict=True):
            found, kind = known or Distance(float(lower[row, column])), Verdict.UNCERTAIN
            try:
                if known is None:
                    found = _refined(other, model, place, found, scene, allowance)
                kind = scene.thresholds.verdict(found, allowance)
            except MissingLibraryError:
                raise
            except Exception:  # one pose that fails is a finding, not the end of all others
                kind = Verdict.FAILED
            lower[row, column], upper[row, column] = found.lower, found.upper
            verdict[row, column] = kind.value
    return PoseVerdicts(part, tuple(scene.parts[j].name for j in rest), verdict, lower, upper)


def _near(moving: Boxes, still: Boxes, reach: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Poses and others (m,) whose boxes along the world's axes come within ``reach`` mm."""
    if len(still.centre) <= _FEW:
        away = np.abs(moving.centre[:, None] - still.centre) - moving.reach[:, None] - still.reach
        rows, columns = np.nonzero((away <= reach).all(axis=2))
        return rows.astype(np.int64), columns.astype(np.int64)
    from rtree import index

    half = still.reach + reach
    tree = index.Index(
        (np.arange(len(half)), still.centre - half, still.centre + half), properties=index.Property(dimension=3)
    )
    found, count = tree.intersection_v(moving.centre - moving.reach, moving.centre + moving.reach)  # type: ignore[no-untyped-call]
    rows = np.repeat(np.arange(len(moving.centre)), np.asarray(count, dtype=np.int64))
    return rows, np.asarray(found, dtype=np.int64)


def _refined(a: Model, b: Model, T: Array, start: Distance, scene: Scene, allowance: float | None) -> Distance:
    def enough(known: Distance) -> bool:
        return scene.thresholds.verdict(known, allowance) is not Verdict.UNCERTAIN

    return refine(a, b, T, start, scene.thresholds, enough)
