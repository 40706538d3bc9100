"""The paper's convex partitioning in 3D: a grooved part cut into exact angular convex pieces (its Section 4.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.model import Pieces, check_unit_angle, pose_of, poses_of
from clamp3d.baselines.polytopes import PerPart, Polytopes, Wires
from clamp3d.checks import instance
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array
from clamp3d.core.profile import Arc, Segment
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError

_BACK_ERROR = 0.01
"""Chord error in mm of convex arcs (the round back), which no wire reaches."""

_SLIVER = 1e-6
"""Pieces of less area (mm^2) come from rounding where a ray meets a corner."""

_SAME = 1e-9  # mm


@dataclass(frozen=True, slots=True)
class Wedge:
    """A convex prism: ``polygon`` (k, 2) counter-clockwise, drawn along the groove; ``name`` tells its place."""

    name: str
    polygon: Array

    @property
    def area(self) -> float:
        """Area of the polygon in mm^2."""
        x, y = (self.polygon - self.polygon[0]).T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


class Wedges:
    """Each groove arc as ``ceil(arc / unit_angle)`` convex prisms and two beside it; unit angle in rad.

    The pieces are measured by FCL, so any pose will do (`chords` is the same model in the section). The part is its
    outline with equal chords in place of the arcs, drawn along its length: the groove is too tight by up to
    R (1 - cos(unit_angle / 2)), and the bolt hole is filled, which no wire in a groove reaches.
    """

    name = "wedges"
    limits = ("groove too tight by the chord error", "bolt hole filled", "depth of single wedges")
    meshes_built = 0

    def __init__(self, parts: Mapping[str, Solid], unit_angle: float) -> None:
        unit_angle = check_unit_angle(unit_angle)
        instance("parts", parts, Mapping)
        self.unit_angle = unit_angle
        self.parts = PerPart([*parts], lambda name: _polytopes(parts[name], unit_angle))
        self._wires = Wires()

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every wedge of part a; see `ContactModel`."""
        T_a_b = pose_of(pair, T_a_b)
        return self.parts[pair.a].pieces(self._wires.of(pair), T_a_b @ pair.T_b_cylinder)

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) for poses (n, 4, 4); see `ContactModel`."""
        T_a_b = poses_of(pair, T_a_b)
        return self.parts[pair.a].distances(self._wires.of(pair), T_a_b @ pair.T_b_cylinder)


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
    filled = _filled(edges)
    between = [0.5 * (_mouth(a)[1] + _mouth(b)[0]) for a, b in pairwise(grooves)]
    cuts = sorted({*between, *_inward_corners(filled)})
    limits = [-math.inf, *cuts, math.inf]
    out: list[Wedge] = []
    for low, high in pairwise(limits):
        cell = filled
        if math.isfinite(low):
            cell = clip(cell, np.array([-1.0, 0.0]), -low)
        if math.isfinite(high):
            cell = clip(cell, np.array([1.0, 0.0]), high)
        owner = sum(b <= low for b in between)
        prefix = f"groove {owner + 1} " if len(grooves) > 1 else ""
        out += [Wedge(prefix + w.name, w.polygon) for w in _sectors(cell, grooves[owner], unit_angle)]
    return out


def prism(polygon: Array, start: float, end: float) -> tuple[Array, Array]:
    """Vertices (2k, 3) and outward triangles (4k - 4, 3) of a convex polygon (k, 2) drawn from z = start to end."""
    k = len(polygon)
    vertices = np.vstack([np.column_stack([polygon, np.full(k, z)]) for z in (start, end)])
    i = np.arange(k)
    j = np.roll(i, -1)
    fan = np.column_stack([np.zeros(k - 2, dtype=np.int64), i[1:-1], i[2:]])
    faces = [fan[:, ::-1], fan + k, np.column_stack([i, j, j + k]), np.column_stack([i, j + k, i + k])]
    return vertices, np.concatenate(faces)


def clip(polygon: Array, normal: Array, offset: float) -> Array:
    """The part of a polygon (k, 2) where ``normal . x <= offset`` (Sutherland and Hodgman 1974)."""
    height = polygon @ normal - offset
    out: list[Array] = []
    for p, q, a, b in zip(polygon, np.roll(polygon, -1, axis=0), height, np.roll(height, -1), strict=True):
        if a <= 0.0:
            out.append(p)
        if (a < 0.0 < b) or (b < 0.0 < a):
            out.append(p + (q - p) * (a / (a - b)))
    kept = [p for i, p in enumerate(out) if np.abs(p - out[i - 1]).max() > _SAME]
    return np.array(kept) if len(kept) > 2 else np.empty((0, 2))


def _sectors(cell: Array, arc: Arc, unit_angle: float) -> list[Wedge]:
    """The cell less the groove: a wedge behind each chord, and what lies beside the first and the last ray."""
    m = max(1, math.ceil(-arc.sweep / unit_angle - 1e-9))
    angles = np.linspace(arc.end_angle, arc.start_angle, m + 1)
    centre = np.array(arc.centre)
    inner = arc.radius * math.cos(-arc.sweep / m / 2)

    def side(angle: float, sign: int) -> tuple[Array, float]:
        normal = sign * np.array([-math.sin(angle), math.cos(angle)])
        return normal, float(normal @ centre)

    out: list[Wedge] = []
    for i in range(m):
        outward = np.array([math.cos(0.5 * (angles[i] + angles[i + 1])), math.sin(0.5 * (angles[i] + angles[i + 1]))])
        piece = clip(cell, -outward, -float(outward @ centre) - inner)
        for normal, offset in (side(angles[i], -1), side(angles[i + 1], 1)):
            piece = clip(piece, normal, offset) if len(piece) else piece
        out.append(Wedge(f"wedge {i + 1}", piece))
    if -arc.sweep < math.pi:  # else the rays leave the part at the mouth and nothing lies beside them
        out.append(Wedge("first side", clip(cell, *side(angles[0], 1))))
        out.append(Wedge("last side", clip(cell, *side(angles[-1], -1))))
    return [wedge for wedge in out if len(wedge.polygon) and wedge.area > _SLIVER]


def _filled(edges: tuple[Segment | Arc, ...]) -> Array:
    """Corners (k, 2) of the outline with every groove closed by its mouth and every convex arc as fine chords."""
    corners: list[tuple[float, float]] = []
    for edge in edges:
        corners.append(edge.start)
        if isinstance(edge, Arc) and edge.sweep > 0.0:
            n = edge.chord_count(_BACK_ERROR)
            corners += [edge.at(edge.start_angle + edge.sweep * i / n) for i in range(1, n)]
    return np.array(corners)


def _inward_corners(polygon: Array) -> list[float]:
    """First coordinates of the corners where the outline turns inward."""
    before = polygon - np.roll(polygon, 1, axis=0)
    after = np.roll(polygon, -1, axis=0) - polygon
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    scale = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return [float(x) for x in polygon[turn < -_SAME * scale, 0]]


def _mouth(arc: Arc) -> tuple[float, float]:
    """First coordinates of the groove's left and right end, or of its widest place."""
    reach = arc.radius if -arc.sweep > math.pi else arc.radius * math.sin(-arc.sweep / 2)
    return arc.centre[0] - reach, arc.centre[0] + reach


def _polytopes(part: Solid, unit_angle: float) -> Polytopes:
    body = part.bodies[0]
    wedges = part_wedges(part, unit_angle)
    shapes = []
    for wedge in wedges:
        vertices, faces = prism(wedge.polygon, body.start, body.end)
        shapes.append(convex(vertices @ body.frame.T, faces, f"{part.name} {wedge.name}"))
    return Polytopes(shapes, [wedge.name for wedge in wedges])
