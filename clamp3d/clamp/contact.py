"""How the parts of a clamp touch: every pair measured by the one engine, and named in the paper's words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.dimensions import Clamp, ConnectionType, PartName
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.matrix import ARC_PAIRS, PAIRS, SCREW, Pair, contact_type, plain
from clamp3d.clamp.parts import parts
from clamp3d.clamp.scene import CONTACT, clamp_scene
from clamp3d.clamp.section import SPLINTS, WIRES
from clamp3d.collide.distance import Distance, measure
from clamp3d.collide.model import ModelCache
from clamp3d.core.arc_circle import classify_arc_circle
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, SectionPose, inverse
from clamp3d.core.profile import Arc, Edge
from clamp3d.core.rectangle import Rectangle, hole_bolt
from clamp3d.core.shapes import Solid

Poses = Mapping[PartName, SectionPose]

_MODEL = 0.1
"""The nearest points that a contact model says lie on the surfaces to this many mm."""
NONE = "none"
"""Relation of parts that do not touch and for which the paper has no word."""

_SEATS: tuple[Pair, ...] = (("P1", "P5"), ("P3", "P4"))
"""Pairs whose flat faces meet: the nut on the up splint, the saddle on the bolt's head."""
_HOLES: tuple[Pair, ...] = (("P1", "P4"), ("P2", "P4"))
"""Pairs of Table 2: the bolt in the hole of each splint."""


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """How two parts stand to each other.

    Attributes
    ----------
    a, b : str
        The two parts.
    declared : int
        Their entry in the connection matrix: 0 none, 1 screw joint, 2 convex object, 3 concave arc surface.
    type : int
        The same as measured: 0 where they do not touch.
    relation : str
        In the paper's words: a column of Table 3 for a cylinder and an arc, a row of Table 2 for the bolt in a hole,
        "seat" for flat faces, "screw joint" for the thread; "contact" or "overlap" for others, "none" where they are
        apart.
    distance : Distance
        Signed distance with its nearest points and normal, in the world; mm.
    feature : str
        The surface that is nearest: "arc", "lip", "hole", "flat face", "round face", "end face" or "thread".
    """

    a: PartName
    b: PartName
    declared: ConnectionType
    type: ConnectionType
    relation: str
    distance: Distance
    feature: str

    @property
    def gap(self) -> float:
        """Signed distance in mm, positive apart."""
        return self.distance.value

    @property
    def point(self) -> Array | None:
        """The nearest point (3,) on part a, in the world."""
        return self.distance.point_a

    @property
    def normal(self) -> Array | None:
        """Unit vector (3,) from a to b, in the world."""
        return self.distance.normal

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        data = plain(self)
        distance: dict[str, Any] = data.pop("distance").to_dict()
        return data | {"point": distance["point_a"]} | distance


@dataclass(frozen=True, slots=True)
class Seat:
    """A wire in a groove: ``seated`` if it touches the groove's arc; ``gap`` in mm; ``detail`` in words."""

    splint: PartName
    wire: PartName
    seated: bool
    gap: float
    detail: str


def measure_contacts(
    clamp: Clamp,
    poses: Poses,
    model: ContactModel | None = None,
    *,
    pairs: Iterable[Pair] = PAIRS,
    cache: ModelCache | None = None,
) -> tuple[Contact, ...]:
    """Measure pairs of a clamp's parts and name how they touch.

    Parameters
    ----------
    clamp : Clamp
    poses : dict of SectionPose
        Where the seven parts are.
    model : ContactModel, optional
        How a groove and a wire are measured; by default the exact arcs.
    pairs : iterable of (str, str), optional
        Which pairs; by default all 21, in the order of the connection matrix.
    cache : ModelCache, optional
        Keeps models of the parts from one call to the next.

    Examples
    --------
    >>> from clamp3d.clamp.assemble import assemble
    >>> assembly = assemble()
    >>> [(c.type, c.relation) for c in measure_contacts(assembly.clamp, assembly.poses, pairs=[("P1", "P5")])]
    [(2, 'seat')]
    """
    scene = clamp_scene(clamp, {part: pose.T() for part, pose in poses.items()})
    solids = parts(clamp)
    found = []
    for (a, b), d in measure(scene, pairs, model=model, cache=cache).items():
        relation = _relation(clamp, poses, (a, b), d)
        kind: ConnectionType = contact_type((a, b)) if d.value <= CONTACT and relation != NONE else 0
        names = [
            surface_name(
                solids[part],
                dot(inverse(poses[part].T()), np.array([*point, 1.0])),
                CONTACT if d.estimate is None else _MODEL,
            )
            for part, point in ((a, d.point_a), (b, d.point_b))
            if point is not None
        ]
        feature = "thread" if (a, b) == SCREW else min(names, key=_SURFACES.index, default="inside")
        found.append(Contact(a, b, clamp.connection(a, b), kind, relation, d, feature))
    return tuple(found)


def overlap(contact: Contact) -> str:
    """'P4 overlaps P6 by 1.2 mm' where two parts certainly overlap by more than `CONTACT`, else nothing."""
    if not contact.gap < -CONTACT:
        return ""
    at_least = "" if contact.distance.uncertainty <= CONTACT else "at least "
    return f"{contact.a} overlaps {contact.b} by {at_least}{-contact.gap:.4g} mm"


def seats(contacts: Iterable[Contact], tolerance: float) -> tuple[Seat, ...]:
    """Whether each wire lies in each of its two grooves; a gap up to ``tolerance`` mm touches."""
    by_pair = {(c.a, c.b): c for c in contacts}
    found = []
    for splint, wire in itertools.product(SPLINTS, WIRES):
        contact = by_pair[splint, wire]
        touching = contact.gap <= tolerance
        seated = touching and contact.feature == "arc"
        detail = "seated in the groove" if seated else f"rests on the {contact.feature}" if touching else "loose"
        found.append(Seat(splint, wire, seated, contact.gap, detail))
    return tuple(found)


def _relation(clamp: Clamp, poses: Poses, pair: Pair, d: Distance) -> str:
    """What the paper calls it, or the plainest word where it has none."""
    gap = d.value
    if pair in ARC_PAIRS:
        return _arc_relation(clamp, poses, pair, gap)
    if pair == SCREW:
        return "screw joint" if poses["P4"].y < poses["P5"].y + clamp.nut.height else NONE
    if gap > CONTACT:
        return NONE
    if gap < -CONTACT:
        return "overlap"
    if pair in _SEATS or (pair == ("P1", "P2") and poses["P1"].angle == poses["P2"].angle):
        return "seat"
    words = _hole_relation(clamp, poses, pair[0]) if pair in _HOLES else NONE
    return "contact" if words == NONE else words


def _arc_relation(clamp: Clamp, poses: Poses, pair: Pair, gap: float) -> str:
    """Column of Table 3 for a cylinder and the arc that it lies in."""
    arcs = groove_pairs(clamp)
    arc = arcs[pair] if pair in arcs else arcs[pair[1], pair[0]]
    T = dot(dot(inverse(dot(poses[arc.a].T(), arc.T_a_groove)), poses[arc.b].T()), arc.T_b_cylinder)
    groove, radius = arc.groove, arc.cylinder.radius
    x, y = float(T[0, 3]), float(T[1, 3])
    return classify_arc_circle(gap, groove.radius, groove.half_angle, radius, x, y, tolerance=CONTACT).value


def _hole_relation(clamp: Clamp, poses: Poses, splint: PartName) -> str:
    """Row of Table 2 for the bolt in the hole of a splint."""
    shank = clamp.bolt.shank_length / 2
    bolt = Rectangle(*poses["P4"].point(0.0, shank), clamp.bolt.diameter / 2, shank)
    if splint == "P1":
        up = clamp.up_splint
        middle, half_width, top, bottom = up.width / 2, up.hole_diameter / 2, 0.0, up.thickness
    else:  # the slot's walls end where they come out of the round back
        down = clamp.down_splint
        middle, half_width, top = 0.0, down.slot_width / 2, down.face_depth
        bottom = math.sqrt(down.back_radius**2 - half_width**2)
    centre = poses[splint].point(middle, 0.5 * (top + bottom))
    hole = Rectangle(*centre, half_width, 0.5 * (bottom - top), poses[splint].angle)
    return hole_bolt(hole, bolt, tolerance=CONTACT).relation.value


_SURFACES = ("lip", "arc", "hole", "flat face", "round face", "end face")
"""Names of surfaces; of two that touch the one that comes first names the contact."""


def surface_name(solid: Solid, point: Array, tolerance: float = CONTACT) -> str:
    """The surface of a solid that a point (3,) in its own frame is nearest to; a lip is where a concave arc ends.

    Of surfaces that are as near to within ``tolerance`` mm the first of `_SURFACES` counts.

    >>> from clamp3d.core.shapes import cylinder
    >>> surface_name(cylinder(5.0, 20.0), np.array([5.0, 0.0, 3.0]))
    'round face'
    """
    near: list[tuple[float, str]] = []
    for extrusion in (*solid.bodies, *solid.holes):
        hole = extrusion in solid.holes
        a, b, along = (float(v) for v in dot(np.asarray(point)[:3], extrusion.frame))
        for edge in extrusion.profile.edges:
            near.append((_edge_distance(edge, a, b), "hole" if hole else _edge_name(edge, a, b)))
        if not hole:
            end = min(abs(along - extrusion.start), abs(along - extrusion.end))
            near.append((end, "end face" if extrusion.axis == "Y" else "flat face"))
    least = min(distance for distance, _ in near)
    return min((name for distance, name in near if distance <= least + tolerance), key=_SURFACES.index)


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
    return "lip" if min(math.dist((a, b), edge.start), math.dist((a, b), edge.end)) <= CONTACT else "arc"
