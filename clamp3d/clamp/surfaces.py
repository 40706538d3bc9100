"""Which surfaces of a drawn body a point lies on: arc, lip, hole, flat face, round face, end face."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import Arc, Edge
from clamp3d.geometry.shapes import Solid

TOUCHING = 1e-6
"""Gap or overlap in mm up to which two parts of a clamp touch: a thousand times what a proof leaves."""
SURFACES = ("lip", "arc", "hole", "flat face", "round face", "end face")
"""Names of surfaces; of two that touch the one that comes first names the contact."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A surface of a solid: its ``name``, one of `SURFACES`, and the unit vector (3,) out of it where it is flat."""

    name: str
    normal: Array | None


def surfaces_at(solid: Solid, T: Array, point: Array, tolerance: float = TOUCHING) -> tuple[Surface, ...]:
    """The surfaces of a solid at ``T`` (4, 4) that are nearest to a point (3,), to within ``tolerance`` mm.

    A lip is where a concave arc ends.

    >>> from clamp3d.geometry.shapes import cylinder
    >>> [surface.name for surface in surfaces_at(cylinder(5.0, 20.0), np.eye(4), np.array([5.0, 0.0, 3.0]))]
    ['round face']
    """
    near: list[tuple[float, Surface]] = []
    local = (point - T[:3, 3]) @ T[:3, :3]
    for extrusion in (*solid.bodies, *solid.holes):
        is_hole = extrusion in solid.holes
        frame = T[:3, :3] @ extrusion.frame
        a, b, along = (local @ extrusion.frame).tolist()
        for edge in extrusion.profile.edges:
            name, normal = "hole" if is_hole else _edge_name(edge, a, b), None
            if not isinstance(edge, Arc):  # the material is on the left of an outline's edge
                right, up = np.subtract(edge.end, edge.start) / math.dist(edge.end, edge.start)
                normal = frame[:, :2] @ (up, -right)
            near.append((_edge_distance(edge, a, b), Surface(name, normal)))
        for end, side in ((extrusion.start, -1.0), (extrusion.end, 1.0)) if not is_hole else ():
            name = "end face" if extrusion.axis == "Y" else "flat face"
            near.append((abs(along - end), Surface(name, side * frame[:, 2])))
    least = min(distance for distance, _ in near)
    return tuple(surface for distance, surface in near if distance <= least + tolerance)


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
