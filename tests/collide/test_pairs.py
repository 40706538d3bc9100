"""One pair of parts at a time, against closed forms and the definitions of the shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from clamp3d.collide.answer import Distance
from clamp3d.collide.check import check
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Thresholds, Verdict
from clamp3d.core import shapes
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import SweptArc
from clamp3d.testing import common, separation
from tests.kinds import measured_alike

BLOCK = shapes.groove_block(SweptArc(7.0, math.radians(60.0), 50.0), 40.0, 20.0)  # top at -3.5, back at -23.5
WIRE = shapes.cylinder(6.935, 80.0)


def pair(a, b, T, **settings_):
    scene = Scene(**settings_).add("a", a).add("b", b, T)
    return scene, check(scene)


@pytest.mark.parametrize(
    ("T", "distance"),
    [
        (np.eye(4), 0.065),  # coaxial
        (translation(0, -0.065, 0), 0.0),
        (translation(0, -0.0751, 0), -0.0101),
        (translation(20 + 6.935 + 0.3, -12.0, 0), 0.3),  # beside the block, where the endless groove has material
        (translation(0, -23.5 - 6.935 - 0.2, 0), 0.2),  # below it
        (translation(20 + 0.3 + 6.935 / math.sqrt(2), -3.5 + 0.3 + 6.935 / math.sqrt(2), 0), None),  # off its edge
        (translation(0, -3.5 + 6.935 + 0.4, 0) @ rotation([0, 1, 0], math.pi / 2), 0.4),  # across, on both flats
        (translation(5, -3.5 + 6.935 + 0.4, 3) @ rotation([0, 1, 0], math.pi / 2), 0.4),  # its middle off the block
        (translation(0, -7 - 6.935 - 0.1, 65.5), 0.5),  # in line with the block's end, below the groove
        (translation(0, 0, 25.0 + 39.0), 0.065),  # one millimetre of it still in the groove
    ],
)
def test_wire_at_block_is_exact_all_around(T, distance):
    scene = Scene(clearance=2.0).add("a", BLOCK).add("b", WIRE, T)
    row = check(scene).pairs[0]
    truth = separation(BLOCK, WIRE, T)
    if distance is None:
        distance = truth.upper
        assert row.distance.lower - 1e-6 <= distance <= row.distance.upper + 1e-6
    elif distance > 0.0:
        assert truth.lower <= distance <= truth.upper + 1e-6  # the oracle agrees with the closed form of the test
        assert row.distance.lower - 1e-6 <= distance <= row.distance.upper + 1e-6
    if distance < -1e-9:
        assert common(BLOCK, WIRE, T, accuracy=1e-3).lower < 0.0
        assert row.distance.lower - 1e-6 <= distance <= row.distance.upper + 1e-6
    assert row.verdict is scene.thresholds.verdict(Distance(distance, distance))


@pytest.mark.parametrize(
    ("b", "T", "verdict"),
    [
        (shapes.cylinder(4.0, 30.0), translation(0, -16, 0), "contained"),  # wholly in the block's wall: no surface met
        (shapes.cylinder(4.0, 60.0), translation(0, -16, 0), "clash"),  # sticks out at both ends
        (shapes.box((200, 200, 200)), np.eye(4), "contained"),
        (shapes.box((10, 10, 10)), translation(0, -3.5 + 5.0, 0), "clear"),  # hovers in the mouth: 7 deep, 12 wide
        (shapes.box((40, 4, 50)), translation(0, -1.5, 0), "contact"),  # lies on both flats, over the mouth
        (shapes.box((40, 4, 50)), translation(0, -1.5 - 0.02, 0), "clash"),
        (shapes.box((40, 4, 50)), translation(0, -1.5 - 0.008, 0), "contact"),
        (shapes.box((40, 4, 50)), translation(0, -1.5 + 0.3, 0), "clearance"),
    ],
)
def test_verdicts(b, T, verdict):
    scene, result = pair(BLOCK, b, T, clearance=0.5)
    assert result.verdict("a", "b").value == verdict
    assert result.verdict("b", "a").value == verdict
    measured_alike(scene, result)


def test_bolt_in_hole_and_tube_on_pin_are_measured_across_the_gap():
    plate = shapes.box((40, 30, 8), holes=[shapes.Hole(5.5, (4.0, 3.0))])
    _, result = pair(plate, shapes.cylinder(5.0, 35.0), translation(4.2, 3.0, 6.0), clearance=1.0)
    assert result.pairs[0].distance.value == pytest.approx(0.3, abs=1e-6)
    assert result.pairs[0].distance.method == "groove kernel"
    _, result = pair(shapes.cylinder(8, 20, bore=5.05), shapes.cylinder(5, 30), rotation([1, 0, 0], 0.002), clearance=1)
    # A pin that leans by t in a bore of length L: R - (L / 2 tan t + r / cos t).
    assert result.pairs[0].distance.value == pytest.approx(
        5.05 - (10 * math.tan(0.002) + 5 / math.cos(0.002)), abs=1e-6
    )


def test_crossed_cylinders_of_equal_radius():
    # FCL's own depth is wrong by decimal powers here (GST_INDEP); the closed form is not.
    for r, depth, angle in ((7.0, 0.001, 30.0), (5.0, 0.1, 90.0), (7.0, 0.02, 90.0)):
        T = translation(0, 2 * r - depth, 0) @ rotation([0, 1, 0], math.radians(angle))
        _, result = pair(shapes.cylinder(r, 60), shapes.cylinder(r, 60), T)
        assert result.pairs[0].distance.value == pytest.approx(-depth, abs=1e-7)
        assert result.pairs[0].verdict is (Verdict.CONTACT if depth < 0.01 else Verdict.CLASH)


def test_boxes_half_a_millimetre_deep_have_that_depth():
    # Two triangle meshes 100 wide: FCL reports 99.7.
    _, result = pair(shapes.box((100, 100, 20)), shapes.box((100, 100, 20)), translation(0, 0, 19.5))
    row = result.pairs[0]
    assert row.verdict is Verdict.CLASH
    assert row.distance.lower - 1e-9 <= -0.5 <= row.distance.upper + 1e-9


_ANGLE = st.floats(0.0, 2.0 * math.pi)
_SHAPES = st.sampled_from(
    [
        BLOCK,
        shapes.groove_block(SweptArc(6.0, math.radians(110.0), 40.0), 40.0, 30.0),
        shapes.cylinder(5.0, 40.0),
        shapes.cylinder(8.0, 12.0, bore=4.0),
        shapes.box((30.0, 12.0, 18.0)),
        shapes.box((30.0, 25.0, 6.0), holes=[shapes.Hole(4.0, (3.0, 2.0))]),
        shapes.groove_block(
            SweptArc(7.0, 1.0, 40.0), 60.0, 20.0, others=[(18.0, 5.0, 0.9)], holes=[shapes.Hole(2.0, (-15.0, 3.0), "y")]
        ),
    ]
)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    a=_SHAPES,
    b=_SHAPES,
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    angle=st.one_of(_ANGLE, st.sampled_from([0.0, math.pi / 2, math.pi])),
    at=st.tuples(*[st.floats(-30, 30)] * 3),
    full=st.sampled_from([False, False, False, True]),  # it takes ten times as long
)
def test_any_pair_against_the_definitions_of_the_shapes(a, b, axis, angle, at, full):
    T = rotation(axis, angle)
    T[:3, 3] = at
    scene = Scene(clearance=1.0).add("a", a).add("b", b, T)
    result = check(scene)
    rows = measured_alike(scene, result).pairs if full else result.pairs
    truth = separation(a, b, T)
    for row in rows:
        assert row.distance.lower <= truth.upper + 1e-6
        assert truth.lower <= max(row.distance.upper, 0.0) + 1e-6
    verdict = result.verdict("a", "b")
    if common(a, b, T).upper < -0.02:
        assert verdict in (Verdict.DUPLICATE, Verdict.CLASH, Verdict.CONTAINED, Verdict.UNCERTAIN)
    if verdict is Verdict.CLEAR:
        assert truth.upper >= 1.0 - 1e-6
    if verdict is Verdict.CLEARANCE:
        assert truth.lower <= 1.0


def test_a_rigid_motion_of_both_changes_nothing():
    rng = np.random.default_rng(3)
    for _ in range(20):
        T = rotation(rng.normal(size=3), rng.uniform(0, 6))
        T[:3, 3] = rng.normal(size=3) * 12.0
        world = rotation(rng.normal(size=3), rng.uniform(0, 6))
        world[:3, 3] = rng.normal(size=3) * 1000.0
        here = check(Scene(clearance=1.0).add("a", BLOCK).add("b", WIRE, T))
        there = check(Scene(clearance=1.0).add("a", BLOCK, world).add("b", WIRE, world @ T))
        assert here.verdict("a", "b") is there.verdict("a", "b")


def test_witnesses_attest_the_distance():
    _, result = pair(BLOCK, WIRE, translation(0.3, 2.0, 4.0), clearance=5.0)
    row = result.pairs[0]
    assert np.linalg.norm(row.distance.point_b - row.distance.point_a) == pytest.approx(row.distance.upper, abs=1e-6)
    assert np.hypot(*row.distance.point_a[:2]) == pytest.approx(7.0, abs=1e-9)


def test_thresholds():
    t = Thresholds(contact=0.01, clearance=1.0)
    cases = {-0.02: "clash", -0.01: "contact", 0.01: "contact", 0.02: "clearance", 1.0: "clear", 2.0: "clear"}
    assert {d: t.verdict(Distance(d, d)).value for d in cases} == cases
    assert t.verdict(Distance(-0.02, 0.0)) is Verdict.UNCERTAIN
    assert t.verdict(Distance(1.0 - 1e-9, 1.0 + 1e-9)) is Verdict.CLEAR
    assert t.verdict(Distance(-math.inf, -0.02)) is Verdict.CLASH


@pytest.mark.parametrize(("distances", "shift"), [(False, 0.0), (False, 1e-9), (True, 1e-9)])
@pytest.mark.parametrize(
    "make",
    [
        lambda: shapes.box((50.0, 40.0, 30.0)),
        lambda: shapes.cylinder(10.0, 40.0),
        lambda: shapes.cylinder(12.0, 40.0, bore=8.0),
        lambda: shapes.groove_block(SweptArc(12.0, 1.2, 50.0), 60.0, 30.0),
    ],
)
def test_a_part_that_is_there_twice_clashes(make, shift, distances):
    # The surfaces coincide, so no point of either lies deep in the other: only what is between them does.
    T = rotation([1, 2, 3], 0.7) @ translation(5.0, 6.0, 7.0)
    scene = Scene().add("a", make(), T).add("b", make(), T @ translation(shift, 0.0, 0.0))
    (row,) = check(scene, distances=distances).pairs
    assert row.verdict is Verdict.DUPLICATE
