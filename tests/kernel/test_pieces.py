"""Pieces of a groove and gradients: against the definition and against differences, one-sided ones at ties."""

import math

import numpy as np
import pytest

from clamp3d.errors import InputError
from clamp3d.kernel import Capsule, Cylinder, SweptArc, groove_pieces, rotation, signed_distance, translation
from clamp3d.kernel.distance import Feature, signed_distances
from clamp3d.kernel.subgradient import generalised_gradient
from tests.kernel.oracle import load, surface_distance
from tests.kernel.test_flat import random_scene

CASES = load()


def test_least_piece_is_the_signed_distance():
    outside = 0
    for case in CASES:
        a = signed_distance(case.groove, case.cylinder, case.pose)
        p = groove_pieces(case.groove, case.cylinder, case.pose)
        if a.axis_inside:
            assert p.distance.min() <= a.distance + 1e-11 * case.size
        else:
            outside += 1
            assert abs(p.distance.min() - a.distance) <= 1e-13 * case.size
            assert surface_distance(case.groove, p.point_on_groove).max() <= 1e-12 * case.size
    assert outside > 500


def _surfaces(groove, P):
    """Distances (n, 5) of points from the surface of each piece alone, by the definition."""
    R, half, H = groove.radius, groove.half_angle, groove.length / 2
    s, h = R * math.sin(half), -R * math.cos(half)
    x, y, z = P.T
    rho, beyond = np.hypot(x, y), np.maximum(np.abs(z) - H, 0.0)
    lips = [np.hypot(x - side * s, y - h) for side in (-1.0, 1.0)]
    arc = np.where(np.abs(np.arctan2(x, -y)) <= half, np.abs(R - rho), np.minimum(*lips))
    flats = [np.where(side * x >= s, np.abs(y - h), lip) for side, lip in zip((-1.0, 1.0), lips, strict=True)]
    face = np.where((y <= h) & (rho >= R), 0.0, np.min([arc, *flats], axis=0))
    return np.column_stack([*np.hypot([arc, *flats], beyond), np.hypot(face, z + H), np.hypot(face, z - H)])


def _of_axis(distances, T, length, row):
    """Least of the distances along the axis, by three grids, each about the least of the one before."""
    centre, reach = 0.0, 0.5 * length
    for _ in range(4):
        t = np.clip(centre + reach * np.linspace(-1.0, 1.0, 301), -0.5 * length, 0.5 * length)
        found = distances(T[:3, 3] + t[:, None] * T[:3, 2])[:, row]
        centre, reach = t[found.argmin()], reach / 75.0
    return found.min(), centre


def test_each_piece_is_the_distance_from_its_own_surface():
    """With the axis in the material, of a side piece times the cosine of the way about the lip to the deepest point."""
    rng = np.random.default_rng(6)
    inside = 0
    for k in range(300):
        groove, wire = SweptArc(12.0, rng.uniform(0.2, 3.0), 40.0), Capsule(2.0, rng.choice([3.0, 30.0, 120.0]))
        T = rotation(rng.normal(size=3), rng.choice([0.0, 1e-3, 0.2, 1.0, 2.0]))
        s, h = 12.0 * math.sin(groove.half_angle), -12.0 * math.cos(groove.half_angle)
        T[:3, 3] = rng.normal(size=3) * [10.0, 10.0, 18.0] + [[0.0, 0.0, 0.0], [s, h, 0.0]][k % 2]
        found = groove_pieces(groove, wire, T)
        free = np.array([_of_axis(lambda P, g=groove: _surfaces(g, P), T, wire.length, row)[0] for row in range(5)])

        if not signed_distance(groove, wire, T).axis_inside:
            assert np.abs(found.distance + 2.0 - free).max() <= 1e-6
            continue

        def shallow(P, groove=groove, h=h):
            depth = np.minimum(np.hypot(P[:, 0], P[:, 1]) - 12.0, h - P[:, 1])
            return np.where(np.abs(P[:, 2]) < 20.0, -depth, np.inf)[:, None]

        least, t = _of_axis(shallow, T, wire.length, 0)
        x, y, z = T[:3, 3] + t * T[:3, 2]
        if least >= -1e-3 or abs(z) > 20.0 - 1e-3:
            continue
        inside += 1
        deepest = _surfaces(groove, np.array([[x, y, z]]))[0]
        for row, side in enumerate((1.0 if x >= 0.0 else -1.0, -1.0, 1.0)):
            part = math.atan2(h - y, side * x - s) / (0.5 * (math.pi - groove.half_angle))
            turn = math.pi * (min(part, 1.0) if row == 0 else min(max(part - 1.0, 0.0), 1.0))
            factor = math.cos(turn) if row == 0 else -math.cos(turn)
            if factor <= 0.0 or free[row] > 1e-6:  # else the axis goes through the piece
                expected = factor * (free if factor > 0.0 else deepest)[row]
                assert found.distance[row] + 2.0 == pytest.approx(expected, abs=1e-4)
    assert inside > 50


def test_an_axis_that_ends_in_the_plane_of_an_end_face_is_outside():
    groove, wire = SweptArc(1.0, 1.0, 1.0), Capsule(1.0, 1.0)
    T = translation(0.0, -2.0, 1.0)
    assert not signed_distance(groove, wire, T).axis_inside
    gaps = groove_pieces(groove, wire, T).distance
    lip = math.hypot(math.sin(1.0), 2.0 - math.cos(1.0)) - 1.0  # the face's nearest point, from (0, -2)
    assert np.allclose(gaps[:3], [0.0, lip, lip], atol=1e-12)
    assert abs(gaps.min() + 1.0) < 1e-12


def test_gradients_are_the_differences_where_those_agree_from_both_sides():
    """Those of the end faces also with the wire's end deep in the material, whichever way out is the shorter."""
    groove, step = SweptArc(7.0, 1.0, 20.0), 1e-6
    rng, compared, aside, through = np.random.default_rng(4), 0, 0, {-1: 0, 1: 0}
    for case in range(250):
        wire = Capsule(float(rng.uniform(1.0, 6.0)), float(rng.uniform(4.0, 60.0)))
        T = rotation(rng.normal(size=3), float(rng.uniform(-1.5, 1.5)) * (case % 3 > 0))
        T[:3, 3] = rng.uniform((-15.0, -25.0, -25.0), (15.0, 5.0, 25.0))
        here = groove_pieces(groove, wire, T)
        assert np.abs(np.linalg.norm(here.normal, axis=1) - 1.0).max() <= 1e-12
        sideways = (here.distance < -wire.radius) & (here.normal[:, 2] == 0.0) & (np.arange(5) > 2)
        assert np.abs(here.normal - here.gradient[:, :3])[sideways, :2].max(initial=0.0) <= 1e-9
        aside += sideways.sum()
        for k in range(6):
            there = [groove_pieces(groove, wire, moved(T, np.eye(6)[k], s * step)).distance for s in (-1, 1)]
            back, forth = (here.distance - there[0]) / step, (there[1] - here.distance) / step
            smooth = np.abs(back - forth) < 1e-4
            smooth[:3] &= (here.distance > -wire.radius).all() | (case % 3 == 0 and k < 3)
            np.testing.assert_allclose(here.gradient[smooth, k], (0.5 * (back + forth))[smooth], atol=1e-3)
            compared += int(smooth.sum())
        for row, sign in ((3, -1.0), (4, 1.0)):
            if here.distance[row] < -wire.radius and abs(abs(here.gradient[row, 2]) - 1.0) < 1e-9:
                through[int(sign * here.gradient[row, 2])] += 1
    assert compared > 1900
    assert min(*through.values(), aside) > 5


def moved(T, v, step):
    w = np.asarray(v[3:]) * step
    M = rotation(w, np.linalg.norm(w)) if np.linalg.norm(w) > 0.0 else np.eye(4)
    out = M @ T
    out[:3, 3] += np.asarray(v[:3]) * step
    return out


@pytest.mark.parametrize("shape", [Cylinder, Capsule])
def test_gradient_is_that_of_central_differences_at_smooth_poses(shape):
    rng = np.random.default_rng(20)
    smooth = {"apart": 0, "overlap": 0, "inside": 0}
    for _ in range(2000):
        groove, wire, T = random_scene(rng)
        if rng.random() < 0.3:  # into the material
            T[1, 3] -= 2.0 * groove.radius
        wire = shape(wire.radius, wire.length)
        a = signed_distance(groove, wire, T)
        v = rng.normal(size=6)
        v[3:] /= max(groove.radius, groove.length, wire.length, np.abs(T[:3, 3]).max())
        step = 1e-6 * min(groove.radius, wire.radius, wire.length, groove.length)
        d = signed_distances(groove, wire, np.array([moved(T, v, k * step) for k in (-2, -1, 0, 1, 2)]))
        rates = np.diff(d) / step
        if np.ptp(rates) > 2e-4:  # next to a tie, or an edge
            continue
        kind = "inside" if a.axis_inside else "overlap" if a.distance < 0.0 else "apart"
        smooth[kind] += 1
        wanted = (d[3] - d[1]) / (2.0 * step)
        assert abs(a.gradient @ v - wanted) < 1e-3, (groove, wire, T.tolist(), v.tolist(), a)
    assert min(smooth.values()) > 150, smooth


def one_sided(groove, wire, T, v, step):
    d = signed_distances(groove, wire, np.array([moved(T, v, k * step) for k in (0, 1, 2)]))
    return (4.0 * d[1] - 3.0 * d[0] - d[2]) / (2.0 * step)


TIES = {
    "both lips": (14.0, 80.0, translation(0.0, 5.0, 0.0)),
    "both lips, tilted": (14.0, 80.0, translation(0.0, 5.0, 0.0) @ rotation((1, 0, 0), 0.02)),
    "along the arc": (10.0, 20.0, translation(0.0, -1.0, 3.0)),
    "on the arc's axis": (10.0, 80.0, rotation((1, 0, 0), 0.01)),
    "before the end face": (3.0, 20.0, translation(0.0, -25.0, 36.0)),
    "on the flat face": (3.0, 20.0, translation(15.0, -5.0, 0.0) @ rotation((1, 0, 0), math.pi / 2)),
}


@pytest.mark.parametrize("shape", [Cylinder, Capsule])
@pytest.mark.parametrize("name", TIES)
def test_one_sided_derivatives_at_ties_are_the_least_rates(shape, name):
    radius, length, T = TIES[name]
    groove, wire = SweptArc(12.0, math.pi / 3, 50.0), shape(radius, length)
    found = generalised_gradient(groove, wire, T)
    rng = np.random.default_rng(21)
    for _ in range(60):
        v = rng.normal(size=6) * [1, 1, 1, 0.02, 0.02, 0.02]
        change = one_sided(groove, wire, T, v, 1e-4)
        least = (found.rates @ v).min()
        # A rim has no corners: its extreme points are sampled, the true least rate is a little lower.
        assert -0.15 < change - least < 0.02 + 1e-3, (v.tolist(), found.features)
        assert change <= (found.rates @ v).max() + 1e-3


def test_ties_are_told_and_smooth_poses_too():
    groove = SweptArc(12.0, math.pi / 3, 50.0)
    tie = generalised_gradient(groove, Cylinder(14.0, 80.0), TIES["both lips, tilted"][2])
    assert not tie.unique
    assert {Feature.CORNER_M, Feature.CORNER_N} <= set(tie.features)
    T = translation(2.0, -3.0, 1.0) @ rotation((1, 2, 0), 0.1)
    smooth = generalised_gradient(groove, Cylinder(5.0, 80.0), T)
    assert smooth.unique
    assert np.array_equal(smooth.rates[0], smooth.nearest.gradient)
    assert signed_distance(groove, Cylinder(5.0, 80.0), T).unique
    assert not signed_distance(groove, Cylinder(14.0, 80.0), TIES["both lips"][2]).unique


def test_bad_tolerance():
    with pytest.raises(InputError, match="tolerance must be"):
        generalised_gradient(SweptArc(12.0, 1.0, 50.0), Cylinder(1.0, 2.0), np.eye(4), tolerance=0.0)
