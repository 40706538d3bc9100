"""One body that moves against one that stands: bounds at a time and over a stretch, least distance, first contact."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.model import FINEST_CAD, Model
from clamp3d.collide.refine import from_boxes, refine
from clamp3d.collide.swept import swept_lower
from clamp3d.collide.swept_pair import SweptPair
from clamp3d.collide.verdict import Thresholds, Verdict
from clamp3d.core.linear import dot, to_target
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array, inverse

ACCURACY = 1e-4
"""A least distance on a way is found to within this (mm), or to what the models give."""
MAX_STEPS = 2000
SPARE_STEPS = 100
"""Steps for a nearer time where what the models leave open at the times looked at leaves the verdict open."""
VAIN_STEPS = 24
"""Steps, and two for each stretch that waits, which may tell no more than a tenth of what is open of a least distance,
once the verdict is certain: what the models leave open over stretches no cut narrows."""
MAX_UNINFORMATIVE = 12
"""Answers in a row that told nothing, after which a method is not asked again."""


class MovingPair:
    """A shape that moves against one that stands: bounds at a time t, and over a stretch of times."""

    def __init__(self, moving: Model, still: Model, motion: Motion, start: Array, T_still: Array) -> None:
        self.a, self.b = moving, still
        self.motion, self.start, self.T_still, self.back = motion, start, T_still, inverse(T_still)
        self.meshes = SweptPair(moving, still, motion, start, T_still)
        self.counters = moving.counters
        self.speed = motion.speed(box_corners(moving, start))
        # How often in a row closed forms, and swept ones, had nothing to say: hulls in each other never have.
        self.n_uninformative = self.n_uninformative_swept = 0

    @property
    def meshed(self) -> bool:
        """Whether a stretch has been bounded by meshes, and that asks for less than a distance at a time."""
        return self.meshes.asked and not self.meshes.by_faces

    @property
    def left_open(self) -> float:
        """How much (mm) of a least distance two meshes of CAD leave open at their finest."""
        return 2.0 * FINEST_CAD if self.meshes.by_faces else 0.0

    def pose(self, t: float) -> Array:
        """The standing shape in the moving shape's frame."""
        return inverse(dot(self.back, self.motion.at(t, self.start)))

    def ask(self, t: float, enough: Callable[[Distance], bool], thresholds: Thresholds) -> Distance:
        """Distance at time ``t``, in the moving shape's frame."""
        T = self.pose(t)
        forms = self.n_uninformative < MAX_UNINFORMATIVE
        self.counters.queries["boxes"] += 1
        found = refine(self.a, self.b, T, from_boxes(self.a, self.b, T), thresholds, enough, forms=forms)
        self.n_uninformative = self.n_uninformative + 1 if found.level == "meshes" else 0
        return found

    def lower(self, t: float, half: float, here: float, wanted: float, meshes: float | None = None) -> float:
        """Lower bound from t - half to t + half, ``here`` being that at t; no better than ``wanted``.

        ``meshes``: what they have said of this stretch, where they have been asked.
        """
        plain = here - self.speed * half
        if plain >= wanted:
            return plain
        if self.meshes.by_faces and here > 0.0:
            return max(plain, self.by_meshes(t, half, min(wanted, here), apart=True))
        stretch = (self.pose(t - half), self.pose(t), self.pose(t + half))
        swept = plain
        if self.n_uninformative_swept < MAX_UNINFORMATIVE:
            self.counters.queries["swept"] += 1
            angle = self.motion.angle * half
            swept = max(plain, swept_lower(self.a, self.b, *stretch, angle=angle, screw=self.motion.is_screw))
        if swept >= min(wanted, here) - ACCURACY:
            self.n_uninformative_swept = 0
            return swept
        if meshes is None:
            meshes = self.by_meshes(t, half, min(wanted, here))
        told = swept > max(plain, meshes, -np.inf if wanted < 0.0 else 0.0)
        self.n_uninformative_swept = 0 if told else self.n_uninformative_swept + 1
        return max(swept, meshes)

    def by_meshes(self, t: float, half: float, wanted: float, apart: bool = False) -> float:
        """The same by meshes alone, and no better than just below ``wanted``; ``apart``: at t they certainly are."""
        return self.meshes.lower(t, half, wanted - 0.25 * ACCURACY, apart)


def box_corners(model: Model, T: Array) -> Array:
    """Corners (8, 3) of the box around a shape, placed by ``T`` (4, 4)."""
    pick = np.indices((2, 2, 2)).reshape(3, -1).T
    points = np.where(pick == 0, model.bounds[0], model.bounds[1])
    return np.asarray(to_target(T, points))


def least_distance(pair: MovingPair, thresholds: Thresholds, allowance: float | None) -> tuple[Distance, float]:
    """Least distance on the way, in the moving shape's frame, and its t.

    Branch and bound over t: a stretch is done when nothing in it can come below the best distance found.
    """
    best, at, reached = Distance(), 0.0, np.inf

    def clash(known: Distance) -> bool:
        return thresholds.verdict(known, allowance) is Verdict.CLASH

    def look(t: float, half: float, above: float) -> tuple[float, float]:
        nonlocal best, at, reached

        def enough(known: Distance) -> bool:
            sharp = known.upper - known.lower <= max(ACCURACY, 0.02 * abs(known.lower))
            return sharp or known.lower - pair.speed * half >= best.upper - ACCURACY or clash(known)

        found = pair.ask(t, enough, thresholds)
        reached = min(reached, found.lower)
        if found.upper < best.upper:
            best, at = found, t
        lower = pair.lower(t, half, found.lower, best.upper - ACCURACY) if half else found.lower
        return max(lower, above), found.lower

    heap: list[tuple[float, float, float, float]] = []
    for t, half in ((0.0, 0.0), (1.0, 0.0), (0.5, 0.5)):
        heapq.heappush(heap, (*look(t, half, -np.inf), t, half))
    floor = np.inf  # of stretches that were given up
    spare, nearest = SPARE_STEPS, best.upper
    vain, widest, waiting = 0, np.inf, 0
    for _ in range(MAX_STEPS):
        lower, here, t, half = heap[0]
        width = best.upper - min(floor, lower)
        limit = max(2.0 * ACCURACY, pair.left_open, 0.02 * abs(best.upper), 2.0 * (best.upper - best.lower))
        if best.upper < 0.0:  # depths take the longest
            limit = max(limit, 0.1 * thresholds.contact)
        verdict = thresholds.verdict(Distance(min(floor, lower), best.upper), allowance)
        if clash(best) or (width <= limit and verdict is not Verdict.UNCERTAIN) or width <= 2.0 * ACCURACY:
            break
        vain += 1
        if width <= 0.9 * widest:
            vain, widest, waiting = 0, width, len(heap)
        if vain >= max(VAIN_STEPS, 2 * waiting) and verdict is not Verdict.UNCERTAIN:
            break
        # No lower bound rises above what the models say at the times looked at: where that leaves the verdict open,
        # only a nearer time can decide.
        open_ = thresholds.verdict(Distance(min(reached, best.upper), best.upper), allowance) is Verdict.UNCERTAIN
        settled = open_ and best.upper == nearest and width <= 1.5 * (best.upper - reached) + 2.0 * ACCURACY
        spare, nearest = spare - 1 if settled else SPARE_STEPS, best.upper
        if not spare:
            break
        heapq.heappop(heap)
        if half * pair.speed <= 0.5 * ACCURACY or here <= lower + ACCURACY:  # the models have no more to say
            floor = min(floor, lower)
        else:
            for s in (t - 0.5 * half, t + 0.5 * half):
                heapq.heappush(heap, (*look(s, 0.5 * half, lower), s, 0.5 * half))
        if not heap:
            break
    lower = min([floor, *(item[0] for item in heap)])
    return replace(best, lower=min(lower, best.upper)), at


def first_time(pair: MovingPair, known: float, thresholds: Thresholds, margin: float) -> float:
    """Everything before this t, at most ``known``, is proven to be further apart than ``margin`` mm.

    It is the start of the leftmost stretch that can neither be cleared nor cut further, so it is never late; where
    the steps come to an end, of the leftmost one that is still open.
    """

    # How deep an overlap within the accuracy is, meshes take seconds to say, and rarely can: that it is one is enough.
    overlap = max(margin, -1e-6) if margin >= -ACCURACY else margin

    def enough(distance: Distance) -> bool:
        sharp = distance.upper - distance.lower <= ACCURACY
        return sharp or distance.lower > 2.0 * margin + ACCURACY or distance.upper <= overlap

    todo = [(0.0, known)]
    for _ in range(MAX_STEPS):
        start, stop = todo[-1]
        middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
        if half * pair.speed <= 0.5 * ACCURACY:
            return start
        todo.pop()
        wanted = margin + 0.5 * ACCURACY
        # Where meshes are used, the few triangles that can meet are asked first: that is cheaper than a distance.
        low = pair.by_meshes(middle, half, wanted) if pair.meshed else None
        clear = low is not None and low > margin
        if not clear:
            here = pair.ask(middle, enough, thresholds)
            clear = here.upper > margin and pair.lower(middle, half, here.lower, wanted, low) > margin
        if not clear:
            todo += [(middle, stop), (start, middle)]
        elif not todo:
            return known
    return todo[-1][0]
