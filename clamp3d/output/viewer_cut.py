"""Parts cut open, and overlaps of two parts, of the meshes that are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.core.pose import Array, inverse

if TYPE_CHECKING:
    import trimesh


def cut_open(
    mesh: trimesh.Trimesh, T_world: Array, y: float = 0.0
) -> tuple[trimesh.Trimesh | None, trimesh.Trimesh | None]:
    """What of a part at ``T_world`` lies behind the world's plane Y = ``y``: without and with nothing but the cut face.

    Both in the part's frame; None for what is empty.
    """
    normal = T_world[:3, :3].T @ [0.0, 1.0, 0.0]
    offset = y - float(T_world[1, 3])
    half = _manifold(mesh).trim_by_plane(tuple(normal), offset)
    behind = _mesh(half)
    if behind is None:
        return None, None
    height = behind.vertices @ normal - offset
    on_cut = (np.abs(height[behind.faces]) < 1e-9 * (1.0 + np.abs(behind.vertices).max())).all(axis=1)
    pieces = []
    for chosen in (~on_cut, on_cut):
        piece = type(behind)(behind.vertices, behind.faces[chosen], process=False)
        piece.remove_unreferenced_vertices()
        pieces.append(piece if chosen.any() else None)
    return pieces[0], pieces[1]


def overlap(a: trimesh.Trimesh, T_a: Array, b: trimesh.Trimesh, T_b: Array) -> trimesh.Trimesh | None:
    """What two parts at their poses have in common, in the frame of ``a``; None where their facets do not meet."""
    placed = _manifold(b).transform((inverse(T_a) @ T_b)[:3])
    return _mesh(_manifold(a) ^ placed)


def _manifold(mesh: trimesh.Trimesh) -> Any:
    import manifold3d

    return manifold3d.Manifold(
        manifold3d.Mesh64(
            vert_properties=np.array(mesh.vertices, dtype=np.float64), tri_verts=np.array(mesh.faces, dtype=np.uint64)
        )
    )


def _mesh(solid: Any) -> trimesh.Trimesh | None:
    import trimesh

    made = solid.to_mesh64()
    if not len(made.tri_verts):
        return None
    return trimesh.Trimesh(np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts, int), process=False)
