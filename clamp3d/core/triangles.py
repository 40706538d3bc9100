"""Points and numbers of triangles, without trimesh and numpy.ma, whose import takes 0.5 s and 0.008 s of CPU."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.pose import Array


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """What is in an array, once each and sorted: ``numpy.unique``, which asks numpy.ma whether its array is masked.

    >>> distinct(np.array([[3, 1], [1, 2]])).tolist()
    [1, 2, 3]
    """
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def closest_points(triangles: Array, points: Array) -> Array:
    """The point (n, 3) of each triangle (n, 3, 3) that is nearest to the point (n, 3) of the same row.

    >>> closest_points(np.array([[[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]]), np.array([[1.0, 1.0, 5.0]])).tolist()
    [[1.0, 1.0, 0.0]]
    """
    starts = triangles
    sides = np.roll(triangles, -1, axis=1) - triangles
    to_point = points[:, None] - starts
    square = (sides * sides).sum(axis=2)
    share = np.clip((to_point * sides).sum(axis=2) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    feet = starts + share[:, :, None] * sides
    away = ((feet - points[:, None]) ** 2).sum(axis=2)
    rows = np.arange(len(points))
    nearest = feet[rows, away.argmin(axis=1)]
    normal = np.cross(sides[:, 0], sides[:, 1])
    # Inside: left of all three sides, as seen from the tip of the normal.
    left = (np.cross(normal[:, None], sides) * to_point).sum(axis=2)
    inside = (left > 0.0).all(axis=1)
    n, p = normal[inside], points[inside]
    height = ((p - starts[inside, 0]) * n).sum(axis=1) / (n * n).sum(axis=1)
    nearest[inside] = p - height[:, None] * n
    return np.asarray(nearest)


def side_keys(a: NDArray[np.int64], b: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Numbers that name the sides between nodes ``a`` and ``b`` of ``n``, whichever way they go.

    >>> side_keys(np.array([0, 4]), np.array([4, 0]), 10).tolist()
    [4, 4]
    """
    return np.asarray(np.minimum(a, b) * n + np.maximum(a, b))
