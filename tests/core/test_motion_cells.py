"""The bounds over a cell of a swept axis, against the definition at many points of the cell; what they give away."""

from __future__ import annotations

import math

import numpy as np
import pytest

from clamp3d.core.kernel_motion import apart, cell, first, least, ridge, turns_about_the_groove
from clamp3d.core.pose import rotation
from clamp3d.core.primitives import SweptArc
from clamp3d.testing import body

R, L, CELL = 12.0, 40.0, np.linspace(-1.0, 1.0, 13)


def test_the_best_mixture_of_two_slopes_is_the_least_of_the_higher():
    """Over a square the higher of two planes is lowest in a corner, or where they cross on a side."""
    rng = np.random.default_rng(0)
    for _ in range(2000):
        f, fu, ft, g, gu, gt = rng.normal(size=6)
        corners = [(u, t) for u in (-1.0, 1.0) for t in (-1.0, 1.0)]
        for side in (-1.0, 1.0):
            d, du, dt = f - g, fu - gu, ft - gt
            corners += [(u, side) for u in [-(d + dt * side) / du] if abs(u) <= 1.0]
            corners += [(side, t) for t in [-(d + du * side) / dt] if abs(t) <= 1.0]
        true = min(max(f + fu * u + ft * t, g + gu * u + gt * t) for u, t in corners)
        plain = max(f - abs(fu) - abs(ft), g - abs(gu) - abs(gt))
        assert max(plain, ridge(f, fu, ft, 0.0, g, gu, gt, 0.0, 0.0)) == pytest.approx(true, abs=1e-9)
        fk, gk, curve = 0.3 * rng.normal(), 0.3 * rng.normal(), 0.1
        u, t = np.meshgrid(CELL, CELL)
        higher = np.maximum(f - curve * np.hypot(u, t) + fu * u + ft * t + fk * u * t, g + gu * u + gt * t + gk * u * t)
        assert ridge(f, fu, ft, fk, g, gu, gt, gk, 2.0**0.5 * curve) <= higher.min() + 1e-12


@pytest.mark.parametrize("quadrant", [False, True])
def test_a_patch_is_as_far_away_as_its_nearest_point(quadrant):
    rng = np.random.default_rng(1)
    s = np.linspace(-1.0, 1.0, 401)
    side = np.column_stack([np.tile(s, 2), np.repeat([-1.0, 1.0], len(s))])
    border = np.vstack([side, side[:, ::-1]])
    away = 0
    for _ in range(400):
        x, a, b, k = rng.normal(size=2) * 4.0, *rng.normal(size=(2, 2)), 0.5 * rng.normal(size=2)

        def far(u, t, k, x=x, a=a, b=b):
            p = x + np.outer(u, a) + np.outer(t, b) + np.outer(u * t, k)
            return np.linalg.norm(np.maximum(p, 0.0) if quadrant else p, axis=1).min()

        inner = np.repeat(CELL, 13), np.tile(CELL, 13)
        true = min(far(*border.T, 0.0 * k), far(*inner, 0.0 * k))
        found = apart(*x, *a, *b, 0.0, 0.0, quadrant)
        if quadrant:  # beside it each coordinate tells alone
            found = max(found, *(x - np.abs(a) - np.abs(b)))
        assert found <= true + 1e-12
        if true > 0.5:
            away += 1
            assert found >= true - 0.02
        assert apart(*x, *a, *b, *k, quadrant) <= min(far(*border.T, k), far(*inner, k)) + 1e-12
    assert away > 150


def _motions(rng, count):
    """Motions as the kernel has them, of wires around a groove: straight, turning, along its axis, about its axis."""
    for i in range(count):
        c, d, p = rng.normal(size=3) * (8.0, 8.0, 18.0), rng.normal(size=3), rng.normal(size=3) * 15.0
        axis, v, angle = rng.normal(size=3), rng.normal(size=3) * 10.0, rng.normal()
        if i % 4 == 0:
            angle = 0.0
        if i % 5 == 0:
            d *= (0.02, 0.02, 1.0)
        if i % 4 == 1:
            p, axis = np.zeros(3), np.array([0.0, 0.0, 1.0])
            v[:2] *= rng.choice([0.0, 1.0])
        d, axis = d / np.linalg.norm(d), axis / np.linalg.norm(axis)
        yield np.array([*c, *d, *p, *axis, *v, angle])


def _points(m, u, t):
    """Points of the moving axis, by its definition."""
    c, d, p, axis, v = m[:15].reshape(5, 3)
    found = []
    for at in u:
        turn = rotation(axis, at * m[15])[:3, :3]
        found.append(p + turn @ (c - p) + at * v + np.outer(t, turn @ d))
    return np.array(found)


@pytest.mark.parametrize(("width", "given"), [(0.5, 0.1), (0.05, 0.0135), (1e-3, 2.4e-4)])
def test_no_point_of_a_cell_is_nearer_than_its_bound(width, given):
    """And beside a cell's size they give away little, and of a small one next to nothing: as ``given`` was measured."""
    rng = np.random.default_rng(2)
    lost = []
    for m in _motions(rng, 800):
        half_angle, u, t = rng.uniform(0.2, 3.0), rng.uniform(0.0, 1.0), rng.uniform(-20.0, 20.0)
        hu, ht = width * rng.choice([0.02, 0.2, 1.0]), 15.0 * width * rng.choice([0.02, 0.2, 1.0])
        s, h = R * math.sin(half_angle), -R * math.cos(half_angle)
        ends = [m[:3] + e * m[3:6] - m[6:9] for e in (-30.0, 30.0)]
        bend = max(np.linalg.norm(np.cross(m[9:12], end)) for end in ends) * m[15] ** 2
        coaxial = turns_about_the_groove(m)
        f, low, *_ = cell(R, s, h, 0.5 * L, m, bend, coaxial, u, t, hu, ht)
        groove, at = body(SweptArc(R, half_angle, L)), _points(m, u + hu * CELL, t + ht * CELL)
        field = groove.field(at.reshape(-1, 3))
        assert f == pytest.approx(field[84], abs=1e-11)
        assert low <= field.min() + 1e-11
        reach = np.linalg.norm(at - at[6, 6], axis=2).max()
        lost.append((field.min() - low) / reach)
        assert lost[-1] <= 1.0 + 0.5 * bend * hu * hu / reach
    assert np.mean(lost) <= given


def test_searches_with_little_room_tell_a_wider_bound_but_a_true_one():
    rng = np.random.default_rng(3)
    u, early = np.linspace(0.0, 1.0, 301), 0
    for m in _motions(rng, 80):
        half_angle, length = rng.uniform(0.2, 3.0), rng.choice([2.0, 30.0])
        groove, sizes = body(SweptArc(R, half_angle, L)), (R, half_angle, 0.5 * L, length, m)
        field = groove.field(_points(m, u, np.linspace(-length, length, 101)).reshape(-1, 3)).reshape(len(u), -1)
        true, ways = field.min(), field.min(axis=1)
        level = float(rng.choice([-1.0, 0.5, 5.0]))
        crossed = u[(ways <= level).argmax()] if (ways <= level).any() else 2.0
        for room in (3, 12, 100, 20_000):
            heap, out = np.full((max(1024, room) + 2, 5), np.nan), np.empty(4)
            count = least(*sizes, 0.0, 1.0, 1e-6, room, heap[:-2], out)
            value, at, along, bound = out
            assert np.isnan(heap[-2:]).all()
            assert bound <= min(true + 1e-12, value)
            assert value == pytest.approx(groove.field(_points(m, [at], [along])[0])[0], abs=1e-11)
            assert abs(along) <= length
            if room == 20_000:
                assert value - bound <= 1e-6
                assert value <= true + 1e-6
                assert count < room
            first(*sizes, level, 1e-6, heap[: room + 1024], out)
            hit, until = out[:2]
            early += until < hit
            assert until <= hit
            assert not (ways[u < min(until, hit) - 1e-12] <= level - 1e-6).any()
            assert hit == 2.0 or ways[np.abs(u - hit) <= 0.005].min() <= level + 1.0
            if room == 20_000 and hit == 2.0 and until == 1.0:
                assert crossed == 2.0
            if until >= min(hit, 1.0):
                assert hit <= crossed + 1e-12
    assert early > 0
