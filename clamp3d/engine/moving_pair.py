"""One body that moves against one that stands: distances at a time and over a stretch, and the first contact."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.model import DRAWN_CHORDS, Model, box_corners
from clamp3d.engine.motion_search import ACCURACY, Spent, first_time, least
from clamp3d.engine.refine import accuracy_for, from_boxes, refine, with_normal
from clamp3d.engine.swept import HALF_TURN, swept_lower
from clamp3d.engine.verdict import Thresholds, Verdict
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, inverse, to_target

CHECKED = 1e-4
"""The same for the least distance of a scene's motion whose verdict is certain: it is a number to print."""
SHARPENING = 0.04
"""Share of its budget after which any bounds of a verdict that is certain end a search."""
BUDGET = 5000
"""Work of one search, in evaluations by closed forms or meshes, which take about a millisecond."""
_HEAVY = 50
"""How many of those one by Open CASCADE counts for, or one that needs the common part of two meshes."""
_FINE = 20
"""The same for one that asks for the finest meshes of drawn bodies, of thousands of triangles each."""
_UNINFORMATIVE = 8
"""Swept bounds in a row that said no more than the speed, after which they are no longer asked for."""


class First(NamedTuple):
    """A first contact: there is none before ``t``, and one at ``by`` at the latest; inf if no time was seen with one.

    They are as good as one unless the budget ended, or the bodies stay within the accuracy of contact.
    """

    t: float
    by: float


class _CertainError(Exception):
    """Ends a search whose verdict is certain."""


class MovingPair:
    """A shape that moves against one that stands; all distances are in the moving shape's frame."""

    accuracy = ACCURACY
    """A first contact and a least distance are searched to within this (mm), or to what the models give."""
    overlaps = 64
    """Times at which a pair is looked at after it was seen to overlap, for a deeper one."""

    def __init__(self, moving: Model, still: Model, motion: Motion, start: Array, T_still: Array) -> None:
        self.a, self.b = moving, still
        self.motion, self.start, self.back = motion, start, inverse(T_still)
        self.speed = motion.speed(to_target(start, box_corners(moving.bounds)))
        self.evaluations = 0
        self.work = 0
        self._known = accuracy_for(moving, still, 0.0)
        self._uninformative = 0

    def pose(self, t: float) -> Array:
        """The standing shape (4, 4) in the moving shape's frame."""
        return inverse(self.back @ self.motion.at(t, self.start))

    def at(self, t: float, enough: Enough) -> Distance:
        """Distance at time ``t``, refined until ``enough``."""
        self.evaluations += 1
        T, before = self.pose(t), self.a.counters.queries["meshes"]
        distance = refine(self.a, self.b, T, from_boxes(self.a, self.b, T), enough, cad_forms=True)
        meshes = self.a.counters.queries["meshes"] - before
        if distance.level == "exact" or (distance.level == "meshes" and distance.lower <= 0.0):
            self.work += _HEAVY
        else:
            self.work += _FINE if meshes == len(DRAWN_CHORDS) else 1
        return distance

    def budget(self) -> Spent:
        """A new budget of work for a search."""
        start = self.work
        return lambda: (self.work - start) / BUDGET

    def as_seen(self, distance: Distance, t: float) -> Distance:
        """A distance at time ``t`` as the standing shape sees it, where that stands in the origin."""
        return with_normal(distance.moved(self.motion.at(t, self.start)).swapped())

    def reached(self, first: float, level: float) -> float:
        """Where the distance comes down to ``level`` mm, for a ``first`` time that is never late: that time itself."""
        return first

    def between(self, start: float, stop: float, by_speed: float = 0.0) -> float:
        """Lower bound (mm) of the distance between two times, from swept shapes; minus infinity if they say nothing.

        They are asked for as long as they are above what the speed says, ``by_speed``, now and then.
        """
        if self._uninformative >= _UNINFORMATIVE or not (self.a.closed and self.b.closed):
            return -np.inf
        middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
        angle = self.motion.angle * half
        if abs(angle) >= HALF_TURN:  # shorter stretches may say something
            return -np.inf
        poses = (self.pose(start), self.pose(middle), self.pose(stop))
        lower = swept_lower(self.a, self.b, *poses, angle=angle, screw=self.motion.is_screw)
        self._uninformative = 0 if lower > by_speed else self._uninformative + 1
        return lower

    def least_distance(
        self, thresholds: Thresholds | None = None, allowance: float | None = None
    ) -> tuple[Distance, float]:
        """Least distance on the way, and its time; with ``thresholds`` sharp where that is cheap or they need it."""
        best, t_best, overlaps = Distance(), 0.0, 0

        def distance(t: float, way: float) -> tuple[float, float]:
            nonlocal best, t_best, overlaps
            here = self._sharp(t, best.upper + way, thresholds)
            if here.upper < best.upper:
                best, t_best = here, t
                if thresholds is not None and thresholds.verdict(here, allowance) is Verdict.CLASH:
                    raise _CertainError
            overlaps += best.upper < -ACCURACY
            if overlaps > self.overlaps:  # no bound here says how deep the deepest overlap is
                raise _CertainError
            return here.lower, here.upper

        def is_certain(lower: float, upper: float) -> bool:
            if thresholds is None or thresholds.verdict(Distance(lower, upper), allowance) is Verdict.UNCERTAIN:
                return False
            return upper - lower <= CHECKED or spent() >= SHARPENING

        spent = self.budget()
        try:
            bounds = least(
                distance, self.speed, bound=self.between, accuracy=self.accuracy, spent=spent, is_enough=is_certain
            )
        except _CertainError:
            return replace(best, lower=-np.inf), t_best
        return replace(best, lower=min(bounds.lower, best.upper)), t_best

    def _sharp(self, t: float, most: float, thresholds: Thresholds | None) -> Distance:
        """The distance at ``t``, refined as far as it can matter: known, deep enough, or more than ``most`` mm."""

        def enough(distance: Distance) -> bool:
            width = distance.upper - distance.lower
            if width <= self._width(self.accuracy) or distance.lower >= most:
                return True
            if thresholds is None:  # of an overlap nothing is searched that the distance at one time does not tell
                return distance.upper < -ACCURACY
            verdict = thresholds.verdict(distance)
            is_known = width <= self._width(CHECKED) and verdict is not Verdict.UNCERTAIN
            return is_known or verdict in (Verdict.CLASH, Verdict.CONTACT)

        return self.at(t, enough)

    def _width(self, accuracy: float) -> float:
        """Width (mm) of a distance that is known for a search to within ``accuracy`` mm."""
        return max(self._known, 0.5 * accuracy)

    def first_time(self, level: float, seen: float = np.inf) -> First | None:
        """When they first come within ``level`` mm; None if all of the way is proven to be further apart.

        ``seen``: a time at which they are known to be so near.
        """
        by, touching = seen, level + self.accuracy + self._width(self.accuracy)

        def distance(t: float, way: float) -> tuple[float, float]:
            nonlocal by

            def enough(distance: Distance) -> bool:
                width = distance.upper - distance.lower
                return width <= self._width(self.accuracy) or distance.lower > level + way or distance.upper <= level

            here = self.at(t, enough)
            by = min(by, t) if here.upper <= touching else by
            return here.lower, here.upper

        bound, spent = self.between, self.budget()
        t = first_time(distance, self.speed, level, bound=bound, accuracy=self.accuracy, spent=spent)
        return None if t is None else First(t, max(by, t))
