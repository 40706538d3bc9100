"""The distance of boxes and cylinders in closed form, before truths that know only what the bodies are."""

import numpy as np
import pytest
from scipy.optimize import minimize

from clamp3d.collide.convex import Rod, convex_distance, hull
from clamp3d.collide.depth_convex import convex_depth
from clamp3d.core.pose import rotation, translation

HERE = np.eye(4)
SIGNS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def _pieces(rng):
    box = hull(SIGNS * rng.uniform(1.0, 9.0, 3))
    return [box, Rod(*rng.uniform(1.0, 9.0, 2), HERE), hull(SIGNS * rng.uniform(1.0, 9.0, 3))]


def _support(piece, n):
    """Height along n, from the definition."""
    if isinstance(piece, Rod):
        return piece.radius * np.hypot(n[0], n[1]) + 0.5 * piece.length * abs(n[2])
    return (piece.vertices @ n).max()


def _gap(a, b, T, n):
    """The gap between planes square to n; its largest value is the signed distance."""
    return float(n @ T[:3, 3]) - _support(a, n) - _support(b, T[:3, :3].T @ -n)


def _climbed(a, b, T, n):
    """A local maximum of the gap near n."""
    return -minimize(lambda v: -_gap(a, b, T, v / np.linalg.norm(v)), n, method="Nelder-Mead").fun


def test_it_is_the_widest_slab():
    """Apart no pair of points is nearer, and in an overlap no direction is a shorter way out."""
    rng = np.random.default_rng(5)
    apart = inside = 0
    for _ in range(60):
        pieces = _pieces(rng)
        a, b = (pieces[k] for k in rng.choice(3, 2, replace=False))
        T = translation(*(rng.normal(size=3) * 6.0)) @ rotation(rng.normal(size=3), rng.uniform(0.0, 3.0))
        d = convex_depth(a, HERE, b, T)
        assert d.upper - d.lower <= 1e-9
        assert _gap(a, b, T, d.normal) == pytest.approx(d.value, abs=1e-9)
        assert d.point_b - d.point_a == pytest.approx(d.value * d.normal, abs=1e-7)
        assert min(a.depth(d.point_a[None])[0], b.depth(((d.point_b - T[:3, 3]) @ T[:3, :3])[None])[0]) >= -1e-12
        starts = rng.normal(size=(200, 3))
        starts /= np.linalg.norm(starts, axis=1)[:, None]
        gaps = [_gap(a, b, T, n) for n in starts]
        for n in starts[np.argsort(gaps)[-3:]]:
            assert _climbed(a, b, T, n) <= d.upper + 1e-9
        apart, inside = apart + (d.lower > 0.0), inside + (d.upper < 0.0)
    assert min(apart, inside) >= 10


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_points_of_nearly_parallel_cylinders_are_as_far_apart_as_said(angle):
    """Lines that are almost parallel: the rate along them is lost in rounding, the points must not be."""
    a, b = Rod(3.0, 40.0, HERE), Rod(2.0, 30.0, HERE)
    for gap in (1e-9, 1e-5, 0.1):
        T = translation(5.0 + gap, 0.0, 6.0) @ rotation([1.0, 0.0, 0.0], angle)
        d = convex_distance(a, HERE, b, T)
        assert d.lower <= d.upper <= d.lower + 1e-10
        assert d.value == pytest.approx(gap, abs=1e-10)
        assert np.linalg.norm(d.point_b - d.point_a) == pytest.approx(d.value, abs=1e-10)


def test_coaxial_cylinders_come_free_in_any_direction():
    d = convex_depth(Rod(5.0, 60.0, HERE), HERE, Rod(3.0, 50.0, HERE), HERE)
    assert d.value == pytest.approx(-8.0, abs=1e-10)
    assert d.normal[2] == pytest.approx(0.0, abs=1e-10)
