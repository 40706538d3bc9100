"""Least distance and first contact along a motion, by branch and bound over the time: knows no geometry.

A search asks for the distance of two bodies at single times, as an interval, and bounds it between two times from
below. It halves the stretch of time that decides, until its bound does, or until it has asked as often as it may.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from typing import NamedTuple

DistanceAt = Callable[[float, float], tuple[float, float]]
"""Lower and upper bound (mm) of the distance at a time, and how far (mm) it can change in the time it is asked for."""
BoundBetween = Callable[[float, float, float], float]
"""Lower bound (mm) of the distance between two times; the last argument is one (mm) that is known already."""
Spent = Callable[[], float]
"""The share of its budget of work that a search has spent: at 1 it ends."""

ACCURACY = 1e-6
"""Default accuracy of a search, mm."""


class Least(NamedTuple):
    """The least distance: it is ``upper`` mm at time ``t`` (or less), and nowhere below ``lower`` mm."""

    t: float
    lower: float
    upper: float


class _Stretch(NamedTuple):
    """A stretch of time with lower bounds of the distance at both ends; the first in order is the lowest."""

    lower: float
    start: float
    stop: float
    at_start: float
    at_stop: float


def bound_by_speed(at_start: float, at_stop: float, way: float) -> float:
    """Lower bound of a distance between two times, ``at_start`` and ``at_stop`` mm at these.

    Lemma: a distance changes no faster than the fastest point of the moving body moves. On a way of ``way`` mm it is at
    least ``at_start - x`` and ``at_stop - (way - x)`` after x mm, and the larger of the two is no less than their mean,
    nor than either at its far end (but for the rounding of these numbers).

    >>> bound_by_speed(3.0, 2.0, 4.0)
    0.5
    >>> bound_by_speed(9.0, -math.inf, 4.0)
    5.0
    """
    return max(0.5 * (at_start + at_stop - way), max(at_start, at_stop) - way)


def least(
    distance: DistanceAt,
    speed: float,
    *,
    bound: BoundBetween | None = None,
    accuracy: float = ACCURACY,
    spent: Spent = lambda: 0.0,
    is_enough: Callable[[float, float], bool] = lambda lower, upper: False,
) -> Least:
    """Find the least distance between the times 0 and 1.

    Parameters
    ----------
    distance : callable
        Lower and upper bound (mm) of the distance at a time. Its other argument is how far (mm) the distance can change
        between there and the ends of the stretch: where it is greater by that, it needs no sharp bounds.
    speed : float
        How fast it changes at most, mm per unit of time.
    bound : callable, optional
        Another lower bound (mm) between two times, asked for where the speed does not decide.
    accuracy : float
        How far the bounds of the answer may be apart, mm, besides those of ``distance``.
    spent : callable, optional
        The share of its budget that the search has spent; the bounds are further apart where that is not enough, as it
        is where those of ``distance`` are.
    is_enough : callable, optional
        Whether bounds (mm) of the answer are sharp enough to end the search.

    Examples
    --------
    >>> answer = least(lambda t, way: (abs(t - 0.25),) * 2, 1.0, accuracy=1e-9)
    >>> answer.t, answer.lower, answer.upper
    (0.25, 0.0, 0.0)
    """
    start, stop = distance(0.0, speed), distance(1.0, speed)
    t, upper = (0.0, start[1]) if start[1] <= stop[1] else (1.0, stop[1])
    heap = [_bounded(_Stretch(-math.inf, 0.0, 1.0, start[0], stop[0]), speed, bound, upper - accuracy)]
    lower = math.inf  # of all stretches that no time parts
    while heap and heap[0].lower < upper - accuracy and spent() < 1.0:
        if is_enough(min(heap[0].lower, lower), upper):
            break
        stretch = heapq.heappop(heap)
        middle = _meeting(stretch, speed)
        if not stretch.start < middle < stretch.stop:
            lower = min(lower, stretch.lower)
            continue
        here = distance(middle, _way(stretch, middle, speed))
        if here[1] < upper:
            t, upper = middle, here[1]
        for half in _halves(stretch, middle, here[0]):
            heapq.heappush(heap, _bounded(half, speed, bound, upper - accuracy))
    return Least(t, min([lower, upper, *(stretch.lower for stretch in heap[:1])]), upper)


def first_time(
    distance: DistanceAt,
    speed: float,
    level: float,
    *,
    bound: BoundBetween | None = None,
    accuracy: float = ACCURACY,
    spent: Spent = lambda: 0.0,
) -> float | None:
    """Find the first time between 0 and 1 at which the distance is at most ``level`` mm; None if it never is.

    The other parameters are those of `least`. The time is never late: a stretch is left behind only where its lower
    bound is above the level. It is early where the distance stays within the accuracy of the level, where the bounds of
    ``distance`` are on both sides of it, or where the search ended.

    Examples
    --------
    >>> round(first_time(lambda t, way: (1.0 - t,) * 2, 1.0, 0.25), 5)
    0.75
    """
    at_start, _ = distance(0.0, speed)
    if at_start <= level:
        return 0.0
    todo = [_Stretch(-math.inf, 0.0, 1.0, at_start, distance(1.0, speed)[0])]
    while todo:
        stretch = _bounded(todo.pop(), speed, bound, level)
        if stretch.lower > level:
            continue
        middle = 0.5 * (stretch.start + stretch.stop)
        is_short = (stretch.stop - stretch.start) * speed <= accuracy or not stretch.start < middle < stretch.stop
        if is_short or spent() >= 1.0:
            return stretch.start
        here, _ = distance(middle, _way(stretch, middle, speed))
        todo += reversed(_halves(stretch, middle, here))
    return None


def _bounded(stretch: _Stretch, speed: float, bound: BoundBetween | None, enough: float) -> _Stretch:
    """A stretch with its bound by the speed, and where that is below ``enough`` with the caller's own."""
    way = speed * (stretch.stop - stretch.start)
    lower = max(stretch.lower, bound_by_speed(stretch.at_start, stretch.at_stop, way))
    if lower < enough and bound is not None:
        lower = max(lower, bound(stretch.start, stretch.stop, lower))
    return stretch._replace(lower=lower)


def _halves(stretch: _Stretch, middle: float, here: float) -> tuple[_Stretch, _Stretch]:
    """Both parts of a stretch, with what is known of the whole; ``here``: lower bound at the time between them."""
    return stretch._replace(stop=middle, at_stop=here), stretch._replace(start=middle, at_start=here)


def _way(stretch: _Stretch, middle: float, speed: float) -> float:
    """How far (mm) the distance can change between a time in a stretch and its ends."""
    return speed * max(middle - stretch.start, stretch.stop - middle)


def _meeting(stretch: _Stretch, speed: float) -> float:
    """The time at which the two bounds by the speed meet: the lowest that the distance can be is there."""
    middle = 0.5 * (stretch.start + stretch.stop)
    meeting = middle + 0.5 * (stretch.at_start - stretch.at_stop) / speed if speed > 0.0 else middle
    return meeting if stretch.start < meeting < stretch.stop else middle
