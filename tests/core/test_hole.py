"""The shortest way into a hole by the kernel, against pins that are only points: sampled, cut by the plate, moved."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from clamp3d.core.kernel_hole import CUTS, furthest, hole


def _across(pin, low, high, count):
    """Points (n, 2) around what of a pin lies between two planes, every corner of its outline among them."""
    cx, cy, cz, s, k, r, l = pin  # noqa: E741
    turns = [np.linspace(-np.pi, np.pi, count + 1)]
    for end, plane in itertools.product((-l, l), (low, high)):  # where a plane cuts a rim
        if abs(at := cz + end * k - plane) < r * s:
            turns.append(np.arccos(at / (r * s)) * np.array([-1.0, 1.0]))
    turn = np.concatenate(turns)
    u, v = r * np.cos(turn), r * np.sin(turn)
    first, last = np.full(len(u), -l), np.full(len(u), l)
    if k > 1e-9:
        first, last = np.maximum(first, (low - cz + u * s) / k), np.minimum(last, (high - cz + u * s) / k)
    else:
        last[(cz - u * s < low - 1e-12) | (cz - u * s > high + 1e-12)] = -np.inf
    cut = first <= last + 1e-12  # rounding of the corners
    ends = [np.column_stack([cx + t * s + u * k, cy + v])[cut] for t in (first, last)]
    return np.vstack(ends)


def _shortest(points, R):
    """Length of the shortest translation in the plane that brings points (n, 2) into a circle: one or two decide."""
    kept, t = [], np.zeros(2)
    while (off := np.linalg.norm(points + t, axis=1)).max() > R * (1.0 + 1e-12):
        if int(off.argmax()) in kept:
            return np.inf
        kept.append(int(off.argmax()))
        P = points[kept]
        size = np.linalg.norm(P, axis=1)
        i, j = np.triu_indices(len(P), 1)
        gap, middle = P[j] - P[i], -0.5 * (P[i] + P[j])
        half = 0.5 * np.linalg.norm(gap, axis=1)
        reach = np.sqrt(np.maximum(R * R - half * half, 0.0)) / (2.0 * half)
        side = reach[:, None] * np.stack([-gap[:, 1], gap[:, 0]], axis=1)
        ways = np.vstack([P * (R / size - 1.0)[:, None], middle + side, middle - side])
        fits = (np.linalg.norm(ways[:, None] + P, axis=2) <= R * (1.0 + 5e-13)).all(axis=1)
        if not fits.any():
            return np.inf
        ways = ways[fits]
        t = ways[(ways**2).sum(axis=1).argmin()]
    return float(np.linalg.norm(t))


def _found(pin, R, H, limit, tolerance, most=5000, waiting=1000):
    """Bounds and translation of the kernel, and the stretches that it looked at."""
    out, rows = np.empty(5), np.empty((4, CUTS))
    work = (rows, np.empty(4), *np.empty((4, CUTS)), np.empty((4, CUTS + 1)), np.empty(4))
    heap = np.full((waiting + 4, 5), np.nan)
    count = hole(np.array(pin), R, H, limit, tolerance, most, heap[:waiting], *work, out)
    assert np.isnan(heap[waiting:]).all()
    return float(out[0]), float(out[1]), out[2:], count


def _pins(rng, count):
    """Pins near a hole of radius 1 and half its depth: upright, leaning, lying; flat and long, thin and too thick."""
    for k in range(count):
        lean = [0.0, 1e-7, rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.5), rng.uniform(0.0, 1.57), 0.5 * np.pi][k % 6]
        radius = rng.choice([rng.uniform(0.05, 0.95), 0.999, 1.1], p=[0.8, 0.1, 0.1])
        middle = rng.normal(size=3) * [0.5, 0.5, 1.0]
        if k % 4 == 0:
            middle[1] = 0.0
        yield (
            (*middle, np.sin(lean), np.cos(lean), radius, rng.choice([0.05, 0.5, 5.0])),
            10.0 ** rng.uniform(-1.0, 0.3),
        )


def test_the_furthest_point_of_a_cut_pin():
    rng = np.random.default_rng(0)
    for pin, H in _pins(rng, 300):
        low, high = sorted(rng.uniform(-H, H, 2)) if rng.random() < 0.5 else (-H, H)
        points = _across(pin, low, high, 2000)
        for angle in (*rng.uniform(-np.pi, np.pi, 4), 0.0, 0.5 * np.pi, np.pi):
            n = np.array([np.cos(angle), np.sin(angle)])
            height, *at = furthest(*n, low, high, pin)
            if not len(points):
                assert height < -1e300
                continue
            best = float((points @ n).max())
            assert best - 1e-9 <= height <= best + 1e-5
            assert height == pytest.approx(n @ at, abs=1e-12)
            assert np.linalg.norm(points - at, axis=1).min() <= 2e-2  # a point of the pin


def test_the_way_into_a_hole_is_the_shortest_that_leads_there():
    """Moved by it the pin is in the hole; no way that a search of points finds is shorter than the lower bound."""
    rng = np.random.default_rng(1)
    inside = none = 0
    for pin, H in _pins(rng, 120):
        limit, size = rng.choice([0.3, 3.0]), np.abs(pin).sum() + 1.0 + 2.0 * H
        lower, upper, t, _ = _found(pin, 1.0, H, limit, 1e-7 * size)
        assert 0.0 <= lower <= upper <= limit
        assert upper - lower <= 1.01e-7 * size
        if upper < limit:
            inside += 1
            assert np.linalg.norm(t) == pytest.approx(upper, abs=1e-12)
            moved = (pin[0] + t[0], pin[1] + t[1], pin[2] + t[2], *pin[3:])
            around = _across(moved, -H + 3e-12 * size, H - 3e-12 * size, 2000)
            assert np.linalg.norm(around, axis=1).max(initial=0.0) <= 1.0 + 1e-12
        else:
            none += 1
            assert (t == 0.0).all()

        def way(z, pin=pin, H=H):
            points = _across((pin[0], pin[1], pin[2] + z, *pin[3:]), -H, H, 128)
            # Between two samples the outline bulges by no more than this.
            bulge = pin[5] * (1.0 - np.cos(np.pi / 128)) / max(pin[4], 1e-3)
            return np.hypot(z, _shortest(points, 1.0 - bulge)) if len(points) else np.inf

        heights = np.linspace(-limit, limit, 41)
        ways = [way(z) for z in heights]
        near = heights[int(np.argmin(ways))]
        ways += [way(near + dz) for dz in np.linspace(-0.05, 0.05, 11) * limit]
        assert min(ways) >= lower - 1e-12
        # Whoever asks for less, in tolerance, stretches or room for them, is told a wider bound, but a true one.
        for tolerance, most, waiting in ((0.1, 5000, 1000), (0.5, 5000, 1000), (1e-7, 4, 1000), (1e-7, 400, 3)):
            rough, best, _, count = _found(pin, 1.0, H, limit, tolerance * size, most, waiting)
            assert rough <= upper
            assert lower <= best <= limit
            assert count <= most + 40
    assert min(inside, none) >= 20


def test_a_corner_of_the_cut_pin_may_be_what_keeps_it_out():
    """Round it is furthest from the hole's axis nearly everywhere; a corner of its outline is by 1e-4 further."""
    pin = (0.38531564, -0.05582286, -0.25766232, 0.47390461, 0.88057619, 0.999, 0.05)
    lower, upper, t, _ = _found(pin, 1.0, 1.7793352092829975, 3.0, 1e-7)
    assert upper - lower <= 1.01e-7
    moved = (*(np.array(pin[:3]) + t), *pin[3:])
    assert np.linalg.norm(_across(moved, -1.77933520928, 1.77933520928, 2000), axis=1).max() <= 1.0 + 1e-11
