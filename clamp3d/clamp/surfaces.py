"""Which surfaces of a drawn body a point lies on: arc, lip, hole, flat face, round face, end face."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import Arc, Edge
from clamp3d.geometry.shapes import Solid

TOUCHING = 1e-6
"""Gap or overlap in mm up to which two parts of a clamp touch."""
SURFACES = ("lip", "arc", "hole", "flat face", "round face", "end face")
"""Names of surfaces; of two that touch the one that comes first names the contact."""


@dataclass(frozen=True, slots=True)
class Surface:
    """A surface of a solid near a point.

    Attributes
    ----------
    name : str
        One of `SURFACES`.
    distance : float
        Of the point from it, mm.
    extrusion : Extrusion
        The body or hole that it bounds.
    edge : Edge or None
        The edge of the outline; None for an end.
    normal : ndarray (3,) or None
        Unit vector out of the material in the solid's frame; None where it is not flat.
    """

    name: str
    distance: float
    extrusion: Extrusion
    edge: Edge | None
    normal: Array | None


def surfaces_at(solid: Solid, point: Array, tolerance: float = TOUCHING) -> tuple[Surface, ...]:
    """The surfaces that are nearest to a point (3,) in the solid's frame, to within ``tolerance`` mm."""
    near: list[Surface] = []
    for extrusion in (*solid.bodies, *solid.holes):
        hole = extrusion in solid.holes
        a, b, along = (np.asarray(point)[:3] @ extrusion.frame).tolist()
        for edge in extrusion.profile.edges:
            name = "hole" if hole else _edge_name(edge, a, b)
            near.append(Surface(name, _edge_distance(edge, a, b), extrusion, edge, _edge_normal(extrusion, edge)))
        for end, side in ((extrusion.start, -1.0), (extrusion.end, 1.0)) if not hole else ():
            name = "end face" if extrusion.axis == "Y" else "flat face"
            near.append(Surface(name, abs(along - end), extrusion, None, side * extrusion.frame[:, 2]))
    least = min(surface.distance for surface in near)
    return tuple(surface for surface in near if surface.distance <= least + tolerance)


def surface_name(solid: Solid, point: Array, tolerance: float = TOUCHING) -> str:
    """The surface of a solid that a point (3,) in its own frame is nearest to; a lip is where a concave arc ends.

    Of surfaces that are as near to within ``tolerance`` mm the first of `SURFACES` counts.

    >>> from clamp3d.geometry.shapes import cylinder
    >>> surface_name(cylinder(5.0, 20.0), np.array([5.0, 0.0, 3.0]))
    'round face'
    """
    return min((surface.name for surface in surfaces_at(solid, point, tolerance)), key=SURFACES.index)


def _edge_distance(edge: Edge, a: float, b: float) -> float:
    """How far a point (a, b) is from an edge of an outline, mm."""
    if isinstance(edge, Arc):
        da, db = a - edge.centre[0], b - edge.centre[1]
        low, high = sorted((edge.start_angle, edge.end_angle))
        if (math.atan2(db, da) - low) % (2.0 * math.pi) <= high - low:
            return abs(math.hypot(da, db) - edge.radius)
        return min(math.dist((a, b), edge.start), math.dist((a, b), edge.end))
    (a0, b0), (a1, b1) = edge.start, edge.end
    t = ((a - a0) * (a1 - a0) + (b - b0) * (b1 - b0)) / ((a1 - a0) ** 2 + (b1 - b0) ** 2)
    t = min(max(t, 0.0), 1.0)
    return math.dist((a, b), (a0 + t * (a1 - a0), b0 + t * (b1 - b0)))


def _edge_name(edge: Edge, a: float, b: float) -> str:
    if not isinstance(edge, Arc):
        return "flat face"
    if edge.sweep > 0.0:
        return "round face"
    return "lip" if min(math.dist((a, b), edge.start), math.dist((a, b), edge.end)) <= TOUCHING else "arc"


def _edge_normal(extrusion: Extrusion, edge: Edge) -> Array | None:
    """Out of the material, which is on the left of an outline's edge."""
    if isinstance(edge, Arc):
        return None
    along = np.array([edge.end[0] - edge.start[0], edge.end[1] - edge.start[1]])
    normal: Array = extrusion.frame[:, :2] @ np.array([along[1], -along[0]]) / np.linalg.norm(along)
    return normal
