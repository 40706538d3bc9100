"""Which faces of two solids from CAD can be the nearest, by their coarse triangles: others need no closer look."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.surface import Surface, fcl_tree, rounding_of, tree_distance
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
        return self._boxes_at(np.eye(4))

    def _boxes_at(self, T: Array) -> Array:
        """The same with the solid placed by ``T`` (4, 4)."""
        corners = to_target(T, self.surface.vertices)[self.surface.faces]
        order = np.argsort(self.face, kind="stable")
        first = np.searchsorted(self.face[order], self.numbers)
        low, high = corners.min(axis=1)[order], corners.max(axis=1)[order]
        return np.array([np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)])

    def tree(self, number: int) -> Any:
        """FCL's tree of the triangles of a face."""
        if number not in self._trees:
            self._trees[number] = fcl_tree(self.surface.vertices, self.surface.faces[self.face == number])
        return self._trees[number]

    def near(self, other: FaceMeshes, T: Array, limit: float) -> Faces:
        """The faces (k,) that are not certainly more than ``limit`` mm from another solid's, placed by ``T`` (4, 4)."""
        low, high = other._boxes_at(T)
        gaps = (
            np.maximum(np.maximum(low - own_high, own_low - high), 0.0)
            for own_low, own_high in zip(*self.boxes, strict=True)
        )
        may_be_near = [bool((np.linalg.norm(gap, axis=1) <= limit).any()) for gap in gaps]
        rows = self.numbers[may_be_near].tolist()
        tree = other.surface.bvh
        return np.array([k for k in rows if tree_distance(self.tree(k), tree, T) <= limit], dtype=np.int64)


def near_faces(a: FaceMeshes, b: FaceMeshes, T: Array) -> tuple[Faces, Faces] | None:
    """The faces of two solids that can hold nearest points of their surfaces, ``b`` at ``T`` (4, 4) in a's frame.

    None where there are few faces in all, and where one solid may be inside the other.
    """
    if len(a.numbers) * len(b.numbers) <= _FEW:
        return None
    corners_b, corners_a = to_target(T, b.surface.vertices), to_target(inverse(T), a.surface.vertices)
    if not (a.surface.is_any_outside(corners_b) and b.surface.is_any_outside(corners_a)):
        return None
    return faces_nearby(a, b, T)


def faces_nearby(a: FaceMeshes, b: FaceMeshes, T: Array) -> tuple[Faces, Faces]:
    """The faces of two solids that are no further from the other one than nearest points or an overlap can be."""
    off = a.surface.error + b.surface.error + rounding_of(a.surface, b.surface, T)
    # The solids are no further apart than their triangles and this, nor a face nearer than its triangles less this.
    limit = max(tree_distance(a.surface.bvh, b.surface.bvh, T), 0.0) + 2.0 * off
    return a.near(b, T, limit), b.near(a, inverse(T), limit)
