"""Flat-ended cylinders: the kernel against branch and bound from the definition, Open CASCADE, and its own promises."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.bench.stress.poses.flat_truth import flat_truth
from clamp3d.kernel import Capsule, Cylinder, Feature, SweptArc, groove_pieces, rotation, signed_distance
from tests.kernel.oracle import point_distance, surface_distance
from tests.kinds import poses


def random_scene(rng):
    """A groove, a cylinder and a pose of any proportions; leans from none to square."""
    R = 10 ** rng.uniform(0, 1.5)
    half_angle = rng.uniform(0.1, 3.1) if rng.random() < 0.5 else rng.uniform(0.2, 1.57)
    groove = SweptArc(R, half_angle, R * 10 ** rng.uniform(-1, 1))
    wire = Cylinder(R * 10 ** rng.uniform(-1, 0.3), R * 10 ** rng.uniform(-1.3, 1))
    T = rotation(rng.normal(size=3), rng.choice([0, 1e-9, 1e-4, 0.02, 0.3, 1.0, 3.0]))
    if rng.random() < 0.2:
        T = rotation((rng.normal(), rng.normal(), 0), math.pi / 2)
    T[:3, 3] = rng.normal(size=3) * [R, R, (groove.length + wire.length) / 3]
    return groove, wire, T


def test_agrees_with_branch_and_bound_from_the_definition():
    rng = np.random.default_rng(7)
    seen, narrow = set(), 0
    for _ in range(400):
        groove, wire, T = random_scene(rng)
        R = groove.radius
        low, high = flat_truth(R, groove.half_angle, groove.length, wire.radius, wire.length, T, 1e-9 * R, 10_000)
        found = signed_distance(groove, wire, T)
        narrow += high - low < 1e-7 * R
        seen.add((found.feature, found.distance < 0.0))
        if found.axis_inside:  # nothing is left of the cylinder
            assert low <= -min(wire.radius, 0.5 * wire.length) + 1e-12 * R
        else:
            slack = found.error_bound + 1e-13 * R
            assert low - slack <= found.distance <= high + slack, (groove, wire, T.tolist())
            assert found.error_bound < 1e-12 * (np.abs(T[:3, 3]).max() + R + wire.radius + groove.length + wire.length)
    assert len(seen) == 2 * len(Feature)
    assert narrow > 120


@pytest.mark.parametrize("scale", [2.0**-9, 2.0**9])
def test_no_length_is_absolute(scale):
    """All sizes times a power of two: all answers are the same times that."""
    rng = np.random.default_rng(8)
    for _ in range(300):
        groove, wire, T = random_scene(rng)
        scaled = T.copy()
        scaled[:3, 3] *= scale
        other = SweptArc(scale * groove.radius, groove.half_angle, scale * groove.length)
        for kind in (Cylinder, Capsule):
            own, large = kind(wire.radius, wire.length), kind(scale * wire.radius, scale * wire.length)
            one, many = signed_distance(groove, own, T), signed_distance(other, large, scaled)
            assert (many.distance, many.feature) == (pytest.approx(scale * one.distance, rel=1e-12), one.feature)
            few, rows = groove_pieces(groove, own, T), groove_pieces(other, large, scaled)
            assert rows.distance == pytest.approx(scale * few.distance, rel=1e-12)
            assert rows.gradient[:, :3] == pytest.approx(few.gradient[:, :3], abs=1e-9)


@pytest.mark.parametrize(
    ("groove", "wire", "turn", "place"),
    [
        ((21.4, 1.5, 93.0), (16.4, 116.0), (0.0, 1.6, 0.4), (28.0, 10.0, 37.0)),
        ((11.7, 0.3, 49.0), (8.2, 42.0), (-0.7, -1.4, -0.1), (-12.0, 7.0, -5.0)),
        ((14.4, 0.9, 120.0), (6.3, 66.0), (1.1, -1.2, 0.0), (16.0, 19.0, 10.0)),
        ((16.6, 2.1, 85.0), (20.1, 20.0), (-1.2, 1.2, -1.7), (0.0, 0.0, 3.0)),
        ((28.7, 0.3, 79.0), (28.5, 81.0), (-1.2, -1.0, 0.0), (-6.0, 8.0, 11.0)),
    ],
)
def test_the_end_that_is_nearer_to_the_grooves_axis_can_be_nearest_to_its_arc(groove, wire, turn, place):
    """The last of the four stretches of the arc surface: without it these are off by 0.2 to 5 mm."""
    groove, wire = SweptArc(*groove), Cylinder(*wire)
    T = rotation(turn, np.linalg.norm(turn))
    T[:3, 3] = place
    sizes = groove.radius, groove.half_angle, groove.length, wire.radius, wire.length
    low, high = flat_truth(*sizes, T, 1e-9 * groove.radius, 10_000)
    assert high - low < 0.05
    assert low - 1e-9 <= signed_distance(groove, wire, T).distance <= high + 1e-9


def depth_in(wire, T, points):
    """How deep points (k, 3) lie in a flat-ended cylinder, negative outside it (not the distance there)."""
    m = (points - T[:3, 3]) @ T[:3, :3]
    return np.minimum(wire.radius - np.hypot(m[:, 0], m[:, 1]), 0.5 * wire.length - np.abs(m[:, 2]))


def test_witnesses_lie_on_both_bodies_and_the_normal_is_unit():
    rng = np.random.default_rng(8)
    for _ in range(1500):
        groove, wire, T = random_scene(rng)
        a = signed_distance(groove, wire, T)
        tol = 1e-11 * max(groove.radius, groove.length, wire.length, np.abs(T[:3, 3]).max())
        q, p = a.point_on_groove, a.point_on_cylinder
        assert abs(np.linalg.norm(a.normal) - 1.0) < 1e-12
        assert np.abs(q + a.distance * a.normal - p).max() <= tol
        on_groove = surface_distance(groove, q[None])[0]
        if not a.axis_inside:
            if a.distance <= -0.5 * wire.length + tol:  # a point within counts
                on_groove = point_distance(q[None], groove.radius, groove.half_angle, 0.5 * groove.length)[0]
            assert on_groove <= tol
            assert abs(depth_in(wire, T, p[None])[0]) <= tol, (groove, wire, T.tolist())
            if a.distance < 0.0:
                assert abs(depth_in(wire, T, q[None])[0] + a.distance) <= tol


def off_part(groove, feature, q):
    """How far a point is off the part of the groove that this names."""
    name, R, a, (x, y, z) = Feature(feature).name, groove.radius, groove.half_angle, q
    aside = (-x if name.endswith("_M") else x) - R * math.sin(a)
    end = abs(z) - 0.5 * groove.length
    off = [end if "END" in name or "CORNER" in name else max(end, 0.0)]
    if "ARC" in name:
        off.append(math.hypot(x, y) - R)
    elif name != "END_FACE":
        off += [y + R * math.cos(a), min(aside, 0.0) if "FLAT" in name or "EDGE" in name else aside]
    return np.abs(off).max()


@pytest.mark.parametrize("kind", [Cylinder, Capsule])
def test_features_and_places_are_those_of_the_points(kind):
    rng = np.random.default_rng(9)
    for k in range(1500):
        groove, wire, T = random_scene(rng)
        T[1, 3] -= 2.0 * groove.radius * (k % 3 == 0)  # into the material
        wire = kind(wire.radius, wire.length)
        a, pieces = signed_distance(groove, wire, T), groove_pieces(groove, wire, T)
        tol = 1e-11 * max(groove.radius, groove.length, wire.length, *np.abs(T[:3, 3]))
        out = a.point_on_groove - T[:3, 3]
        away = np.linalg.norm(out - a.along * T[:3, 2])  # from the place on the axis
        if kind is Capsule or a.axis_inside:
            inner = wire.radius if kind is Capsule else min(wire.radius, 0.5 * wire.length)
            assert abs(away - abs(a.distance + inner)) <= tol
        else:
            assert abs(away - np.linalg.norm(np.cross(out, T[:3, 2]))) <= tol
        if a.axis_inside or a.distance > -0.5 * wire.length + tol:
            assert off_part(groove, a.feature, a.point_on_groove) <= tol
        assert max(map(off_part, [groove] * 5, pieces.feature, pieces.point_on_groove)) <= tol


def test_the_normal_at_contact_is_that_before_it():
    rng, same = np.random.default_rng(10), 0
    for _ in range(1500):
        groove, wire, T = random_scene(rng)
        before = signed_distance(groove, wire, T)
        if before.distance < 1e-3 * groove.radius or 0.0 < np.hypot(*T[:2, 2]) < 1e-3:  # where a normal is ill defined
            continue
        left = rng.choice([50.0, 200.0]) * before.error_bound
        T[:3, 3] -= (before.distance - left) * before.normal
        at = signed_distance(groove, wire, T)
        assert abs(at.distance - left) <= 2.0 * at.error_bound
        if at.feature is before.feature < Feature.CORNER_M:  # an edge that is touched belongs to its faces too
            same += 1
            assert np.abs(at.normal - before.normal).max() <= 0.1
    assert same > 400


@settings(deadline=None)
@given(
    st.builds(SweptArc, st.floats(3.0, 15.0), st.floats(0.1, 3.0), st.floats(1.0, 60.0)),
    st.tuples(st.floats(0.5, 14.0), st.floats(0.2, 90.0)),
    poses(25.0),
)
def test_error_bounds_are_no_larger_than_the_rounding_they_stand_for(groove, sizes, T):
    """A bound ten times too large would let a wrong formula pass for rounding."""
    unit, lengths = 2.0**-53, np.abs(T[:3, 3]).sum() + sizes[1] + groove.length + groove.radius + sizes[0]
    assert 0.0 < signed_distance(groove, Capsule(*sizes), T).error_bound <= 13.0 * unit * lengths
    assert 0.0 < signed_distance(groove, Cylinder(*sizes), T).error_bound <= 30.0 * unit * lengths
