"""Where parts overlap: the volume between its bounds against closed forms, the box, a point in both."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.engine.check import check
from clamp3d.engine.scene import Scene
from clamp3d.geometry import shapes
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import translation


def overlap(a, b, T_b):
    (row,) = check(Scene().add("a", a).add("b", b, T_b)).pairs
    return row.where


@settings(max_examples=15, deadline=None)
@given(x=st.floats(0.5, 5.0), y=st.floats(-2.0, 2.0))
def test_boxes_share_a_box(x, y):
    where = overlap(shapes.box((10, 10, 10)), shapes.box((10, 10, 10)), translation(10.0 - x, y, 0.0))
    low, high = where.volume
    assert low <= x * (10.0 - abs(y)) * 10.0 <= high
    assert high - low < 1e-6
    assert where.box == pytest.approx(np.array([[5 - x, max(-5, y - 5), -5], [5, min(5, y + 5), 5]]), abs=1e-8)
    assert not where.of_facets


@settings(max_examples=8, deadline=None)
@given(d=st.floats(0.2, 9.0))
def test_crossed_side_by_side_cylinders_share_a_lens(d):
    """Two parallel cylinders of radius 5, axes d apart: the lens of two circles times the length."""
    where = overlap(shapes.cylinder(5.0, 20.0), shapes.cylinder(5.0, 20.0), translation(d, 0.0, 0.0))
    lens = 2.0 * 25.0 * math.acos(d / 10.0) - 0.5 * d * math.sqrt(100.0 - d * d)
    low, high = where.volume
    assert low <= lens * 20.0 <= high
    half = math.sqrt(25.0 - 0.25 * d * d)
    assert (where.box[0] <= [d - 5.0, -half, -10.0]).all()
    assert (where.box[1] >= [5.0, half, 10.0]).all()
    assert high - low < 0.01 * lens * 20.0
    assert math.hypot(*where.point[:2]) <= 5.0
    assert math.hypot(where.point[0] - d, where.point[1]) <= 5.0


def test_a_motion_tells_where_it_is_deepest_and_a_clear_pair_nothing():
    box = shapes.box((10, 10, 10))
    scene = Scene().add("a", box).add("b", box, translation(0, 0, 20)).add("c", box, translation(40, 0, 0))
    result = check(Scene(parts=scene.parts, motions=(Motion.translate((0, 0, -12), parts=("b",), name="down"),)))
    (row,) = result.motions
    assert row.where.to_dict()["volume_at_least_mm3"] > 0.0
    assert row.where.box[:, 2].tolist() == pytest.approx([row.where.box[0, 2], 5.0])
    assert all(other.where is None for other in result.pairs)
