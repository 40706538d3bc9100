import math
from dataclasses import replace

import numpy as np
import pytest

from clamp3d import Motion, first_contact, min_clearance
from clamp3d.kernel import Capsule, Cylinder, Feature, SweptArc, rotation, signed_distances, translation
from tests.refusals import refusals

GROOVE, WIRE = SweptArc(12.0, math.radians(70.0), 50.0), Capsule(10.5, 80.0)
S, H = 12.0 * math.sin(GROOVE.half_angle), -12.0 * math.cos(GROOVE.half_angle)
DROP = Motion.translate((0.0, -40.0, 0.0))


def test_drop_into_the_groove():
    hit = first_contact(GROOVE, WIRE, DROP, translation(0.0, 20.0, 0.0))
    assert hit.touches
    assert hit.t == pytest.approx(21.5 / 40.0, abs=1e-15)
    assert hit.contact.feature is Feature.ARC
    early = first_contact(GROOVE, WIRE, DROP, translation(0.0, 20.0, 0.0), margin=0.25)
    assert early.t == pytest.approx(21.25 / 40.0, abs=1e-12)
    assert early.distance.value == pytest.approx(0.25, abs=1e-12)
    rest = first_contact(GROOVE, WIRE, Motion.translate((0.0, 0.0, 0.0)))
    assert (rest.touches, rest.distance.value) == (False, pytest.approx(1.5, abs=1e-12))
    start = first_contact(GROOVE, WIRE, Motion.translate((0.0, 30.0, 0.0)), translation(0.0, -3.0, 0.0))
    assert (start.touches, start.t) == (True, 0.0)


def test_swing_about_an_end_reaches_the_end_edge():
    # Turning about x through the middle: (R - L/2 tan t) cos t = r
    hit = first_contact(GROOVE, WIRE, Motion.screw((1, 0, 0), 0.5))
    t = hit.t * 0.5
    assert (12.0 - 25.0 * math.tan(t)) * math.cos(t) == pytest.approx(10.5, abs=1e-12)
    assert hit.contact.feature is Feature.END_ARC


def test_a_disc_that_tips_over_a_flat_face_meets_it_with_its_rim():
    """Its middle stands still: nothing but the tilt of its ends brings it nearer, between two times that are clear."""
    disc, half, high = Cylinder(8.0, 0.002), 0.001, 7.9
    start = translation(30.0, H + high, 0.0) @ rotation((0, 0, 1), -0.7) @ rotation((0, 1, 0), math.pi / 2)
    hit = first_contact(GROOVE, disc, Motion.screw((0, 0, 1), 2.0, point=start[:3, 3]), start)
    tilt = math.acos(high / math.hypot(8.0, half)) + math.atan(half / 8.0)
    assert hit.touches
    assert hit.t == pytest.approx((0.7 - tilt) / 2.0, abs=1e-9)


def test_sliding_near_a_surface_is_proven_quickly():
    slides = [
        (1e-4, translation(0.0, -1.5 + 1e-4, -100.0), (0.0, 0.0, 200.0)),  # through the groove
        (0.1, translation(0.0, -30.0, 65.0 + 10.5 + 0.1), (5.0, -60.0, 0.0)),  # in front of an end face
    ]
    for gap, start, way in slides:
        least = first_contact(GROOVE, WIRE, Motion.translate(way), start)
        assert not least.touches
        assert least.distance.value == pytest.approx(gap, abs=1e-6)
        assert least.distance.lower > 0.0
        assert least.evaluations < 30_000


@pytest.mark.parametrize("offset", [0.0, 1e-5, -1e-3])
def test_grazing_a_lip(offset):
    # The wire's centre passes the lip N on a line at 45 degrees, at the distance r + offset: a double root for 0.
    groove, wire = SweptArc(12.0, math.radians(70.0), 50.0), Capsule(2.0, 80.0)
    u, v = np.array([1.0, 1.0]) / math.sqrt(2.0), np.array([-1.0, 1.0]) / math.sqrt(2.0)
    lip = np.array([S, H])
    start = lip + (2.0 + offset) * v - 3.0 * u
    path, T = Motion.translate((*(7.0 * u), 0.0)), translation(*start, 0.0)
    hit = first_contact(groove, wire, path, T)
    assert hit.touches == (offset <= 0.0)
    wanted = 3.0 - math.sqrt(max(0.0, 4.0 - (2.0 + offset) ** 2))
    tolerance = 1e-10 if offset < 0.0 else 3e-3  # a double root is known to the square root of the accuracy
    assert hit.t * 7.0 == pytest.approx(wanted, abs=tolerance)
    assert hit.contact.feature is Feature.LIP_N
    least = min_clearance(groove, wire, path, T) if hit.touches else hit
    assert least.distance.value == pytest.approx(offset, abs=1e-6)


def test_thin_wire_through_a_thin_sheet_is_not_missed():
    # 1e-3 mm against 1e-3 mm on a path of 2 m: no sampling of practical density sees it.
    sheet, needle = SweptArc(10.0, 1.0, 1e-3), Capsule(1e-3, 1e-3)
    hit = first_contact(sheet, needle, Motion.translate((0.0, 0.0, 2000.0)), translation(30.0, -30.0, -1000.0))
    assert hit.touches
    assert hit.t * 2000.0 == pytest.approx(1000.0 - 0.5e-3 - 0.5e-3 - 1e-3, abs=1e-9)
    assert hit.contact.feature is Feature.END_FACE


@pytest.mark.parametrize("kind", [Capsule, Cylinder])
def test_the_first_of_several_contacts_is_found_not_the_deepest(kind):
    """On long ways round the groove, also such that carry the turn across its axis, which may be the groove's own."""
    rng = np.random.default_rng(0)
    samples, shallow = np.linspace(0.0, 1.0, 201), 0
    for k in range(100):
        groove, wire = SweptArc(12.0, rng.uniform(0.3, 2.8), 40.0), kind(*rng.uniform((0.3, 1.0), (3.0, 20.0)))
        T = rotation(rng.normal(size=3), rng.uniform(0.0, 3.0))
        T[:3, 3] = rng.normal(size=3) * 25.0
        axis, point = ((0.0, 0.0, 1.0), np.zeros(3)) if k % 2 else (rng.normal(size=3), rng.normal(size=3) * 10.0)
        screw = Motion.screw(axis, float(rng.normal() * 6.0), point=point)
        motion = replace(screw, travel=rng.normal(size=3) * 30.0)
        values = signed_distances(groove, wire, np.array([motion.at(s, T) for s in samples]))
        below = values < -1e-6
        if below[0] or not below.any():
            continue
        starts = np.flatnonzero(below[1:] & ~below[:-1])
        shallow += len(starts) > 1 and values[: starts[1]].min() > values.min()
        hit = first_contact(groove, wire, motion, T)
        assert hit.t <= samples[below.argmax()]
        assert abs(hit.distance.value) < 1e-6
        assert (values[samples < hit.t - 1e-9] > 0.0).all()
    assert shallow >= 5


test_bad_motions_are_named = refusals(
    (lambda: Motion.screw((0, 0, 0), 1.0), "axis must not be zero"),
    (lambda: Motion.translate((0, np.nan, 0)), "by must be finite, got nan"),
    (lambda: Motion.screw((0, 0, 1), math.inf, travel=1.0), "angle must be a finite number"),
    (lambda: first_contact(GROOVE, WIRE, DROP, np.zeros((4, 4))), "T_a_b must have the last"),
    (lambda: first_contact(GROOVE, WIRE, DROP, margin=math.nan), "margin must be a finite"),
    (lambda: min_clearance(GROOVE, WIRE, 3), "motion must be a Motion"),
    (lambda: Motion.translate((0, 0, -1.1e9)), "by must be three lengths up to 1e.09 mm"),
    (lambda: Motion.screw((0, 0, 1), 1.0, travel=-1.1e9), "travel must be up to 1e.09 mm, got -1.1e.09"),
    (lambda: Motion.to_pose(translation(0.0, 1.1e9, 0.0)), "offset of to must be three lengths"),
    (lambda: DROP.at(-1.1e6), "t must be from 0 to 1 .or at most 1e.06 times"),
    (lambda: Motion.translate((0, 0, 1), parts=("a", 3)), "part of a motion must be"),
)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("slope", [0.5, 1.0, 2.0])
def test_a_diagonal_way_down_onto_a_flat_face(side, slope):
    """Least at its end, in closed form: sideways and down, the two must not cancel in the bound."""
    start = translation(side * 30.0, H + 30.0, 0.0)
    way = Motion.translate((side * 15.0 / slope, -15.0, 0.0))
    least = min_clearance(GROOVE, WIRE, way, start)
    assert least.t == pytest.approx(1.0, abs=1e-12)
    assert least.distance.value == pytest.approx(15.0 - 10.5, abs=1e-12)
    assert least.evaluations < 100
    low = Motion.translate((side * 25.0 / slope, -25.0, 0.0))
    assert first_contact(GROOVE, WIRE, low, start).t == pytest.approx((30.0 - 10.5) / 25.0, abs=1e-12)


def test_a_screw_leads_to_its_pose_at_constant_rates_and_no_faster_than_its_bound():
    rng = np.random.default_rng(1)
    for k in range(60):
        turns = [rotation(rng.normal(size=3), rng.uniform(0.0, 3.0)) for _ in "ab"]
        start, to = (translation(*rng.normal(size=3) * 9.0) @ turns[i * (k % 6 > 0)] for i in (0, 1))
        motion = Motion.to_pose(to).resolved(start)
        np.testing.assert_allclose(motion.at(0.3, motion.at(0.7, start)), to, atol=1e-12)
        wider = replace(motion, travel=motion.travel + np.cross(motion.axis, (1.0, 2.0, 3.0)))
        assert (motion.is_screw, wider.is_screw) == (True, k % 6 == 0)
        points = motion.point + rng.normal(size=(8, 3)) * 5.0
        out = [np.linalg.norm(np.cross(p - motion.point, motion.axis)) for p in points]
        np.testing.assert_allclose(motion.from_axis(points), out, atol=1e-12)
        way = (motion.at(1e-6) - np.eye(4)) @ np.vstack([points.T, np.ones(8)]) * 1e6
        assert np.linalg.norm(way, axis=0).max() - 1e-4 <= motion.speed(points)
        turn = Motion.screw(motion.axis, -2.0, point=motion.point)  # of a mere turn the bound is met
        assert turn.speed(points) == pytest.approx(2.0 * max(out), rel=1e-12)
