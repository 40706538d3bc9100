"""How the parts of a clamp touch: every pair measured by the one engine, and named in the paper's words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.dimensions import PAIRS, TOUCHING, Clamp, ConnectionType, Pair, PartName
from clamp3d.clamp.parts import clamp_scene, groove_pairs, parts
from clamp3d.clamp.plain import plain
from clamp3d.clamp.section import SPLINTS
from clamp3d.engine.answer import Distance
from clamp3d.engine.distance import measure
from clamp3d.engine.model import ModelCache
from clamp3d.geometry.pose import Array, SectionPose, inverse
from clamp3d.geometry.profile import Arc, Edge
from clamp3d.geometry.shapes import Solid
from clamp3d.kernel.arc_and_circle import classify_arc_circle
from clamp3d.kernel.contact_model import GroovePair
from clamp3d.kernel.rectangle import Rectangle, hole_bolt

Poses = Mapping[PartName, SectionPose]

_MODEL = 0.1
"""The nearest points that a contact model says lie on the surfaces to this many mm: twice a mesh's usual error."""
NONE = "none"
"""Relation of parts that do not touch and for which the paper has no word."""

SCREW_JOINT = "screw joint"
"""Relation of a bolt and its nut."""
_PARALLEL = 1e-8
"""Turn of two flat faces in rad up to which they meet as faces: over 100 mm that is `TOUCHING`."""

SURFACES = ("lip", "arc", "hole", "flat face", "round face", "end face")
"""Names of surfaces; of two that touch the one that comes first names the contact."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A surface of a solid: its ``name``, one of `SURFACES`, and the unit vector (3,) out of it where it is flat."""

    name: str
    normal: Array | None


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
        distance: dict[str, Any] = data.pop("distance")
        return data | {"point": distance["point_a"]} | distance


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
    solids, contacts = parts(clamp), []
    for (a, b), d in measure(scene, pairs, model=model, cache=cache).items():
        tolerance = TOUCHING if d.estimate is None else _MODEL
        places = ((solids[a], poses[a].T(), d.point_a), (solids[b], poses[b].T(), d.point_b))
        first, second = (() if point is None else surfaces_at(solid, T, point, tolerance) for solid, T, point in places)
        kind, relation = _relation(clamp, poses, (a, b), d.value, (first, second))
        names = [surface.name for surface in (*first, *second)]
        feature = "thread" if relation == SCREW_JOINT else min(names, key=SURFACES.index, default="inside")
        contacts.append(Contact(a, b, clamp.connection(a, b), kind, relation, d, feature))
    return tuple(contacts)


def overlap(contact: Contact) -> str:
    """'P4 overlaps P6 by 1.2 mm' where two parts certainly overlap by more than `TOUCHING`, else nothing."""
    if not contact.gap < -TOUCHING:
        return ""
    at_least = "" if contact.distance.uncertainty <= TOUCHING else "at least "
    return f"{contact.a} overlaps {contact.b} by {at_least}{-contact.gap:.4g} mm"


def _relation(
    clamp: Clamp, poses: Poses, pair: Pair, gap: float, surfaces: tuple[tuple[Surface, ...], tuple[Surface, ...]]
) -> tuple[ConnectionType, str]:
    """Type of the connection by what touches, and what the paper calls it, or the plainest word where it has none."""
    if pair == ("P4", "P5") and _is_screwed_on(clamp, poses):
        return 1, SCREW_JOINT
    first, second = ({surface.name for surface in own} for own in surfaces)
    groove = next((groove for groove in groove_pairs(clamp).values() if {groove.a, groove.b} == set(pair)), None)
    if groove is not None and (gap <= TOUCHING or clamp.connection(*pair) == 3):
        hollow, back = (first, second) if groove.a == pair[0] else (second, first)
        if hollow & {"arc", "lip"} and "round face" in back:
            return (3 if gap <= TOUCHING else 0), _arc_relation(groove, poses, gap)
    if gap > TOUCHING:
        return 0, NONE
    if gap < -TOUCHING:
        return 2, "overlap"
    flat = [(x.normal, y.normal) for x in surfaces[0] for y in surfaces[1]]
    if any(x is not None and y is not None and np.linalg.norm(x + y) <= _PARALLEL for x, y in flat):
        return 2, "seat"
    if pair[0] in SPLINTS and "hole" in first and "round face" in second:
        words = _hole_relation(clamp, poses, pair[0])
        return 2, "contact" if words == NONE else words
    return 2, "contact"


def _arc_relation(pair: GroovePair, poses: Poses, gap: float) -> str:
    """Column of Table 3 for a concave arc and a round face along it."""
    T = pair.T_groove_a @ inverse(poses[pair.a].T()) @ poses[pair.b].T() @ pair.T_b_cylinder
    groove, (x, y) = pair.groove, T[:2, 3].tolist()
    radius = pair.cylinder.radius
    return classify_arc_circle(gap, groove.radius, groove.half_angle, radius, x, y, tolerance=TOUCHING).value


def _is_screwed_on(clamp: Clamp, poses: Poses) -> bool:
    """Whether the shank stands in the nut's hole, which it fills: threads are not drawn."""
    bolt, nut = poses["P4"], poses["P5"]
    is_coaxial = max(abs(bolt.x - nut.x), abs(bolt.along - nut.along)) <= TOUCHING
    return is_coaxial and bolt.y < nut.y + clamp.nut.height and bolt.y + clamp.bolt.shank_length > nut.y


def _hole_relation(clamp: Clamp, poses: Poses, splint: PartName) -> str:
    """Row of Table 2 for the bolt in the hole of a splint."""
    shank = clamp.bolt.shank_length / 2
    bolt = Rectangle(*poses["P4"].point(0.0, shank), clamp.bolt.diameter / 2, shank)
    up, down = clamp.up_splint, clamp.down_splint
    middle, width, top, bottom = up.width / 2, up.hole_diameter, 0.0, up.thickness
    if splint == "P2":
        middle, width, top, bottom = 0.0, down.slot_width, down.face_depth, down.slot_bottom
    centre = poses[splint].point(middle, 0.5 * (top + bottom))
    hole = Rectangle(*centre, width / 2, 0.5 * (bottom - top), poses[splint].angle)
    return hole_bolt(hole, bolt, tolerance=TOUCHING).relation.value


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
