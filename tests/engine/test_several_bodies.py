"""Meshes of several bodies that overlap or touch: what they make together is the part, without walls inside of it."""

import numpy as np
import pytest
import trimesh

from clamp3d import Scene, check, shapes
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.pose import translation
from clamp3d.geometry.shapes import MeshShape

FIRST = np.array([[-5.0, -5.0, -5.0], [5.0, 5.0, 5.0]])
CAVITY = np.array([[-3.0, -3.0, -3.0], [3.0, 3.0, 3.0]])
SECOND = {
    "crossing": [[0.0, -4.0, -4.0], [10.0, 6.0, 6.0]],
    "touching": [[5.0, -3.0, -3.0], [13.0, 3.0, 3.0]],
    "touching all over": [[5.0, -5.0, -5.0], [15.0, 5.0, 5.0]],
    "inside": [[-4.5, -4.5, -4.5], [-3.5, -3.5, -3.5]],
    "apart": [[6.0, -3.0, -3.0], [9.0, 3.0, 3.0]],
}


def box_mesh(bounds, inward=False):
    mesh = trimesh.creation.box(bounds=bounds)
    if inward:
        mesh.invert()
    return mesh


def shared(*boxes):
    """Volume of the common part of boxes (2, 3)."""
    return float(np.prod(np.maximum(np.min([b[1] for b in boxes], axis=0) - np.max([b[0] for b in boxes], axis=0), 0)))


@pytest.mark.parametrize("hollow", [False, True])
@pytest.mark.parametrize("second", SECOND)
@pytest.mark.parametrize("turned", [False, True])
def test_bodies_of_one_mesh_are_one_part(second, hollow, turned):
    other = np.array(SECOND[second])
    if hollow and second == "crossing":
        other[0, 0] = 4.0  # beside the cavity
    bodies = [box_mesh(FIRST), box_mesh(other), *([box_mesh(CAVITY, inward=True)] if hollow else [])]
    whole = trimesh.util.concatenate(bodies[::-1] if turned else bodies)
    part = MeshShape(make_mesh(whole.vertices, whole.faces), "off")
    rng = np.random.default_rng(5)
    for centre in [(-1.2, 0.0, 0.0), (4.3, 0.0, 0.3), (4.0, 0.4, 0.2), *rng.uniform(-6.0, 11.0, (12, 3))]:
        probe = np.array([-0.5, 0.5])[:, None] + centre
        truth = shared(probe, FIRST) + shared(probe, other) - shared(probe, FIRST, other)
        truth -= hollow * (shared(probe, CAVITY) - shared(probe, CAVITY, other))
        result = check(Scene().add("a", part).add("b", shapes.box((1, 1, 1)), translation(*centre)))
        verdicts = {"contained"} if truth > 1.0 - 1e-12 else {"clash"} if truth > 0.0 else {"clear", "contact"}
        assert result.verdict("a", "b").value in verdicts
        if truth > 0.0:
            low, high = result.pairs[0].where.volume
            assert low <= truth <= high <= truth + 1e-6
