"""From drawn solids to bodies in closed form: circles are cylinders, concave arcs grooves, the rest polyhedra."""

from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.body import Bore, ClosedForm, Slot
from clamp3d.collide.convex import Convex, Rod, hull
from clamp3d.core.extrusion import Extrusion
from clamp3d.core.pose import Array
from clamp3d.core.profile import Arc, Profile
from clamp3d.core.shapes import Solid

_FLAT = 1e-9


def bodies_of(solid: Solid) -> tuple[ClosedForm, ...] | None:
    """Bodies whose union is the solid; None if an outline is of a kind that has no closed form here.

    An outline is taken apart at the chords of its arcs: what remains must be convex. Each convex arc adds the segment
    between it and its chord, each concave one is a groove.
    """
    found: list[ClosedForm] = []
    for body in solid.bodies:
        pieces = _pieces(body)
        if pieces is None:
            return None
        for outers, grooves in pieces:
            bores, slots = list(grooves), list[Slot]()
            for hole in solid.holes:
                hollow = _hollow(hole, outers)
                if hollow is None:
                    return None
                if isinstance(hollow, Bore):
                    bores.append(hollow)
                else:
                    slots.append(hollow)
            found.append(ClosedForm(outers, tuple(bores), tuple(slots)))
    return tuple(found)


def _pieces(body: Extrusion) -> list[tuple[tuple[Convex, ...], list[Bore]]] | None:
    circle = _circle(body.profile)
    if circle is not None:
        return [((Rod(circle.radius, body.length, _pose(body, circle.centre)),), [])]
    corners = np.array([edge.start for edge in body.profile.edges])
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    if (turn < -_FLAT * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)).any():
        return None
    pieces: list[tuple[tuple[Convex, ...], list[Bore]]] = []
    grooves = []
    for arc in body.profile.arcs:
        if arc.sweep < 0.0:
            middle = 0.5 * (arc.start_angle + arc.end_angle)
            T = _pose(body, arc.centre, middle)
            grooves.append(Bore(arc.radius, 0.5 * abs(arc.sweep), body.length, T))
        else:
            pieces.append(((Rod(arc.radius, body.length, _pose(body, arc.centre)), _beyond_chord(body, arc)), []))
    if (turn > _FLAT).any():
        pieces.insert(0, ((hull(_prism(body, corners)),), grooves))
    elif grooves:
        return None
    return pieces


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


def _prism(body: Extrusion, corners: Array) -> Array:
    ends = [np.column_stack([corners, np.full(len(corners), z)]) for z in (body.start, body.end)]
    return np.vstack(ends) @ body.frame.T


def _beyond_chord(body: Extrusion, arc: Arc) -> Convex:
    """Prism around the segment between a convex arc and its chord."""
    middle, half = 0.5 * (arc.start_angle + arc.end_angle), 0.5 * arc.sweep
    out = np.array([math.cos(middle), math.sin(middle)])
    side = np.array([-out[1], out[0]])
    low, high = arc.radius * math.cos(half), arc.radius
    wide = arc.radius * (1.0 if half > 0.5 * math.pi else math.sin(half))
    corners = [np.array(arc.centre) + d * out + w * side for d in (low, high) for w in (-wide, wide)]
    return hull(_prism(body, np.array(corners)))


def _hollow(hole: Extrusion, outers: tuple[Convex, ...]) -> Bore | Slot | None:
    """A round hole or a slot, as long as the body it goes through."""
    circle = _circle(hole.profile)
    if circle is not None:
        T = _pose(hole, circle.centre)
        z, middle = T[:3, 2], T[:3, 3]
        low = max(float(z @ (piece.support(-z) - middle)) for piece in outers)
        high = min(float(z @ (piece.support(z) - middle)) for piece in outers)
        T[:3, 3] = middle + 0.5 * (low + high) * z
        return Bore(circle.radius, math.pi, max(high - low, 1e-6), T)
    if hole.profile.arcs:
        return None
    corners = np.array([edge.start for edge in hole.profile.edges])
    along = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    offsets = -np.einsum("ij,ij->i", normals, corners)
    if ((corners @ normals.T + offsets) > _FLAT * (1.0 + np.abs(corners).max())).any():
        return None
    planes = np.column_stack([np.column_stack([normals, 0.0 * offsets]) @ hole.frame.T, offsets])
    return Slot(planes)
