"""One pair of parts at a time, against closed forms and the definitions of the shapes."""

import math

import numpy as np
import pytest

from clamp3d.engine.answer import Distance
from clamp3d.engine.check import check
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Thresholds, Verdict
from clamp3d.geometry import shapes
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.primitives import SweptArc
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
