"""The separate closed surfaces of a mesh: their volumes, what winds round what, and which of them are inside out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.geometry.pose import Array

Faces = NDArray[np.int64]

_FLAT = 1e-14
"""A volume below this part of area x extent is rounding."""

_MOST_SAMPLES = 64
"""Corners of a surface that are looked at to tell whether it lies in another."""

_FEW = 8
"""Points up to which the sum over all triangles for each is quicker than to build a tree of them first."""


def volume(vertices: Array, faces: Faces) -> float:
    """Signed volume of a closed surface in mm^3, positive if its faces wind outward, 0.0 if it is flat to rounding.

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> 6.0 * volume(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    1.0
    """
    used = vertices[faces].reshape(-1, 3)
    low, high = used.min(axis=0), used.max(axis=0)
    # The middle as origin: far from it the volumes cancel badly.
    a, b, c = np.moveaxis(vertices[faces] - 0.5 * (low + high), 1, 0)
    enclosed = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return enclosed if abs(enclosed) > _FLAT * area * float((high - low).max()) else 0.0


def joined(groups: Faces, n: int) -> Faces:
    """The least number (n,) among 0 to ``n`` - 1 that each is joined to by ``groups`` (m, k), over others or directly.

    >>> joined(np.array([[3, 1], [4, 3], [0, 2]]), 5).tolist()
    [0, 1, 0, 1, 1]
    """
    import igl

    label = igl.vertex_components(np.concatenate([groups, np.full((1, groups.shape[1]), n - 1)]))
    _, least, place = np.unique(label, return_index=True, return_inverse=True)
    return np.asarray(least[place])


def shells(faces: Faces) -> list[NDArray[np.intp]]:
    """Rows of ``faces`` of each surface that edges connect; those that share no more than corners are several."""
    import igl

    label = igl.facet_components(faces)[1]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def winding_numbers(vertices: Array, faces: Faces, points: Array) -> Array:
    """How often (k,) a surface winds round points (k, 3) that are not on it: 1 inside of a closed one, 0 outside.

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    >>> winding_numbers(corners, faces, np.array([[0.1, 0.2, 0.3], [1.0, 1.0, 1.0]])).round(12)
    array([1., 0.])
    """
    import igl

    if len(points) <= _FEW:
        return np.array([igl.winding_number(vertices, faces, point) for point in points])
    return np.asarray(igl.winding_number(vertices, faces, np.ascontiguousarray(points)))


def sampled(corners: Array) -> Array:
    """Some (k, 3) of the corners (n, 3) of a surface, all over it."""
    return corners[:: max(1, len(corners) // _MOST_SAMPLES)]


def inside_out(vertices: Array, faces: Faces) -> list[NDArray[np.intp]]:
    """Rows of ``faces`` of each closed surface that winds inward and is not a cavity of another one.

    A cavity lies wholly inside the rest. Its winding number there is negative: a body of no material, which a wire in
    it would not be seen in.
    """
    turned = []
    for rows in shells(faces):
        if volume(vertices, faces[rows]) >= 0.0:
            continue
        rest = np.delete(faces, rows, axis=0)
        corners = sampled(vertices[np.unique(faces[rows])])
        if not len(rest) or winding_numbers(vertices, rest, corners).min() < 0.9:
            turned.append(rows)
    return turned
