"""Meshes as manifold3d's solids, and back: in double precision, which trimesh's booleans lose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.geometry.pose import Array


def as_manifold(vertices: Array, faces: NDArray[np.int64]) -> Any:
    """Vertices (n, 3) and faces (m, 3) of a closed mesh as a solid of manifold3d; its ``status()`` says if it is none.

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> round(6.0 * as_manifold(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])).volume(), 12)
    1.0
    """
    import manifold3d

    corners, triangles = np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.uint64)
    return manifold3d.Manifold(manifold3d.Mesh64(vert_properties=corners, tri_verts=triangles))


def arrays_of(manifold: Any) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of a solid of manifold3d."""
    mesh = manifold.to_mesh64()
    return np.array(mesh.vert_properties, dtype=np.float64), np.array(mesh.tri_verts, dtype=np.int64)


def prism(loops: Sequence[Array], length: float) -> Any:
    """What is inside of an odd number of outlines (n, 2), drawn ``length`` along z to both sides, as such a solid.

    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    >>> round(prism([corners, corners + (0.5, 0.0)], 5.0).volume(), 9)
    10.0
    """
    import manifold3d

    inside = manifold3d.CrossSection([loop.tolist() for loop in loops], manifold3d.FillRule.EvenOdd)
    return inside.extrude(2.0 * length).translate((0.0, 0.0, -length))
