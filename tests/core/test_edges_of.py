"""Edges of one and of two triangles, against trimesh."""

import numpy as np
import pytest
import trimesh

from clamp3d.core.mesh import edges_of


@pytest.mark.parametrize(
    "mesh", [trimesh.creation.icosphere(2), trimesh.creation.annulus(1.0, 2.0, 3.0), trimesh.creation.box()]
)
@pytest.mark.parametrize("left_out", [0, 3])
def test_edges_are_those_of_trimesh(mesh, left_out):
    F = np.asarray(mesh.faces[left_out:], dtype=np.int64)
    known = trimesh.Trimesh(mesh.vertices, F, process=False)
    edges, pairs, across = edges_of(F, 2)
    assert np.array_equal(pairs, known.face_adjacency)
    assert np.array_equal(edges, known.face_adjacency_edges)
    assert np.array_equal(across, known.face_adjacency_unshared)
    edges, faces, across = edges_of(F, 1)
    alone = trimesh.grouping.group_rows(known.edges_sorted, require_count=1)
    assert np.array_equal(edges, known.edges_sorted[alone])
    assert faces[:, 0].tolist() == known.edges_face[alone].tolist()
    assert [set(F[i]) - {*ends} for ends, i in zip(edges.tolist(), faces[:, 0], strict=True)] == [
        {x} for x in across[:, 0]
    ]
