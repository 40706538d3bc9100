"""Table 2, row by row, against polygons of another library and random positions."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point
from shapely.geometry import Polygon

from clamp3d.kernel.rectangle import HoleRelation, Rectangle, hole_bolt
from tests.refusals import refusals

BOLT = Rectangle(0.0, 0.0, 10.0, 80.0)
W, H, TOL = 11.0, 15.0, 1e-9


def tilt_that_fits(half_width: float) -> float:
    """Tilt at which a hole of half height H grips a bolt of half width 10: W cos t - H sin t = 10."""
    return math.acos(10.0 / math.hypot(half_width, H)) - math.atan2(H, half_width)


def row(hole: Rectangle, bolt: Rectangle = BOLT) -> HoleRelation:
    return hole_bolt(hole, bolt, tolerance=TOL).relation


def test_table_2() -> None:
    grip = tilt_that_fits(W)
    t = grip / 2
    reach = W * math.cos(t) - H * math.sin(t) - 10.0  # what is left on either side at half that tilt
    assert row(Rectangle(0.0, 0.0, W, H)) is HoleRelation.NONE
    assert row(Rectangle(0.0, 0.0, W, H, t)) is HoleRelation.NONE
    for side in (-1, 1):
        for turn in (-t, t):
            assert row(Rectangle(side * reach, 0.0, W, H, turn)) is HoleRelation.ONE_POINT
            assert row(Rectangle(side * (reach + 1e-6), 0.0, W, H, turn)) is HoleRelation.OVERLAP
        assert row(Rectangle(side * 1.0, 0.0, W, H)) is HoleRelation.TWO_POINTS_ONE_SIDE
        assert row(Rectangle(0.0, 0.0, W, H, side * grip)) is HoleRelation.TWO_POINTS_TWO_SIDES
        assert row(Rectangle(0.0, 0.0, W, H, side * (grip + 1e-6))) is HoleRelation.OVERLAP


def test_points_of_the_grip() -> None:
    """Turned counter-clockwise as seen, the hole's upper right and lower left corners come in: y is down."""
    grip = tilt_that_fits(W)
    hole = Rectangle(0.0, 0.0, W, H, grip)
    contact = hole_bolt(hole, BOLT, tolerance=TOL)
    assert contact.gap_left == pytest.approx(0.0, abs=1e-14)
    assert contact.gap_right == pytest.approx(0.0, abs=1e-14)
    (left_x, left_y), (right_x, right_y) = contact.points
    assert (left_x, right_x) == (pytest.approx(-10.0), pytest.approx(10.0))
    assert left_y > 0.0 > right_y


def test_bolt_that_ends_in_the_hole_meets_its_wall() -> None:
    """A short bolt's own corners count: its lower right corner touches the wall of the leaning hole."""
    t = math.radians(10.0)
    bolt = Rectangle(0.0, -10.0, 5.0, 10.0)  # lower end at y = 0, the middle of the hole
    wall = W / math.cos(t)  # where the right wall crosses y = 0
    contact = hole_bolt(Rectangle(5.0 - wall, 0.0, W, H, -t), bolt, tolerance=TOL)
    assert contact.relation is HoleRelation.ONE_POINT
    assert contact.points == (pytest.approx((5.0, 0.0), abs=1e-12),)


def test_bolt_that_is_not_in_the_hole() -> None:
    contact = hole_bolt(Rectangle(0.0, 0.0, W, H), Rectangle(0.0, -100.0, 10.0, 20.0), tolerance=TOL)
    assert (contact.relation, contact.gap_left, contact.gap_right) == (HoleRelation.NONE, math.inf, math.inf)


def test_gaps_up_to_the_tolerance_are_contact() -> None:
    for tolerance, relation in ((1.0, HoleRelation.TWO_POINTS_TWO_SIDES), (1.0 - 1e-12, HoleRelation.NONE)):
        assert hole_bolt(Rectangle(0.0, 0.0, W, H), BOLT, tolerance=tolerance).relation is relation


def test_small_differences_survive_a_large_offset() -> None:
    """Both moved by 1e6 mm (the offset itself is exact in float64): the gap keeps every digit that the position has."""
    far = 2.0**20
    contact = hole_bolt(Rectangle(far + 1.0 + 2.0**-30, far, W, H), Rectangle(far, far, 10.0, 80.0), tolerance=TOL)
    assert contact.gap_left == -(2.0**-30)


test_bad_rectangles_and_tolerances = refusals(
    (lambda: Rectangle(0.0, 0.0, -1.0, 1.0), "half_width must be a finite length > 0 mm, got -1"),
    (lambda: Rectangle(math.nan, 0.0, 1.0, 1.0), "x must be a finite number"),
    (lambda: hole_bolt(Rectangle(0.0, 0.0, W, H, math.pi / 2), BOLT, tolerance=TOL), "less than 90 deg"),
    (lambda: hole_bolt(Rectangle(0.0, 0.0, W, H), BOLT, tolerance=-1.0), "tolerance"),
    (lambda: hole_bolt(Rectangle(0.0, 0.0, W, H), BOLT, tolerance=math.nan), "tolerance"),
)


def corners(r: Rectangle) -> list[tuple[float, float]]:
    return [r.point(u * r.half_width, v * r.half_height) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


HEIGHTS = {
    "bolt passes through": (15.0, 60.0),
    "bolt ends inside": (60.0, 15.0),
    "bolt ends at a corner": (30.0, 30.0),
}


@settings(max_examples=150, deadline=None)
@given(
    x=st.floats(-8.0, 8.0),
    y=st.floats(-12.0, 12.0),
    w=st.floats(4.0, 12.0),
    turn=st.floats(-0.6, 0.6),
    lean=st.floats(-3.0, 3.0),
    b=st.floats(3.0, 10.0),
    ends=st.sampled_from([*HEIGHTS]),
)
def test_gaps_against_polygons(x: float, y: float, w: float, turn: float, lean: float, b: float, ends: str) -> None:
    """Drawn back from the wall by its own gap and 1 mm, the bolt stands 1 mm from it: depth and distance alike."""
    hole_height, bolt_height = HEIGHTS[ends]
    bolt = Rectangle(1.0, -2.0, b, bolt_height, lean)
    hole = Rectangle(*bolt.point(x, y), w, hole_height, lean + turn)
    got = hole_bolt(hole, bolt, tolerance=TOL)
    assert (got.relation is HoleRelation.OVERLAP) == (min(got.gap_left, got.gap_right) < -TOL)
    # The direction in which each gap is taken: across the bolt, or square to the wall.
    across = bolt.angle if ends == "bolt passes through" else hole.angle
    for side, gap in ((-1, got.gap_left), (1, got.gap_right)):
        back = -side * (1.0 - gap)
        moved = replace(bolt, x=bolt.x + back * math.cos(across), y=bolt.y - back * math.sin(across))
        wall = LineString([hole.point(side * w, v) for v in (-hole_height, hole_height)])
        assert ends == "bolt ends at a corner" or abs(wall.distance(Polygon(corners(moved))) - 1.0) < 1e-9
    # Witness contract: unit normal, point on the hole's wall, point + gap * normal on the bolt's outline.
    gap = min(got.gap_left, got.gap_right)
    assert math.hypot(*got.normal) == pytest.approx(1.0)
    p = corners(hole)
    walls = [LineString([p[0], p[3]]), LineString([p[1], p[2]])]
    on_bolt = got.point[0] + gap * got.normal[0], got.point[1] + gap * got.normal[1]
    assert min(wall.distance(Point(got.point)) for wall in walls) < 1e-9
    assert Polygon(corners(bolt)).exterior.distance(Point(on_bolt)) < 1e-9
