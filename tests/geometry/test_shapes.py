"""Shapes that are drawn by one call: boxes, extrusions and spheres."""

import math

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from clamp3d import InputError, distance
from clamp3d.geometry.profile import Profile
from clamp3d.geometry.shells import volume
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import Hole, MeshShape, SweptArc, box, cylinder, extrusion, groove_block, mesh, sphere
from tests.refusals import refusals

ANGLE = [(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (2.0, 2.0), (2.0, 10.0), (0.0, 10.0)]


def test_a_box_takes_three_numbers_or_one_sequence():
    assert box(10, 20.0, 5) == box((10, 20, 5)) == box(size=np.array([10.0, 20.0, 5.0]))


@pytest.mark.parametrize("outline", [ANGLE, ANGLE[::-1], [*ANGLE, ANGLE[0]], Profile.of(*ANGLE)])
def test_an_extrusion_is_its_polygon_times_its_height(outline):
    solid = extrusion(outline, 4.0)
    assert solid.bounds.tolist() == [[0.0, 0.0, -2.0], [10.0, 10.0, 2.0]]
    made = mesh(solid)
    assert made.is_watertight
    assert made.volume == pytest.approx(4.0 * Polygon(ANGLE).area, rel=1e-12)
    found = distance(solid, box(2, 2, 2), translation(6.0, 7.0, 0.0))
    assert found.lower - 1e-9 <= 3.0 <= found.upper + 1e-9


@pytest.mark.parametrize("mesh_error", [None, 0.5])
def test_distances_of_a_sphere_hold_for_the_true_one(mesh_error):
    ball = sphere(5.0, mesh_error=mesh_error)
    assert 0.0 < ball.error <= (mesh_error or 5e-3)
    assert np.linalg.norm(ball.mesh.vertices, axis=1) == pytest.approx(5.0, abs=1e-12)
    centres = ball.mesh.vertices[ball.mesh.faces].mean(axis=1)
    assert 5.0 - np.linalg.norm(centres, axis=1).min() <= ball.error
    for turn in (0.0, 0.3, 1.1):
        T = rotation((1.0, 2.0, 0.0), turn)
        T[:3, 3] = T[:3, :3] @ (0.0, 0.0, 7.0)  # the ball sees the box's face from its middle
        found = distance(ball, box(2, 2, 2), T)
        assert found.lower <= 1.0 <= found.upper
        assert found.upper - found.lower <= 3.0 * ball.error


test_what_is_no_shape_is_refused = refusals(
    (lambda: box(1, 2), "size of a box must be three numbers"),
    (lambda: box(1, 2, -1), "size must be a finite length > 0 mm, got -1"),
    (lambda: extrusion(ANGLE, 0.0), "height must be a finite length > 0 mm"),
    (lambda: extrusion([(0, 0), (1, 0)], 1.0), "outline must enclose an area"),
    (lambda: extrusion(3, 1.0), "outline must have shape"),
    (lambda: sphere(-1.0), "radius must be a finite length > 0 mm, got -1"),
    (lambda: sphere(1.0, mesh_error=1e-9), "mesh_error of a sphere must be >= 1e-05 mm"),
    (lambda: sphere(1.0, mesh_error=math.nan), "mesh_error must be a finite number"),
)


def test_a_surface_that_is_flat_to_rounding_has_no_volume():
    box = trimesh.creation.box((3.0, 4.0, 5.0))
    flat = (box.vertices * (1.0, 1.0, 0.0)) @ rotation((1.0, 2.0, 3.0), 0.7)[:3, :3].T + (100.0, 200.0, 300.0)
    assert volume(flat, box.faces) == 0.0
    assert volume(box.vertices, box.faces) == pytest.approx(60.0)


def plate(at, axis="z", radius=2.0):
    return box((10.0, 20.0, 6.0), holes=[Hole(radius, at, axis)])


def block(width=50.0, height=20.0, half=1.0, **more):
    return groove_block(SweptArc(7.0, half, 50.0), width, height, **more)


REACH, OTHER = 7.0 * math.sin(1.0), 5.0 * math.sin(0.9)


@pytest.mark.parametrize(
    ("make", "limit", "words"),
    [
        (lambda x: plate((x, 1.0)), 7.0, r"at \(.*, 1.0\) lies beside"),
        (lambda x: plate((5.0 + x, -10.0 - x)), math.sqrt(2.0), "lies beside"),
        (lambda x: plate((1.0, -x), "y"), 5.0, "lies beside"),
        (lambda x: plate((1.0, -2.0), radius=x), math.hypot(6.0, 12.0), "leaves nothing of the part"),
        (lambda x: plate((1.0, -2.0), "y", radius=x), math.hypot(6.0, 5.0), "leaves nothing of the part"),
        (lambda x: cylinder(5.0, 1.0, bore=x), 5.0, "bore must be between"),
        (lambda x: block(1.0 / x), 0.5 / REACH, r"x = 0 mm leaves the block: width must be > 11\.78"),
        (lambda x: block(1.0 / x, 40.0, 2.0), 1.0 / 14.0, "width must be > 14 mm"),
        (lambda x: block(others=[(x, 5.0, 0.9)]), 25.0 - OTHER, "leaves the block: width must be > 50 mm"),
        (lambda x: block(holes=[Hole(2.0, (1.0, -x), "y")]), 27.0, "lies beside"),
        (lambda x: block(height=1.0 / x), 1.0 / (7.0 - 7.0 * math.cos(1.0)), r"height must be > 3\.217"),
        (lambda x: block(others=[(-1.0 / x, 5.0, 0.9)]), 1.0 / (REACH + OTHER), r"must be > 9\.806"),
        (lambda x: MeshShape(sphere(2.0).mesh, error=x), 1e5, "error of a mesh must be >= 0 and < 100000 mm"),
    ],
)
def test_what_does_not_fit_is_refused_from_its_limit_on(make, limit, words):
    make(limit * (1.0 - 1e-9))
    with pytest.raises(InputError, match=words):
        make(limit * (1.0 + 1e-9))
