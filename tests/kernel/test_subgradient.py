"""Gradients of both shapes against differences: central ones where the distance is smooth, one-sided ones at ties."""

import math

import numpy as np
import pytest

from clamp3d.errors import InputError
from clamp3d.kernel import Capsule, Cylinder, SweptArc, rotation, translation
from clamp3d.kernel.distance import Feature, signed_distance, signed_distances
from clamp3d.kernel.subgradient import generalised_gradient
from tests.kernel.test_flat import random_scene


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
