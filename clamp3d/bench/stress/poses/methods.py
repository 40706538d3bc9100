"""The contact methods that the families are put to, behind one question: distances of some cases of one shape."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clamp3d.baselines import ContactModel, contact_model
from clamp3d.bench.stress.poses.cases import Cases
from clamp3d.bench.stress.worker import Measured, Measures, Method
from clamp3d.core.distance import SignedDistances, signed_distances
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array
from clamp3d.core.primitives import SweptArc
from clamp3d.core.profile import Arc, Profile
from clamp3d.core.relation3d import relative_pose
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError

_WORLD = 5e-16
"""Rounding of a position by `relative_pose`, in parts of the distance between the two origins."""

_FCL = 2e-6
"""Error of FCL's own distance in mm, as measured in `contact.fcl_shapes` (worst of 600 000), rounded up."""


def poses(cases: Cases) -> Array:
    """Poses (n, 4, 4) of the wires in their grooves' frames, as a user gets them from world poses."""
    if cases.T_world_groove is None:
        return cases.T_world_wire
    return np.array([relative_pose(a, b) for a, b in zip(cases.T_world_groove, cases.T_world_wire, strict=True)])


def _by_kernel(cases: Cases, T: Array) -> SignedDistances:
    k = int(cases.shape[0])
    return signed_distances(cases.shapes.groove(k), cases.shapes.cylinder(k), T, full=True, workers=1)


class CasMethod:
    """The project's kernel, with its error bound; what `relative_pose` rounds is added to it."""

    measures: Measures = "depth"

    def measure(self, cases: Cases) -> Measured:
        """See `Method`."""
        found = _by_kernel(cases, poses(cases))
        bound = found.error_bound
        if cases.T_world_groove is not None:
            apart = cases.T_world_wire[:, :3, 3] - cases.T_world_groove[:, :3, 3]
            reach = np.sqrt((apart**2).sum(1)) + 0.5 * cases.shapes.length[cases.shape[0]]
            bound = bound + 2.0 * _WORLD * reach
        return Measured(found.distance, bound, np.zeros(len(cases), bool))


class ChordsMethod:
    """The paper's convex partitioning at ``unit_angle`` rad; its bound is the chord error."""

    measures: Measures = "clearance"

    def __init__(self, unit_angle: float) -> None:
        self.model, self.unit_angle = contact_model("chords", unit_angle=unit_angle), unit_angle

    def measure(self, cases: Cases) -> Measured:
        """See `Method`. It works in the section: wires beside the groove's length are none of its business."""
        k = int(cases.shape[0])
        T = poses(cases)
        distance = self.model.distances(cases.shapes.pair(k), T)
        beside = np.abs(T[:, 2, 3]) > 0.5 * (cases.shapes.L[k] + cases.shapes.length[k])
        bound = _chord_error(cases, self.unit_angle) + 2e-9 * cases.scene()  # 1e-9 rad counts as parallel
        return Measured(distance, bound, beside, "method 'chords' knows no end faces: the wire must overlap the groove")


class SolidMethod:
    """A model that measures a finite block with the groove: ``build(part, groove radius)`` makes it.

    The block reaches beyond every nearest point, so its distance is that of the endless material. FCL's cylinder has
    flat ends and the truth's wire has round ones: only cases whose nearest place is on the wire's side count.
    """

    measures: Measures = "clearance"

    def __init__(self, build: Callable[[Solid, float], ContactModel], bound: Callable[[Cases], Array]) -> None:
        self._build, self._bound = build, bound

    def measure(self, cases: Cases) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        T = poses(cases)
        groove, cylinder = cases.shapes.groove(k), cases.shapes.cylinder(k)
        exact = _by_kernel(cases, T)
        ended = np.abs(np.einsum("ni,ni->n", exact.normal, T[:, :3, 2])) > 1e-9
        q = exact.point_on_groove[~ended]
        model = self._build(block(groove, q), groove.radius)
        distance = np.full(len(cases), np.nan)
        pair = GroovePair("P1", "P6", groove, np.eye(4), cylinder, np.eye(4))
        if not ended.all():
            distance[~ended] = model.distances(pair, T[~ended])
        return Measured(distance, self._bound(cases), ended, "the wire's end is nearest, which is flat in FCL")


def block(groove: SweptArc, points: Array) -> Solid:
    """A block with the groove, in the groove's own frame, that reaches beyond ``points`` (n, 3) and the groove."""
    R, a, H = groove.radius, groove.half_angle, 0.5 * groove.length
    s, h = R * math.sin(a), -R * math.cos(a)
    wide = 1.1 * max(s, float(np.abs(points[:, 0]).max(initial=0.0))) + R
    low = -1.1 * max(R, float((-points[:, 1]).max(initial=0.0))) - R
    arc = Arc((0.0, 0.0), R, a - 0.5 * math.pi, -a - 0.5 * math.pi)
    profile = Profile.of((-wide, low), (wide, low), (wide, h), arc, (-wide, h))
    body = Extrusion(profile, "Z", -H, H)
    return Solid("P1", (body,), title="block with a groove", volume=body.volume)


def _chord_error(cases: Cases, unit_angle: float) -> Array:
    """Largest distance (n,) in mm of the chords from the arc."""
    k = int(cases.shape[0])
    R, half = float(cases.shapes.R[k]), float(cases.shapes.half_angle[k])
    chord = 2.0 * half / max(1, math.ceil(2.0 * half / unit_angle - 1e-9))
    return np.full(len(cases), 2.0 * R * math.sin(0.25 * chord) ** 2)


_MESH_ERROR = 1.0 / 2400.0
"""Chord error of meshes in parts of the groove's radius: 0.01 mm for the reference clamp."""

_THRESHOLD = 1.0 / 12.0
"""Threshold of CoACD in parts of the groove's radius: 2 mm for the reference clamp, the command line's default."""

_UNIT = math.radians(5.0)


def _wedges(part: Solid, radius: float) -> ContactModel:
    return contact_model("wedges", {"P1": part}, unit_angle=_UNIT)


def _mesh(part: Solid, radius: float) -> ContactModel:
    return contact_model("mesh", {"P1": part}, mesh_error=_MESH_ERROR * radius)


def _hulls(part: Solid, radius: float) -> ContactModel:
    sizes = {"threshold": _THRESHOLD * radius, "mesh_error": _MESH_ERROR * radius}
    return contact_model("hulls", {"P1": part}, **sizes, time_limit=60.0, progress=False)


METHODS: dict[str, tuple[str, Callable[[], Method]]] = {
    "cas": ("closed forms of the arc groove; its bound is that of rounding", CasMethod),
    "chords 5 deg": (
        "convex partitioning in the section, chords of 5 degrees; its bound is the chord error",
        lambda: ChordsMethod(_UNIT),
    ),
    "wedges 5 deg": (
        "convex partitioning in 3D: python-fcl on exact wedges of 5 degrees; its bound is the chord error",
        lambda: SolidMethod(_wedges, lambda cases: _chord_error(cases, _UNIT) + _FCL),
    ),
    "mesh": (
        "python-fcl's triangle mesh, chord error R / 2400, which is its bound",
        lambda: SolidMethod(_mesh, lambda cases: _MESH_ERROR * cases.shapes.R[cases.shape] + _FCL),
    ),
    "hulls": (
        "CoACD's hulls of that mesh at a threshold of R / 12, each convex in python-fcl; no bound",
        lambda: SolidMethod(_hulls, lambda cases: np.full(len(cases), np.nan)),
    ),
}
"""Name -> what it is, and how it is made."""


def method(name: str) -> Method:
    """The method of that name. Raises InputError naming the choices."""
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; available: {', '.join(METHODS)}")
    return METHODS[name][1]()
