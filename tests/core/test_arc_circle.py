"""Table 3, cell by cell, against constructions in 50 digits and against brute force over a dense arc."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import Point, Polygon

from clamp3d.core.arc_circle import ArcFeature, ArcRelation, arc_circle, classify_arc_circle
from clamp3d.errors import InputError

R, TOL = 7.0, 1e-9
MINOR, MAJOR = math.radians(60), math.radians(130)

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
        for turn, relation in (
            (share * mpmath.pi / 2, ArcRelation.EXTERIOR_CONTACT),
            ((1 + share) * mpmath.pi / 2, ArcRelation.INTERIOR_CONTACT),
        ):
            x, y = (float(m[i] + r * (mpmath.cos(turn) * out[i] + mpmath.sin(turn) * off[i])) for i in (0, 1))
            contact = arc_circle(R, math.radians(half_deg), r, x, y, tolerance=TOL)
            assert contact.relation is relation
            assert contact.feature.value == end
            assert abs(contact.gap) < 1e-14
            assert contact.points == (pytest.approx((float(m[0]), float(m[1])), abs=1e-14),)


def test_point_r_of_fig_6_is_exterior() -> None:
    m_x, m_y = -R * math.sin(MINOR), -R * math.cos(MINOR)
    x, y = m_x - 2 * math.cos(MINOR), m_y + 2 * math.sin(MINOR)
    assert arc_circle(R, MINOR, 2.0, x, y, tolerance=TOL).relation is ArcRelation.EXTERIOR_CONTACT


def test_thick_circle_rests_on_both_ends() -> None:
    """Not a small circle: it cannot enter, and it touches M and N at once, from inside."""
    r = 9.0
    y = -R * math.cos(MINOR) + math.sqrt(r**2 - (R * math.sin(MINOR)) ** 2)
    contact = arc_circle(R, MINOR, r, 0.0, y, tolerance=TOL)
    assert contact.relation is ArcRelation.INTERIOR_CONTACT
    assert contact.feature is ArcFeature.BOTH_ENDS
    assert len(contact.points) == 2
    assert contact.points[0][0] == -contact.points[1][0]


def test_a_larger_circle_around_the_arc_intersects_it() -> None:
    """|r_o - r_MN| of Eq. 7 holds here, and the disk covers the whole arc."""
    assert arc_circle(R, MINOR, 9.0, 0.0, 2.0, tolerance=TOL).relation is ArcRelation.INTERSECT


def test_equal_radii_and_coaxial_is_interior_contact() -> None:
    contact = arc_circle(R, MAJOR, R, 0.0, 0.0, tolerance=0.0)
    assert (contact.relation, contact.gap) == (ArcRelation.INTERIOR_CONTACT, 0.0)
    assert contact.points == ((0.0, -R),)


@pytest.mark.parametrize(("offset", "gap"), [(0.05, 0.015), (0.065, 0.0), (0.0650001, -1e-7)])
@pytest.mark.parametrize("turn_deg", [0, 37, -59])
def test_tangency_near_equal_radii(offset: float, gap: float, turn_deg: float) -> None:
    x, y = offset * math.sin(math.radians(turn_deg)), -offset * math.cos(math.radians(turn_deg))
    assert arc_circle(R, MINOR, 6.935, x, y, tolerance=1e-10).gap == pytest.approx(gap, abs=2e-15)


def test_mouth_narrower_than_the_wire() -> None:
    """Wire 13.87 in a hollow of 14 with a mouth of 13.787: free in the middle, stopped in the mouth."""
    half = math.radians(100)
    inside = arc_circle(R, half, 6.935, 0.0, 0.0, tolerance=TOL)
    assert (inside.relation, inside.gap) == (ArcRelation.INSIDE, pytest.approx(0.065, abs=1e-15))
    mouth = arc_circle(R, half, 6.935, 0.0, -R * math.cos(half), tolerance=TOL)
    assert mouth.relation is ArcRelation.INTERSECT
    assert mouth.gap == pytest.approx(R * math.sin(half) - 6.935, abs=1e-14)


@pytest.mark.parametrize("half_deg", [1e-6, 1.0, 90.0, 179.999])
def test_span_has_no_seam(half_deg: float) -> None:
    """The gap is 1-Lipschitz in the centre: no jump at +-180 degrees, at M, at N or on the axis."""
    half = math.radians(half_deg)
    for radius in (1e-9, 3.0, 7.0, 12.0):
        turns = np.linspace(-math.pi, math.pi, 2001)
        gaps = [arc_circle(R, half, 2.0, radius * math.sin(t), -radius * math.cos(t), tolerance=0).gap for t in turns]
        step = radius * (turns[1] - turns[0])
        assert np.abs(np.diff(gaps)).max() <= step + 1e-13
        assert gaps[0] == pytest.approx(gaps[-1], abs=1e-13)


def test_tolerance_below_rounding_is_raised_to_it() -> None:
    contact = arc_circle(0.3, MINOR, 0.1, 0.0, -0.2, tolerance=0.0)  # 0.3 - 0.1 - 0.2 is not 0 in float64
    assert contact.gap != 0.0
    assert contact.relation is ArcRelation.INTERIOR_CONTACT
    assert 0.0 < contact.tolerance < 1e-14


def test_tolerance_decides() -> None:
    for gap, tolerance, relation in (
        (1e-4, 1e-3, ArcRelation.INTERIOR_CONTACT),
        (1e-4, 1e-5, ArcRelation.INSIDE),
        (-1e-4, 1e-3, ArcRelation.INTERIOR_CONTACT),
        (-1e-4, 1e-5, ArcRelation.INTERSECT),
    ):
        assert arc_circle(R, MINOR, 2.0, 0.0, -5.0 + gap, tolerance=tolerance).relation is relation
        assert classify_arc_circle(gap, R, MINOR, 2.0, 0.0, -5.0, tolerance=tolerance) is relation


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ((-1.0, 1.0, 1.0, 0.0, 0.0, 1e-9), "arc_radius"),
        ((7.0, math.pi, 1.0, 0.0, 0.0, 1e-9), "half_angle"),
        ((7.0, 1.0, math.nan, 0.0, 0.0, 1e-9), "circle_radius"),
        ((7.0, 1.0, 1.0, math.inf, 0.0, 1e-9), "centre"),
        ((7.0, 1.0, 1.0, 0.0, 0.0, 2.0), "tolerance"),
        ((7.0, 1.0, 1.0, 0.0, 0.0, math.nan), "tolerance"),
    ],
)
def test_bad_values_are_named(values: tuple[float, ...], name: str) -> None:
    with pytest.raises(InputError, match=name):
        arc_circle(*values[:5], tolerance=values[5])


ANY = st.floats(-15.0, 15.0)


@settings(max_examples=300, deadline=None)
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


@settings(max_examples=200, deadline=None)
@given(half=st.floats(0.05, 3.1), r=st.floats(0.5, 6.9), share=st.floats(-1.0, 1.0), exterior=st.booleans())
def test_contact_along_the_arc(half: float, r: float, share: float, exterior: bool) -> None:
    """Centres set at R + r and R - r in 50 digits (Eq. 7)."""
    with mpmath.workdps(50):
        t, d = mpmath.mpf(half) * share, mpmath.mpf(R) + (r if exterior else -r)
        x, y = float(d * mpmath.sin(t)), float(-d * mpmath.cos(t))
        p = float(R * mpmath.sin(t)), float(-R * mpmath.cos(t))
    got = arc_circle(R, half, r, x, y, tolerance=1e-9)
    # On an arc over 180 degrees that runs back on itself, an exterior circle may reach the arc's other end too.
    assume(exterior is False or half + math.asin(r / (R + r)) < math.pi or abs(share) < 0.5)
    assert abs(got.gap) < 1e-14
    assert got.relation is (ArcRelation.EXTERIOR_CONTACT if exterior else ArcRelation.INTERIOR_CONTACT)
    assert got.points[0] == pytest.approx(p, abs=1e-7 if abs(share) == 1.0 else 1e-13 * R / (R - r))


@pytest.mark.parametrize(("side", "feature"), [(-1.0, ArcFeature.M), (1.0, ArcFeature.N)])
@pytest.mark.parametrize("half", [0.4, 1.0, 2.6])
def test_a_contact_within_the_tolerance_of_an_end_is_at_the_end(half: float, side: float, feature: ArcFeature) -> None:
    angle = side * (half - 1e-5)  # 1e-4 mm from the end of an arc of radius 10
    x, y = 7.0 * math.sin(angle), -7.0 * math.cos(angle)
    for tolerance, wanted in ((2e-4, feature), (5e-5, ArcFeature.ARC)):
        assert arc_circle(10.0, half, 3.0, x, y, tolerance=tolerance).feature is wanted
