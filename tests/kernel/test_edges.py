"""Least distance of a flat-ended cylinder along a groove's edges, by the kernel's formulas, against dense sampling."""

import math

import numba
import numpy as np
import pytest

from clamp3d.kernel import edges, rotation
from clamp3d.kernel.features import Groove, Rod
from clamp3d.kernel.vector import Vector


@numba.njit(error_model="numpy", cache=True)
def on_arc(groove, rod, ez, limit, eps):
    return edges.on_arc(groove, rod, ez, limit, eps)


@numba.njit(error_model="numpy", cache=True)
def bounds_about(groove, rod, ez, angle, half):
    arc = edges.end_arc_of(groove, rod, ez)
    course = edges.course_at(arc, rod, angle)
    stretch = edges.stretch_about(arc, rod, course, half)
    f = edges.cylinder_distance(rod, course.w, course.t)
    mixture = edges.bound_by_mixture(stretch, course, f) if stretch.bend < math.inf else -math.inf
    rates = np.empty((101, 4))
    for i in range(101):
        at = edges.course_at(arc, rod, angle + half * (0.02 * i - 1.0))
        rates[i] = at.w1, at.w2, at.t1, at.t2
    return mixture, stretch, rates


def _beside(angle, z, r, l, c, d):  # noqa: E741
    """Of points at ``angle`` of an arc of radius 12: the signed distance from a cylinder, from its side, its ends."""
    m = np.column_stack([12.0 * np.sin(angle), -12.0 * np.cos(angle), 0.0 * angle + z]) - c
    t = m @ d
    g, e = np.linalg.norm(m - t[:, None] * d, axis=1) - r, np.abs(t) - l
    f = np.where(np.maximum(g, e) > 0.0, np.hypot(np.maximum(g, 0.0), np.maximum(e, 0.0)), np.maximum(g, e))
    return f, g, e


def _cylinders(rng, count):
    """Radius, half length, middle and axis beside an arc of radius 12: along it, across it, on its axis, on an edge."""
    for k in range(count):
        r, l, c = *10.0 ** rng.uniform((-1.0, -1.0), (1.3, 2.0)), rng.normal(size=3) * 12.0  # noqa: E741
        lean = [0.0, 1e-6, 0.05, 0.5, 0.5 * math.pi, rng.uniform(0.0, math.pi)][k % 6]
        if k % 5 == 0:
            c[:2] = 0.0
        if k % 7 == 0:
            c[0] = 0.0
        axis = (math.cos(turn := rng.uniform(-math.pi, math.pi)), math.sin(turn), 0.0)
        yield r, l, c, rotation(axis if k % 3 else (1.0, 0.0, 0.0), lean)[:3, 2]


def _rod(r, half, c, d):
    return Rod(Vector(*map(float, c)), Vector(*map(float, d)), float(d[0] ** 2 + d[1] ** 2), float(r), float(half))


def test_an_end_arc_has_no_nearer_point():
    rng = np.random.default_rng(1)
    for r, l, c, d in _cylinders(rng, 160):  # noqa: E741
        half_angle, ez = rng.uniform(0.2, 3.1), rng.choice([0.0, 5.0, 25.0])

        def at(angle, ez=ez, r=r, l=l, c=c, d=d):  # noqa: E741
            return _beside(np.atleast_1d(angle), ez, r, l, c, d)[0]

        groove, rod = Groove(12.0, half_angle, 0.0, 0.0, 0.0), _rod(r, l, c, d)
        angle = np.linspace(-half_angle, half_angle, 4001)
        fine = angle[at(angle).argmin()] + np.linspace(-1.0, 1.0, 2001) * half_angle / 2000.0
        true = at(np.clip(fine, -half_angle, half_angle)).min()
        best = on_arc(groove, rod, ez, math.inf, 1e-13)
        assert abs(best.p) <= half_angle * (1.0 + 1e-12)
        assert best.f == pytest.approx(at(best.p)[0], abs=1e-11)
        assert best.f <= true + 1e-9
        assert best.f - best.left <= 1e-9
        assert min(best.f, best.left) >= true - 1e-4
        # What is not nearer than what is known is not looked for.
        assert on_arc(groove, rod, ez, true - 1e-3, 1e-13).f == math.inf
        assert on_arc(groove, rod, ez, true + 1e-3, 1e-13).f == pytest.approx(best.f, abs=1e-12)


def test_on_a_stretch_of_an_arc_nothing_is_outside_its_bounds():
    rng = np.random.default_rng(2)
    tight = 0
    for r, l, c, d in _cylinders(rng, 2000):  # noqa: E741
        angle, half = rng.uniform(-3.0, 3.0), 10.0 ** rng.uniform(-3.0, 0.0)
        rod, groove = _rod(r, l, c, d), Groove(12.0, 3.1, 0.0, 0.0, 0.0)
        mixture, stretch, rates = bounds_about(groove, rod, 5.0, angle, half)
        f, g, e = _beside(angle + np.linspace(-half, half, 301), 5.0, r, l, c, d)
        assert mixture <= f.min() + 1e-12
        assert stretch.g_low - 1e-12 <= g.min() <= g.max() <= stretch.g_high + 1e-12
        assert stretch.e_low - 1e-12 <= e.min() <= e.max() <= stretch.e_high + 1e-12
        third = np.abs(np.diff(rates[:, 1])).max() / (0.02 * half)
        w1, w2, t1, t2 = np.abs(rates).max(axis=0) - 1e-9
        assert w1 <= stretch.by
        assert w2 <= stretch.bend
        assert third <= stretch.third * 1.001 + 1e-6
        assert max(t1, t2) <= stretch.tilt
        tight += mixture > f.min() - 0.02 * half
    assert tight > 500  # a bound that says nothing would hold too
