"""The shared body of two parts, and parts cut open, as pages and pictures show them: meshes, by manifold3d."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from clamp3d.geometry.pose import Array, inverse


def cut_open(
    mesh: trimesh.Trimesh, T_world: Array, y: float = 0.0
) -> tuple[trimesh.Trimesh | None, trimesh.Trimesh | None]:
    """What of a part at ``T_world`` lies behind the world's plane Y = ``y``: without and with nothing but the cut face.

    Both in the part's frame; None for what is empty.
    """
    normal = T_world[:3, :3].T @ [0.0, 1.0, 0.0]
    offset = y - float(T_world[1, 3])
    behind = _mesh(_manifold(mesh).trim_by_plane(tuple(normal), offset))
    if behind is None:
        return None, None
    height = behind.vertices @ normal - offset
    on_cut = (np.abs(height[behind.faces]) < 1e-9 * (1.0 + np.abs(behind.vertices).max())).all(axis=1)
    pieces = []
    for chosen in (~on_cut, on_cut):
        piece = trimesh.Trimesh(behind.vertices, behind.faces[chosen], process=False)
        piece.remove_unreferenced_vertices()
        pieces.append(piece if chosen.any() else None)
    return pieces[0], pieces[1]


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
