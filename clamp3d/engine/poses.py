"""One part at many poses against the others of its scene: verdicts and bounds by pose."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import function, instance, items
from clamp3d.engine.batch import bounds_at_poses, overlaps_at_poses
from clamp3d.engine.broad import Boxes, near_between
from clamp3d.engine.judge import judge, kind_of_overlap, may_hold
from clamp3d.engine.model import Model, ModelCache, Progress, ignore
from clamp3d.engine.refine import from_boxes
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import VERDICTS, Thresholds, Verdict
from clamp3d.errors import InputError, MissingLibraryError
from clamp3d.geometry.pose import Array, check_pose_array, inverse

_NAMES = np.array([verdict.value for verdict in VERDICTS])
_CLASH, _UNCERTAIN = VERDICTS.index(Verdict.CLASH), VERDICTS.index(Verdict.UNCERTAIN)


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
        worst = np.full(self.poses, VERDICTS.index(Verdict.CLEAR))
        np.minimum.at(worst, self.row, self.rank)
        return np.asarray(_NAMES[worst])

    def _whole(self, other: Any, values: NDArray[Any]) -> NDArray[Any]:
        matrix = np.full((self.poses, len(self.others)), other, dtype=values.dtype)
        matrix[self.row, self.column] = values
        return matrix


def check_poses(
    scene: Scene,
    part: str,
    poses: ArrayLike,
    *,
    others: tuple[str, ...] | None = None,
    progress: Progress | None = None,
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
    progress : callable, optional
        Called with (stage, done, of) for each pose that is measured by itself; most are measured together.
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
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> scene = Scene().add("plate", shapes.box((50, 50, 4))).add("pin", shapes.cylinder(5, 20))
    >>> check_poses(scene, "pin", [translation(0, 0, z) for z in (12.0, 12.5, 0.0)]).worst.tolist()
    ['contact', 'clear', 'clash']
    """
    instance("scene", scene, Scene)
    if cache is not None:
        instance("cache", cache, ModelCache)
    function("progress", progress)
    cache, progress = cache or ModelCache(), progress or ignore
    number = scene.index(part)
    names = tuple(p.name for p in scene.parts if p.name != part)
    names = names if others is None else items("others", others, "part names")
    rest = [scene.index(name) for name in names]
    if number in rest:
        raise InputError(f"others must not hold {part!r} itself")
    T = check_pose_array(poses)
    moving, standing = cache.model(scene.parts[number].shape), [cache.model(scene.parts[k].shape) for k in rest]
    P = np.array([scene.parts[k].T_world for k in rest]).reshape(-1, 4, 4)
    reach = scene.thresholds.reach
    boxes = Boxes.of(np.broadcast_to(moving.bounds, (len(T), 2, 3)), T)
    still = Boxes.of(np.array([model.bounds for model in standing]).reshape(-1, 2, 3), P)
    row, column = near_between(boxes, still, reach).T
    least, most, rank = np.empty(len(row)), np.empty(len(row)), np.empty(len(row), dtype=np.int8)
    for k, (name, other) in enumerate(zip(names, standing, strict=True)):
        own = np.flatnonzero(column == k)
        if len(own):
            relative = inverse(P[k]) @ T[row[own]]
            judged = _judged(other, moving, relative, scene.thresholds, scene.allowance(part, name), progress)
            least[own], most[own], rank[own] = judged
    least[least < 0.0] = -np.inf  # how deep a point lies in the other bounds verdicts, not the way out
    return PoseVerdicts(part, names, len(T), reach, row, column, least, most, rank)


def _judged(
    a: Model, b: Model, T: Array, thresholds: Thresholds, allowance: float | None, progress: Progress
) -> tuple[Array, Array, NDArray[np.int8]]:
    """Bounds of the signed distances (m,) of ``b`` at ``T`` (m, 4, 4) in a's frame, and their verdicts' places."""
    batch = bounds_at_poses(a, b, T)
    least, most = batch.lower.copy(), batch.upper.copy()
    undecided = thresholds.verdicts(least, most, allowance) == _UNCERTAIN
    most[undecided] = np.minimum(most[undecided], overlaps_at_poses(a, b, T[undecided]))
    rank = thresholds.verdicts(least, most, allowance)
    # A part that clashes may hold the other whole.
    clash = np.flatnonzero(rank == _CLASH)
    holds = may_hold(b, a, T[clash], thresholds.contact) | may_hold(a, b, inverse(T[clash]), thresholds.contact)
    still_open = np.union1d(np.flatnonzero(rank == _UNCERTAIN), clash[holds])
    for n, k in enumerate(still_open.tolist()):
        progress("poses", n, len(still_open))
        try:
            if rank[k] == _CLASH:
                rank[k] = VERDICTS.index(kind_of_overlap(a, b, T[k], thresholds.contact))
                continue
            verdict, distance = judge(a, b, T[k], from_boxes(a, b, T[k]), thresholds, allowance)
            rank[k], least[k], most[k] = VERDICTS.index(verdict), distance.lower, distance.upper
        except MissingLibraryError:
            raise
        except Exception:  # one pose that fails is a finding, not the end of all others
            rank[k], least[k], most[k] = VERDICTS.index(Verdict.FAILED), -np.inf, np.inf
    return least, most, rank
