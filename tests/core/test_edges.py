"""Least distance of a flat-ended cylinder along a groove's edges, by the kernel's formulas, against dense sampling."""

import math

import numpy as np
import pytest

from clamp3d.core.kernel_edges import Line, fall, on_arc, on_line
from clamp3d.core.kernel_features import Groove, Rod
from clamp3d.core.kernel_vector import Vector
from clamp3d.core.pose import rotation


def _beside(P, r, l, c, d):  # noqa: E741
    """Signed distance of points (n, 3) from a cylinder about c along d."""
    m = P - c
    t = m @ d
    g, e = np.linalg.norm(m - t[:, None] * d, axis=1) - r, np.abs(t) - l
    return np.where(np.maximum(g, e) > 0.0, np.hypot(np.maximum(g, 0.0), np.maximum(e, 0.0)), np.maximum(g, e))


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


def test_a_function_falls_by_no_more_than_its_derivatives_let_it():
    rng = np.random.default_rng(0)
    x = np.linspace(-1.0, 1.0, 2001)
    for _ in range(1000):
        slope, bend, third, reach = *rng.normal(size=2) * rng.choice([0.1, 1.0, 10.0], 2), *rng.uniform(0.0, 3.0, 2)
        X = reach * x
        square = slope * X + 0.5 * bend * X * X
        assert -square.min() == pytest.approx(fall(slope, bend, 0.0, reach), abs=1e-4)
        for cubic in (-third, third):
            assert -(square + cubic * X**3 / 6.0).min() <= fall(slope, bend, third, reach) + 1e-12
        assert fall(slope, bend, third, reach) <= -square.min() + third * reach**3 / 6.0 + 1e-4


def _rod(r, half, c, d):
    return Rod(Vector(*map(float, c)), Vector(*map(float, d)), float(d[0] ** 2 + d[1] ** 2), float(r), float(half))


def test_an_end_arc_has_no_nearer_point():
    rng = np.random.default_rng(1)
    for r, l, c, d in _cylinders(rng, 160):  # noqa: E741
        half_angle, ez = rng.uniform(0.2, 3.1), rng.choice([0.0, 5.0, 25.0])

        def at(angle, ez=ez, r=r, l=l, c=c, d=d):  # noqa: E741
            angle = np.atleast_1d(angle)
            return _beside(np.column_stack([12.0 * np.sin(angle), -12.0 * np.cos(angle), 0.0 * angle + ez]), r, l, c, d)

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


def test_a_line_has_no_nearer_point():
    rng = np.random.default_rng(2)
    inside = 0
    for r, l, c, d in _cylinders(rng, 400):  # noqa: E741
        u = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)][int(rng.integers(2))])
        k = rng.normal(size=3) * 12.0 * (1.0 - u) - c * (1.0 - u)
        lo, hi = sorted(rng.normal(size=2) * 20.0)

        def at(s, k=k, u=u, r=r, l=l, d=d):  # noqa: E741
            return _beside(k + np.atleast_1d(s)[:, None] * u, r, l, np.zeros(3), d)

        s = np.linspace(lo, hi, 4001)
        near = s[at(s).argmin()] + np.linspace(-1.0, 1.0, 2001) * (hi - lo) / 2000.0
        true = at(np.clip(near, lo, hi)).min()
        rod, line = (
            _rod(r, l, np.zeros(3), d),
            Line(Vector(*map(float, k)), Vector(*map(float, u)), float(lo), float(hi)),
        )
        f, place, _ = on_line(rod, line, math.inf)
        assert lo <= place <= hi
        assert f == pytest.approx(at(place)[0], abs=1e-11)
        assert true - 1e-4 <= f <= true + 1e-9
        inside += f < 0.0
        assert on_line(rod, line, true + 1e-3).f == f
        assert on_line(rod, line, true - 1e-3).f >= f
    assert inside > 15
