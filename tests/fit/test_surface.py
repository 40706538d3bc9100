"""A mesh prepared for the search for round surfaces, against trimesh and SciPy; and what a CAD mesh does without."""

import numpy as np
import trimesh
from fit_shapes import splint

from clamp3d.fit import seeds
from clamp3d.fit.fit import fit_mesh
from clamp3d.geometry.mesh import make_mesh

SPLINT = splint(0.3, hole=11.0)


def test_flat_sides_of_a_cad_mesh_are_no_seeds_of_patches(monkeypatch):
    """The noise of a mesh is measured over 150 patches; a mesh of strips and flat sides has no use for it."""
    asked = []
    monkeypatch.setattr(seeds, "_noise", lambda *given: asked.append(given) or np.inf)
    tube, ball = trimesh.creation.annulus(5.0, 9.0, 20.0, sections=48), trimesh.creation.icosphere(3, 10.0)
    found = fit_mesh(make_mesh(tube.vertices, tube.faces))
    assert (len(found.cylinders), len(found.holes), len(asked)) == (1, 1, 0)
    fit_mesh(make_mesh(ball.vertices, ball.faces))
    assert len(asked) == 1
