"""Lower bounds over a stretch of a motion from the hulls that the triangles of a mesh sweep.

A point that moves along a straight line stays on it, so a triangle stays in the hull of its first and last place, and
one that slides along a face keeps its distance however long the stretch. Arcs leave the hull by their sagitta.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.broad import BoxTree
from clamp3d.collide.surface import fcl_tree
from clamp3d.core.linear import dot, norm
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array
from clamp3d.core.triangles import distinct

_MOST = 3000
"""Swept triangles whose hulls are measured at once."""
_PRISM = np.array(
    [(0, 1, 2), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)], dtype=np.int64
)
_ONE = np.array([(0, 1, 2)], dtype=np.int64)
_ALL = np.array(list(itertools.combinations(range(6), 3)), dtype=np.int64)
"""Of six points the faces of any hull are among these."""


class Standing:
    """Triangles (n, 3, 3) of a part that stands still, each with its error (n,) mm.

    ``piece`` (n,) numbers the connected surfaces that they make among themselves: of a shell of which some triangles
    are left out there may be several.
    """

    def __init__(self, triangles: Array, errors: Array, piece: NDArray[np.int64]) -> None:
        self.triangles, self.errors = triangles, errors
        _, first, self.piece = np.unique(piece, return_index=True, return_inverse=True)
        self.points = triangles[first, 0]
        self.boxes = np.full((len(first), 2, 3), np.inf) * np.array([[1.0], [-1.0]])
        np.minimum.at(self.boxes[:, 0], self.piece, triangles.min(axis=1))
        np.maximum.at(self.boxes[:, 1], self.piece, triangles.max(axis=1))
        self._tree = BoxTree(triangles.min(axis=1) - errors[:, None], triangles.max(axis=1) + errors[:, None])

    def near(self, low: Array, high: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Which boxes ``low``, ``high`` (m, 3) meet one of a triangle, and which triangles those are."""
        rows, triangles = self._tree.meeting(low, high)
        return distinct(rows), distinct(triangles)


def swept_gap(
    standing: Standing,
    triangles: Array,
    errors: Array,
    motion: Motion,
    stretch: tuple[float, float],
    most: float,
    least: float = -np.inf,
) -> float:
    """Distance (mm) that moving triangles certainly keep from standing ones all through a stretch, up to ``most``.

    Parameters
    ----------
    standing : Standing
        What they may meet, in the world.
    triangles, errors : ndarray (m, 3, 3), (m,)
        The moving ones at t = 0 in the world, each with how far the true surface may be from it (mm).
    motion : Motion
        What moves them.
    stretch : tuple of float
        First and last time.
    most : float
        A distance (mm) that is enough.
    least : float
        A distance (mm) that they are known to keep.

    Returns
    -------
    float
        Minus infinity where they may meet.
    """
    import fcl

    span = stretch[1] - stretch[0]
    out = motion.from_axis(triangles).max(axis=1) if motion.angle else np.zeros(len(triangles))

    def at(t: float) -> Array:
        T = motion.at(t)
        return np.asarray(dot(triangles, T[:3, :3].T) + T[:3, 3])

    hulls = np.concatenate([at(t) for t in stretch], axis=1)
    # Along arcs the acceleration is at most that of the corner furthest from the axis.
    off_chord = errors + 0.125 * (motion.angle * span) ** 2 * out
    reach = (off_chord + most)[:, None]
    low, high = hulls.min(axis=1), hulls.max(axis=1)
    rows, other = standing.near(low - reach, high + reach)
    if not len(rows):
        return most
    if most - errors[rows].max() - standing.errors[other].max() <= least:  # hulls will say no more
        return least
    shape, gap, errors = _ALL if motion.angle else _PRISM, most, off_chord
    if len(rows) > _MOST:  # where they are at the middle, and as far as they travel from there
        errors = off_chord + 0.5 * span * (norm(motion.travel) + abs(motion.angle) * out)
        shape, hulls = _ONE, at(0.5 * (stretch[0] + stretch[1]))
    elif _holds(hulls[rows], standing, distinct(standing.piece[other])):
        return least
    still = [(_tree(standing.triangles[other[k]], _ONE), error) for k, error in _levels(standing.errors[other])]
    for k, error in _levels(errors[rows]):
        moving = _tree(hulls[rows[k]], shape)
        for fixed, off in still:
            d = float(fcl.distance(fixed, moving, fcl.DistanceRequest(), fcl.DistanceResult()))
            if d <= 0.0:
                return least
            gap = min(gap, d - error - off)
    return max(gap, least)


def _holds(hulls: Array, standing: Standing, pieces: NDArray[np.intp]) -> bool:
    """Whether one of the ``pieces`` may be inside the hull of some row of ``hulls`` (m, 6, 3), whose sides it misses.

    It is as a whole where one of its points is. The planes that separate a point from a hull are those of its sides.
    """
    low, high = hulls.min(axis=1), hulls.max(axis=1)
    for k in pieces:
        box, point = standing.boxes[k], standing.points[k]
        around = hulls[((low <= box[0]) & (box[1] <= high)).all(axis=1)] - point
        if not len(around):
            continue
        a, b, c = (around[:, _ALL[:, i]] for i in range(3))
        height = dot(np.cross(b - a, c - a), np.swapaxes(around, 1, 2))
        slack = 1e-14 * np.abs(around).max(axis=(1, 2), initial=0.0) ** 3
        beyond = (height > slack[:, None, None]).all(axis=2) | (height < -slack[:, None, None]).all(axis=2)
        if not beyond.any(axis=1).all():
            return True
    return False


def _levels(errors: Array) -> list[tuple[NDArray[np.intp], float]]:
    """Rows of errors (m,) of one order of magnitude, and the largest of each."""
    level = np.ceil(np.log2(np.maximum(errors, 1e-300)) / 2.0)
    return [(rows, float(errors[rows].max())) for k in distinct(level) if len(rows := np.flatnonzero(level == k))]


def _tree(points: Array, shape: NDArray[np.int64]) -> Any:
    """FCL's tree of triangles with the corners ``shape`` (k, 3) among each row of ``points`` (m, c, 3)."""
    import fcl

    count = points.shape[1]
    faces = (count * np.arange(len(points))[:, None, None] + shape).reshape(-1, 3)
    return fcl.CollisionObject(fcl_tree(points.reshape(-1, 3), faces))
