"""How a pin and a hole of two parts fit: read from faces that CAD, a drawing or a fit states to be cylinders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from clamp3d.engine.model import box_corners
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.pose import Array, to_target
from clamp3d.geometry.shapes import MeshShape, Shape, Solid, Sphere

if TYPE_CHECKING:
    from clamp3d.engine.scene import Part

RELATIONS = {
    "running": (-0.01, 0.0),
    "press": (0.0, 0.005),
    "thread": (0.005, 0.25),
    "duplicate": (math.inf, math.inf),
}
"""By how much a pin is thicker than its hole: more than ... and up to ..., in parts of its radius."""
_COAXIAL = 1e-3
"""mm by which two axes of one fit, or two places of one part, differ at most."""


@dataclass(frozen=True, slots=True)
class Relation:
    """How two parts fit: one of `RELATIONS`, and by how many mm they overlap because of it."""

    kind: str
    overlap: float


@dataclass(frozen=True, slots=True)
class RoundFace:
    """A whole cylindrical face with the ``ends`` (2, 3) of its axis, mm; of a hole the material is outside."""

    ends: Array
    radius: float
    is_hole: bool


def relation(a: Part, b: Part) -> Relation | None:
    """How two parts fit; None where no pin of one stands in a hole of the other on one axis.

    Of several pins in holes the one that fits most closely counts.

    >>> from clamp3d.engine.scene import Part
    >>> from clamp3d.geometry import shapes
    >>> nut, bolt = shapes.cylinder(9.0, 8.0, bore=4.2), shapes.cylinder(5.0, 40.0)
    >>> relation(Part("nut", nut, np.eye(4)), Part("bolt", bolt, np.eye(4)))
    Relation(kind='thread', overlap=0.8)
    """
    if a.shape == b.shape:
        moved = to_target(b.T_world, _corners(a.shape)) - to_target(a.T_world, _corners(a.shape))
        if np.linalg.norm(moved, axis=1).max() <= _COAXIAL:
            return Relation("duplicate", math.inf)
    fits = [
        (round(pin.radius - hole.radius, 9), pin.radius)
        for p, q in ((a, b), (b, a))
        for pin in round_faces(p.shape)
        for hole in round_faces(q.shape)
        if hole.is_hole and not pin.is_hole
        if _stands_in(to_target(p.T_world, pin.ends), to_target(q.T_world, hole.ends))
    ]
    if not fits:
        return None
    overlap, radius = min(fits, key=lambda fit: abs(fit[0]))
    for kind, (low, high) in RELATIONS.items():
        if low * radius < overlap <= high * radius:
            return Relation(kind, max(0.0, overlap))
    return None


def _corners(shape: Shape) -> Array:
    """Points (k, 3) of which some move at least as far as any point of a shape."""
    if isinstance(shape, (Solid, Sphere, BrepSolid)):
        return box_corners(shape.bounds_at(np.eye(4)))
    return shape.mesh.vertices


def _stands_in(pin: Array, hole: Array) -> bool:
    """Whether two axes, given by their ends (2, 3), are one, and side by side on a part of their lengths."""
    length = float(np.linalg.norm(hole[1] - hole[0]))
    axis = (hole[1] - hole[0]) / length
    along = (pin - hole[0]) @ axis
    off = np.linalg.norm(pin - hole[0] - along[:, None] * axis, axis=1)
    return bool(off.max() <= _COAXIAL and along.max() > 0.0 and along.min() < length)


@lru_cache(maxsize=4096)
def round_faces(shape: Shape) -> tuple[RoundFace, ...]:
    """The whole cylindrical faces of a shape, in its own frame."""
    if isinstance(shape, Solid):
        drawn = [(body, False) for body in shape.bodies] + [(hole, True) for hole in shape.holes]
        rounds = [(body, body.profile.arcs[0], hole) for body, hole in drawn if len(body.profile.edges) == 1]
        return tuple(
            RoundFace(np.array([[*arc.centre, end] for end in (body.start, body.end)]) @ body.frame.T, arc.radius, hole)
            for body, arc, hole in rounds
        )
    from clamp3d.fit.cad import fit_solid
    from clamp3d.fit.fit import fit_mesh

    if not isinstance(shape, MeshShape) or not (isinstance(shape, BrepSolid) or shape.fit == "round"):
        return ()
    fitted = fit_solid(shape) if isinstance(shape, BrepSolid) else fit_mesh(shape.mesh)
    whole = [(f, False) for f in fitted.cylinders if f.full] + [(f, True) for f in fitted.holes]
    ends = [
        f.T_part_feature[:3, 3] + 0.5 * f.length * np.array([[-1], [1]]) * f.T_part_feature[:3, 2] for f, _ in whole
    ]
    return tuple(RoundFace(end, f.radius, is_hole) for end, (f, is_hole) in zip(ends, whole, strict=True))
