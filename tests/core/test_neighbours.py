"""Triangles on both sides of an edge, against trimesh."""

import numpy as np
import pytest
import trimesh

from clamp3d.core.mesh import neighbours


@pytest.mark.parametrize(
    "mesh", [trimesh.creation.icosphere(2), trimesh.creation.annulus(1.0, 2.0, 3.0), trimesh.creation.box()]
)
@pytest.mark.parametrize("left_out", [0, 3])
def test_neighbours_are_those_of_trimesh(mesh, left_out):
    F = np.asarray(mesh.faces[left_out:], dtype=np.int64)
    known = trimesh.Trimesh(mesh.vertices, F, process=False)
    pairs, across = neighbours(F)

    def rows(pairs, across):
        both = zip(pairs.tolist(), across.tolist(), strict=True)
        return sorted(tuple(sorted(zip(*row, strict=True))) for row in both)

    assert rows(pairs, across) == rows(known.face_adjacency, known.face_adjacency_unshared)
