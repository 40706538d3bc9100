"""Distance of two parts in the section by their outlines: for pairs that no groove, hole, seat or thread joins.

Every part is as wide along the wires as its section is on the plane Y = 0 or narrower, so two parts whose sections are
apart are as far apart as these. Arcs are equal chords with their ends on the arc, so the distance is off by the two
chord errors at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clamp3d.core.extrusion import Extrusion
from clamp3d.core.pose import Array, SectionPose
from clamp3d.core.shapes import Solid


@dataclass(frozen=True, slots=True)
class OutlineGap:
    """``distance`` >= 0 mm between ``point_a`` and ``point_b`` (2,) in the section; ``error_bound`` mm.

    ``overlap`` says that the outlines meet (then the distance is 0), ``contained`` that one lies inside the other.
    """

    distance: float
    point_a: Array
    point_b: Array
    error_bound: float
    overlap: bool
    contained: bool


def outline_gap(a: Solid, pose_a: SectionPose, b: Solid, pose_b: SectionPose, mesh_error: float) -> OutlineGap:
    """How far apart the outlines of two parts are in the section, holes filled.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> from clamp3d.clamp.parts import parts
    >>> wires = parts(load_clamp(line="20", jumper="10"))
    >>> gap = outline_gap(wires["P6"], SectionPose(0, 0), wires["P7"], SectionPose(30, 0), 1e-4)
    >>> abs(gap.distance - 15.0) <= gap.error_bound <= 2e-4
    True
    """
    error = sum(_chord_error(part, mesh_error) for part in (a, b))
    best = OutlineGap(np.inf, np.zeros(2), np.zeros(2), error, False, False)
    for p in _outlines(a, pose_a, mesh_error):
        for q in _outlines(b, pose_b, mesh_error):
            found = _polygon_gap(p, q, error)
            if (found.distance, not found.contained) < (best.distance, not best.contained):
                best = found
    return best


def _outlines(part: Solid, pose: SectionPose, mesh_error: float) -> list[Array]:
    """Each body's outline (n, 2) in the section's x, y."""
    c, s = np.cos(pose.angle), np.sin(pose.angle)
    turn = np.array([[c, -s], [s, c]])
    return [_silhouette(body, mesh_error) @ turn + (pose.x, pose.y) for body in part.bodies]


def _silhouette(body: Extrusion, mesh_error: float) -> Array:
    if body.axis == "Y":
        return body.profile.polygon(mesh_error)
    (left, _), (right, _) = body.profile.bounds
    return np.array([(left, -body.end), (right, -body.end), (right, -body.start), (left, -body.start)])


def _chord_error(part: Solid, mesh_error: float) -> float:
    return max((body.profile.chord_error(mesh_error) for body in part.bodies if body.axis == "Y"), default=0.0)


def _polygon_gap(p: Array, q: Array, error: float) -> OutlineGap:
    import shapely

    one, other = shapely.Polygon(p), shapely.Polygon(q)
    if one.intersects(other):
        contained = one.contains(other) or other.contains(one)
        inside = np.array(one.intersection(other).representative_point().coords[0])
        return OutlineGap(0.0, inside, inside, error, True, bool(contained))
    a, b = shapely.get_coordinates(shapely.shortest_line(one, other))
    return OutlineGap(float(np.hypot(*(b - a))), a, b, error, False, False)
