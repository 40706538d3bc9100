"""The search over time, on distances that are formulas of the time."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from clamp3d.engine.motion_search import bound_by_speed, first_time, least

times = st.floats(0.0, 1.0)


def exactly(f):
    return lambda t, way: (f(t), f(t))


@given(st.lists(st.tuples(times, st.floats(-2.0, 5.0)), min_size=1, max_size=6), times, times)
def test_bound_by_speed_is_below_every_distance_of_that_speed(peaks, start, stop):
    """Cones of slope 3: their minimum is a distance that changes at most that fast."""
    start, stop = sorted((start, stop))

    def f(t):
        return min(v + 3.0 * abs(t - p) for p, v in peaks)

    for at_start, at_stop in ((f(start), f(stop)), (-9.0, f(stop)), (f(start), -9.0)):  # nothing is known of the end
        low = bound_by_speed(at_start, at_stop, 3.0 * (stop - start))
        assert all(f(start + k / 50.0 * (stop - start)) >= low - 1e-12 for k in range(51))


@given(st.lists(st.tuples(times, st.floats(0.0, 5.0)), min_size=1, max_size=6))
def test_least_and_first_time_of_the_minimum_of_cones(peaks):
    def f(t):
        return min(v + 3.0 * abs(t - p) for p, v in peaks)

    value = min(v for _, v in peaks)
    answer = least(exactly(f), 3.0, accuracy=1e-6)
    assert answer.lower - 1e-12 <= value <= answer.upper <= answer.lower + 1e-6  # the rounding of the cones
    assert f(answer.t) == answer.upper
    level = value + 0.5
    first = max(0.0, min(p - (level - v) / 3.0 for p, v in peaks if v <= level))
    assert first - 1e-6 <= first_time(exactly(f), 3.0, level, accuracy=1e-6) <= first + 1e-12
    assert first_time(exactly(f), 3.0, value - 1e-3) is None


def test_a_distance_is_asked_for_with_how_far_it_can_change_in_its_stretch():
    """Where the bounds by the speed 8 from both ends meet, the search asks; the first contact halves its stretch."""
    ways = []

    def distance(t, way):
        ways.append((t, way))
        return (4.0 + 4.0 * t,) * 2

    answer = least(distance, 8.0, accuracy=0.1)
    assert (answer.t, answer.upper, 3.9 <= answer.lower <= 4.0) == (0.0, 4.0, True)
    assert ways[:4] == [(0.0, 8.0), (1.0, 8.0), (0.25, 6.0), (0.0625, 1.5)]
    ways.clear()
    first = first_time(lambda t, way: distance(1.0 - t, way), 8.0, 6.0, accuracy=0.1)
    assert first == pytest.approx(0.5, abs=0.1 / 8.0)
    assert ways[:4] == [(1.0, 8.0), (0.0, 8.0), (0.5, 4.0), (0.75, 2.0)]


@given(st.lists(st.tuples(times, st.floats(0.0, 5.0)), min_size=1, max_size=6), st.floats(0.0, 2.0))
def test_a_distance_that_is_large_enough_for_its_stretch_may_be_known_loosely(peaks, off):
    value = min(v for _, v in peaks)

    def f(t):
        return min(v + abs(t - p) for p, v in peaks)

    def measured(level):
        def distance(t, way):
            return (f(t) - off, f(t) + off) if f(t) - off > level + way else (f(t), f(t))

        return distance

    answer = least(measured(value), 3.0)
    assert answer.upper - 1e-6 <= answer.lower <= value + 1e-12 <= answer.upper + 1e-11
    first = first_time(measured(value + 0.5), 3.0, value + 0.5)
    assert first == pytest.approx(first_time(exactly(f), 3.0, value + 0.5), abs=1e-6)


def test_intervals_give_bounds_that_hold_and_first_times_that_are_never_late():
    count = 0

    def between(t, way):
        nonlocal count
        count += 1
        return abs(t - 0.5) - 0.01, abs(t - 0.5) + 0.02

    answer = least(between, 1.0, spent=lambda: count / 1000)
    assert answer.lower == pytest.approx(-0.01, abs=1e-6)
    assert answer.upper == pytest.approx(0.02, abs=1e-6)
    assert first_time(between, 1.0, 0.1) == pytest.approx(0.39, abs=2e-6)
    assert first_time(between, 1.0, 0.495) == 0.0  # it is not known of the start


class Counted:
    """A distance that does not change, and how often it was asked for."""

    def __init__(self, value):
        self.value, self.times = value, 0

    def __call__(self, t, way):
        self.times += 1
        return self.value, self.value


def test_a_constant_distance_needs_a_bound_between_times_or_ends_undecided():
    assert first_time(Counted(0.01), 100.0, 0.0) is None
    near = Counted(1e-5)
    assert 0.0 < first_time(near, 100.0, 0.0, spent=lambda: near.times / 500) < 1e-3
    assert near.times == 500
    wide = least(near, 100.0, spent=lambda: (near.times - 500) / 500)
    assert wide.lower < 0.0 < wide.upper
    assert near.times == 1000
    bounded = Counted(1e-5)
    bounds = least(bounded, 100.0, bound=lambda *_: 1e-5)
    assert (bounds.lower, bounds.upper, bounded.times) == (1e-5, 1e-5, 2)
    assert first_time(bounded, 100.0, 0.0, bound=lambda *_: 1e-5) is None
    assert bounded.times == 4


def test_grazing_by_less_than_the_accuracy_is_reached_and_by_more_is_clear():
    def parabola(gap):
        return exactly(lambda t: gap + 4.0 * (t - 0.5) ** 2)

    assert first_time(parabola(1e-8), 4.0, 0.0) == pytest.approx(0.5, abs=1e-3)
    assert first_time(parabola(1e-5), 4.0, 0.0) is None
    assert least(parabola(1e-8), 4.0).t == pytest.approx(0.5, abs=1e-3)


def test_what_stands_still_is_searched_at_once():
    still = Counted(1.5)
    assert least(still, 0.0).upper == 1.5
    assert first_time(still, 0.0, 1.0) is None
    assert first_time(still, 0.0, 2.0) == 0.0
    assert still.times == 5
