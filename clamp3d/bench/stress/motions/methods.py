"""The methods that motions are put to: does the wire touch on its way, and how near does it come?"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.family import Methods
from clamp3d.bench.stress.motions.cases import Motions, poses
from clamp3d.bench.stress.worker import Measured, Measures
from clamp3d.collide.motions import first_contact, min_clearance
from clamp3d.core.distance import signed_distances
from clamp3d.core.pose import Array


class CasMethod:
    """`min_clearance` for the least distance and `first_contact`, whose answers are kept for `first_contacts`.

    The bound is that of rounding (distance and pose) and the resolution of the search.
    """

    measures: Measures = "depth"

    def __init__(self) -> None:
        self._first: dict[int, tuple[bool, float, float]] = {}
        self._lowest: dict[int, float] = {}

    def measure(self, cases: Motions) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        groove, wire = cases.shapes.groove(k), cases.shapes.wire(k)
        distance, bound = np.empty(len(cases)), np.empty(len(cases))
        for i in range(len(cases)):
            motion, start = cases.motion(i), cases.start[i]
            least = min_clearance(groove, wire, motion, start)
            first = first_contact(groove, wire, motion, start)
            distance[i] = least.distance.value
            rounding = max(least.distance.uncertainty, first.distance.uncertainty)
            bound[i] = rounding + max(least.resolution, first.resolution)
            self._lowest[int(cases.number[i])] = least.t
            self._first[int(cases.number[i])] = (first.touches, first.t, first.distance.value)
        return Measured(distance, bound)

    def instants(self, n: int) -> Array:
        """Instants (n, 1) that `min_clearance` named, -1 where it was not asked."""
        out = np.full((n, 1), -1.0)
        out[list(self._lowest), 0] = list(self._lowest.values())
        return out

    def first_contacts(self, n: int) -> tuple[NDArray[np.bool_], Array, Array]:
        """Whether, when (n,) and at which distance (n,) `first_contact` found contact; NaN where not asked."""
        touches, instant, at = np.zeros(n, bool), np.full(n, np.nan), np.full(n, np.nan)
        for i, (hit, when, distance) in self._first.items():
            touches[i], instant[i], at[i] = hit, when, distance
        return touches, instant, at


class SteppedMethod:
    """Exact distances at evenly spaced poses, ends included: the least of them. It has no bound."""

    measures: Measures = "depth"

    def __init__(self, steps: int) -> None:
        self.instants = np.linspace(0.0, 1.0, steps + 1)

    def measure(self, cases: Motions) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        groove, wire = cases.shapes.groove(k), cases.shapes.wire(k)
        ways = (poses(cases, i, self.instants) for i in range(len(cases)))
        least = np.array([signed_distances(groove, wire, way, workers=1).min() for way in ways])
        return Measured(least, np.full(len(cases), np.nan))


METHODS: Methods = {
    "cas": ("closed forms of the arc groove; its bound is that of rounding", CasMethod),
    "stepped 100": (
        "exact distances at 101 evenly spaced poses of a motion, the usual practice; no bound",
        partial(SteppedMethod, 100),
    ),
}
