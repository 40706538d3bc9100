"""How the parts of a clamp touch: every pair measured by the one engine, and named in the paper's words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.dimensions import Clamp, ConnectionType, PartName
from clamp3d.clamp.matrix import PAIRS, Pair, plain
from clamp3d.clamp.parts import parts
from clamp3d.clamp.scene import clamp_scene
from clamp3d.clamp.section import SPLINTS
from clamp3d.clamp.surfaces import SURFACES, TOUCHING, Surface, surfaces_at
from clamp3d.engine.answer import Distance
from clamp3d.engine.distance import measure
from clamp3d.engine.model import ModelCache
from clamp3d.geometry.pose import Array, SectionPose, inverse
from clamp3d.geometry.profile import Arc
from clamp3d.geometry.shapes import Solid
from clamp3d.kernel.arc_and_circle import classify_arc_circle
from clamp3d.kernel.rectangle import Rectangle, hole_bolt

Poses = Mapping[PartName, SectionPose]

_MODEL = 0.1
"""The nearest points that a contact model says lie on the surfaces to this many mm."""
NONE = "none"
"""Relation of parts that do not touch and for which the paper has no word."""

SCREW_JOINT = "screw joint"
"""Relation of a bolt and its nut."""
_PARALLEL = 1e-8
"""Turn of two flat faces in rad up to which they meet as faces."""


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
        first = _Side.at(solids[a], poses[a].T(), d.point_a, tolerance)
        second = _Side.at(solids[b], poses[b].T(), d.point_b, tolerance)
        kind, relation = _relation(clamp, poses, first, second, d.value)
        names = [surface.name for surface in (*first.surfaces, *second.surfaces)]
        feature = "thread" if relation == SCREW_JOINT else min(names, key=SURFACES.index, default="inside")
        contacts.append(Contact(a, b, clamp.connection(a, b), kind, relation, d, feature))
    return tuple(contacts)


def overlap(contact: Contact) -> str:
    """'P4 overlaps P6 by 1.2 mm' where two parts certainly overlap by more than `TOUCHING`, else nothing."""
    if not contact.gap < -TOUCHING:
        return ""
    at_least = "" if contact.distance.uncertainty <= TOUCHING else "at least "
    return f"{contact.a} overlaps {contact.b} by {at_least}{-contact.gap:.4g} mm"


@dataclass(frozen=True, slots=True)
class _Side:
    """One of two parts that are measured: its solid, its pose (4, 4) in the world, and its nearest surfaces."""

    solid: Solid
    T: Array
    surfaces: tuple[Surface, ...]

    @classmethod
    def at(cls, solid: Solid, T: Array, point: Array | None, tolerance: float) -> _Side:
        """With the surfaces at a point (3,) of the world."""
        local = None if point is None else inverse(T) @ np.array([*point, 1.0])
        return cls(solid, T, () if local is None else surfaces_at(solid, local, tolerance))

    def named(self, *names: str) -> Iterator[Surface]:
        """Its surfaces of these names."""
        return (surface for surface in self.surfaces if surface.name in names)


def _relation(clamp: Clamp, poses: Poses, a: _Side, b: _Side, gap: float) -> tuple[ConnectionType, str]:
    """Type of the connection by what touches, and what the paper calls it, or the plainest word where it has none."""
    if _threaded(a, b) or _threaded(b, a):
        return 1, SCREW_JOINT
    for arc, back in ((a, b), (b, a)):
        for concave, convex in itertools.product(arc.named("arc", "lip"), back.named("round face")):
            if gap <= TOUCHING or clamp.connection(a.solid.name, b.solid.name) == 3:
                return (3 if gap <= TOUCHING else 0), _arc_relation(arc, concave, back, convex, gap)
    if gap > TOUCHING:
        return 0, NONE
    if gap < -TOUCHING:
        return 2, "overlap"
    if any(_face_each_other(a, x, b, y) for x, y in itertools.product(a.surfaces, b.surfaces)):
        return 2, "seat"
    if a.solid.name in SPLINTS and any(a.named("hole")) and any(b.named("round face")):
        words = _hole_relation(clamp, poses, a.solid.name)
        return 2, "contact" if words == NONE else words
    return 2, "contact"


def _arc_relation(arc: _Side, concave: Surface, back: _Side, convex: Surface, gap: float) -> str:
    """Column of Table 3 for a concave arc and a round face along it."""
    groove, circle = concave.edge, convex.edge
    if not (isinstance(groove, Arc) and isinstance(circle, Arc)):
        return NONE
    centre = convex.extrusion.frame @ np.array([*circle.centre, 0.0])
    T = inverse(arc.T) @ back.T
    a, b, _ = (T[:3, :3] @ centre + T[:3, 3]) @ concave.extrusion.frame
    x, y = float(a) - groove.centre[0], float(b) - groove.centre[1]
    deepest = 0.5 * (groove.start_angle + groove.end_angle)
    c, s = -math.sin(deepest), math.cos(deepest)  # turned until the deepest point is at -y
    half = 0.5 * abs(groove.sweep)
    x, y = c * x + s * y, c * y - s * x
    return classify_arc_circle(gap, groove.radius, half, circle.radius, x, y, tolerance=TOUCHING).value


def _face_each_other(a: _Side, x: Surface, b: _Side, y: Surface) -> bool:
    """Whether two surfaces are flat and their normals opposite, to what a part's size makes of `TOUCHING`."""
    if x.normal is None or y.normal is None:
        return False
    return bool(np.linalg.norm(a.T[:3, :3] @ x.normal + b.T[:3, :3] @ y.normal) <= _PARALLEL)


def _threaded(bolt: _Side, nut: _Side) -> bool:
    """Whether a round bar of one part stands in a round hole of the other that it fills: threads are not drawn."""
    T = inverse(nut.T) @ bolt.T
    for bar, hole in itertools.product(bolt.solid.bodies, nut.solid.holes):
        circle, bore = bar.profile.edges[0], hole.profile.edges[0]
        if not (isinstance(circle, Arc) and isinstance(bore, Arc)) or bar.axis != hole.axis:
            continue
        frame = hole.frame
        ends = [frame.T @ (T[:3, :3] @ frame @ np.array([*circle.centre, z]) + T[:3, 3]) for z in (bar.start, bar.end)]
        filled = abs(circle.radius - bore.radius) <= TOUCHING
        coaxial = all(math.dist(end[:2], bore.centre) <= TOUCHING for end in ends)
        low, high = sorted(float(end[2]) for end in ends)
        if filled and coaxial and low < hole.end and high > hole.start:
            return True
    return False


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
    return hole_bolt(hole, bolt, tolerance=TOUCHING).relation.value
