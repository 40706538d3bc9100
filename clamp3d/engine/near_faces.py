"""Which faces of two solids from CAD can be the nearest, by their coarse triangles: others need no exact distance."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.surface import Surface, fcl_tree, tree_distance
from clamp3d.geometry.pose import Array, inverse, to_target

_FEW = 300
"""Pairs of faces up to which Open CASCADE looks at all of them in less time than it takes to choose."""

Faces = NDArray[np.int64]


@dataclass(eq=False)
class FaceMeshes:
    """The triangles of a solid by its faces: ``face`` (m,) is the number of the face of each."""

    surface: Surface
    face: Faces
    _trees: dict[int, Any] = field(default_factory=dict)

    @cached_property
    def numbers(self) -> Faces:
        """The numbers (n,) of its faces."""
        return np.unique(self.face)

    @cached_property
    def boxes(self) -> Array:
        """Lower and upper corners (2, n, 3) of the faces' triangles."""
        corners = self.surface.vertices[self.surface.faces]
        order = np.argsort(self.face, kind="stable")
        first = np.searchsorted(self.face[order], self.numbers)
        low, high = corners.min(axis=1)[order], corners.max(axis=1)[order]
        return np.array([np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)])

    def tree(self, number: int) -> Any:
        """FCL's tree of the triangles of a face."""
        if number not in self._trees:
            self._trees[number] = fcl_tree(self.surface.vertices, self.surface.faces[self.face == number])
        return self._trees[number]

    def near(self, other: Surface, T: Array, limit: float) -> Faces:
        """The faces (k,) that are not certainly more than ``limit`` mm from another mesh placed by ``T`` (4, 4)."""
        points = to_target(T, other.vertices)
        low, high = self.boxes
        gap = np.linalg.norm(np.maximum(np.maximum(low - points.max(axis=0), points.min(axis=0) - high), 0.0), axis=1)
        rows = self.numbers[gap <= limit].tolist()
        return np.array([k for k in rows if tree_distance(self.tree(k), other.bvh, T) <= limit], dtype=np.int64)


def near_faces(a: FaceMeshes | None, b: FaceMeshes | None, T: Array) -> tuple[Faces, Faces] | None:
    """The faces of two solids that can hold nearest points of their surfaces, ``b`` at ``T`` (4, 4) in a's frame.

    None where triangles are missing, where there are few faces in all, where triangles meet (Open CASCADE soon finds a
    point of one solid in the other then), and where one solid may be inside the other.
    """
    if a is None or b is None or len(a.numbers) * len(b.numbers) <= _FEW:
        return None
    gap = tree_distance(a.surface.bvh, b.surface.bvh, T)
    if gap <= 0.0:
        return None
    corners_b, corners_a = to_target(T, b.surface.vertices), to_target(inverse(T), a.surface.vertices)
    if not (a.surface.is_any_outside(corners_b) and b.surface.is_any_outside(corners_a)):
        return None
    off = a.surface.error + b.surface.error
    # The solids are no further apart than their triangles and this, nor a face nearer than its triangles less this.
    limit = gap + 2.0 * off
    return a.near(b.surface, T, limit), b.near(a.surface, inverse(T), limit)
