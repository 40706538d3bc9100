"""Tables 2 and 3, row by row, against constructions in 50 digits, polygons of another library and random positions."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from clamp3d.errors import InputError
from clamp3d.kernel import Capsule, Cylinder, SweptArc, rotation, translation
from clamp3d.kernel.arc_and_circle import ArcFeature, ArcRelation, arc_circle, classify_arc_circle
from clamp3d.kernel.rectangle import HoleRelation, Rectangle, hole_bolt
from clamp3d.kernel.relation import Relation3D, groove_relation
from tests.refusals import refusals

R, TOL = 7.0, 1e-9
MINOR, MAJOR = math.radians(60), math.radians(130)
S60, C60 = math.sin(MINOR), math.cos(MINOR)

# Table 3: (half angle, r, x, y) -> relation; first the minor, then the major arc.
TABLE_3 = [
    (MINOR, 2.0, 0.0, -4.5, ArcRelation.INSIDE),
    (MINOR, 2.0, 1.0, -3.0, ArcRelation.INSIDE),  # reaches out through the chord
    (MINOR, 2.0, 0.0, -1.0, ArcRelation.OUTSIDE),  # in the disk, beyond the chord
    (MINOR, 2.0, 0.0, -9.5, ArcRelation.OUTSIDE),
    (MINOR, 2.0, 0.0, -8.0, ArcRelation.INTERSECT),
    (MINOR, 2.0, -6.0, -3.5, ArcRelation.INTERSECT),  # M inside the disk
    (MINOR, 2.0, 0.0, -9.0, ArcRelation.EXTERIOR_CONTACT),
    (MINOR, 2.0, 0.0, -5.0, ArcRelation.INTERIOR_CONTACT),
    (MAJOR, 2.0, 0.0, 3.0, ArcRelation.INSIDE),
    (MAJOR, 2.0, 0.0, 5.5, ArcRelation.INSIDE),  # on its way through the mouth
    (MAJOR, 2.0, 0.0, 7.0, ArcRelation.OUTSIDE),
    (MAJOR, 2.0, -9.5, 0.0, ArcRelation.OUTSIDE),
    (MAJOR, 2.0, 6.0, 0.0, ArcRelation.INTERSECT),
    (MAJOR, 2.0, 9.0, 0.0, ArcRelation.EXTERIOR_CONTACT),
    (MAJOR, 2.0, 4.0, 3.0, ArcRelation.INTERIOR_CONTACT),
    (MAJOR, 7.0, 0.0, 0.0, ArcRelation.INTERIOR_CONTACT),  # the arc's own circle
    (MINOR, 9.0, 0.0, 2.0, ArcRelation.INTERSECT),  # |r_o - r_MN| of Eq. 7 holds, and the disk covers the whole arc
    (math.radians(100), 6.935, 0.0, 0.0, ArcRelation.INSIDE),  # free in the middle, stopped in the narrower mouth
    (math.radians(100), 6.935, 0.0, -R * math.cos(math.radians(100)), ArcRelation.INTERSECT),
    # The point R of Fig. 6, which belongs to both of its arcs.
    (MINOR, 2.0, -R * S60 - 2.0 * C60, -R * C60 + 2.0 * S60, ArcRelation.EXTERIOR_CONTACT),
    # Too thick to enter: it touches M and N at once, from inside.
    (MINOR, 9.0, 0.0, -R * C60 + math.sqrt(81.0 - (R * S60) ** 2), ArcRelation.INTERIOR_CONTACT),
]


@pytest.mark.parametrize(("half", "r", "x", "y", "relation"), TABLE_3)
def test_table_3(half: float, r: float, x: float, y: float, relation: ArcRelation) -> None:
    assert arc_circle(R, half, r, x, y, tolerance=TOL).relation is relation
    assert arc_circle(R, half, r, -x, y, tolerance=TOL).relation is relation


@pytest.mark.parametrize("half_deg", [20, 60, 90, 100, 130, 175])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
@pytest.mark.parametrize("end", ["M", "N"])
def test_end_points_by_fig_6(half_deg: int, share: float, end: str) -> None:
    """Centres on the arcs PR and RQ about M, built in 50 digits, on the side of M where the arc is not."""
    r = 0.5 if half_deg > 170 else 2.0  # as wide as the mouth lets it, so that the other end stays clear
    side = -1 if end == "M" else 1
    with mpmath.workdps(50):
        a = mpmath.radians(half_deg)
        m = (side * R * mpmath.sin(a), -R * mpmath.cos(a))
        out = (side * mpmath.sin(a), -mpmath.cos(a))  # from O through M: towards P
        off = (side * mpmath.cos(a), mpmath.sin(a))  # MR: on along the circle, away from the arc
        for quarter, relation in ((share, ArcRelation.EXTERIOR_CONTACT), (1 + share, ArcRelation.INTERIOR_CONTACT)):
            turn = quarter * mpmath.pi / 2
            x, y = (float(m[i] + r * (mpmath.cos(turn) * out[i] + mpmath.sin(turn) * off[i])) for i in (0, 1))
            contact = arc_circle(R, math.radians(half_deg), r, x, y, tolerance=TOL)
            assert contact.relation is relation
            assert contact.feature.value == end
            assert abs(contact.gap) < 1e-14
            assert contact.points == (pytest.approx((float(m[0]), float(m[1])), abs=1e-14),)


def test_tolerance_decides() -> None:
    for gap, relation in ((1e-4, ArcRelation.INSIDE), (-1e-4, ArcRelation.INTERSECT)):
        for tolerance, wanted in ((1e-3, ArcRelation.INTERIOR_CONTACT), (1e-5, relation)):
            assert arc_circle(R, MINOR, 2.0, 0.0, -5.0 + gap, tolerance=tolerance).relation is wanted
            assert classify_arc_circle(gap, R, MINOR, 2.0, 0.0, -5.0, tolerance=tolerance) is wanted
    contact = arc_circle(0.3, MINOR, 0.1, 0.0, -0.2, tolerance=0.0)  # 0.3 - 0.1 - 0.2 is not 0 in float64
    assert contact.relation is ArcRelation.INTERIOR_CONTACT
    assert contact.gap != 0.0 < contact.tolerance < 1e-14


def test_a_contact_at_both_ends_has_both_points():
    contact = arc_circle(R, MINOR, 9.0, 0.0, -R * C60 + math.sqrt(81.0 - (R * S60) ** 2), tolerance=TOL)
    assert contact.feature is ArcFeature.BOTH_ENDS
    assert np.ravel(contact.points) == pytest.approx([-R * S60, -R * C60, R * S60, -R * C60])


test_bad_values_are_named = refusals(
    (lambda: arc_circle(-1.0, 1.0, 1.0, 0.0, 0.0, tolerance=1e-9), "arc_radius"),
    (lambda: arc_circle(7.0, math.pi, 1.0, 0.0, 0.0, tolerance=1e-9), "half_angle"),
    (lambda: arc_circle(7.0, 1.0, math.nan, 0.0, 0.0, tolerance=1e-9), "circle_radius"),
    (lambda: arc_circle(7.0, 1.0, 1.0, math.inf, 0.0, tolerance=1e-9), "centre"),
    (lambda: arc_circle(7.0, 1.0, 1.0, 0.0, 0.0, tolerance=2.0), "tolerance"),
    (lambda: arc_circle(7.0, 1.0, 1.0, 0.0, 0.0, tolerance=math.nan), "tolerance"),
)


ANY = st.floats(-15.0, 15.0)


@settings(max_examples=150, deadline=None)
@given(half=st.floats(0.01, 3.13), r=st.floats(0.05, 12.0), x=ANY, y=ANY)
def test_against_a_dense_arc(half: float, r: float, x: float, y: float) -> None:
    """Distance over 20001 points of the arc; relation of the disk and the region as polygons."""
    t = np.linspace(-half, half, 20001)
    arc = np.column_stack((R * np.sin(t), -R * np.cos(t)))
    got = arc_circle(R, half, r, x, y, tolerance=1e-9)
    brute = float(np.hypot(arc[:, 0] - x, arc[:, 1] - y).min()) - r
    assert got.gap <= brute + 1e-12
    assert got.gap == pytest.approx(brute, abs=R * half / 20000 + 1e-12)
    for px, py in got.points:
        assert math.hypot(px, py) == pytest.approx(R, abs=1e-13)
        assert abs(math.atan2(px, -py)) <= half + 1e-12
        assert math.hypot(px - x, py - y) - r == pytest.approx(got.gap, abs=1e-9)

    assume(abs(got.gap) > 1e-3)
    to_region = Polygon(arc).distance(Point(x, y))
    assume(abs(to_region - r) > 1e-3)
    expected = ArcRelation.INTERSECT if got.gap < 0 else ArcRelation.INSIDE if to_region < r else ArcRelation.OUTSIDE
    assert got.relation is expected


@pytest.mark.parametrize(("side", "feature"), [(-1.0, ArcFeature.M), (1.0, ArcFeature.N)])
@pytest.mark.parametrize("half", [0.4, 1.0, 2.6])
def test_a_contact_within_the_tolerance_of_an_end_is_at_the_end(half: float, side: float, feature: ArcFeature) -> None:
    angle = side * (half - 1e-5)  # 1e-4 mm from the end of an arc of radius 10
    x, y = 7.0 * math.sin(angle), -7.0 * math.cos(angle)
    for tolerance, wanted in ((2e-4, feature), (5e-5, ArcFeature.ARC)):
        assert arc_circle(10.0, half, 3.0, x, y, tolerance=tolerance).feature is wanted


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
@example(x=0.0, y=2.0, w=12.0, turn=0.25, lean=0.0, b=3.0, ends="bolt ends at a corner")  # beyond the wall's end
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


GROOVE, WIDE = SweptArc(7.0, math.radians(60.0), 50.0), SweptArc(7.0, math.radians(120.0), 50.0)
LIP_X, LIP_Y = 7.0 * math.sin(GROOVE.half_angle), -7.0 * math.cos(GROOVE.half_angle)
TILT = rotation((1, 0, 0), 0.01)


def at_lip(angle):
    """Where a wire of radius 3 touches the lip N of the major arc, ``angle`` off the face's normal."""
    return translation(LIP_X - 3.0 * math.sin(angle), 3.5 + 3.0 * math.cos(angle), 0.0)


@pytest.mark.parametrize(
    ("groove", "radius", "T", "wanted"),
    [
        (GROOVE, 3.0, translation(0.0, -2.0, 0.0), "inside"),
        (GROOVE, 3.0, translation(0.0, -2.0, 0.0) @ TILT, "inside"),
        (GROOVE, 3.0, translation(0.0, 0.0, 0.0), "outside"),
        (GROOVE, 3.0, translation(0.0, -2.0, 70.0), "outside"),
        (GROOVE, 3.0, translation(0.0, -4.0, 0.0), "interior contact"),
        (GROOVE, 3.0, translation(0.0, -4.1, 0.0), "intersect"),
        (GROOVE, 3.0, translation(0.0, -5.0, 0.0) @ TILT, "intersect"),
        (GROOVE, 3.0, translation(LIP_X + 5.0, LIP_Y + 3.0, 0.0), "exterior contact"),
        (GROOVE, 3.0, translation(LIP_X - 3.0 * math.sin(1.0), LIP_Y + 3.0 * math.cos(1.0), 0.0), "interior contact"),
        (GROOVE, 3.0, translation(0.0, -12.0, 68.0), "exterior contact"),
        (GROOVE, 9.0, translation(0.0, LIP_Y + math.sqrt(81.0 - LIP_X * LIP_X), 0.0), "interior contact"),
        (GROOVE, 3.0, translation(0.0, LIP_Y + 2.9, 0.0), "inside"),
        (GROOVE, 3.0, translation(0.0, LIP_Y + 3.1, 0.0), "outside"),
        (GROOVE, 0.5, translation(0.0, -3.0, 0.0) @ rotation((0, 1, 0), math.pi / 2), "outside"),
        # Fig. 6: exterior if the centre is beyond the perpendicular to OM at M, here 30 deg off the face's normal.
        (WIDE, 3.0, at_lip(0.2), "exterior contact"),
        (WIDE, 3.0, at_lip(math.radians(29.9)), "exterior contact"),
        (WIDE, 3.0, at_lip(0.6), "interior contact"),
    ],
)
def test_table_3_in_any_pose(groove, radius, T, wanted):
    length = 4.0 if wanted == "outside" and radius == 0.5 else 80.0
    assert groove_relation(groove, Capsule(radius, length), T, tolerance=1e-9).relation.value == wanted


@settings(max_examples=150, deadline=None)
@given(st.floats(0.2, 2.9), st.floats(0.5, 11.9), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_parallel_wire_agrees_with_the_plane_relation(half, r, x, y):
    # Only outside the material: the arc of the plane relation is a curve, without material behind it.
    groove, wire = SweptArc(12.0, half, 50.0), Capsule(r, 80.0)
    answer = groove_relation(groove, wire, translation(x, y, 0.0), tolerance=1e-9)
    plane = arc_circle(12.0, half, r, x, y, tolerance=1e-9)
    if answer.contact.feature.name not in ("ARC", "LIP_M", "LIP_N") or answer.contact.axis_inside:
        return
    assert abs(answer.contact.distance - plane.gap) < 1e-12
    is_above = y >= 0.0 > -12 * math.cos(half)
    if plane.relation is ArcRelation.INSIDE or (plane.relation is ArcRelation.OUTSIDE and is_above):
        # a circle that covers the region of the chord only partly may reach under a flat face: then it intersects
        assert answer.relation.value == plane.relation.value


def test_uncertain_where_the_tolerance_is_below_the_error_bound():
    T = translation(0.0, -4.0, 0.0) @ rotation((0, 0, 1), 0.3)
    wire = Capsule(3.0, 80.0)
    assert groove_relation(GROOVE, wire, T, tolerance=0.0).relation is Relation3D.UNCERTAIN
    assert groove_relation(GROOVE, wire, T, tolerance=1e-13).relation is Relation3D.INTERIOR_CONTACT
    assert groove_relation(GROOVE, wire, translation(0, -2, 0), tolerance=0.0).relation is Relation3D.INSIDE
    for tolerance in (-1.0, 3.0, math.nan):
        with pytest.raises(InputError, match="tolerance must be >= 0 mm and less than both radii"):
            groove_relation(GROOVE, wire, T, tolerance=tolerance)


@pytest.mark.parametrize("kind", [Cylinder, Capsule])
def test_a_flat_ended_cylinder_is_inside_if_it_reaches_the_block(kind):
    """By turns to the nearest point of the block and of the wire, which leads to where they are nearest."""
    rng = np.random.default_rng(4)
    counts = {Relation3D.INSIDE: 0, Relation3D.OUTSIDE: 0}
    for _ in range(200):
        wire, T = kind(rng.uniform(0.5, 6.0), rng.uniform(0.5, 20.0)), rotation(rng.normal(size=3), rng.uniform(0, 3))
        T[:3, 3] = rng.uniform((-4.0, LIP_Y - 2.0, -33.0), (4.0, LIP_Y + 12.0, 33.0))
        relation = groove_relation(GROOVE, wire, T, tolerance=1e-9).relation
        if relation not in counts:
            continue
        p, r, half = T[:3, 3], wire.radius, 0.5 * wire.length
        for _ in range(200):
            q = np.array([p[0], min(p[1], LIP_Y), np.clip(p[2], -25.0, 25.0)])
            m = (q - T[:3, 3]) @ T[:3, :3]
            foot = np.array([0.0, 0.0, np.clip(m[2], -half, half)])
            out = m - foot if kind is Capsule else m * (1.0, 1.0, 0.0)
            p = T[:3, 3] + T[:3, :3] @ (foot + out * min(1.0, r / max(np.linalg.norm(out), 1e-300)))
        n, d = (p - q) * (0.0, 1.0, 1.0), T[:3, 2]  # the block has no end along x
        n /= max(np.linalg.norm(n), 1e-300)
        near = n @ T[:3, 3] - half * abs(n @ d) - r * (1.0 if kind is Capsule else np.linalg.norm(np.cross(n, d)))
        apart = near - n[1] * LIP_Y - abs(n[2]) * 25.0  # how far the plane square to n keeps them apart
        if apart > 1e-9 or np.linalg.norm(p - q) < 1e-9:
            counts[relation] += 1
            assert relation is (Relation3D.OUTSIDE if apart > 1e-9 else Relation3D.INSIDE)
    assert min(counts.values()) > 20
