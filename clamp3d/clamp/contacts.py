"""Contacts of a state: every declared pair measured and named, and pairs that meet though they should not."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from clamp3d.clamp.connections import CONVEX_PAIRS, GEOMETRY, PAIRS, Undeclared, convex_gap
from clamp3d.clamp.contact import Seat
from clamp3d.clamp.dimensions import Clamp, ConnectionType, PartName
from clamp3d.clamp.result import Event, Waypoint
from clamp3d.clamp.section import SPLINTS, WIRES, Section
from clamp3d.core.arc_circle import classify_arc_circle
from clamp3d.core.pose import Array, SectionPose, inverse
from clamp3d.core.rectangle import Rectangle, hole_bolt

CONTACT = 1e-6
"""Gap in mm up to which two parts touch."""

OFF_ARC = ("face ", "flat", "lip", "end", "corner")
"""How the names of features begin that are not of a groove's arc."""


@dataclass(frozen=True, slots=True)
class Contact:
    """How a declared pair stands: ``distance`` mm (positive apart), ``point`` (3,) and ``normal`` (3,) in the world.

    ``relation`` is a column of Table 3 (type 3), a row of Table 2 or 'seat' (type 2), or 'screw joint' (type 1);
    ``feature`` names the piece of the groove. ``point`` lies on part a, ``normal`` is unit from a to b.
    """

    a: PartName
    b: PartName
    type: ConnectionType
    relation: str
    distance: float
    point: Array
    normal: Array
    feature: str


Poses = dict[PartName, SectionPose]


def measure_pairs(section: Section, poses: Poses, tolerance: float) -> tuple[Contact, ...]:
    """All 21 pairs at ``poses``, in the order of the connection matrix; equality is ``|gap| <= tolerance`` mm."""
    return tuple(_measure(section, poses, a, b, tolerance) for a, b in PAIRS)


def seats(pairs: Sequence[Contact], resolution: float) -> tuple[Seat, ...]:
    """Whether each wire lies in each of its two grooves, of `measure_pairs`; a gap up to ``resolution`` mm touches."""
    by_pair = {(c.a, c.b): c for c in pairs}
    found = []
    for splint, wire in itertools.product(SPLINTS, WIRES):
        contact = by_pair[splint, wire]
        on_arc = not contact.feature.startswith(OFF_ARC)
        touching = contact.distance <= resolution
        if touching and on_arc:
            detail = "seated in the groove"
        elif touching:
            detail = f"rests on {contact.feature}"
        else:
            detail = "loose"
        found.append(Seat(splint, wire, touching and on_arc, contact.distance, detail))
    return tuple(found)


def undeclared_meetings(section: Section, path: Sequence[Waypoint], events: Sequence[Event]) -> tuple[Undeclared, ...]:
    """Pairs that met anywhere on ``path`` or in ``events`` otherwise than the connection matrix declares."""
    clamp = section.clamp
    met: dict[tuple[PartName, PartName], str] = {}
    for event in events:
        met.setdefault((event.a, event.b), event.step)
    for before, after in itertools.pairwise(path):
        for pair, gap in _least_on_the_way(section, before.poses, after.poses).items():
            if gap <= CONTACT:
                met.setdefault(pair, f"{after.step} ({after.label})")
    return tuple(
        Undeclared(a, b, clamp.connection(a, b), GEOMETRY.get((a, b), 2), where)
        for (a, b), where in met.items()
        if clamp.connection(a, b) != GEOMETRY.get((a, b), 2)
    )


# Rows of (hole, bolt) pairs and of flat seats: the nut on the up splint, the bolt's head under the saddle.
_HOLES = {("P1", "P4"), ("P2", "P4")}
_SEATS = {("P1", "P5"), ("P3", "P4")}


def _measure(section: Section, poses: Poses, a: PartName, b: PartName, tolerance: float) -> Contact:
    clamp, kind = section.clamp, GEOMETRY.get((a, b), 2)
    if kind == 3:
        return _groove_contact(section, poses, a, b, tolerance)
    if kind == 1:
        axis = poses[b].point(0.0, clamp.nut.height / 2)
        gap = max(0.0, poses[a].y - poses[b].y - clamp.nut.height)  # the bolt's end below the nut
        relation = "none" if gap else "screw joint"
        return Contact(a, b, 1, relation, gap, _world(axis), np.array([0.0, 0.0, 1.0]), "thread")
    if (a, b) in _SEATS:
        return _seat_contact(clamp, poses, a, b, tolerance)
    if (a, b) in _HOLES:
        return _hole_contact(clamp, poses, a, b, tolerance)
    if (a, b) == ("P1", "P2"):
        gap, point = _face_gap(section, poses)
        relation = "faces meet" if gap <= tolerance else "none"
        return Contact(a, b, 2, relation, gap, point, np.array([0.0, 0.0, -1.0]), "inner face")
    gap = convex_gap(clamp, poses, a, b)
    point = _world((poses[b].x, poses[b].y))
    away = point - _world((poses[a].x, poses[a].y))
    normal = away / max(float(np.linalg.norm(away)), 1e-300)
    return Contact(a, b, 2, "contact" if gap <= tolerance else "none", gap, point, normal, "box")


def _groove_contact(section: Section, poses: Poses, a: PartName, b: PartName, tolerance: float) -> Contact:
    key = (a, b) if (a, b) in section.pairs else (b, a)
    pair = section.pairs[key]
    T_a, T_b = poses[pair.a].T(), poses[pair.b].T()
    pieces = section.model.pieces(pair, inverse(T_a) @ T_b)
    section.queries.contact += 1
    k = int(np.argmin(pieces.distance))
    gap = float(pieces.distance[k])
    T = inverse(T_a @ pair.T_a_groove) @ T_b @ pair.T_b_cylinder
    g, r = pair.groove, pair.cylinder.radius
    relation = classify_arc_circle(gap, g.radius, g.half_angle, r, float(T[0, 3]), float(T[1, 3]), tolerance=tolerance)
    point = T_a[:3, :3] @ pieces.point[k] + T_a[:3, 3]
    normal = T_a[:3, :3] @ pieces.normal[k]
    if key != (a, b):
        point, normal = point + gap * normal, -normal
    return Contact(a, b, 3, relation.value, gap, point, normal, pieces.feature[k])


def _seat_contact(clamp: Clamp, poses: Poses, a: PartName, b: PartName, tolerance: float) -> Contact:
    if (a, b) == ("P1", "P5"):  # nut's lower face over the up splint's top face
        gap, up = poses["P1"].y - (poses["P5"].y + clamp.nut.height), 1.0
        point = (poses["P5"].x, poses["P1"].y)
    else:  # bolt's head under the saddle's flat bottom
        bottom = poses["P3"].y + clamp.saddle.radius + clamp.saddle.apex_thickness
        gap, up = poses["P4"].y + clamp.bolt.shank_length - bottom, -1.0
        point = (poses["P3"].x, bottom)
    relation = "seat" if abs(gap) <= tolerance else "overlap" if gap < 0.0 else "none"
    return Contact(a, b, 2, relation, gap, _world(point), np.array([0.0, 0.0, up]), "flat face")


def _hole_contact(clamp: Clamp, poses: Poses, a: PartName, b: PartName, tolerance: float) -> Contact:
    bolt = Rectangle(
        *poses["P4"].point(0.0, clamp.bolt.shank_length / 2), clamp.bolt.diameter / 2, clamp.bolt.shank_length / 2
    )
    if a == "P1":
        up = clamp.up_splint
        middle, half_width, top, bottom = up.width / 2, up.hole_diameter / 2, 0.0, up.thickness
    else:  # the slot's walls end where they come out of the round back
        down = clamp.down_splint
        middle, half_width, top = 0.0, down.slot_width / 2, down.face_depth
        bottom = math.sqrt(down.back_radius**2 - half_width**2)
    centre = poses[a].point(middle, 0.5 * (top + bottom))
    hole = Rectangle(*centre, half_width, 0.5 * (bottom - top), poses[a].angle)
    found = hole_bolt(hole, bolt, tolerance=tolerance)
    gap, (nx, ny) = min(found.gap_left, found.gap_right), found.normal
    if math.isinf(gap):  # the bolt ends before the hole
        gap = convex_gap(clamp, poses, a, b)
    return Contact(a, b, 2, found.relation.value, gap, _world(found.point), np.array([nx, 0.0, -ny]), "hole")


def _face_gap(section: Section, poses: Poses) -> tuple[float, Array]:
    """Least gap between the inner faces of the splints along the bolt in mm, and its point (3,) in the world."""
    q = np.zeros(6)
    q[4] = poses["P2"].y - poses["P1"].y
    q[5] = section.lever * poses["P2"].angle
    gaps = section.face_gaps(q)
    k = int(np.argmin(gaps.value[:2]))
    return float(gaps.value[k]), _world(poses["P1"].point(*gaps.point[k]))


def _least_on_the_way(section: Section, before: Poses, after: Poses) -> dict[tuple[PartName, PartName], float]:
    """Least gap of each convex pair while all parts go straight from one state to the next.

    Between convex bodies that do not turn the gap is a convex function of the way, so one descent finds it.
    """

    def at(t: float) -> Poses:
        return {
            name: SectionPose(
                p.x + t * (after[name].x - p.x),
                p.y + t * (after[name].y - p.y),
                p.angle + t * (after[name].angle - p.angle),
            )
            for name, p in before.items()
        }

    def gap_at(pair: tuple[PartName, PartName], t: float) -> float:
        poses = at(t)
        return _face_gap(section, poses)[0] if pair == ("P1", "P2") else convex_gap(section.clamp, poses, *pair)

    least = {}
    for pair in (*CONVEX_PAIRS, ("P1", "P2")):
        a, b = pair
        gap = min(gap_at(pair, 0.0), gap_at(pair, 1.0))
        # The parts cannot come closer than their way relative to each other, turning counted at the splints' ends.
        way = math.hypot(
            after[a].x - before[a].x - after[b].x + before[b].x, after[a].y - before[a].y - after[b].y + before[b].y
        )
        way += 2.0 * section.lever * max(abs(after[n].angle - before[n].angle) for n in pair)
        if 0.0 < gap < way:
            found = minimize_scalar(lambda t, pair=pair: gap_at(pair, t), bounds=(0.0, 1.0), method="bounded")
            gap = min(gap, float(found.fun))
        least[pair] = gap
    return least


def _world(point: tuple[float, float]) -> Array:
    """World coordinates of a section point, in the middle of the clamp."""
    return np.array([point[0], 0.0, -point[1]])
