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
    found = np.sort(values, axis=None)
    return found[np.append(True, found[1:] != found[:-1])] if len(found) else found


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
    found = feet[rows, away.argmin(axis=1)]
    normal = np.cross(sides[:, 0], sides[:, 1])
    # Inside: left of all three sides, as seen from the tip of the normal.
    left = (np.cross(normal[:, None], sides) * to_point).sum(axis=2)
    inside = (left > 0.0).all(axis=1)
    n, p = normal[inside], points[inside]
    height = ((p - starts[inside, 0]) * n).sum(axis=1) / (n * n).sum(axis=1)
    found[inside] = p - height[:, None] * n
    return np.asarray(found)


def side_keys(a: NDArray[np.int64], b: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Numbers that name the sides between nodes ``a`` and ``b`` of ``n``, whichever way they go.

    >>> side_keys(np.array([0, 4]), np.array([4, 0]), 10).tolist()
    [4, 4]
    """
    return np.asarray(np.minimum(a, b) * n + np.maximum(a, b))


def halved(F: NDArray[np.int64], middle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles F (m, 3) cut at the nodes ``middle`` (m, 3) of the sides that start at each corner; -1 for none.

    >>> halved(np.array([[0, 1, 2]]), np.array([[3, -1, -1]])).tolist()
    [[0, 3, 2], [3, 1, 2]]
    """
    count = (middle >= 0).sum(axis=1)
    made = [F[count == 0]]
    # Turned so that one cut side is the first, and of two the side that is whole the last.
    first = np.where(count == 2, np.argmin(middle, axis=1) + 1, np.argmax(middle, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    F, middle = np.take_along_axis(F, turn, axis=1), np.take_along_axis(middle, turn, axis=1)
    nodes = np.concatenate([F, middle], axis=1)
    for n, pieces in enumerate(_CUTS, start=1):
        made.append(nodes[count == n][:, pieces].reshape(-1, 3))
    return np.concatenate(made)


_CUTS = (
    [(0, 3, 2), (3, 1, 2)],
    [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
    [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
)
"""Triangles with one, two and three sides cut: corners 0 to 2, and the middles 3 to 5 of the sides that they start."""
