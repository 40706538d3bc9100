"""Parts cut open, and overlaps of two parts, of the meshes that are drawn."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from clamp3d.collide.overlap import common
from clamp3d.collide.surface import Surface
from clamp3d.core.pose import Array, inverse


def cut_open(
    mesh: trimesh.Trimesh, T_world: Array, y: float = 0.0
) -> tuple[trimesh.Trimesh | None, trimesh.Trimesh | None]:
    """What of a part at ``T_world`` lies behind the world's plane Y = ``y``: without and with nothing but the cut face.

    Both in the part's frame; None for what is empty.
    """
    normal = T_world[:3, :3].T @ [0.0, 1.0, 0.0]
    offset = y - float(T_world[1, 3])
    half = _surface(mesh).manifold.trim_by_plane(tuple(normal), offset).to_mesh64()
    if not len(half.tri_verts):
        return None, None
    behind = _mesh(np.asarray(half.vert_properties)[:, :3], np.asarray(half.tri_verts, int))
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
    found = common(_surface(a), _surface(b), inverse(T_a) @ T_b)
    return None if found is None else _mesh(found.vertices, found.faces)


def _surface(mesh: trimesh.Trimesh) -> Surface:
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def _mesh(vertices: Array, faces: NDArray[np.int64]) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)
