"""All families of hard poses: what has broken collision code, the methods put to it, and how truths are found."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines import contact_model
from clamp3d.baselines.chords import chord_error
from clamp3d.bench.stress.family import Family, Methods
from clamp3d.bench.stress.poses import features
from clamp3d.bench.stress.poses.cases import Cases
from clamp3d.bench.stress.poses.truth import EXTENDED_ERROR, truth, truth_50_digits
from clamp3d.bench.stress.worker import Measured, Measures, run_here
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import SweptArc
from clamp3d.geometry.shapes import Solid, groove_block
from clamp3d.kernel.distance import SignedDistances, signed_distances

FCL_ERROR = 2e-6
"""Error of FCL's own distance in mm, as measured in `baselines.fcl_shapes` (worst of 600 000), rounded up."""

MESH_ERROR = 1.0 / 2400.0
"""Chord error of meshes in parts of the groove's radius: 0.01 mm for the reference clamp."""

THRESHOLD = 1.0 / 12.0
"""Threshold of CoACD in parts of the groove's radius: 2 mm for the reference clamp, the command line's default."""

UNIT = math.radians(5.0)


def _by_kernel(cases: Cases) -> SignedDistances:
    k = int(cases.shape[0])
    return signed_distances(cases.shapes.groove(k), cases.shapes.wire(k), cases.T_groove_wire, full=True, workers=1)


class CasMethod:
    """The kernel, with its error bound."""

    measures: Measures = "depth"

    def measure(self, cases: Cases) -> Measured:
        """See `Method`."""
        answers = _by_kernel(cases)
        return Measured(answers.distance, answers.error_bound)


class ChordsMethod:
    """The paper's convex partitioning; its bound is the chord error."""

    measures: Measures = "clearance"

    def measure(self, cases: Cases) -> Measured:
        """See `Method`. It works in the section: wires beside the groove's length are none of its business."""
        k = int(cases.shape[0])
        T = cases.T_groove_wire
        distance = contact_model("chords", unit_angle=UNIT).distances(cases.shapes.pair(k), T)
        beside = np.abs(T[:, 2, 3]) > 0.5 * (cases.shapes.L[k] + cases.shapes.length[k])
        bound = chord_error(cases.shapes.groove(k), UNIT) + 2e-9 * cases.scene()  # 1e-9 rad counts as parallel
        return Measured(distance, bound, beside, "method 'chords' knows no end faces: the wire must overlap the groove")


@dataclass(frozen=True)
class SolidMethod:
    """A model by FCL, which measures a finite block with the groove; ``bound(groove)`` is the error of its pieces, mm.

    ``settings`` of `contact_model` are in parts of the groove's radius, except for the angle. The block reaches beyond
    every nearest point, so its distance is that of the endless material. FCL's cylinder has flat ends and the truth's
    wire has round ones: only cases whose nearest place is on the wire's side count.
    """

    name: str
    bound: Callable[[SweptArc], float]
    settings: Mapping[str, float] = field(default_factory=dict)
    measures: Measures = "clearance"

    def measure(self, cases: Cases) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        T = cases.T_groove_wire
        pair = cases.shapes.pair(k)
        exact = _by_kernel(cases)
        ended = np.abs(np.einsum("ni,ni->n", exact.normal, T[:, :3, 2])) > 1e-9
        part = block(pair.groove, exact.point_on_groove[~ended])
        distance = np.full(len(cases), np.nan)
        if not ended.all():
            scale = {key: 1.0 if key == "unit_angle" else pair.groove.radius for key in self.settings}
            sizes = {key: value * scale[key] for key, value in self.settings.items()}
            model = contact_model(self.name, {"P1": part}, **sizes, time_limit=60.0, progress=False)
            distance[~ended] = model.distances(pair, T[~ended])
        bound = np.full(len(cases), self.bound(pair.groove) + FCL_ERROR)
        return Measured(distance, bound, ended, "the wire's end is nearest, which is flat in FCL")


def block(groove: SweptArc, points: Array) -> Solid:
    """A block with the groove, in the groove's own frame, that reaches beyond ``points`` (n, 3) and the groove."""
    R = groove.radius
    s, h = R * math.sin(groove.half_angle), -R * math.cos(groove.half_angle)
    wide = 1.1 * max(s, float(np.abs(points[:, 0]).max(initial=0.0))) + R
    low = -1.1 * max(R, float((-points[:, 1]).max(initial=0.0))) - R
    return groove_block(groove, 2.0 * wide, h - low, name="P1")


def in_radii(groove: SweptArc, bound: float) -> float:
    """A bound in mm that is given in parts of the groove's radius; NaN if there is none."""
    return bound * groove.radius


_NO_BOUND = partial(in_radii, bound=math.nan)
METHODS: Methods = {
    "cas": ("closed forms of the arc groove; its bound is that of rounding", CasMethod),
    "chords 5 deg": (
        "convex partitioning in the section, chords of 5 degrees; its bound is the chord error",
        ChordsMethod,
    ),
    "wedges 5 deg": (
        "convex partitioning in 3D: python-fcl on exact wedges of 5 degrees; its bound is the chord error",
        partial(SolidMethod, "wedges", partial(chord_error, unit_angle=UNIT), {"unit_angle": UNIT}),
    ),
    "mesh": (
        "python-fcl's triangle mesh, chord error R / 2400, which is its bound",
        partial(SolidMethod, "mesh", partial(in_radii, bound=MESH_ERROR), {"mesh_error": MESH_ERROR}),
    ),
    "hulls": (
        "CoACD's hulls of that mesh at a threshold of R / 12, each convex in python-fcl; no bound",
        partial(SolidMethod, "hulls", _NO_BOUND, {"threshold": THRESHOLD, "mesh_error": MESH_ERROR}),
    ),
}


_BLOCK = 5000
_MOST_DECIDED = 500


class PoseFamily(Family):
    """A kind of difficulty of single poses."""

    methods = METHODS
    truth_error = EXTENDED_ERROR

    def truths(self, cases: Cases) -> NDArray[Any]:
        """Long doubles. Where quick search and kernel differ, 50 digits decide: the search can miss a minimum."""
        n = len(cases)
        exact = np.concatenate([truth(cases.take(np.arange(i, min(i + _BLOCK, n)))) for i in range(0, n, _BLOCK)])
        kernel = run_here(CasMethod(), cases)
        differ = np.flatnonzero(~(np.abs(np.asarray(kernel.distance - exact, np.float64)) <= kernel.bound))
        for i in differ[:_MOST_DECIDED]:
            high = truth_50_digits(cases, int(i))
            exact[i] = np.longdouble(float(high)) + np.longdouble(float(high - float(high)))
        return exact

    def difference(self, cases: Cases, truths: NDArray[Any], i: int) -> float:
        """See `Family`."""
        high = float(truths[i])  # the long double as the sum of two floats, which mpmath takes to the last bit
        difference = truth_50_digits(cases, i) - high - float(truths[i] - np.longdouble(high))
        return abs(float(difference)) / float(cases.scene()[i])

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        return f"{cases.snippet(i)}\n# truth: {float(truth_50_digits(cases, i))!r} mm"


POSES = {name: PoseFamily(name, *maker) for name, maker in features.MAKERS.items()}
