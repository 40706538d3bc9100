"""The least-squares cylinder against closed forms, mpmath and its own covariance."""

import numpy as np
import pytest

from clamp3d.fit.axis import Axis
from clamp3d.fit.cylinder import covariance, fit_axis, surface_error
from clamp3d.kernel import rotation


def points_on(rng, n, radius, half, length):
    t, z = rng.uniform(-half, half, n), rng.uniform(-length / 2, length / 2, n)
    return np.stack([radius * np.sin(t), -radius * np.cos(t), z], axis=1)


@pytest.mark.parametrize("half_deg", [5.0, 27.75, 90.0, 180.0])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_exact_points_give_the_cylinder_to_rounding(half_deg, offset):
    rng = np.random.default_rng(1)
    R = rotation(rng.normal(size=3), 2.0)[:3, :3]
    shift = rng.normal(size=3) * offset
    points = points_on(rng, 60, 23.8012, np.radians(half_deg), 60.0) @ R.T + shift
    # A start that is wrong by 10 % in radius and 3 degrees in direction.
    d = R @ np.array([0.05, 0.02, 1.0])
    start = Axis(shift + R @ np.array([0.0, 2.0, 0.0]), d / np.linalg.norm(d), 26.0)
    got = fit_axis(points, start)
    loss = 1e-16 * max(offset, 60.0) / (1.0 - np.cos(np.radians(half_deg)))  # a shallow arc magnifies rounding
    assert got is not None
    assert abs(got.radius - 23.8012) < 1e3 * loss
    assert np.linalg.norm(np.cross(got.direction, R[:, 2])) < 1e3 * loss
    assert np.linalg.norm(np.cross(got.point - shift, R[:, 2])) < 1e3 * loss


def test_covariance_of_a_full_ring_is_the_closed_form():
    # n points evenly on two full rings at z = +-h: J^T J is diagonal: n, n/2, n/2, n h^2/2, n h^2/2.
    t = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.concatenate([np.column_stack([7 * np.cos(t), 7 * np.sin(t), np.full(40, z)]) for z in (-5.0, 5.0)])
    C = covariance(points, 7.0, 0.01)
    assert np.allclose(C, np.diag([1.0, 2.0, 2.0, 2.0 / 25, 2.0 / 25]) * 0.01**2 / 80, atol=1e-18)


def test_standard_errors_of_a_shallow_arc_hold():
    """Radius and axis of 100 scattered arcs of the reference clamp: errors in units of their standard errors."""
    half, radius, length, sigma, n = np.radians(27.75), 23.8012, 60.0, 0.05, 120
    errors, worst = [], 0.0
    for seed in range(100):
        rng = np.random.default_rng(1000 + seed)
        points = points_on(rng, n, radius, half, length) + rng.normal(0.0, sigma, (n, 3))
        got = fit_axis(points, Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]), 20.0))
        res = got.residual(points)
        noise = np.sqrt(res @ res / (n - 5))
        C = covariance(points, radius, noise)
        d = got.direction / got.direction[2]
        at = got.point - got.point[2] * d
        error = np.array([got.radius - radius, at[0], at[1], d[0], d[1]])
        errors.append(error / np.sqrt(np.diag(C)))
        # The simultaneous bound on the surface, against the true surface on a grid.
        t, z = (q.ravel() for q in np.meshgrid(np.linspace(-half, half, 21), np.linspace(-30, 30, 5)))
        true = np.column_stack([radius * np.sin(t), -radius * np.cos(t), z])
        worst = max(worst, np.abs(got.residual(true)).max() / surface_error(C, half, length, n - 5))
    errors = np.array(errors)
    assert np.abs(errors.mean(axis=0)).max() < 4 / np.sqrt(100)
    assert np.all(np.abs(errors.std(axis=0) - 1.0) < 4 / np.sqrt(200))
    assert (np.abs(errors) > 3).mean() < 0.01
    assert worst < 1.0
