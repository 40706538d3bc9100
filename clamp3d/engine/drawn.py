"""From drawn solids to bodies in closed form: circles are cylinders, concave arcs grooves, the rest polyhedra."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from clamp3d.engine.closed_form import Bore, ClosedForm
from clamp3d.engine.convex import Convex, Rod
from clamp3d.engine.hull import STRAIGHT, Hull, hull, prism
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import Array, cross, to_source, to_target, translation
from clamp3d.geometry.profile import Arc, Profile, turns
from clamp3d.geometry.shapes import Solid

_TANGENTS = 12


def bodies_of(solid: Solid) -> tuple[ClosedForm, ...] | None:
    """Bodies whose union is the solid; None if an outline is of a kind that has no closed form here.

    An outline is taken apart at the chords of its arcs: what remains must be convex. Each convex arc adds the segment
    between it and its chord, each concave one is a groove of what remains, and may not reach into such a segment.
    """
    bodies: list[ClosedForm] = []
    for body in solid.bodies:
        pieces = _pieces(body)
        if pieces is None:
            return None
        forms = [ClosedForm(outers, tuple(grooves)) for outers, grooves in pieces]
        for hole in solid.holes:
            cut = [_less(piece, hole) for piece in forms]
            if any(one is None for one in cut):
                return None
            forms = [piece for one in cut if one is not None for piece in one]
        bodies += forms
    return tuple(bodies)


def _pieces(body: Extrusion) -> list[tuple[tuple[Convex, ...], list[Bore]]] | None:
    circle = _circle(body.profile)
    if circle is not None:
        return [((Rod(circle.radius, body.length, _pose(body, circle.centre)),), [])]
    corners = np.array([edge.start for edge in body.profile.edges])
    turn = turns(corners)
    if (turn < -STRAIGHT).any():
        return None
    pieces: list[tuple[tuple[Convex, ...], list[Bore]]] = []
    grooves = []
    for arc in body.profile.arcs:
        if arc.sweep < 0.0:
            if any(_passes_chord(arc, other) for other in body.profile.arcs if other.sweep > 0.0):
                return None
            middle = 0.5 * (arc.start_angle + arc.end_angle)
            T = _pose(body, arc.centre, middle)
            grooves.append(Bore(arc.radius, 0.5 * abs(arc.sweep), body.length, T))
        else:
            pieces.append(((Rod(arc.radius, body.length, _pose(body, arc.centre)), _beyond_chord(body, arc)), []))
    if (turn > STRAIGHT).any():
        pieces.insert(0, ((prism(corners, body.start, body.end, body.frame),), grooves))
    elif grooves:
        return None
    return pieces


def _passes_chord(concave: Arc, convex: Arc) -> bool:
    """Whether a concave arc takes something away between a convex one and its chord, as the inside of a clip does."""
    (x0, y0), (x1, y1) = convex.start, convex.end
    out = y1 - y0, x0 - x1
    size = abs(x0) + abs(y0) + concave.radius + math.hypot(*concave.centre)
    return concave.support(*out) > out[0] * x0 + out[1] * y0 + STRAIGHT * size * math.hypot(*out)


def _circle(profile: Profile) -> Arc | None:
    arcs = profile.arcs
    if len(profile.edges) == 1 and len(arcs) == 1 and arcs[0].sweep > 0.0:
        return arcs[0]
    return None


def _pose(body: Extrusion, centre: tuple[float, float], middle: float = -math.pi / 2) -> Array:
    """Frame (4, 4) at an outline's point: z along the drawing axis, -y to the outline's direction ``middle`` (rad)."""
    y = -np.array([math.cos(middle), math.sin(middle), 0.0])
    R = np.column_stack([[y[1], -y[0], 0.0], y, [0.0, 0.0, 1.0]])
    T = np.eye(4)
    T[:3, :3] = body.frame @ R
    T[:3, 3] = body.frame @ np.array([*centre, 0.5 * (body.start + body.end)])
    return T


def _beyond_chord(body: Extrusion, arc: Arc) -> Hull:
    """Prism around the segment between a convex arc and its chord: tangents in place of the arc."""
    step = arc.sweep / _TANGENTS
    angles = [arc.start_angle, *(arc.start_angle + (k + 0.5) * step for k in range(_TANGENTS)), arc.end_angle]
    radii = [arc.radius, *[arc.radius / math.cos(0.5 * step)] * _TANGENTS, arc.radius]
    tangents = np.column_stack([np.cos(angles), np.sin(angles)]) * np.array(radii)[:, None]
    return prism(np.array(arc.centre) + tangents, body.start, body.end, body.frame)


def _less(body: ClosedForm, hole: Extrusion) -> list[ClosedForm] | None:
    """The body less a round hole, or in pieces: one for each wall of a straight-sided slot, beyond that wall."""
    circle = _circle(hole.profile)
    if circle is not None:
        T = _pose(hole, circle.centre)
        axis = np.outer((-1.0, 1.0), T[:3, 2])
        ends = np.array([to_source(T, piece.support(axis))[:, 2] for piece in body.outers])
        low, high = float(ends[:, 0].max()), float(ends[:, 1].min())
        bore = Bore(circle.radius, math.pi, max(high - low, 1e-6), T @ translation(0.0, 0.0, 0.5 * (low + high)))
        return [replace(body, bores=(*body.bores, bore))]
    if hole.profile.arcs:
        return None
    corners = np.array([edge.start for edge in hole.profile.edges])
    along = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    offsets = -np.einsum("ij,ij->i", normals, corners)
    if ((corners @ normals.T + offsets) > STRAIGHT * (1.0 + np.abs(corners).max())).any():
        return None
    planes = np.column_stack([np.column_stack([normals, 0.0 * offsets]) @ hole.frame.T, offsets])
    return [piece for plane in planes if (piece := _beyond(body, plane)) is not None]


def _beyond(body: ClosedForm, plane: Array) -> ClosedForm | None:
    """What of a body lies in the half-space plane[:3] . x + plane[3] >= 0; None for nothing."""
    rods = [piece for piece in body.outers if isinstance(piece, Rod)]
    hulls = [piece for piece in body.outers if isinstance(piece, Hull)]
    if not hulls:
        sides = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        hulls = [hull(to_target(rods[0].T, sides * (rods[0].radius, rods[0].radius, 0.5 * rods[0].length)))]
    clipped = [piece.clipped(plane) for piece in hulls]
    if None in clipped:
        return None
    outers: list[Convex] = [*rods, *(piece for piece in clipped if piece is not None)]
    for rod in rods:
        offset = -float(plane[:3] @ rod.T[:3, 3] + plane[3])
        if abs(float(plane[:3] @ rod.T[:3, 2])) < STRAIGHT and abs(offset) < rod.radius:
            # Where the wall leaves the round side there is a corner: the tangents there make it one of the hull.
            outers = [_tangential(piece, rod, plane[:3], offset) for piece in outers]
    return replace(body, outers=tuple(outers))


def _tangential(piece: Convex, rod: Rod, wall: Array, offset: float) -> Convex:
    """A hull around a rod cut by the tangent planes where a ``wall`` parallel to the rod's axis meets its side."""
    across = cross(rod.T[:3, 2], wall)
    for side in (-1.0, 1.0):
        if isinstance(piece, Hull):
            out = (offset * wall + side * math.sqrt(rod.radius**2 - offset**2) * across) / rod.radius
            piece = piece.clipped(np.array([*-out, rod.radius + float(out @ rod.T[:3, 3])])) or piece
    return piece
