"""A mesh prepared for the search for round surfaces, against trimesh and SciPy; and what a CAD mesh does without."""

import numpy as np
import pytest
import trimesh
from fit_shapes import splint
from scipy.sparse import coo_matrix, csgraph

from clamp3d.core.mesh import make_mesh
from clamp3d.core.shells import joined
from clamp3d.fit import patches
from clamp3d.fit.cylinder import Axis
from clamp3d.fit.fit import fit_mesh
from clamp3d.fit.surface import Surface, facet_span

SPLINT = splint(0.3, hole=11.0)


@pytest.mark.parametrize("left_out", [0, 5])
def test_normals_areas_and_edges_are_those_of_trimesh(left_out):
    mesh = make_mesh(SPLINT.vertices, SPLINT.faces[left_out:])
    own, known = Surface(mesh), trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert np.allclose(own.normals, known.face_normals, rtol=0.0, atol=1e-15)
    assert np.allclose(own.areas, known.area_faces, rtol=1e-15)
    assert np.allclose(own.centres, known.triangles_center, rtol=1e-15)
    assert np.array_equal(own.pairs, known.face_adjacency)
    assert np.array_equal(own.edges, known.face_adjacency_edges)
    assert np.allclose(own.bend, known.face_adjacency_angles, atol=1e-7)  # trimesh takes the arc cosine
    assert len(own.rim) == len(own.rim_faces) == (0 if left_out == 0 else len(known.edges) - 2 * len(own.pairs))


def test_span_of_a_cell_is_its_largest_angle_less_its_least():
    surface = Surface(make_mesh(SPLINT.vertices, SPLINT.faces))
    rng = np.random.default_rng(2)
    faces, cells = rng.permutation(len(surface.F))[:40], rng.integers(0, 6, len(surface.F))
    axis = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0)
    names = np.unique(cells[faces])
    spans = facet_span(surface, axis, faces, cells)
    for name, span in zip(names, spans, strict=True):
        own = faces[cells[faces] == name]
        p = surface.V[surface.F[own]]
        angle = np.arctan2(p[..., 1], p[..., 0])
        # ``perpendicular`` turns the angles; seen from one corner they are the same.
        turned = (angle - angle[0, 0] + np.pi) % (2.0 * np.pi) - np.pi
        assert span == pytest.approx(np.ptp(turned), abs=1e-12)


def test_joined_numbers_are_the_components_of_a_graph():
    rng = np.random.default_rng(1)
    for n, m in ((1, 0), (5, 3), (50, 40), (400, 380), (3000, 1200)):
        groups = rng.integers(0, n, (m, 2 if n % 4 else 3))
        one, other = (np.concatenate([groups[:, k] for k in ks]) for ks in ((0, 0), (1, -1)))
        graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(n, n))
        known = csgraph.connected_components(graph, directed=False)[1]
        least = np.array([np.flatnonzero(known == k)[0] for k in known])
        assert np.array_equal(joined(groups, n), least)


def test_flat_sides_of_a_cad_mesh_are_no_seeds_of_patches(monkeypatch):
    """The noise of a mesh is measured over 150 patches; a mesh of strips and flat sides has no use for it."""
    asked = []
    monkeypatch.setattr(patches, "_noise", lambda *given: asked.append(given) or np.inf)
    tube, ball = trimesh.creation.annulus(5.0, 9.0, 20.0, sections=48), trimesh.creation.icosphere(3, 10.0)
    found = fit_mesh(make_mesh(tube.vertices, tube.faces))
    assert (len(found.cylinders), len(found.holes), len(asked)) == (1, 1, 0)
    fit_mesh(make_mesh(ball.vertices, ball.faces))
    assert len(asked) == 1
