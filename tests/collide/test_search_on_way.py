"""The searches over a motion, asked about pairs whose distance at each time is a formula."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d import shapes
from clamp3d.collide.answer import Distance
from clamp3d.collide.model import ModelCache
from clamp3d.collide.moving_pair import ACCURACY, MovingPair, box_corners, first_time, least_distance
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.linear import to_target
from clamp3d.core.motion import Motion
from clamp3d.core.pose import rotation, translation
from tests.kinds import faceted_shape

TIMES = np.linspace(0.0, 1.0, 20_001)
NONE = Thresholds(1e-6)


class Cones:
    """A pair whose distance comes down to some times, and goes up from them, as fast as its speed allows.

    It is known to within ``error`` mm, and over a stretch by the speed alone. ``meshed``: as a pair whose stretches
    have been bounded by meshes is.
    """

    def __init__(self, seed: int, error: float, above: float, meshed: bool = False) -> None:
        rng = np.random.default_rng(seed)
        self.speed, self.when = rng.uniform(0.5, 20.0), rng.uniform(0.0, 1.0, 6)
        self.low = rng.uniform(0.0, 0.3, 6) * self.speed
        self.error, self.meshed, self.shift, self.left_open = error, meshed, 0.0, 0.0
        self.shift = above - self.least()
        self.asked: list[float] = []
        self.stretches: list[tuple[float, float]] = []

    def at(self, t):
        return self.shift + (self.low + self.speed * np.abs(np.subtract.outer(t, self.when))).min(axis=-1)

    def least(self):
        return float(self.at(self.when).min())

    def ask(self, t, enough, thresholds):
        self.asked.append(t)
        value = float(self.at(t))
        known = Distance(value - 0.3 * self.error, value + 0.7 * self.error)
        enough(known)
        return known

    def lower(self, t, half, here, wanted, meshes=None):
        assert t - half >= -1e-12
        assert t + half <= 1.0 + 1e-12
        if meshes is None:
            self.by_meshes(t, half, wanted)
        return here - self.speed * half

    def by_meshes(self, t, half, wanted):
        self.stretches.append((t, half))
        return float(self.at(t)) - self.speed * half


pairs = st.builds(
    Cones,
    st.integers(0, 10**6),
    st.sampled_from([0.0, 1e-3, 0.05]),
    st.sampled_from([0.0, 0.01, 0.3, 5.0]),
    st.booleans(),
)


@settings(max_examples=60, deadline=None)
@given(pairs, st.sampled_from([NONE, Thresholds(0.01, 0.5)]))
def test_the_least_distance_of_cones(pair, thresholds):
    """No time is below ``lower``; ``upper`` is known at the time named; no wider apart than the answers and 2 %."""
    found, t = least_distance(pair, thresholds, None)
    truth = pair.least()
    assert found.lower <= min(truth, found.upper) + 1e-9
    assert found.upper == pytest.approx(float(pair.at(t)) + 0.7 * pair.error, abs=1e-12)
    assert t in pair.asked
    assert truth - 1e-7 <= found.upper
    width = max(2.0 * ACCURACY, 0.02 * abs(found.upper), 2.0 * pair.error) + pair.error + 2.0 * ACCURACY
    assert found.upper - found.lower <= width


@settings(max_examples=60, deadline=None)
@given(pairs, st.sampled_from([0.0, 0.01, 0.2]), st.sampled_from([-0.05, -1e-4, 0.0, 0.1]))
def test_the_first_time_of_cones(pair, deep, margin):
    """Cones that come down to the margin: never later than they do, and no earlier than they nearly do."""
    pair.shift += margin - deep - pair.least()
    times = np.union1d(TIMES, pair.when)
    values = pair.at(times)
    least, known = pair.least(), float(pair.when[np.argmin(pair.at(pair.when))])
    first = first_time(pair, known, NONE, margin)
    assert first <= known
    assert values[first > times].min(initial=math.inf) >= margin - 1e-9
    near = values <= margin + 1.1 * pair.error + 1.5 * ACCURACY
    assert first >= times[near][0] - 1.1 * ACCURACY / pair.speed - 1e-4 or least > margin


def test_the_first_time_is_the_end_where_nothing_comes_near():
    pair = Cones(3, 0.0, 1.0)
    assert first_time(pair, 0.7, NONE, 0.5) == 0.7


def test_meshes_are_asked_once_about_a_stretch():
    for seed in range(5):
        pair = Cones(seed, 0.0, -1.0, meshed=True)
        first_time(pair, float(pair.when[np.argmin(pair.at(pair.when))]), NONE, 0.0)
        assert len(pair.stretches) == len(set(pair.stretches)) > 5


def test_a_search_that_takes_too_long_tells_what_it_has_proven(monkeypatch):
    """Only what is before the leftmost open stretch is free; of the least distance the bounds are wide, not wrong."""
    monkeypatch.setattr("clamp3d.collide.moving_pair.MAX_STEPS", 12)
    for seed in range(10):
        pair = Cones(seed, 0.0, -1.0)
        values = pair.at(TIMES)
        first = first_time(pair, float(pair.when[np.argmin(pair.at(pair.when))]), NONE, 0.0)
        assert values[first > TIMES].min(initial=math.inf) >= 0.0
        pair = Cones(seed, 0.0, 0.1)
        assert least_distance(pair, NONE, None)[0].lower <= pair.least() + 1e-9


@pytest.mark.parametrize("angle", [0.0, 0.8])
def test_a_stretch_is_bounded_by_what_each_method_says(angle):
    """A box that slides or turns off a plate: each bound holds, and none is idle."""
    plate, block = shapes.box((60.0, 60.0, 4.0)), shapes.box((6.0, 4.0, 2.0))
    start = translation(0.0, 0.0, 8.0) @ rotation((0.0, 0.0, 1.0), 0.3)
    way = Motion.screw((0.0, 1.0, 0.0), angle, point=(0.0, 0.0, 8.0)) if angle else Motion.translate((10.0, 0.0, 0.0))

    def least(low, high):
        found = math.inf
        for t in np.linspace(low, high, 101):
            P = way.at(t, start)
            found = min(found, P[2, 3] - 2.0 - 0.5 * np.abs(P[2, :3] @ np.diag([6.0, 4.0, 2.0])).sum())
        return found

    cache = ModelCache()
    corners = np.array(list(itertools.product((-3.0, 3.0), (-2.0, 2.0), (-1.0, 1.0))))
    for a, b in ((block, plate), (faceted_shape(block, 0.3), faceted_shape(plate, 0.3))):
        pair = MovingPair(cache.model(a), cache.model(b), way, start, np.eye(4))
        step = to_target(way.at(1e-6, start), corners) - to_target(start, corners)
        assert pair.speed >= 1e6 * np.linalg.norm(step, axis=1).max() - 1e-6
        for t, half in ((0.5, 0.5), (0.3, 0.1), (0.9, 0.05)):
            truth, here = least(t - half, t + half), least(t, t)
            for bound in (pair.lower(t, half, here, math.inf), pair.by_meshes(t, half, here)):
                assert bound <= truth + 1e-9
                # A turn costs the sagitta of the furthest corner, 3.75 mm from the axis.
                assert bound >= truth - 0.5 * (angle * half) ** 2 * 3.75 - ACCURACY
            assert pair.lower(t, half, here, here - pair.speed * half) == here - pair.speed * half


@pytest.mark.parametrize("mesh", [False, True])
@pytest.mark.parametrize("pin", [False, True])
@pytest.mark.parametrize("when", [0.25, 0.5, 0.75])
def test_what_swings_past_between_two_times_is_bounded(when, pin, mesh):
    """A body on an arm turns by nearly half a circle: it comes closest to a wall where its way bows out most."""
    size, arm, angle = 0.4, 20.0, 3.0
    moving, wall = (
        (shapes.cylinder(size, 2.0 * size) if pin else shapes.box((size, size, size))),
        shapes.box((200, 2, 50)),
    )
    T_wall = translation(0.0, arm + 1.5 * size + 1.1, 0.0)
    way = Motion.screw((0.0, 0.0, 1.0), angle)
    start = rotation((0.0, 0.0, 1.0), -when * angle) @ translation(0.0, arm, 0.0)
    cache = ModelCache()
    swung, still = cache.model(faceted_shape(moving, 0.3) if mesh else moving), cache.model(wall)
    pairs = (
        MovingPair(swung, still, way, start, T_wall),
        MovingPair(still, swung, Motion.screw((0.0, 0.0, 1.0), -angle), T_wall, start),  # the wall goes round
    )
    for t, half in ((0.5, 0.5), (when, 0.2), (0.3, 0.25)):
        truth = here = math.inf
        for s in [t, *np.linspace(t - half, t + half, 101)]:
            P = way.at(s, start)
            reach = size if pin else 0.5 * size * np.abs(P[1, :2]).sum()
            gap = T_wall[1, 3] - 1.0 - P[1, 3] - reach
            truth, here = min(truth, gap), (gap if s == t else here)
        lost = 0.3 if mesh and pin else 1e-3
        for pair in pairs:
            assert pair.lower(t, half, here, here) <= truth + lost


def test_what_a_way_has_no_time_for_is_not_asked():
    """Poses of a pair are those of the standing body as the moving one sees it."""
    way, start, T_still = Motion.translate((3.0, 0.0, 0.0)), translation(1.0, 2.0, 3.0), translation(0.0, 5.0, 0.0)
    cache = ModelCache()
    pair = MovingPair(
        cache.model(shapes.box((1.0, 1.0, 1.0))), cache.model(shapes.box((2.0, 2.0, 2.0))), way, start, T_still
    )
    assert pair.pose(0.5) == pytest.approx(translation(-2.5, 3.0, -3.0))
    model = SimpleNamespace(bounds=np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]))
    corners = box_corners(model, translation(10.0, 0.0, 0.0))
    assert sorted(map(tuple, corners)) == [(10.0 + x, y, z) for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)]


def test_a_search_ends_where_stretches_tell_no_more_and_the_verdict_is_certain():
    class Along:
        """0.5 mm apart all the way, over any stretch known to 0.02 mm: a pin from CAD in its hole."""

        speed, left_open, count = 20.0, 0.0, 0

        def ask(self, t, enough, thresholds):
            self.count += 1
            return Distance(0.4995, 0.5)

        def lower(self, t, half, here, wanted):
            return max(0.48, here - self.speed * half)

    pair = Along()
    found, _ = least_distance(pair, Thresholds(), None)
    assert (found.lower, found.upper) == (0.48, 0.5)
    assert pair.count < 100
