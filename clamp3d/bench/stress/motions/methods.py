"""The methods that motions are put to: does the wire touch on its way, and how near does it come?

Of python-fcl's continuous collision (0.7.0.11), which gives verdicts only, was tried on a wire that meets a block at
0.375 of its way:

- ``CCDM_SCREW`` answers 0.009 for a motion without a turn (its screw axis is that of a turn by 0), so a translation is
  given as ``CCDM_TRANS`` and only what turns as a screw. A screw is taken the short way round: it is cut into quarters.
- Conservative advancement on convex shapes; on meshes it ends the interpreter. Its wire is a capsule, as the truth's.
- In the units of `baselines.fcl_shapes` (2^-14 mm) every answer is a hit at 0: lengths go to FCL in mm.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import Any

import fcl
import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines.chords import chord_error
from clamp3d.baselines.fcl_shapes import encoded
from clamp3d.baselines.wedges import wedge_solids
from clamp3d.bench.stress.family import Methods
from clamp3d.bench.stress.motions.cases import Motions, poses
from clamp3d.bench.stress.poses.family import UNIT, block
from clamp3d.bench.stress.worker import Measured, Measures
from clamp3d.collide.motions import first_contact, min_clearance
from clamp3d.core.distance import signed_distances
from clamp3d.core.pose import Array
from clamp3d.core.primitives import SweptArc

_SMALLEST, _LARGEST = 1e-4, 1e4
"""Lengths in mm: FCL's tolerances are absolute, 1e-6."""

_QUARTER = 0.5 * math.pi


class FclMethod:
    """Wedges of 5 degrees around the groove against a capsule. It is tight by the chord error."""

    measures: Measures = "verdict"

    def measure(self, cases: Motions) -> Measured:
        """See `Method`: -1 where FCL finds contact, 1 where it does not."""
        k = int(cases.shape[0])
        groove, wire = cases.shapes.groove(k), cases.shapes.wire(k)
        n = len(cases)
        ways = [poses(cases, i, np.linspace(0.0, 1.0, 129)) for i in range(n)]
        reach = np.array([_reach(way, wire.length) + wire.radius for way in ways])
        small = min(groove.radius, groove.length, wire.radius, wire.length) < _SMALLEST
        unfit = (reach.max(1) > _LARGEST) | small
        bound = np.full(n, chord_error(groove, UNIT))
        distance = np.full(n, np.nan)
        if not unfit.all():
            pieces = self._pieces(groove, reach[~unfit].max(0))
            capsule = fcl.Capsule(wire.radius, wire.length)
            for i in np.flatnonzero(~unfit):
                distance[i] = -1.0 if self._hits(pieces, capsule, cases, int(i)) else 1.0
        why = f"FCL's tolerances are absolute: lengths from {_SMALLEST:g} to {_LARGEST:g} mm only"
        return Measured(distance, bound, unfit, why)

    def _pieces(self, groove: SweptArc, reach: Array) -> list[Any]:
        """Convex pieces of a block that no wire reaches the back of."""
        part = block(groove, np.array([[reach[0], -reach[1], 0.0]]))
        out = []
        for _, V, F in wedge_solids(part, UNIT):
            shape = fcl.Convex(V, len(F), encoded(F))
            out.append(fcl.CollisionObject(shape, fcl.Transform()))
        return out

    def _hits(self, pieces: list[Any], capsule: Any, cases: Motions, i: int) -> bool:
        turns = cases.angle[i] != 0.0
        parts = max(1, math.ceil(abs(float(cases.angle[i])) / _QUARTER))
        request = fcl.ContinuousCollisionRequest(
            num_max_iterations=1000,
            toc_err=1e-6,
            ccd_motion_type=fcl.CCDMotionType.CCDM_SCREW if turns else fcl.CCDMotionType.CCDM_TRANS,
            gjk_solver_type=fcl.GJKSolverType.GST_LIBCCD,
            ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
        )
        stops = [fcl.Transform(T[:3, :3], T[:3, 3]) for T in poses(cases, i, np.linspace(0.0, 1.0, parts + 1))]
        still = fcl.Transform()
        for start, end in pairwise(stops):
            wire = fcl.CollisionObject(capsule, start)
            for piece in pieces:
                result = fcl.ContinuousCollisionResult()
                fcl.continuousCollide(wire, end, piece, still, request, result)
                if result.is_collide:
                    return True
        return False


def _reach(way: Array, length: float) -> NDArray[np.float64]:
    """Largest |x| and -y of the axis on its way (m, 4, 4), and |z|."""
    ends = np.concatenate([way[:, :3, 3] + t * way[:, :3, 2] for t in (-0.5 * length, 0.5 * length)])
    step = np.abs(np.diff(way[:, :3, 3], axis=0)).max(initial=0.0)
    x, y, z = np.abs(ends[:, 0]).max(), (-ends[:, 1]).max(), np.abs(ends[:, 2]).max()
    return np.array([x + step, max(y, 0.0) + step, z + step])


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
    "FCL continuous": (
        "python-fcl's continuous collision of wedges of 5 degrees, conservative advancement; verdicts only",
        FclMethod,
    ),
}
