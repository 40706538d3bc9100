"""Distances of scene parts by another library: manifold3d on fine meshes, with the chord error as its bound."""

from __future__ import annotations

import numpy as np

from clamp3d.core.meshing import chord_error, mesh
from clamp3d.core.shapes import Solid


def manifold(shape: Solid, T: np.ndarray, error: float):
    import manifold3d

    made = mesh(shape, error)
    solid = manifold3d.Manifold(
        manifold3d.Mesh64(
            vert_properties=np.array(made.vertices, dtype=np.float64), tri_verts=np.array(made.faces, dtype=np.uint64)
        )
    )
    return solid.transform(np.ascontiguousarray(T[:3])), 2.0 * chord_error(shape, error)


def gap(a: Solid, b: Solid, T: np.ndarray, error: float = 1e-3, reach: float = 100.0) -> tuple[float, float, float]:
    """Least distance of the meshes (0 where they meet), their common volume, and the bound of the distance."""
    A, ea = manifold(a, np.eye(4), error)
    B, eb = manifold(b, T, error)
    return float(A.min_gap(B, reach)), float((A ^ B).volume()), ea + eb
