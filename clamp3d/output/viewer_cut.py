"""Surfaces for the viewer that are no part's own mesh: the part cut open at the section, and the groove's arc."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.pose import Array
from clamp3d.core.primitives import SweptArc
from clamp3d.core.profile import Arc

if TYPE_CHECKING:
    import trimesh

_LIFT = 0.05
"""How far in mm a groove's coloured surface stands off the part, so that the two do not flicker."""


def cut_open(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """The half of a part behind the section plane Y = 0, without and with nothing but the cut face."""
    import manifold3d
    import trimesh

    raw = manifold3d.Mesh64(
        vert_properties=np.array(mesh.vertices, dtype=np.float64),
        tri_verts=np.array(mesh.faces, dtype=np.uint64),
    )
    half = manifold3d.Manifold(raw).trim_by_plane((0.0, 1.0, 0.0), 0.0).to_mesh64()
    vertices = np.asarray(half.vert_properties)[:, :3]
    faces = np.asarray(half.tri_verts, dtype=np.int64)
    on_cut = (np.abs(vertices[faces][:, :, 1]) < 1e-9).all(axis=1)
    rest, cap = (trimesh.Trimesh(vertices, f, process=False) for f in (faces[~on_cut], faces[on_cut]))
    for piece in (rest, cap):
        piece.remove_unreferenced_vertices()
    return rest, cap


def groove_surface(
    groove: SweptArc, T_part_groove: Array, mesh_error: float, *, half: bool = False
) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3) mm and faces (m, 3) of a groove's arc surface in its part's frame, a hair towards the axis.

    With ``half`` only what lies behind the section plane, Y > 0.
    """
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
    return vertices @ T_part_groove[:3, :3].T + T_part_groove[:3, 3], faces
