"""Table 3, cell by cell, against constructions in 50 digits and against brute force over a dense arc."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import Point, Polygon

from clamp3d.kernel.arc_and_circle import ArcFeature, ArcRelation, arc_circle, classify_arc_circle
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
