"""One part at many poses against the others of its scene: verdicts and bounds by pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import instance, items
from clamp3d.collide.answer import Distance
from clamp3d.collide.batch import by_kernel
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.model import Model, ModelCache
from clamp3d.collide.refine import refine
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import NAMES, Verdict
from clamp3d.core.linear import dot
from clamp3d.core.motion import FARTHEST, scene_pose
from clamp3d.core.pose import Array, check_pose_array, inverse
from clamp3d.errors import InputError, MissingLibraryError

_FEW = 32
"""Other parts up to which all of their boxes are compared with those of all poses."""


@dataclass(frozen=True, eq=False)
class PoseVerdicts:
    """One part at n poses against the k ``others`` that it may meet.

    ``row``, ``column`` (m,): the poses and others that come near; ``least``, ``most`` (m,) bound their signed distances
    in mm, no more closely than the verdict needs; ``kind`` (m,) holds the verdicts' names. All else is clear, more than
    ``reach`` mm apart.
    """

    part: str
    others: tuple[str, ...]
    poses: int
    reach: float
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    least: Array
    most: Array
    kind: NDArray[np.str_]

    @cached_property
    def verdict(self) -> NDArray[np.str_]:
        """Names (n, k) of the verdicts."""
        return self._whole(Verdict.CLEAR.value, self.kind)

    @cached_property
    def lower(self) -> Array:
        """Lower bounds (n, k) of the signed distances, mm."""
        return self._whole(self.reach, self.least)

    @cached_property
    def upper(self) -> Array:
        """Upper bounds (n, k) of the signed distances, mm; infinite where nothing came near."""
        return self._whole(np.inf, self.most)

    @property
    def worst(self) -> NDArray[np.str_]:
        """Worst verdict (n,) of each pose."""
        names = [v.value for v in Verdict]
        rank = np.full(self.poses, names.index(Verdict.CLEAR.value))
        np.minimum.at(rank, self.row, np.argsort(names, kind="stable")[np.searchsorted(np.sort(names), self.kind)])
        return np.asarray(np.array(names)[rank])

    def _whole(self, other: Any, values: NDArray[Any]) -> NDArray[Any]:
        made = np.full((self.poses, len(self.others)), other, dtype=values.dtype)
        made[self.row, self.column] = values
        return made


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
    T = check_pose_array(poses)
    for k in np.flatnonzero(np.abs(T[:, :3, 3]).max(axis=1) > FARTHEST)[:1]:
        scene_pose(T[k], f"poses[{k}]")
    model = shop.model(scene.parts[i].shape)
    models = [shop.model(scene.parts[j].shape) for j in rest]
    poses_of = np.array([scene.parts[j].T_world for j in rest]).reshape(-1, 4, 4)
    moving = Boxes.of(np.repeat(model.bounds[None], len(T), axis=0), T)
    still = Boxes.of(np.array([m.bounds for m in models]).reshape(-1, 2, 3), poses_of)
    reach = scene.thresholds.reach + 1e-6
    row, column = _near(moving, still, reach)
    both = still.joined(moving)
    least, most = np.full(len(row), -np.inf), np.full(len(row), np.inf)
    kind = np.full(len(row), Verdict.UNCERTAIN.value, dtype=NAMES)
    # Equal parts that may meet this one alike are measured together.
    alike: dict[tuple[int, float | None], list[int]] = {}
    for k in np.unique(column).tolist():
        allowance = scene.allowance(part, scene.parts[rest[k]].name)
        alike.setdefault((id(models[k]), allowance), []).append(k)
    for (_, allowance), columns in alike.items():
        near = np.flatnonzero(np.isin(column, columns))
        other, local = models[columns[0]], dot(inverse(poses_of[column[near]]), T[row[near]])
        known = by_kernel(other, model, local)
        least[near], most[near] = known.lower, known.upper
        kind[near] = scene.thresholds.verdicts(known.lower, known.upper, allowance)
        left = np.flatnonzero(kind[near] == Verdict.UNCERTAIN.value)
        near, local = near[left], local[left]
        least[near] = box_gaps(both, np.column_stack([column[near], len(rest) + row[near]]))
        shop.counters.queries["boxes"] += len(near)
        for m, T_other in zip(near.tolist(), local, strict=True):
            if least[m] >= reach:
                kind[m] = Verdict.CLEAR.value
                continue
            try:
                found = _refined(other, model, T_other, Distance(float(least[m])), scene, allowance)
                kind[m] = scene.thresholds.verdict(found, allowance).value
                least[m], most[m] = found.lower, found.upper
            except MissingLibraryError:
                raise
            except Exception:  # one pose that fails is a finding, not the end of all others
                kind[m], most[m] = Verdict.FAILED.value, np.inf
    names = tuple(scene.parts[j].name for j in rest)
    return PoseVerdicts(part, names, len(T), reach, row, column, least, most, kind)


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
