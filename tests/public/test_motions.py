"""First contacts and least clearances on motions against formulas: drawn bodies, meshes, CAD."""

import math

import numpy as np
import pytest
import trimesh

from clamp3d import Motion, Scene, check, first_contact, load, min_clearance
from clamp3d.kernel import translation
from clamp3d.shapes import SweptArc, box, cylinder, groove_block
from tests.kinds import DRAWN, faceted_shape, mesh_shape, pose

ACCURACY = 3e-4
"""How far apart bodies may still be at a first contact, mm."""
GROOVE = SweptArc(7.0, math.radians(60.0), 50.0)
BLOCK, WIRE = groove_block(GROOVE, 40.0, 20.0), cylinder(6.935, 80.0)
TUBE, PIN = cylinder(9.0, 40.0, bore=5.1), cylinder(5.0, 60.0)


def mesh_box(*size):
    return mesh_shape(trimesh.creation.box(size))


def down(way):
    return Motion.translate((0.0, 0.0, -way))


# a, b, motion, pose of b at the start, t of the first contact, speed there in mm
CONTACTS = {
    "box onto box": (box((20, 20, 4)), box((3, 3, 3)), down(20), translation(0, 0, 13.5), 0.5, 20.0),
    "cylinder onto box": (box((20, 20, 4)), cylinder(2, 7), down(20), translation(1, 2, 10.5), 0.25, 20.0),
    "wire into its groove": (
        BLOCK, WIRE, Motion.translate((0, -40, 0)), translation(0, 29.935, 0), 0.75, 40.0,
    ),
    "pin against a tube": (TUBE, PIN, Motion.translate((8, 0, 0)), np.eye(4), 0.0125, 8.0),
    # The wall's face at y = -5 meets a rod of radius 2 that is carried round at 20 mm from an axis 15 mm before it.
    "screwing rod against a wall": (
        box((60, 10, 100)), cylinder(2, 8), Motion.screw((0, 0, 1), math.pi / 2, point=(0, -20, 0), travel=6.0),
        translation(20, -20, 0), math.asin((15.0 - 2.0) / 20.0) / (math.pi / 2), 20 * math.pi / 2 + 6,
    ),
    "mesh onto mesh": (mesh_box(20, 20, 4), mesh_box(3, 3, 3), down(20), translation(0, 0, 13.5), 0.5, 20.0),
    "mesh onto box": (box((20, 20, 4)), mesh_box(3, 3, 3), down(20), translation(0, 0, 13.5), 0.5, 20.0),
}  # fmt: skip


@pytest.mark.parametrize("case", CONTACTS)
def test_the_first_contact_is_neither_late_nor_early(case):
    a, b, motion, start, t, speed = CONTACTS[case]
    hit = first_contact(a, b, motion, start)
    assert hit.touches
    assert hit.t <= t + 1e-9
    assert hit.t >= t - 3 * ACCURACY / speed - 1e-9
    assert hit.distance.upper <= ACCURACY
    np.testing.assert_allclose(hit.pose, motion.at(hit.t, start), atol=1e-9)


CLEARANCES = {
    "wire to the bottom": (BLOCK, WIRE, Motion.translate((0, -30, 0)), translation(0, 30, 0), 0.065),
    "pin through a tube": (TUBE, PIN, Motion.translate((0, 0, -240)), translation(0, 0, 120), 0.1),
    "turning pin in a tube": (TUBE, PIN, Motion.screw((0, 0, 1), 4.0, point=(0.03, 0, 0), travel=4.0), np.eye(4), 0.04),
    "box past a corner": (
        box((10, 10, 10)), box((4, 4, 4)), Motion.translate((0, 0, 40)), translation(10, 11, -20), 5.0,
    ),
    "mesh past a mesh": (
        mesh_box(10, 10, 10), mesh_box(4, 4, 4), Motion.translate((40, 0, 0)), translation(-20, 7.25, 0), 0.25,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CLEARANCES)
def test_the_least_clearance_on_a_way(case):
    a, b, motion, start, truth = CLEARANCES[case]
    least = min_clearance(a, b, motion, start)
    assert not least.touches
    assert least.distance.lower - 1e-9 <= truth <= least.distance.upper + 1e-9
    assert least.distance.upper - least.distance.lower < 0.005
    assert least.distance.value == pytest.approx(truth, abs=0.003)


@pytest.mark.parametrize(
    ("way", "expected"), [(30.0, "clearance"), (30.0651, "contact"), (30.0749, "contact"), (30.0751, "clash")]
)
def test_verdicts_of_a_motion_in_a_scene(way, expected):
    scene = Scene(clearance=0.07).add("block", BLOCK).add("wire", WIRE, translation(0, 30, 0))
    result = check(scene.with_motion(Motion.translate((0, -way, 0), parts="wire", name="in")))
    (row,) = result.motions
    assert (row.motion, row.verdict.value) == ("in", expected)
    assert result.clean == (expected != "clash")
    if expected == "clash":
        assert row.contact_at == pytest.approx(30.055 / way, abs=1e-5)
    else:
        assert row.contact_at is None or expected == "contact"


@pytest.fixture(scope="module")
def plate_and_pin(tmp_path_factory):
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    from tests.cad import block, cut, location, rod
    from tests.files.assemblies import write_step

    plate = cut(block((-15, -15, -3), (15, 15, 3)), rod(4.1, -4, 4))
    parts = {"plate": plate, "pin": rod(4.0, 0, 20).Located(location(translation(0, 0, 10)))}
    return load(write_step(parts, tmp_path_factory.mktemp("cad") / "pin.step")).parts


@pytest.mark.parametrize("aside", [0.0, 0.05])
def test_a_pin_of_cad_passes_its_hole(plate_and_pin, aside):
    plate, pin = plate_and_pin
    start = translation(aside, 0, 0) @ pin.T_world
    least = min_clearance(plate.shape, pin.shape, down(20.0), start)
    assert least.distance.lower - 1e-9 <= 0.1 - aside <= least.distance.upper + 1e-9
    assert least.distance.upper - least.distance.lower < 1e-5  # its faces name the hole: the kernel measures it
    assert least.distance.method == "groove kernel"
    assert not least.touches


def test_a_round_side_of_cad_leaves_a_plate(tmp_path):
    """What stands out of the facets counts: the lowest line of the cylinder starts 0.05 mm above the plate."""
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    from tests.cad import block, rod
    from tests.files.assemblies import write_step

    parts = {"plate": block((-40, -40, -3), (40, 40, 0)), "bar": rod(8.0, -6, 6)}
    plate, bar = load(write_step(parts, tmp_path / "over.step")).parts
    start = pose((1.0, 0.0, 0.0), math.pi / 2, (-10.0, 0.0, 8.05))
    least = min_clearance(plate.shape, bar.shape, Motion.translate((20, 0, 20)), start)
    assert least.distance.lower - 1e-6 <= 0.05 <= least.distance.upper + 1e-6
    assert not least.touches


@pytest.mark.parametrize(("aside", "t"), [(0.3, (10 - 3) / 20), (9.0, (10 - 3) / 20)])
def test_a_pin_of_cad_beside_its_hole_meets_the_plate(plate_and_pin, aside, t):
    plate, pin = plate_and_pin
    hit = first_contact(plate.shape, pin.shape, down(20.0), translation(aside, 0, 0) @ pin.T_world)
    assert hit.touches
    assert t - 0.001 <= hit.t <= t + 1e-9


def test_bodies_that_slide_along_each_other_and_meet_later_touch():
    """Heads of two bolts pass at a hair's breadth before the shank meets: the search for the first time ends early."""
    bolt = next(shape for shape in DRAWN if shape.name == "bolt")
    angle = math.atan2(-0.9621351675436614, -0.2725727781267431)
    start = translation(-19.914325967547395, 0.0, 9.538685459192337) @ pose((0.0, 0.0, 1.0), angle, (0.0, 0.0, 0.0))
    way = Motion.translate((28.26490223, 8.0, -7.70344421))
    hit = first_contact(faceted_shape(bolt, 0.3), bolt, way, start)
    assert hit.touches
    assert hit.t <= min_clearance(faceted_shape(bolt, 0.3), bolt, way, start).t
