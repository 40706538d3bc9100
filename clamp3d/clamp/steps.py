"""The motions of an assembly sequence, each ending at a contact, and the poses of all parts on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from clamp3d.clamp.contact import Contact, Poses, measure_contacts
from clamp3d.clamp.dimensions import PartName
from clamp3d.clamp.matrix import PAIRS, Pair
from clamp3d.clamp.result import Event, Waypoint
from clamp3d.clamp.section import D, Section
from clamp3d.engine.model import ModelCache
from clamp3d.geometry.pose import Array, SectionPose

Meetings = list[tuple[Pair, Array]]
"""Pairs of parts, each with the state (10,) in which they meet."""
_SPARE = 20.0
"""Free way in mm between a wire and the open clamp before it comes in."""


@dataclass(frozen=True)
class Closing:
    """What the solver found: states at the start, closed by hand and at the end, and the contacts on the way."""

    start: Array
    held: Array
    end: Array
    by_hand: Meetings
    taken: Meetings


@dataclass
class Log:
    """What happens on the way; ``on_waypoint(waypoint)`` is called as it happens."""

    section: Section
    on_waypoint: Callable[[Waypoint], None] | None
    events: list[Event] = field(default_factory=list)
    path: list[Waypoint] = field(default_factory=list)
    cache: ModelCache = field(default_factory=ModelCache)
    measured: dict[tuple[Pair, SectionPose, SectionPose], Contact] = field(default_factory=dict)
    aside: dict[PartName, Array] = field(default_factory=dict)
    """How far parts that wait are from where the section has them, (3,) mm of the world."""

    def reach(self, step: str, label: str, poses: Poses) -> None:
        """Add a waypoint."""
        self.path.append(Waypoint(step, label, self.shifted(poses)))
        if self.on_waypoint is not None:
            self.on_waypoint(self.path[-1])

    def touch(self, q: Array, step: str, pair: Pair, travel: float) -> None:
        """Add the event of a contact that is found at state ``q``."""
        self.measure(self.section.poses(q), step, [pair], travel)

    def measure(self, poses: Poses, step: str, pairs: Sequence[Pair], travel: float, within: float = math.inf) -> None:
        """Add an event for each pair that is no further apart than ``within`` mm."""
        for c in self.contacts(self.shifted(poses), pairs):
            if c.gap <= within:
                self.events.append(Event(step, c.a, c.b, c.relation, c.point, travel))

    def contacts(self, poses: Poses, pairs: Sequence[Pair] = PAIRS) -> tuple[Contact, ...]:
        """How pairs stand to each other; what has been measured at the same two poses is not measured again."""
        section, keys = self.section, [(pair, poses[pair[0]], poses[pair[1]]) for pair in pairs]
        new = [key for key in keys if key not in self.measured]
        if new:
            asked = [pair for pair, *_ in new]
            found = measure_contacts(section.clamp, poses, section.model, pairs=asked, cache=self.cache)
            self.measured.update(zip(new, found, strict=True))
        return tuple(self.measured[key] for key in keys)

    def shifted(self, poses: Poses) -> dict[PartName, SectionPose]:
        """The poses with those of parts that wait where they wait."""
        return {name: moved(pose, self.aside[name]) if name in self.aside else pose for name, pose in poses.items()}


def moved(pose: SectionPose, by: Array) -> SectionPose:
    """A pose moved ``by`` (3,) mm of the world."""
    x, along, z = (float(v) for v in by)
    return SectionPose(pose.x + x, pose.y - z, pose.angle, pose.along + along)


def approach_line(section: Section, opened: Array, start: Array, step: str, log: Log) -> Array:
    """The ``opened`` clamp comes in from the right until the line lies under its groove, then settles on the line."""
    clamp = section.clamp
    beside, over, settled = opened.copy(), opened.copy(), opened.copy()
    middle = 0.5 * (clamp.up_splint.thickness + section.down_splint(opened).point(0.0, clamp.down_splint.face_depth)[1])
    beside[1] = over[1] = middle
    beside[0] = -clamp.line.radius - _SPARE
    settled[:2] = start[:2]
    # The jumper waits clear of the clamp's way in.
    waiting = settled.copy()
    waiting[2] = settled[0] - beside[0] + clamp.up_splint.width + clamp.jumper.radius + _SPARE
    waiting[3] = middle
    jumper = section.poses(waiting)["P7"]
    for state, label in ((beside, "open clamp beside the line"), (over, "line between the splints")):
        log.reach(step, label, section.poses(state) | {"P7": jumper})
    log.reach(step, "up splint rests on the line", section.poses(waiting))
    log.touch(waiting, step, ("P1", "P6"), float(opened[1] - start[1]))
    return waiting


def insert_jumper(section: Section, opened: Array, start: Array, step: str, log: Log) -> None:
    """The jumper comes in between the splints from its side and is lifted into the up splint's groove."""
    inside = start.copy()
    inside[3] = opened[3]
    log.reach(step, "jumper between the splints", section.poses(inside))
    log.reach(step, "jumper in the up splint's groove", section.poses(start))
    log.touch(start, step, ("P1", "P7"), float(opened[3] - start[3]))


def close_splints(section: Section, start: Array, end: Array, met: Meetings, step: str, log: Log) -> None:
    """The down splint closes along its path from ``start`` to ``end``, the saddle left where it was."""
    d = float(start[D])
    for pair, q in met:
        log.reach(step, f"down splint touches {pair[1]}", section.poses(q, saddle_d=d))
        log.touch(q, step, pair, d - float(q[D]))
    log.reach(step, "splints closed", section.poses(end, saddle_d=d))


def tighten_nut(section: Section, closing: Closing, step: str, log: Log) -> float:
    """The nut draws the saddle up to the round back, and on from ``held`` to ``end`` if the joints have play.

    Returns the way that the nut has gone when it is tight, mm.
    """
    clamp, d, held, end = section.clamp, float(closing.start[D]), closing.held, closing.end
    travel = d - float(held[D])
    if not np.array_equal(held, end):
        log.reach(step, "saddle meets the down splint", section.poses(held))
        log.touch(held, step, ("P2", "P3"), travel)
        for pair, q in closing.taken:
            log.touch(q, step, pair, travel + float(held[D] - q[D]))
        travel = d - float(end[D])
    log.reach(step, "nut tightened", section.poses(end))
    if np.array_equal(held, end):
        log.touch(end, step, ("P2", "P3"), travel)
    for pair in (("P1", "P5"), ("P3", "P4")):
        if clamp.connection(*pair):
            log.touch(end, step, pair, travel)
    return travel
