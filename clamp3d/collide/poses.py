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
from clamp3d.collide.batch import Pairs, bounds_by_kernel, relative
from clamp3d.collide.broad import FEW, FIRST, Boxes, BoxTree, box_gaps, box_sizes, world_boxes
from clamp3d.collide.judge import contained, judge
from clamp3d.collide.model import Model, ModelCache
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import VERDICTS, Thresholds, Verdict
from clamp3d.core.motion import FARTHEST, scene_pose
from clamp3d.core.pose import Array, check_pose_array
from clamp3d.errors import InputError, MissingLibraryError

_BLOCK = 8192
"""Poses that are compared together with what comes near any of them."""

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
    placed = scene.placed
    if others is None:
        names = placed.names[:i] + placed.names[i + 1 :]
        rest = np.delete(np.arange(len(placed.names)), i)
    else:
        names = items("others", others, "part names")
        rest = np.array([scene.index(name) for name in names], dtype=np.int64)
    if i in rest:
        raise InputError(f"others must not hold {part!r} itself")
    which = placed.which[rest]
    models = {k: shop.model(placed.shapes[k]) for k in np.flatnonzero(np.bincount(which)).tolist()}
    bounds = np.zeros((len(placed.shapes), 2, 3))
    for k, found in models.items():
        bounds[k] = found.bounds
    model, P = shop.model(scene.parts[i].shape), placed.poses[rest]
    reach = scene.thresholds.reach + 1e-6
    T, row, column = _near(poses, model.bounds, world_boxes(bounds, P, which), reach)
    # Equal parts that may meet this one alike are measured together.
    alike: dict[tuple[int, float | None], list[int]] = {}
    for k in np.flatnonzero(np.bincount(column)).tolist():
        allowance = scene.allowance(part, names[k])
        alike.setdefault((id(models[int(which[k])]), allowance), []).append(k)
    least, most, rank = np.empty(len(row)), np.empty(len(row)), np.empty(len(row), dtype=np.int8)
    for (_, allowance), columns in alike.items():
        some = slice(None) if len(alike) == 1 else np.flatnonzero(np.isin(column, columns))
        other = models[int(which[columns[0]])]
        judged = _judged(other, model, (P, column[some], T, row[some]), scene.thresholds, allowance)
        if len(alike) == 1:
            least, most, rank = judged
        else:
            least[some], most[some], rank[some] = judged
    least[least < 0.0] = -np.inf  # how deep a point lies in the other bounds verdicts, not the way out
    return PoseVerdicts(part, names, len(T), reach, row, column, least, most, rank)


def _judged(
    a: Model, b: Model, pairs: Pairs, thresholds: Thresholds, allowance: float | None
) -> tuple[Array, Array, NDArray[np.int8]]:
    """Bounds of the signed distances (m,) of two parts at pairs of poses, and the places of their verdicts."""
    A, column, T, row = pairs
    least, most = bounds_by_kernel(a, b, pairs, thresholds.clash(allowance))
    rank = thresholds.verdicts(least, most, allowance)
    clash = np.flatnonzero(rank == _CLASH)
    inside = contained(a, b, (A, column[clash], T, row[clash]), thresholds)
    rank[clash[inside]] = VERDICTS.index(Verdict.CONTAINED)
    left = np.flatnonzero(rank == _UNCERTAIN)
    places = relative((A, column[left], T, row[left]))
    around = np.concatenate([np.repeat(b.bounds[None], len(left), axis=0), a.bounds[None]])
    each = np.column_stack([np.full(len(left), len(left)), np.arange(len(left))])
    least[left] = box_gaps(Boxes.of(around, np.concatenate([places, np.eye(4)[None]])), each)
    a.counters.queries["boxes"] += len(left)
    for m, T in zip(left.tolist(), places, strict=True):
        if least[m] >= thresholds.reach + 1e-6:
            rank[m] = _CLEAR
            continue
        try:
            verdict, known = judge(a, b, T, Distance(float(least[m])), thresholds, allowance)
            rank[m], least[m], most[m] = VERDICTS.index(verdict), known.lower, known.upper
        except MissingLibraryError:
            raise
        except Exception:  # one pose that fails is a finding, not the end of all others
            rank[m], most[m] = VERDICTS.index(Verdict.FAILED), np.inf
    return least, most, rank


def _near(
    poses: ArrayLike, bounds: Array, still: Array, reach: float
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """The poses (n, 4, 4), checked, and those poses and others (m,) whose boxes come within ``reach`` mm.

    ``bounds`` (2, 3) is the box of the part in its own frame, ``still`` (6, k) are those of the others in the world.
    """
    T = np.require(array("poses", poses, (None, 4, 4), finite=False), np.float64, ["C", "A"])
    bad, row, column = _meeting(T, bounds, still, reach)
    if bad >= 0:
        T = np.require(check_pose_array(T), np.float64, ["C"])
        bad, row, column = _meeting(T, bounds, still, reach)
        if bad >= 0:
            scene_pose(T[bad], f"poses[{bad}]")
    return T, row, column


def _meeting(T: Array, bounds: Array, still: Array, reach: float) -> tuple[int, NDArray[np.int64], NDArray[np.int64]]:
    """The first pose that is not rigid or too far off, or -1; and what comes near before, as `_near` has it.

    A block of poses, which often follow each other, is compared with all others that come near the block.
    """
    from clamp3d.collide.poses_kernel import around, boxes, meet

    below, above, sizes = still[:3] - reach, still[3:] + reach, box_sizes(bounds[None])
    moving, others = np.empty((6, min(_BLOCK, len(T)))), np.empty(still.shape[1], dtype=np.int64)
    pairs, count = np.empty((2, len(T)), dtype=np.int64), 0
    tree = BoxTree(below.T, above.T)
    for start in range(0, len(T), _BLOCK):
        some = T[start : start + _BLOCK]
        bad = boxes(some, sizes, FIRST, FARTHEST, moving)
        if bad >= 0:
            return start + bad, *pairs[:, :count]
        near, n = others[: around(moving, len(some), below, above, others)], len(some)
        most = n * len(near)
        if len(near) > FEW:
            row, column = tree.meeting(moving[:3, :n].T, moving[3:, :n].T)
            most = len(column)
        if count + most > pairs.shape[1]:
            pairs = np.concatenate([pairs[:, :count], np.empty((2, count + most), dtype=np.int64)], axis=1)
        if len(near) > FEW:
            pairs[0, count : count + most] = start + row
            pairs[1, count : count + most] = column
            count += most
        else:
            count += meet(moving, n, below, above, near, start, pairs[0, count:], pairs[1, count:])
    return -1, *pairs[:, :count]
