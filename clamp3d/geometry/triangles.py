"""Normals, areas, nearest points and pieces of triangles, without trimesh, whose import takes 0.5 s of CPU."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.geometry.pose import Array


def normals_and_areas(triangles: Array) -> tuple[Array, Array]:
    """Unit normals (m, 3) of triangles (m, 3, 3), 0 for those without an area, and areas (m,).

    >>> [x.tolist() for x in normals_and_areas(np.array([[[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]]))]
    [[[0.0, 0.0, 1.0]], [8.0]]
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    cross = np.cross(b - a, c - a)
    size = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(size, 1e-300)[:, None], 0.5 * size


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


def distances_from_segments(points: Array, starts: Array, ends: Array) -> Array:
    """How far (...,) points (..., 3) are from the segments between ``starts`` and ``ends`` (..., 3).

    >>> distances_from_segments(np.array([3.0, 4.0, 0.0]), np.zeros(3), np.array([1.0, 0.0, 0.0])).round(9).tolist()
    4.472135955
    """
    ways = ends - starts
    along = ((points - starts) * ways).sum(axis=-1) / np.maximum((ways * ways).sum(axis=-1), 1e-300)
    return np.asarray(np.linalg.norm(points - starts - np.clip(along, 0.0, 1.0)[..., None] * ways, axis=-1))


def edge_middles(corners: Array) -> Array:
    """The middles (m, 3, k) of the edges of triangles (m, 3, k), each of that which begins at a corner.

    >>> edge_middles(np.array([[[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]])).tolist()
    [[[2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]]
    """
    return np.asarray(0.5 * (corners + np.roll(corners, -1, axis=1)))


def halves(corners: Array, edge: NDArray[np.int64], middle: Array) -> Array:
    """Triangles (2 m, 3, k): each of (m, 3, k) cut in two from a point (m, k) of its edge (m,)."""
    rows = np.arange(len(corners))
    a, b, c = corners[rows, edge], corners[rows, (edge + 1) % 3], corners[rows, edge - 1]
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def quarters(corners: Array) -> Array:
    """Triangles (4 m, 3, k): each of (m, 3, k) cut at the middles of its edges."""
    (a, b, c), (ab, bc, ca) = np.moveaxis(corners, 1, 0), np.moveaxis(edge_middles(corners), 1, 0)
    cut = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(ends, axis=1) for ends in cut])
