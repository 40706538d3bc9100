"""Hulls of points that nearly lie in faces, and meshes that are nearly convex."""

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d import Scene, Verdict, check, distance
from clamp3d.engine.hull import hull, hull_error
from clamp3d.kernel import translation
from clamp3d.shapes import MeshShape, box, make_mesh
from clamp3d.testing import directions


def roof(rise, n=5):
    """A plate of 2 by 2 by 0.3 below z = 0 whose top is a grid that rises by ``rise`` in its middle."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-1.0, 1.0, n), np.linspace(-1.0, 1.0, n)))
    top = np.column_stack([x, y, 0.5 * rise * (2.0 - x * x - y * y)])
    return np.vstack([top, np.column_stack([x, y, np.full(n * n, -0.3)])])


@settings(max_examples=60, deadline=None)
@given(st.sampled_from([0.0, 1e-13, 1e-10, 1e-8, 5e-8, 1e-6]), st.integers(0, 2**32 - 1))
def test_no_point_is_left_out(rise, seed):
    """By the support function: along any direction the hull reaches as far as the furthest point."""
    rng = np.random.default_rng(seed)
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    points = (roof(rise) + rise * rng.normal(size=(50, 3)) * [0.0, 0.0, 0.3]) @ turn.T * 40.0
    made = hull(points)
    assert (points @ made.planes[:, :3].T + made.planes[:, 3]).max() <= 1e-13 * 40.0
    N = np.vstack([directions(300), turn[:, 2] + 1e-7 * rng.normal(size=(300, 3))])
    assert (made.vertices @ N.T).max(axis=0) == pytest.approx((points @ N.T).max(axis=0), abs=1e-12)
    assert len(made.vertices) - 1.5 * len(made.faces) + len(made.faces) == 2


def plate(middle):
    """A plate of 100 by 100 by 10 mm below z = 0 with a pyramid of 0.1 by 0.1 mm on it, or in it below 0."""
    block = manifold3d.Manifold.cube((100.0, 100.0, 10.0), True).translate((0.0, 0.0, -5.0))
    base = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (0.0, -0.1 if middle > 0.0 else 0.01)]
    if middle > 0.0:
        made = block + manifold3d.Manifold.hull_points([*base, (0.0, 0.0, middle)])
    else:
        made = block - manifold3d.Manifold.hull_points([*base, (0.0, 0.0, middle)])
    mesh = made.to_mesh64()
    return MeshShape(make_mesh(np.array(mesh.vert_properties)[:, :3], mesh.tri_verts), "off")


def test_a_small_dent_is_not_filled():
    """A tip in a dent of 0.1 by 0.1 mm that is 0.02 mm deep, a part in 1e9 of the plate's volume."""
    corners = np.array([(0.0, 0.0, -0.01), (0.003, 0.0, 1.0), (-0.003, 0.003, 1.0), (-0.003, -0.003, 1.0)])
    tip = MeshShape(make_mesh(corners, [(0, 2, 1), (0, 3, 2), (0, 1, 3), (1, 2, 3)]), "off")
    dented = plate(-0.02)
    truth = 0.01 * np.cos(np.arctan(0.02 / 0.05))  # of the tip from the dent's sides
    found = distance(dented, tip)
    assert found.lower - 1e-12 <= truth <= found.upper + 1e-12
    assert found.upper - found.lower < 1e-8
    assert check(Scene(contact=1e-3).add("dented", dented).add("tip", tip)).verdict("dented", "tip") is Verdict.CLEAR


@pytest.mark.parametrize("rise", [1e-7, 5e-6])
def test_a_small_rise_is_seen(rise):
    """What a roof stands out by is less than 1e-7 of the plate's size."""
    found = distance(plate(rise), box((10.0, 10.0, 10.0)), translation(0.0, 0.0, 5.0 + 1e-3))
    assert found.lower <= 1e-3 - rise <= found.upper
    assert found.upper - found.lower < 1e-9


def test_a_dent_in_a_face_is_within_the_error_of_the_hull():
    """The middle of a face is pressed in by 1e-7 mm: the hull covers it, and says so."""
    cube = trimesh.creation.box((10.0, 10.0, 10.0)).subdivide()
    V = np.array(cube.vertices)
    V[np.argmax(V @ (1.0, 1e-3, 1e-3) - np.abs(V[:, 1:]).sum(axis=1)), 0] -= 1e-7
    assert 0.9e-7 <= hull_error(V, np.array(cube.faces)) <= 1e-6
