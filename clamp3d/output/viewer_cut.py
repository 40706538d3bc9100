"""Surfaces for the viewer that are no part's own mesh: parts cut open, grooves' arcs, overlaps of two parts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.core.pose import Array, inverse
from clamp3d.core.primitives import SweptArc
from clamp3d.core.profile import Arc

if TYPE_CHECKING:
    import trimesh

_LIFT = 0.05
"""How far in mm a groove's coloured surface stands off the part, so that the two do not flicker."""


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
    """What two parts at their world poses have in common, in the frame of ``a``; None where their facets do not meet."""
    placed = _manifold(b).transform((inverse(T_a) @ T_b)[:3])
    return _mesh(_manifold(a) ^ placed)


def groove_surface(groove: SweptArc, T_part_groove: Array, mesh_error: float, *, half: bool = False) -> trimesh.Trimesh:
    """A groove's arc surface in its part's frame, a hair towards the axis; with ``half`` only its end on +Y."""
    import trimesh

    arc = Arc((0.0, 0.0), groove.radius, -math.pi / 2 - groove.half_angle, -math.pi / 2 + groove.half_angle)
    n = arc.chord_count(mesh_error)
    t = np.linspace(arc.start_angle, arc.end_angle, n + 1)
    r = groove.radius - _LIFT
    outline = np.column_stack([r * np.cos(t), r * np.sin(t)])
    end = math.copysign(groove.length / 2, T_part_groove[1, 2])  # the end on the part's +Y
    vertices = np.vstack([np.column_stack([outline, np.full(n + 1, z)]) for z in (0.0 if half else -end, end)])
    i = np.arange(n)
    j = i + n + 1
    faces = np.vstack([np.column_stack([i, i + 1, j]), np.column_stack([i + 1, j + 1, j])])
    return trimesh.Trimesh(vertices @ T_part_groove[:3, :3].T + T_part_groove[:3, 3], faces, process=False)


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
