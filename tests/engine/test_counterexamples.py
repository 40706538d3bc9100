"""Counterexamples: bodies of which a bound did not hold once, each with its truth by formula."""

import math

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from clamp3d import Motion, Scene, check, distance, shapes
from clamp3d.engine.relations import relation
from clamp3d.engine.scene import Part
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.profile import Arc, Profile
from clamp3d.shapes import MeshShape, Solid
from tests.kinds import manifold_shape, mesh_shape


def turned_mesh(outline, n, fit="round", slope=0.0, end=0.0):
    """Triangles of a polygon of n corners along a bar, by its (radius, z); the last ring slopes, the middle of the end
    stands out."""
    turn = (np.arange(n) + 0.5) * 2.0 * np.pi / n
    rings = [np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(n, z)]) for r, z in outline]
    rings[-1][:, 2] += slope * rings[-1][:, 0]
    ends = [[0.0, 0.0, outline[0][1]], [0.0, 0.0, outline[-1][1] + end]]
    i, last = np.arange(n), (len(rings) - 1) * n
    j = (i + 1) % n
    faces = [
        np.column_stack([j, i, np.full(n, last + n)]),
        np.column_stack([last + i, last + j, np.full(n, last + n + 1)]),
    ]
    for k in range(0, last, n):
        faces += [np.column_stack([k + i, k + j, k + n + j]), np.column_stack([k + i, k + n + j, k + n + i])]
    return MeshShape(make_mesh(np.vstack([*rings, ends]), np.vstack(faces)), fit)


def row(a, b, T=None, allowed=None, contact=0.01):
    scene = Scene(contact=contact).add("a", a).add("b", b, T)
    scene = scene if allowed is None else scene.allow(("a", "b"), overlap=allowed)
    return next(iter(check(scene).pairs), None)


def test_a_blade_between_two_prisms_that_touch_is_deeper_than_in_either():
    """Swung through the joint of a plate of two halves, 3.018 mm deep."""
    plate = Solid("plate", tuple(Extrusion(Profile.rectangle(20, 20, (x, 0)), "Z", -40.0, 40.0) for x in (-10.0, 10.0)))
    for start, stop in ((22, 35), (26, 50), (30, 70), (35, 100), (40, 130), (40, 160)):
        pose = translation(0, 35, 0) @ rotation((1, 0, 0), math.radians(-start)) @ translation(0, -18, 0)
        swing = Motion.screw((1, 0, 0), math.radians(stop + start), point=(0, 35, 0), parts="blade")
        scene = Scene().add("plate", plate).add("blade", shapes.box((0.02, 20, 2)), pose)
        (answer,) = check(scene.allow(("plate", "blade"), overlap=2.0).with_motion(swing)).motions
        assert answer.verdict.value in ("clash", "uncertain")
        assert answer.distance.lower <= -(math.hypot(28, 1) - 25)


def test_a_blade_between_two_discs_is_deeper_than_in_either():
    half = math.acos(0.5)
    discs = [Arc((5.0, 0.0), 10.0, half - math.pi, math.pi - half), Arc((-5.0, 0.0), 10.0, half, 2 * math.pi - half)]
    wedge = Manifold.extrude(CrossSection([[(0, 0), (0.02, 30), (-0.02, 30)]]), 1.0)
    blade = manifold_shape(wedge.translate((0, 0, -0.5)), "off")
    answer = row(shapes.extrusion(Profile.of(*discs), 200.0), blade, allowed=7.0)
    assert answer.verdict.value in ("clash", "uncertain")
    assert answer.distance.lower <= -math.sqrt(75.0)


@pytest.mark.parametrize("size", [8.0, 9.99])
def test_a_body_that_is_swallowed_is_deep_however_large_another_of_its_part_is(size):
    far = [trimesh.creation.box((100, 100, 100)).apply_translation((x, 50, 0)) for x in (100, -100)]
    inner, outer = trimesh.creation.box(3 * (size,)), trimesh.creation.box((10, 10, 10))
    parts = [mesh_shape(trimesh.util.concatenate(pair), "off") for pair in ((inner, far[0]), (outer, far[1]))]
    for allowed in (None, 2.0, 4.0):
        answer = row(*parts, allowed=allowed)
        assert answer.verdict.value in ("clash", "uncertain")
        assert answer.distance.lower <= -5.0
        assert answer.distance.interference is None or answer.distance.interference[1] >= 5.0


def test_an_open_strip_just_under_a_round_face_is_not_said_to_be_apart():
    for around in np.linspace(0.0, 0.2, 9):
        across, up = np.array([-math.sin(around), math.cos(around), 0.0]), np.array([0.0, 0.0, 5.0])
        middle = 9.998 * np.array([math.cos(around), math.sin(around), 0.0])
        corners = [middle + x * 0.03 * across + z * up for x, z in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        strip = MeshShape(make_mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]])))
        answer = row(shapes.cylinder(10.0, 40.0), strip, contact=0.001)
        assert answer.verdict.value != "clear"
        assert answer.distance.lower <= 0.0


@pytest.mark.parametrize("far", [0.0, 1000.0, 3000.0])
def test_a_chamfer_of_a_fitted_pin_is_there_in_single_precision_too(far):
    pin = turned_mesh([(4.0, 0.0), (4.0, 19.0), (3.0, 20.0)], 48)
    T = rotation((1, 2, 3), 0.7)
    T[:3, 3] = np.array([0.7, -0.5, 0.6]) * far
    corners = (pin.mesh.vertices @ T[:3, :3].T + T[:3, 3]).astype(np.float32)
    scene = Scene().add("pin", MeshShape(make_mesh(corners, pin.mesh.faces), "round"))
    for k in range(0, 48, 12):
        turn, height = 2.0 * np.pi * (k + 1.0) / 48, 3.5 * math.cos(np.pi / 48)
        out = np.array([math.cos(turn), math.sin(turn), 1.0]) / math.sqrt(2.0)
        middle = np.array([height * math.cos(turn), height * math.sin(turn), 19.5]) + 1.9 * out
        scene = scene.add(f"ball-{k}", shapes.sphere(2.0), T @ translation(*middle))
    assert [answer.verdict.value for answer in check(scene).pairs if answer.a == "pin"] == ["clash"] * 4


@pytest.mark.parametrize("gap", [0.01, -0.0005])
def test_the_end_of_a_fitted_bar_that_is_not_quite_flat_is_within_its_error(gap):
    bar = turned_mesh([(5.0, 0.0), (5.0, 1000.0)], 64, end=0.0009)
    answer = distance(bar, shapes.box((50, 50, 10)), translation(0, 0, 1005.0009 + gap))
    assert answer.lower <= gap <= answer.upper


def test_the_tip_of_a_slanting_end_stands_out_of_its_facets():
    """A cylinder of 48 facets cut at 80 degrees: its tip is 0.06 mm beyond theirs, which are 0.011 mm off."""
    slope = math.tan(math.radians(80.0))
    cut = turned_mesh([(5.0, -60.0), (5.0, 30.0)], 48, slope=slope)
    tip, plate = 30.0 + 5.0 * slope, shapes.box((100, 100, 10))
    for gap in (0.2, 0.03, -0.05):
        answer = distance(cut, plate, translation(0, 0, tip + gap + 5.0))
        assert answer.lower <= gap <= answer.upper
    assert row(cut, plate, translation(0, 0, tip + 5.0 - 0.03)).verdict.value != "clear"


def test_a_long_bar_that_is_turned_a_little_is_no_duplicate():
    bar = shapes.box((2000, 10, 10))
    assert relation(Part("a", bar, np.eye(4)), Part("b", bar, rotation((0, 0, 1), 9e-4))) is None
    assert relation(Part("a", bar, np.eye(4)), Part("b", bar, rotation((0, 0, 1), 9e-7))).kind == "duplicate"


def test_long_bars_that_are_turned_a_little_have_an_answer_of_their_own():
    """By 4e-10 rad, which is 2e-6 mm at their ends."""
    bar, turn = shapes.box((10_000, 10, 10)), 4e-10
    scene = Scene().add("a", bar).add("b", bar, translation(0, 10.5, 0)).add("c", bar, translation(0, 0, 500))
    scene = scene.add("d", bar, translation(0, 10.5, 500) @ rotation((0, 0, 1), turn))
    answer = check(scene, distances=True, pairs=[("a", "b"), ("c", "d")]).pairs[1]
    assert answer.distance.lower - 1e-9 <= 0.5 - 5000.0 * turn <= answer.distance.upper + 1e-9


def test_what_facets_leave_of_a_slanting_hole_is_no_material():
    """A small ball over the end of a hole at 75 degrees, between a chord and the arc: 0.128 mm from the wall."""
    tilt, axis = math.radians(75.0), np.array([math.sin(math.radians(75.0)), 0.0, math.cos(math.radians(75.0))])
    drill = Manifold.cylinder(400.0, 5.0, 5.0, 24).translate((0, 0, -200)).rotate((0, 0, 7.5))
    drill = drill.transform(rotation((0, 1, 0), tilt)[:3])
    block = manifold_shape(Manifold.cube((160, 40, 20), True) - drill, "round")
    sagitta = 5.0 * (1.0 - math.cos(math.pi / 24))
    x = (10.0 * math.sin(tilt) - (5.0 - 0.8 * sagitta)) / math.cos(tilt)
    below = np.array([x, 0.0, 10.0])
    assert 5.0 - np.linalg.norm(below - (below @ axis) * axis) == pytest.approx(0.8 * sagitta)
    answer = distance(block, shapes.sphere(0.01), translation(x, 0.0, 10.03))
    assert answer.lower <= 0.128 <= answer.upper
