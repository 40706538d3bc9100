"""The shared body of two parts as pages, pictures and files show it: a mesh, by manifold3d."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from clamp3d.geometry.pose import Array, inverse


def overlap(a: trimesh.Trimesh, T_a: Array, b: trimesh.Trimesh, T_b: Array) -> trimesh.Trimesh | None:
    """What two parts at their poses share, in the frame of ``a``; None where their facets do not meet."""
    T_ab = np.ascontiguousarray((inverse(T_a) @ T_b)[:3])
    return _mesh(_manifold(a) ^ _manifold(b).transform(T_ab))


def _manifold(mesh: trimesh.Trimesh) -> Any:
    import manifold3d

    vertices, faces = np.array(mesh.vertices, np.float64, order="C"), np.array(mesh.faces, np.uint64, order="C")
    return manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices, tri_verts=faces))


def _mesh(manifold: Any) -> trimesh.Trimesh | None:
    if manifold.is_empty():
        return None
    raw = manifold.to_mesh64()
    return trimesh.Trimesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts, np.int64), process=False)
