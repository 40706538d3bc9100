"""One pair of parts at a time, against closed forms: verdicts, depths, common parts, and how pins and holes fit."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d import Distance, Motion, Part, Scene, Verdict, check, distance, shapes
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.judge import judge, kind_of_overlap
from clamp3d.engine.model import ModelCache
from clamp3d.engine.refine import from_boxes
from clamp3d.engine.relations import relation
from clamp3d.engine.verdict import Thresholds
from clamp3d.geometry.pose import rotation, to_target, translation
from clamp3d.shapes import SweptArc
from tests.kinds import faceted_shape, measured_alike, mesh_shape, row_of

BLOCK = shapes.groove_block(SweptArc(7.0, math.radians(60.0), 50.0), 40.0, 20.0)  # top at -3.5, back at -23.5
WIRE, CUBE = shapes.cylinder(6.935, 80.0), shapes.box((10, 10, 10))
CACHE = ModelCache()
QUARTER = rotation([0, 1, 0], math.pi / 2)


@pytest.mark.parametrize(
    ("T", "gap"),
    [
        (np.eye(4), 0.065),  # coaxial
        (translation(0, -0.065, 0), 0.0),
        (translation(0, -0.0751, 0), -0.0101),
        (translation(20 + 6.935 + 0.3, -12.0, 0), 0.3),  # beside the block, where the endless groove has material
        (translation(0, -23.5 - 6.935 - 0.2, 0), 0.2),  # below it
        (translation(20.3 + 6.935 / math.sqrt(2), -3.2 + 6.935 / math.sqrt(2), 0), 0.3 * math.sqrt(2)),  # off its edge
        (translation(0, -3.5 + 6.935 + 0.4, 0) @ QUARTER, 0.4),  # across, on both flats
        (translation(5, -3.5 + 6.935 + 0.4, 3) @ QUARTER, 0.4),  # its middle off the block
        (translation(0, -7 - 6.935 - 0.1, 65.5), 0.5),  # in line with the block's end, below the groove
        (translation(0, 0, 25.0 + 39.0), 0.065),  # one millimetre of it still in the groove
    ],
)
def test_wire_at_block_is_exact_all_around(T, gap):
    row = row_of(BLOCK, WIRE, T, clearance=2.0)
    assert row.distance.lower - 1e-6 <= gap <= row.distance.upper + 1e-6
    assert row.verdict is Thresholds(clearance=2.0).verdict(Distance(gap, gap))


@pytest.mark.parametrize(
    ("b", "T", "verdict"),
    [
        (shapes.cylinder(4.0, 30.0), translation(0, -16, 0), "contained"),  # wholly in the block's wall: no surface met
        (shapes.cylinder(4.0, 60.0), translation(0, -16, 0), "clash"),  # sticks out at both ends
        (shapes.box((200, 200, 200)), np.eye(4), "contained"),
        (CUBE, translation(0, -3.5 + 5.0, 0), "clear"),  # hovers in the mouth: 7 deep, 12 wide
        (shapes.box((40, 4, 50)), translation(0, -1.5, 0), "contact"),  # lies on both flats, over the mouth
        (shapes.box((40, 4, 50)), translation(0, -1.5 - 0.02, 0), "clash"),
        (shapes.box((40, 4, 50)), translation(0, -1.5 - 0.008, 0), "contact"),
        (shapes.box((40, 4, 50)), translation(0, -1.5 + 0.3, 0), "clearance"),
    ],
)
def test_verdicts(b, T, verdict):
    scene = Scene(clearance=0.5).add("a", BLOCK).add("b", b, T)
    result = check(scene)
    assert result.verdict("a", "b").value == verdict
    assert result.verdict("b", "a").value == verdict
    measured_alike(scene, result)


@pytest.mark.parametrize(("hole", "size", "verdict"), [(0.65, 0.01, "contained"), (0.707, 0.33, "clash")])
def test_a_part_in_a_corner_that_is_thinner_than_the_meshes(hole, size, verdict):
    drilled = shapes.box((1, 1, 10), holes=[shapes.Hole(hole)])  # of 0.707 the finest mesh inside is empty too
    row = row_of(drilled, shapes.box((size, size, size)), translation(0.49, 0.49, 0), contact=1e-4)
    assert row.verdict.value == verdict


def test_thresholds():
    t = Thresholds(contact=0.01, clearance=1.0)
    cases = {-0.02: "clash", -0.01: "contact", 0.01: "contact", 0.02: "clearance", 1.0: "clear", 2.0: "clear"}
    assert {d: t.verdict(Distance(d, d)).value for d in cases} == cases
    assert t.verdict(Distance(-0.02, 0.0)) is Verdict.UNCERTAIN
    assert t.verdict(Distance(1.0 - 1e-9, 1.0 + 1e-9)) is Verdict.CLEAR
    # Contact ends at 0.010001 mm; bounds up to 2e-6 mm apart have the verdict of their middle.
    assert t.verdict(Distance(0.0100006 - 0.9e-6, 0.0100006 + 0.9e-6)) is Verdict.CONTACT
    assert t.verdict(Distance(0.0100014 - 0.9e-6, 0.0100014 + 0.9e-6)) is Verdict.CLEARANCE
    assert t.verdict(Distance(0.0100006 - 1.1e-6, 0.0100006 + 1.1e-6)) is Verdict.UNCERTAIN
    assert t.verdict(Distance(-math.inf, -0.02)) is Verdict.CLASH


@pytest.mark.parametrize(("distances", "shift"), [(False, 0.0), (False, 1e-9), (True, 1e-9)])
@pytest.mark.parametrize("shape", [CUBE, shapes.cylinder(12.0, 40.0, bore=8.0), BLOCK])
def test_a_part_that_is_there_twice_clashes(shape, shift, distances):
    # The surfaces coincide, so no point of either lies deep in the other: only what is between them does.
    T = rotation([1, 2, 3], 0.7) @ translation(5.0, 6.0, 7.0)
    scene = Scene().add("a", shape, T).add("b", replace(shape), T @ translation(shift, 0.0, 0.0))
    assert check(scene, distances=distances).verdict("a", "b") is Verdict.DUPLICATE


def test_a_press_fit_is_judged_by_what_the_parts_share():
    plate, pin = shapes.box((40, 40, 8), holes=[shapes.Hole(5.0)]), shapes.cylinder(5.02, 20.0)
    scene = Scene().add("plate", plate).add("pin", pin)
    assert check(scene).verdict("plate", "pin") is Verdict.CLASH
    row = check(scene.allow(("plate", "pin"), overlap=0.03)).pairs[0]
    assert row.verdict is Verdict.ALLOWED
    assert row.distance.depth == pytest.approx(0.02, abs=1e-9)  # though the way out is lengthwise
    assert distance(plate, pin).lower <= -13.9


def test_without_depths_an_overlap_is_at_least():
    scene = Scene().add("a", CUBE).add("b", shapes.box((8, 8, 8)), translation(6.0, 0.0, 0.0))
    found = check(scene, depths=False).pairs[0].distance
    assert found.lower == -math.inf
    assert -3.0 <= found.upper < -0.01
    assert check(scene).pairs[0].distance.depth == pytest.approx(3.0, abs=1e-9)


# --- Which holds which ---------------------------------------------------------------------------------------------


def kind(a, b, T, contact):
    return kind_of_overlap(CACHE.model(a), CACHE.model(b), T, contact).value


@pytest.mark.parametrize("error", [0.0, 0.1])
def test_a_part_is_contained_that_stands_out_by_no_more_than_its_threshold_and_its_errors(error):
    cube, box = trimesh.creation.box((2.0, 2.0, 2.0)), shapes.box((9.0, 9.0, 9.0))
    small = mesh_shape(cube, error=error)
    for out, verdict in ((0.0095, "contained"), (0.0105, "clash")):
        T = translation(3.5 + error + out, 0.0, 0.0)
        assert kind(box, small, T, 0.01) == verdict
        assert kind(small, box, translation(-T[0, 3], 0.0, 0.0), 0.01) == verdict
    large = mesh_shape(cube.copy().apply_scale(4.5), error=error)
    assert kind(large, small, translation(3.5 + 2.0 * error + 0.0095, 0.0, 0.0), 0.01) == "contained"
    assert kind(large, small, translation(3.5 + 2.0 * error + 0.0105, 0.0, 0.0), 0.01) == "clash"


def test_a_round_part_that_fills_another_is_contained_though_both_meshes_are_off():
    assert kind(shapes.cylinder(5.0, 9.0), shapes.cylinder(5.0, 4.0), np.eye(4), 1e-6) == "contained"
    assert kind(shapes.cylinder(5.0, 9.0), shapes.cylinder(5.01, 4.0), np.eye(4), 1e-6) == "clash"


@pytest.mark.parametrize("out", [0.0, 0.009, -0.009])
def test_a_tetrahedron_fills_a_box(out):
    """No part is further from the middle of its own box: by a third of the box's extent."""
    made = trimesh.convex.convex_hull(np.array([(-1.0, -1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]))
    T = np.linalg.inv(np.linalg.qr(np.array([(1.0, 1.0, 1.0), (0.0, 1.0, 0.3), (0.0, 0.0, 1.0)]).T)[0])
    T = np.block([[T * np.linalg.det(T), np.zeros((3, 1))], [np.eye(4)[3:]]])
    points = to_target(T, made.vertices)
    T[:3, 3] = (out, 0.0, 0.0) - 0.5 * (points.min(axis=0) + points.max(axis=0))
    part = mesh_shape(made)
    assert kind(shapes.box(tuple(np.ptp(points, axis=0))), part, T, 0.01) == "contained"


def test_what_an_interference_leaves_open_the_depth_decides():
    """A rim of a cylinder and an edge of a box: a point is 0.01 mm deep to 0.002, and it takes 0.0154 to part them."""
    a, b = CACHE.model(shapes.cylinder(5.0, 10.0)), CACHE.model(shapes.box((6.0, 6.0, 6.0)))
    T = translation(-7.947, -0.014, 7.947) @ rotation((-1.9, -1.1, 1.6), 1.1)
    verdict, distance = judge(a, b, T, from_boxes(a, b, T), Thresholds(contact=0.01), None)
    assert verdict is Verdict.CLASH
    assert -0.0154 == pytest.approx(distance.lower, abs=1e-4) == distance.upper


# --- Where they overlap -----------------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None)
@given(x=st.floats(0.5, 5.0), y=st.floats(-2.0, 2.0))
def test_boxes_share_a_box(x, y):
    where = row_of(CUBE, CUBE, translation(10.0 - x, y, 0.0)).where
    low, high = where.volume
    assert low <= x * (10.0 - abs(y)) * 10.0 <= high
    assert high - low < 1e-6
    assert where.box == pytest.approx(np.array([[5 - x, max(-5, y - 5), -5], [5, min(5, y + 5), 5]]), abs=1e-8)
    assert not where.of_facets


@settings(max_examples=8, deadline=None)
@given(d=st.floats(0.2, 9.0))
def test_crossed_side_by_side_cylinders_share_a_lens(d):
    """Two parallel cylinders of radius 5, axes d apart: the lens of two circles times the length."""
    where = row_of(shapes.cylinder(5.0, 20.0), shapes.cylinder(5.0, 20.0), translation(d, 0.0, 0.0)).where
    lens = 2.0 * 25.0 * math.acos(d / 10.0) - 0.5 * d * math.sqrt(100.0 - d * d)
    low, high = where.volume
    assert low <= lens * 20.0 <= high
    half = math.sqrt(25.0 - 0.25 * d * d)
    assert (where.box[0] <= [d - 5.0, -half, -10.0]).all()
    assert (where.box[1] >= [5.0, half, 10.0]).all()
    assert high - low < 0.01 * lens * 20.0
    assert math.hypot(*where.point[:2]) <= 5.0
    assert math.hypot(where.point[0] - d, where.point[1]) <= 5.0


def test_a_motion_tells_where_it_is_deepest_and_is_a_finding():
    scene = Scene().add("a", CUBE).add("b", CUBE, translation(0, 0, 20)).add("c", CUBE, translation(40, 0, 0))
    result = check(scene.with_motion(Motion.translate((0, 0, -12), parts=("b",), name="down")))
    (row,) = result.motions
    assert row.where.to_dict()["volume_at_least_mm3"] > 0.0
    assert row.where.box[:, 2].tolist() == pytest.approx([row.where.box[0, 2], 5.0])
    assert all(other.where is None for other in result.pairs)
    assert [f["motion"] for f in result.to_dict()["findings"]] == [row.motion] == ["down"]
    assert repr(result) == "CheckResult('scene': not clean; 1 clash, 3 clear)"
    assert "<td>down</td>" in result._repr_html_()


def test_boxes_leave_out_no_pair_that_counts_as_contact():
    for distances in (False, True):
        assert row_of(CUBE, CUBE, translation(10.0100001, 0, 0), distances=distances).verdict is Verdict.CONTACT


TURNED = translation(30.0, -7.0, 4.0) @ [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]


def fit(radius, place=(0.0, 0.0, 0.0), hole=5.0, length=40.0):
    """A pin in a tube whose bore has a radius of 5."""
    tube = Part("tube", shapes.cylinder(9.0, 8.0, bore=hole), TURNED)
    found = relation(tube, Part("pin", shapes.cylinder(radius, length), TURNED @ translation(*place)))
    return found and (found.kind, found.overlap)


def test_the_two_radii_say_how_they_fit():
    assert [fit(radius) for radius in (4.9, 7.0)] == [None, None]
    assert [fit(radius) for radius in (4.99, 5.0)] == [("running", 0.0)] * 2
    assert [fit(radius) for radius in (5.01, 5.1, 6.0)] == [("press", 0.01), ("thread", 0.1), ("thread", 1.0)]


@pytest.mark.parametrize("place", [(0.01, 0.0, 0.0), (0.0, 0.0, 24.1), (0.0, 0.0, -24.1)])
def test_a_pin_beside_or_beyond_its_hole_does_not_fit(place):
    assert fit(5.01, place) is None


def test_the_holes_of_a_block_are_found_wherever_they_are():
    block = Part("block", shapes.box(40.0, 30.0, 8.0, holes=[shapes.Hole(3.0, (10.0, -2.0))]), TURNED)
    pin = Part("pin", shapes.cylinder(3.01, 20.0), TURNED @ translation(10.0, -2.0, 3.0))
    assert relation(block, pin).kind == relation(pin, block).kind == "press"


@pytest.mark.parametrize(("found", "kind"), [("round", "press"), ("off", None)])
def test_meshes_fit_only_where_round_surfaces_are_looked_for(found, kind):
    block = shapes.box(40.0, 30.0, 8.0, holes=[shapes.Hole(3.0, (10.0, -2.0))])
    first, second = (faceted_shape(shape, 0.01, found) for shape in (block, shapes.cylinder(3.01, 20.0)))
    match = relation(Part("block", first), Part("pin", second, translation(10.0, -2.0, 3.0)))
    assert (match and match.kind) == kind


def bolted(*rules, sink=0.0):
    """A bolt in a nut; ``sink``: how far a pin on a plate stands in the plate."""
    scene = Scene().add("nut", shapes.cylinder(9.0, 8.0, bore=4.2)).add("bolt", shapes.cylinder(5.0, 40.0))
    scene = scene.add("plate", shapes.box(20.0, 20.0, 4.0), translation(50.0, 0.0, -2.0))
    scene = scene.add("pin", shapes.cylinder(5.0, 40.0), translation(50.0, 0.0, 20.0 - sink))
    return replace(scene, allowed=rules)


def test_a_rule_covers_the_overlap_of_the_fit_and_no_other():
    assert check(bolted(sink=0.5)).counts["clash"] == 2
    scene = bolted(Allowed(relation="thread"), sink=0.5)
    verdicts = {frozenset((row.a, row.b)): row.verdict.value for row in check(scene).pairs}
    assert verdicts == {frozenset(("nut", "bolt")): "allowed", frozenset(("plate", "pin")): "clash"}
    shallow = check(bolted(Allowed(relation="thread", overlap=0.5)))
    assert shallow.verdict("nut", "bolt").value == "clash"  # its threads overlap by 0.8


def test_duplicates_can_be_meant():
    ball = shapes.cylinder(5.0, 5.0)
    scene = Scene().add("a", ball).add("b", ball)
    assert check(scene).verdict("a", "b").value == "duplicate"
    assert check(Scene(scene.parts, allowed=(Allowed(relation="duplicate"),))).verdict("a", "b").value == "allowed"


def test_a_rule_says_what_it_allows():
    assert str(Allowed("a", "b")) == "a:b"
    assert str(Allowed("bolt*", "plate", 0.05)) == "bolt*:plate up to 0.05 mm"
    assert str(Allowed("#1", "#2")) == "#1:#2"
    assert str(Allowed(relation="thread", overlap=0.5)) == "thread up to 0.5 mm"
    assert str(Allowed("*", "nut", relation="thread")) == "thread *:nut"
