"""The steps of an assembly sequence as they are played, each ending at a contact, and what meets on the way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from clamp3d.clamp.contact import Poses, measure_contacts
from clamp3d.clamp.dimensions import TITLES, TOUCHING, Clamp, Pair, PartName
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Event, Waypoint
from clamp3d.clamp.section import B, D, Section, W
from clamp3d.clamp.sequence import Step, as_published
from clamp3d.clamp.ways import DIRECTIONS, SPARE, Closing, Leg, Offsets, Plan, corners
from clamp3d.engine.check import check
from clamp3d.engine.model import ModelCache
from clamp3d.engine.scene import Part, Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, SectionPose, inverse

_PUBLISHED: dict[PartName, tuple[PartName, str, str]] = {
    "P1": ("P6", "line between the splints", "up splint rests on the line"),
    "P7": ("P7", "jumper between the splints", "jumper in the up splint's groove"),
}
"""The paper's own steps by the part that is grasped: the wire that the up splint meets, and the moments of the way."""


@dataclass
class Log:
    """What happens on the way; ``on_waypoint(waypoint)`` is called as it happens."""

    section: Section
    on_waypoint: Callable[[Waypoint], None] | None
    events: list[Event] = field(default_factory=list)
    path: list[Waypoint] = field(default_factory=list)
    cache: ModelCache = field(default_factory=ModelCache)
    aside: Offsets = field(default_factory=dict)

    def reach(self, step: str, label: str, poses: Poses) -> None:
        """Add a waypoint."""
        self.path.append(Waypoint(step, label, self._shifted(poses)))
        if self.on_waypoint is not None:
            self.on_waypoint(self.path[-1])

    def touch(self, step: str, pairs: Sequence[Pair], poses: Poses, travel: float, within: float = math.inf) -> None:
        """Add an event for each pair that is no further apart than ``within`` mm."""
        section = self.section
        for c in measure_contacts(section.clamp, self._shifted(poses), section.model, pairs=pairs, cache=self.cache):
            if c.gap <= within:
                self.events.append(Event(step, c.a, c.b, c.relation, c.point, travel))

    def _shifted(self, poses: Poses) -> dict[PartName, SectionPose]:
        """The poses with those of parts that wait where they wait."""
        shifted = dict(poses)
        for name, (x, along, z) in self.aside.items():
            pose = poses[name]
            shifted[name] = SectionPose(pose.x + x, pose.y - z, pose.angle, pose.along + along)
        return shifted


def play(steps: tuple[Step, ...], closing: Closing, log: Log) -> None:
    """Play ``steps``. Raises SequenceError for a step that no way leads to."""
    published = _published_ways(log.section, closing.start) if as_published(steps) else None
    plan = Plan(log.section, steps, closing, log.cache, published)
    log.aside = plan.offsets(0)
    log.reach(steps[0].name, "open clamp beside the line" if plan.is_published else "parts apart", plan.bases[0])
    for k, step in enumerate(steps):
        if step.kind == "close":
            _close_splints(step.name, closing, log)
        elif step.kind == "tighten":
            _tighten_nut(step, closing, log)
        else:
            _bring(plan, k, log)


def _published_ways(section: Section, start: Array) -> list[tuple[Leg, ...]]:
    """Clamp and jumper come in from the right, half-way between the splints' faces: then up and down to their places.

    The jumper waits clear of the clamp's way in.
    """
    clamp, (x6, y6, x7, y7) = section.clamp, start[:4].tolist()
    under = section.down_splint(start).point(0.0, clamp.down_splint.face_depth)[1]
    middle = 0.5 * (clamp.up_splint.thickness + under)
    beside = clamp.line.radius + SPARE
    clear = beside + clamp.up_splint.width + clamp.jumper.radius + SPARE
    line = (("from above", middle - y6), ("from the right", beside + x6))
    jumper = (("from below", middle - y7), ("from the right", clear + x6 - x7))
    return [line, jumper, (), ()]


def _bring(plan: Plan, k: int, log: Log) -> None:
    """The parts of a step come in on their way; they end where they touch, if they do."""
    step, legs, base, before, end = plan.steps[k], plan.legs[k], plan.bases[k], log.aside, plan.offsets(k + 1)
    pairs, (origin, length) = plan.meeting_pairs(k), legs[0]
    bend, arrival = f"{step.part} before its place, {legs[-1][0]}", f"{step.part} in place, {origin}"
    meet, travel, within = sorted((min(pair), max(pair)) for pair in pairs), sum(way for _, way in legs), TOUCHING
    if plan.is_published:
        wire, bend, arrival = _PUBLISHED[step.part]
        meet, travel, within = [("P1", wire)], length, math.inf
    stops = [(corners(legs)[0], bend)] if legs[1:] else []
    engaged = base["P5"].y + plan.clamp.nut.height - base["P4"].y
    if any(set(pair) == {"P4", "P5"} for pair in pairs) and DIRECTIONS[origin][2] and 0.0 < engaged < length:
        stops.append((corners([(origin, engaged)])[0], "nut on the bolt's end"))
    for corner, label in stops:
        log.aside = {**before, **{name: end[name] + corner for name in step.parts}}
        log.reach(step.name, label, base)
    log.aside = end
    log.reach(step.name, arrival, base)
    log.touch(step.name, meet, base, travel, within)


def _close_splints(step: str, closing: Closing, log: Log) -> None:
    """The down splint closes by hand, the saddle left where it was; what waits apart it does not meet."""
    section, d = log.section, float(closing.start[D])
    for pair, q in closing.met:
        if _is_by_hand(q) and not any(np.any(log.aside.get(name, 0.0)) for name in pair):
            poses = section.poses(q, saddle_d=d)
            log.reach(step, _meeting(pair), poses)
            log.touch(step, [pair], section.poses(q), d - float(q[D]))
    log.reach(step, "splints closed", section.poses(closing.held, saddle_d=d))


def _is_by_hand(q: Array) -> bool:
    """Whether a state is of the closing by hand: the nut has not begun to take up the joints' play."""
    return not q[B : W + 1].any()


def _meeting(pair: Pair) -> str:
    """The label of a waypoint at which two parts meet, that of the down splint if it is one of them."""
    a, b = pair if pair[0] == "P2" or "P2" not in pair else pair[::-1]
    return f"{TITLES[a]} touches {b}"


def _tighten_nut(step: Step, closing: Closing, log: Log) -> None:
    """The nut draws the saddle up to the round back, and both on to the end if the joints have play.

    If the down splint has not been closed by hand, the saddle takes it along.
    """
    section, d, takes_along = log.section, float(closing.start[D]), "P2" in step.parts
    seated = closing.end if takes_along else closing.held
    if not np.array_equal(seated, closing.end):
        log.reach(step.name, "saddle meets the down splint", section.poses(seated))
    for pair, q in [(pair, q) for pair, q in closing.met if takes_along or not _is_by_hand(q)]:
        if takes_along:
            log.reach(step.name, _meeting(pair), section.poses(q))
        log.touch(step.name, [pair], section.poses(q), d - float(q[D]))
    end = section.poses(closing.end)
    log.reach(step.name, "nut tightened", end)
    log.touch(step.name, [("P2", "P3")], section.poses(seated), d - float(seated[D]))
    log.touch(step.name, [("P1", "P5"), ("P3", "P4")], end, closing.travel)


def meetings(clamp: Clamp, path: Sequence[Waypoint], pairs: Sequence[Pair], cache: ModelCache) -> dict[Pair, str]:
    """Those of ``pairs`` that touch or overlap anywhere on ``path``, with the step in which each does so first.

    Between two waypoints each part moves by one screw in the frame of the other.
    """
    solids, met = parts(clamp), dict[Pair, str]()
    for before, after in itertools.pairwise(path):
        for a, b in [pair for pair in pairs if pair not in met]:
            start, end = (inverse(w.T_world(a)) @ w.T_world(b) for w in (before, after))
            if np.array_equal(start, end):
                continue
            motion = Motion.to_pose(end, parts=b)
            scene = Scene((Part(a, solids[a]), Part(b, solids[b], start)), TOUCHING, 0.0, motions=(motion,))
            if any(row.verdict is not Verdict.CLEAR for row in check(scene, depths=False, cache=cache).rows):
                met[a, b] = f"{after.step} ({after.label})"
    return met
