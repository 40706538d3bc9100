"""The motions of an assembly sequence, each ending at a contact, and the poses of all parts on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from clamp3d.clamp.contact import measure_contacts
from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.motion import travel_to_contact
from clamp3d.clamp.result import Event, Waypoint
from clamp3d.clamp.section import WIRES, D, S, Section
from clamp3d.collide.model import ModelCache
from clamp3d.core.pose import Array, SectionPose

Poses = dict[PartName, SectionPose]
_SPARE = 20.0
"""Free way in mm between a wire and the open clamp before it comes in."""


@dataclass
class Log:
    """What happens on the way; ``on_waypoint(waypoint)`` is called as it happens."""

    section: Section
    on_waypoint: Callable[[Waypoint], None] | None
    events: list[Event] = field(default_factory=list)
    path: list[Waypoint] = field(default_factory=list)
    cache: ModelCache = field(default_factory=ModelCache)

    def reach(self, step: str, label: str, poses: Poses) -> None:
        """Add a waypoint."""
        self.path.append(Waypoint(step, label, dict(poses)))
        if self.on_waypoint is not None:
            self.on_waypoint(self.path[-1])

    def touch(self, q: Array, step: str, pair: Pair | None, travel: float) -> None:
        """Add the event of a motion that ended at state ``q``, where ``pair`` touches."""
        assert pair is not None  # every motion here ends at a groove
        section = self.section
        (c,) = measure_contacts(section.clamp, section_poses(section, q), section.model, pairs=[pair], cache=self.cache)
        self.events.append(Event(step, c.a, c.b, c.relation, c.point, travel))


def approach_line(section: Section, q: Array, step: str, log: Log) -> Array:
    """The open clamp comes in from the right until the line lies under its groove, then settles down on the line."""
    clamp = section.clamp
    beside, over, settled = q.copy(), q.copy(), q.copy()
    middle = 0.5 * (clamp.up_splint.thickness + section.down_splint(q).point(0.0, clamp.down_splint.face_depth)[1])
    for state in (beside, over):
        state[1] = middle
    beside[0] = -clamp.line.radius - _SPARE
    settled[:2] = over[:2]
    travel, touch = travel_to_contact(section, settled, "P6", -_unit(1), "P1")
    settled = settled - travel * _unit(1)
    # The jumper waits clear of the clamp's way in.
    waiting = settled.copy()
    waiting[2] = settled[0] - beside[0] + clamp.up_splint.width + clamp.jumper.radius + _SPARE
    waiting[3] = middle
    jumper = section_poses(section, waiting)["P7"]
    for state, label in ((beside, "open clamp beside the line"), (over, "line between the splints")):
        log.reach(step, label, section_poses(section, state) | {"P7": jumper})
    log.reach(step, "up splint rests on the line", section_poses(section, waiting))
    log.touch(waiting, step, touch, travel)
    return waiting


def insert_jumper(section: Section, q: Array, step: str, log: Log) -> Array:
    """The jumper comes in between the splints from its side and is lifted into the up splint's groove."""
    inside = q.copy()
    inside[2] = float(section.pairs["P1", "P7"].T_a_groove[0, 3])
    log.reach(step, "jumper between the splints", section_poses(section, inside))
    travel, touch = travel_to_contact(section, inside, "P7", -_unit(3), "P1")
    inside = inside - travel * _unit(3)
    log.reach(step, "jumper in the up splint's groove", section_poses(section, inside))
    log.touch(inside, step, touch, travel)
    return inside


def first_touch(section: Section, q: Array, step: str, log: Log, limit: float) -> None:
    """The down splint rises along the bolt until it first touches a wire, within its whole way of ``limit`` mm."""
    reach = {wire: travel_to_contact(section, q, wire, -_unit(D), "P2", limit=limit) for wire in WIRES}
    wire = min(WIRES, key=lambda w: reach[w][0])
    travel, touch = reach[wire]
    if touch is not None:
        touching = q - travel * _unit(D)
        log.reach(step, f"down splint touches {wire}", section_poses(section, touching, saddle_d=float(q[D])))
        log.touch(touching, step, touch, travel)


def _unit(i: int) -> Array:
    return np.asarray(np.eye(6)[i])


def section_poses(section: Section, q: Array, saddle_d: float | None = None) -> Poses:
    """Section poses of all parts with the line at rest; ``saddle_d`` is where the saddle stands if not under P2."""
    clamp = section.clamp
    x, y = -float(q[0]), -float(q[1])
    down = section.down_splint(q)
    saddle_y = y + (down.y - _saddle_lift(section, q) if saddle_d is None else saddle_d - clamp.back_clearance)
    bolt_y = saddle_y + clamp.saddle.radius + clamp.saddle.apex_thickness - clamp.bolt.shank_length
    bolt_x = x + section.bolt_x
    return {
        "P1": SectionPose(x, y),
        "P2": SectionPose(bolt_x, y + down.y, down.angle),
        "P3": SectionPose(bolt_x, saddle_y),
        "P4": SectionPose(bolt_x, bolt_y),
        "P5": SectionPose(bolt_x, y - clamp.nut.height),
        "P6": SectionPose(0.0, 0.0),
        "P7": SectionPose(x + float(q[2]), y + float(q[3])),
    }


def _saddle_lift(section: Section, q: Array) -> float:
    """How far the saddle's arc centre stands above P2's origin when the nut has drawn it up to the round back; mm."""
    pair = section.pairs["P3", "P2"]
    lift = 0.0
    for _ in range(100):
        section.queries.contact += 1
        back = SectionPose(0.0, lift, float(q[S]) / section.lever)
        gap = float(section.model.pieces(pair, back.T()).distance.min())
        if abs(gap) <= 1e-12 * section.clamp.saddle.radius:
            break
        lift += gap
    return lift
