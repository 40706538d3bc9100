"""One part at many poses against the others of its scene: verdicts and bounds by pose."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import array, instance, items
from clamp3d.collide.answer import Distance
from clamp3d.collide.batch import bounds_by_kernel
from clamp3d.collide.broad import FEW, Boxes, box_gaps
from clamp3d.collide.judge import contained, judge
from clamp3d.collide.model import ModelCache
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import VERDICTS, Verdict
from clamp3d.core.motion import FARTHEST, scene_pose
from clamp3d.core.pose import Array, check_pose_array
from clamp3d.errors import InputError, MissingLibraryError

_BLOCK = 8192
"""Poses that the kernel is asked together: what is noted of them stays in the processor's own memory."""

_NAMES = np.array([verdict.value for verdict in VERDICTS])
_CLASH, _UNCERTAIN, _CLEAR = map(VERDICTS.index, (Verdict.CLASH, Verdict.UNCERTAIN, Verdict.CLEAR))


@dataclass(frozen=True, eq=False, repr=False)
class PoseVerdicts:
    """One part at n poses against the k ``others`` that it may meet.

    ``row``, ``column`` (m,): the poses and others that come near; ``least``, ``most`` (m,) bound their signed distances
    in mm, no more closely than the verdict needs, and no overlap from below; ``rank`` (m,) holds the verdicts by their
    places from worst to best, ``kind`` (m,) their names. All else is clear, more than ``reach`` mm apart.
    """

    part: str
    others: tuple[str, ...]
    poses: int
    reach: float
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    least: Array
    most: Array
    rank: NDArray[np.int8]

    @cached_property
    def kind(self) -> NDArray[np.str_]:
        """Names (m,) of the verdicts of what comes near."""
        return np.asarray(_NAMES[self.rank])

    @cached_property
    def verdict(self) -> NDArray[np.str_]:
        """Names (n, k) of the verdicts."""
        return self._whole(Verdict.CLEAR.value, self.kind)

    @cached_property
    def lower(self) -> Array:
        """Lower bounds (n, k) of the signed distances, mm; minus infinity where parts may overlap."""
        return self._whole(self.reach, self.least)

    @cached_property
    def upper(self) -> Array:
        """Upper bounds (n, k) of the signed distances, mm; infinite where nothing came near."""
        return self._whole(np.inf, self.most)

    def __repr__(self) -> str:
        counts = Counter(self.worst.tolist())
        said = ", ".join(f"{counts[v.value]} {v.value}" for v in Verdict if counts[v.value]) or "no poses"
        return f"PoseVerdicts({self.part!r}: {self.poses} poses; {said})"

    @property
    def worst(self) -> NDArray[np.str_]:
        """Worst verdict (n,) of each pose."""
        worst = np.full(self.poses, _CLEAR)
        np.minimum.at(worst, self.row, self.rank)
        return np.asarray(_NAMES[worst])

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
    from clamp3d.collide.poses_kernel import between

    model = shop.model(scene.parts[i].shape)
    shapes = {id(scene.parts[j].shape): scene.parts[j].shape for j in rest}
    found = {key: shop.model(shape) for key, shape in shapes.items()}
    models = [found[id(scene.parts[j].shape)] for j in rest]
    T, moving = _placed(poses, model.bounds)
    P = np.concatenate([np.empty((0, 4)), *(scene.parts[j].T_world for j in rest)]).reshape(-1, 4, 4)
    still = Boxes.of(np.concatenate([np.empty((0, 3)), *(m.bounds for m in models)]).reshape(-1, 2, 3), P)
    reach = scene.thresholds.reach + 1e-6
    row, column = _near(moving, still, reach)
    least, most = np.empty(len(row)), np.empty(len(row))
    rank = np.empty(len(row), dtype=np.int8)
    # Equal parts that may meet this one alike are measured together.
    alike: dict[tuple[int, float | None], list[int]] = {}
    for k in np.unique(column).tolist() if len(rest) > 1 else range(len(rest)):
        allowance = scene.allowance(part, scene.parts[rest[k]].name)
        alike.setdefault((id(models[k]), allowance), []).append(k)
    for (_, allowance), columns in alike.items():
        other, near = models[columns[0]], np.flatnonzero(np.isin(column, columns))

        def local(rows: NDArray[np.int64]) -> Array:
            out = np.empty((len(rows), 4, 4))
            between(P, column[rows], T, row[rows], out)
            return out

        least[near], most[near] = bounds_by_kernel(other, model, (P, column[near], T, row[near]))
        rank[near] = scene.thresholds.verdicts(least[near], most[near], allowance)
        clash = near[rank[near] == _CLASH]
        rank[clash[contained(other, model, local(clash), scene.thresholds)]] = VERDICTS.index(Verdict.CONTAINED)
        left = near[rank[near] == _UNCERTAIN]
        places = local(left)
        around = np.concatenate([np.repeat(model.bounds[None], len(left), axis=0), other.bounds[None]])
        pairs = np.column_stack([np.full(len(left), len(left)), np.arange(len(left))])
        least[left] = box_gaps(Boxes.of(around, np.concatenate([places, np.eye(4)[None]])), pairs)
        shop.counters.queries["boxes"] += len(left)
        for m, T_other in zip(left.tolist(), places, strict=True):
            if least[m] >= reach:
                rank[m] = _CLEAR
                continue
            try:
                start = Distance(float(least[m]))
                verdict, known = judge(other, model, T_other, start, scene.thresholds, allowance)
                rank[m], least[m], most[m] = VERDICTS.index(verdict), known.lower, known.upper
            except MissingLibraryError:
                raise
            except Exception:  # one pose that fails is a finding, not the end of all others
                rank[m], most[m] = VERDICTS.index(Verdict.FAILED), np.inf
    least[least < 0.0] = -np.inf  # how deep a point lies in the other bounds verdicts, not the way out
    names = tuple(scene.parts[j].name for j in rest)
    return PoseVerdicts(part, names, len(T), reach, row, column, least, most, rank)


def _placed(poses: ArrayLike, bounds: Array) -> tuple[Array, Array]:
    """The poses (n, 4, 4), checked, and centre and half sizes (6, n) along the world's axes of a part's box there."""
    from clamp3d.collide.poses_kernel import boxes

    T = np.require(array("poses", poses, (None, 4, 4), finite=False), np.float64, ["C", "A"])
    found = np.empty((6, len(T)))
    sizes = bounds.mean(axis=0), 0.5 * (bounds[1] - bounds[0]), FARTHEST
    if boxes(T, *sizes, found) >= 0:
        T = np.require(check_pose_array(T), np.float64, ["C"])
        bad = boxes(T, *sizes, found)
        if bad >= 0:
            scene_pose(T[bad], f"poses[{bad}]")
    return T, found


def _near(moving: Array, still: Boxes, reach: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Poses and others (m,) whose boxes along the world's axes come within ``reach`` mm.

    A block of poses, which often follow each other, is compared with all others that come near the block.
    """
    from clamp3d.collide.poses_kernel import meet

    wide = still.reach + reach
    below, above = still.centre - wide, still.centre + wide
    rows, columns = [], []
    tree: Any = None
    for start in range(0, moving.shape[1], _BLOCK):
        part = np.ascontiguousarray(moving[:, start : start + _BLOCK])
        low, high = part[:3] - part[3:], part[:3] + part[3:]
        others = np.flatnonzero(((below <= high.max(axis=1)) & (above >= low.min(axis=1))).all(axis=1))
        if len(others) <= FEW:
            row, column = np.empty((2, part.shape[1] * len(others)), dtype=np.int64)
            count = meet(part, below, above, others, row, column)
            row, column = row[:count], column[:count]
        else:
            from rtree import index

            if tree is None:
                tree = index.Index((np.arange(len(below)), below, above), properties=index.Property(dimension=3))
            column, each = tree.intersection_v(low.T, high.T)
            row = np.repeat(np.arange(part.shape[1]), np.asarray(each, dtype=np.int64))
        rows.append(row + start)
        columns.append(column)
    none = np.empty(0, dtype=np.int64)
    found = (np.concatenate([none, *parts]) for parts in (rows, columns))
    row, column = (part.astype(np.int64, copy=False) for part in found)
    return row, column
