"""Meshes with round surfaces and hollows that do not go right through: what stands for them fills none of these."""

import math

import manifold3d
import numpy as np
import pytest

from clamp3d import distance, shapes
from clamp3d.engine.model import ModelCache
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.pose import translation
from clamp3d.geometry.shapes import FITS, MeshShape

PROBE = shapes.cylinder(0.5, 10.0)
CUBE = shapes.box((1.0, 1.0, 1.0))


def bar(radius, low, high):
    """A bar of 48 flats along z, one of them square to x."""
    made = manifold3d.Manifold.cylinder(high - low, radius, radius, 48)
    return made.rotate((0.0, 0.0, 180.0 / 48.0)).translate((0.0, 0.0, low))


def mesh_shape(made, fit, error=0.0, kind=np.float64):
    mesh = made.to_mesh64()
    return MeshShape(make_mesh(np.array(mesh.vert_properties, dtype=kind)[:, :3], mesh.tri_verts), fit, error=error)


@pytest.mark.parametrize("fit", FITS)
def test_hollows_with_a_floor_are_hollow(fit):
    """A cup, a stepped hole and a closed cavity: all triangles of floors and steps have their corners on holes."""
    cup = bar(10.0, -10.0, 10.0) - bar(6.0, 0.0, 20.0)
    stepped = bar(10.0, -10.0, 10.0) - bar(3.0, -20.0, 20.0) - bar(6.0, 0.0, 20.0)
    cavity = bar(10.0, -20.0, 20.0) - bar(6.0, -10.0, 10.0)
    for made, part, at, truth in (
        (cup, PROBE, (0.0, 0.0, 6.0), 1.0),
        (stepped, PROBE, (4.2, 0.0, 6.0), 1.0),
        (cavity, CUBE, (0.0, 0.0, 0.0), 6.0 - math.sqrt(0.5)),
    ):
        found = distance(mesh_shape(made, fit), part, translation(*at))
        least = truth - 6.0 * (1.0 - math.cos(math.pi / 48.0)) * (part is CUBE)
        assert found.lower - 1e-9 <= (truth if fit == "round" else least) <= found.upper + 1e-9
        assert found.upper - found.lower <= 0.05


def test_a_pin_in_a_tube_that_is_round():
    """Its end faces fill what is between chords and arc of the hole; that is air."""
    tube = bar(10.0, -10.0, 10.0) - bar(3.0, -20.0, 20.0)
    for x, truth in ((0.3, -0.29), (0.004, 0.006)):
        found = distance(mesh_shape(tube, "round"), shapes.cylinder(2.99, 30.0), translation(x, 0.0, 0.0))
        assert found.lower - 1e-9 <= truth <= found.upper + 1e-9
        # Of an overlap the depth of a point is known, and only the length of a way out that is verified on the meshes.
        assert found.upper - (truth if truth < 0.0 else found.lower) <= 1e-6


@pytest.mark.parametrize("fit", FITS)
def test_a_window_in_a_round_side_is_open(fit):
    """A cube before a square pocket in a bar: the nearest point is on the pocket's rim, 1 mm aside."""
    pocket = manifold3d.Manifold.cube((3.0, 3.0, 3.0), True).translate((10.0, 0.0, 0.0))
    found = distance(mesh_shape(bar(10.0, -20.0, 20.0) - pocket, fit), CUBE, translation(12.501, 0.0, 0.0))
    truth = math.hypot(12.001 - 10.0 * (math.cos(math.pi / 48.0) if fit == "off" else 1.0), 1.0)
    assert found.lower - 1e-9 <= truth <= found.upper + 1e-9


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("hollow", [False, True])
def test_what_is_stated_of_a_mesh_widens_what_its_round_surfaces_say(fit, hollow):
    """The true bar may be thicker or thinner by the error that its maker states."""
    made = bar(10.0, -20.0, 20.0) - bar(6.0, 0.0, 30.0) if hollow else bar(10.0, -20.0, 20.0)
    found = distance(mesh_shape(made, fit, 0.5), CUBE, translation(12.5, 0.0, -10.0))
    reach = 10.0 * (math.cos(math.pi / 48.0) if fit == "off" else 1.0)
    assert found.lower - 1e-9 <= 12.0 - (reach + 0.5)
    assert found.upper + 1e-9 >= 12.0 - (reach - 0.5)
    assert np.isfinite(found.lower)


def test_what_facets_fill_beside_a_round_rim_is_air():
    """Between a chord of a hole and its arc: the block's face has a point there, the round part has none."""
    block = manifold3d.Manifold.cube((30.0, 30.0, 30.0), True) - bar(6.0, 0.0, 20.0)
    (form,) = ModelCache().model(mesh_shape(block, "round")).bodies
    depth = form.depth(np.array([(5.995, 0.0, 15.0), (6.001, 0.0, 15.0), (6.0, 0.0, 7.0), (-9.0, 8.0, 15.0)]))
    assert depth[0] < -1e-3
    assert depth[1:] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 10.0])
def test_a_pin_in_a_hole_that_leaves_through_a_slanted_face(tilt):
    """Facets beside the hole's mouth reach into its circle by the chords that they share with it."""
    roof = manifold3d.Manifold.cube((60.0, 60.0, 20.0), True).rotate((0.0, tilt, 0.0)).translate((0.0, 0.0, 20.0))
    hole = manifold3d.Manifold.cylinder(60.0, 6.0, 6.0, 48, True)
    block = manifold3d.Manifold.cube((30.0, 30.0, 30.0), True) - roof - hole
    found = distance(mesh_shape(block, "round"), shapes.cylinder(5.9, 60.0), translation(0.02, 0.0, 0.0))
    assert found.lower - 1e-9 <= 0.08 <= found.upper + 1e-9
    assert found.upper - found.lower <= 1e-6
