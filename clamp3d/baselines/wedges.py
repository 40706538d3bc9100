"""The paper's convex partitioning in 3D: a grooved part cut into exact angular convex pieces (its Section 4.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.model import check_unit_angle
from clamp3d.baselines.polytopes import PolytopeModel, Polytopes
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import Arc, Profile, Segment, chord_count, turns
from clamp3d.geometry.shapes import Solid

_BACK_ERROR = 0.01
"""Chord error in mm of convex arcs (the round back), which no wire reaches."""

_SLIVER = 1e-6
"""Pieces of less area (mm^2) come from rounding where a ray meets a corner."""

_SAME = 1e-9  # mm; what differs by less was the same before it was rounded


class Wedge(NamedTuple):
    """A convex prism: its place in the part, and its ``polygon`` (k, 2), counter-clockwise, drawn along the groove."""

    name: str
    polygon: Array


class Wedges(PolytopeModel):
    """Each groove arc as ``ceil(arc / unit_angle)`` convex prisms and two beside it, measured by FCL; any pose.

    `chords` is the same model in the section. The part is its outline with equal chords in place of the arcs, drawn
    along its length: the groove is too tight by up to R (1 - cos(unit_angle / 2)), and the bolt hole is filled, which
    no wire in a groove reaches.

    Parameters
    ----------
    parts : mapping of str to Solid
        Grooved parts by name, mm. A part is cut into wedges when it is first measured.
    unit_angle : float
        Largest angle of a wedge in rad.
    """

    name = "wedges"
    limits = ("groove too tight by the chord error", "bolt hole filled", "depth of single wedges")
    is_meshed = False

    def __init__(self, parts: Mapping[str, Solid], unit_angle: float = math.radians(5.0)) -> None:
        super().__init__(parts)
        self.unit_angle = check_unit_angle(unit_angle)

    def cut(self, name: str, part: Solid) -> Polytopes:
        """See `PolytopeModel`. Raises InputError as `part_wedges` does."""
        wedges, body = part_wedges(part, self.unit_angle), part.bodies[0]
        corners = [prism(wedge.polygon, body.start, body.end) @ body.frame.T for wedge in wedges]
        shapes = [convex(points, f"{name} {wedge.name}") for wedge, points in zip(wedges, corners, strict=True)]
        return Polytopes(shapes, [wedge.name for wedge in wedges])


def part_wedges(part: Solid, unit_angle: float) -> list[Wedge]:
    """Convex pieces of a part's outline, its grooves as chords of at most ``unit_angle`` rad (holes are left out).

    The outline is first filled, then cut into convex cells by lines across the part midway between the grooves and at
    inward corners; each cell is cut by rays from its groove's centre. The pieces fill the outline, chords for arcs,
    without gap or overlap. Raises InputError if the part has no groove, or grooves that do not open up or down.
    """
    if len(part.bodies) != 1:
        raise InputError(f"part {part.name} must be one body to be cut into wedges, got {len(part.bodies)}")
    edges = part.bodies[0].profile.edges
    grooves = sorted((e for e in edges if isinstance(e, Arc) and e.sweep < 0.0), key=lambda arc: arc.centre[0])
    if not grooves:
        raise InputError(f"part {part.name} must have a groove to be cut into wedges")
    if any(abs(math.cos(0.5 * (arc.start_angle + arc.end_angle))) > _SAME for arc in grooves):
        raise InputError(f"part {part.name} must have grooves that open up or down to be cut into wedges")
    mouths = (Segment(e.start, e.end) if isinstance(e, Arc) and e.sweep < 0.0 else e for e in edges)
    corners = Profile(tuple(mouths)).polygon(_BACK_ERROR)  # every groove closed by its mouth
    filled = shapely.Polygon(corners)
    left, bottom, right, top = filled.bounds
    between = [0.5 * (_mouth(a)[1] + _mouth(b)[0]) for a, b in pairwise(grooves)]
    limits = sorted({left, right, *between, *_inward_corners(corners)})
    out: list[Wedge] = []
    for low, high in pairwise(limits):
        cell = shapely.intersection(filled, shapely.box(low, bottom, high, top))
        owner = sum(b <= low for b in between)
        prefix = f"groove {owner + 1} " if len(grooves) > 1 else ""
        out += [Wedge(prefix + w.name, w.polygon) for w in _sectors(cell, grooves[owner], unit_angle)]
    return out


def prism(polygon: Array, start: float, end: float) -> Array:
    """Corners (2k, 3) of a polygon (k, 2) drawn from z = start to end."""
    return np.vstack([np.column_stack([polygon, np.full(len(polygon), z)]) for z in (start, end)])


def _sectors(cell: shapely.Polygon, arc: Arc, unit_angle: float) -> list[Wedge]:
    """The cell less the groove: a wedge behind each chord, and what is left beside the first and the last ray."""
    m = chord_count(arc.sweep, unit_angle)
    angles = np.linspace(arc.end_angle, arc.start_angle, m + 1)
    centre = np.array(arc.centre)
    ray = np.column_stack([np.cos(angles), np.sin(angles)])
    size = float(shapely.hausdorff_distance(cell, shapely.Point(centre)))
    # The far side of each sector lies beyond the cell.
    chord, far = centre + arc.radius * ray, centre + 2.0 * size / math.cos(0.5 * -arc.sweep / m) * ray
    sectors = [shapely.Polygon([chord[i], far[i], far[i + 1], chord[i + 1]]) for i in range(m)]
    hollow = shapely.Polygon(chord) if m > 1 else shapely.Polygon()
    sides = shapely.difference(cell, shapely.union_all([hollow, *sectors]))
    pieces = [(f"wedge {i + 1}", shapely.intersection(cell, sector)) for i, sector in enumerate(sectors)]
    pieces += [("side", polygon) for polygon in getattr(sides, "geoms", [sides])]
    return [
        Wedge(name, np.asarray(orient(shapely.remove_repeated_points(polygon, _SAME)).exterior.coords)[:-1])
        for name, polygon in pieces
        if isinstance(polygon, shapely.Polygon) and polygon.area > _SLIVER
    ]


def _inward_corners(polygon: Array) -> list[float]:
    """First coordinates of the corners where the outline turns inward."""
    return [float(x) for x in polygon[turns(polygon) < -_SAME, 0]]


def _mouth(arc: Arc) -> tuple[float, float]:
    """First coordinates of the groove's left and right end, or of its widest place."""
    reach = arc.radius if -arc.sweep > math.pi else arc.radius * math.sin(-arc.sweep / 2)
    return arc.centre[0] - reach, arc.centre[0] + reach
