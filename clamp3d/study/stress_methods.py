"""The contact methods that the families are put to, behind one question: distances of some cases of one shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from clamp3d.errors import InputError
from clamp3d.geometry.distance import signed_distances
from clamp3d.geometry.pose import Array
from clamp3d.geometry.relation3d import relative_pose
from clamp3d.study.stress_cases import Cases

_WORLD = 5e-16
"""Rounding of a position by `relative_pose`, in parts of the distance between the two origins."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Distances (n,) mm and the method's own bound of their errors (n,) mm: NaN where it gives none."""

    distance: Array
    bound: Array


class Method(Protocol):
    """A contact method: ``measure`` answers cases that share one shape, or raises InputError if it cannot."""

    def measure(self, cases: Cases) -> Measured:
        """Distances of ``cases``, all on the shape of the first."""
        ...


def poses(cases: Cases) -> Array:
    """Poses (n, 4, 4) of the wires in their grooves' frames, as a user gets them from world poses."""
    if cases.T_world_groove is None:
        return cases.T_world_wire
    return np.array([relative_pose(a, b) for a, b in zip(cases.T_world_groove, cases.T_world_wire, strict=True)])


class CasMethod:
    """The project's kernel, with its error bound; what `relative_pose` rounds is added to it."""

    def measure(self, cases: Cases) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        found = signed_distances(cases.shapes.groove(k), cases.shapes.cylinder(k), poses(cases), full=True, workers=1)
        bound = found.error_bound
        if cases.T_world_groove is not None:
            apart = cases.T_world_wire[:, :3, 3] - cases.T_world_groove[:, :3, 3]
            reach = np.sqrt((apart**2).sum(1)) + 0.5 * cases.shapes.length[k]
            bound = bound + 2.0 * _WORLD * reach
        return Measured(found.distance, bound)


class ChordsMethod:
    """The paper's convex partitioning at ``unit_angle`` rad; its bound is the chord error, and it errs to one side."""

    def __init__(self, unit_angle: float) -> None:
        from clamp3d.contact.chords import Chords

        self.model, self.unit_angle = Chords(unit_angle), unit_angle

    def measure(self, cases: Cases) -> Measured:
        """See `Method`."""
        k = int(cases.shape[0])
        distance = self.model.distances(cases.shapes.pair(k), poses(cases))
        R, half = float(cases.shapes.R[k]), float(cases.shapes.half_angle[k])
        chord = 2.0 * half / max(1, math.ceil(2.0 * half / self.unit_angle - 1e-9))
        bound = 2.0 * R * math.sin(0.25 * chord) ** 2 + 1e-12 * cases.scene()
        return Measured(distance, bound)


METHODS: dict[str, tuple[str, Callable[[], Method]]] = {
    "cas": ("closed forms of the arc groove", CasMethod),
    "chords 5 deg": (
        "convex partitioning in the section, chords of 5 degrees",
        lambda: ChordsMethod(math.radians(5.0)),
    ),
    "chords 20 deg": ("the same, chords of 20 degrees", lambda: ChordsMethod(math.radians(20.0))),
}
"""Name -> what it is, and how it is made."""


def method(name: str) -> Method:
    """The method of that name. Raises InputError naming the choices."""
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; available: {', '.join(METHODS)}")
    return METHODS[name][1]()
