"""The path of an assembly: where all parts are from waypoint to waypoint, and which of them meet there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from clamp3d.clamp.contact import Poses, measure_contacts
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Event, Waypoint
from clamp3d.clamp.scene import CONTACT
from clamp3d.clamp.section import Section
from clamp3d.engine.check import check
from clamp3d.engine.model import ModelCache
from clamp3d.engine.scene import Part, Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, SectionPose, inverse

Offsets = Mapping[PartName, Array]
"""How far parts that wait are from where the section has them, (3,) mm of the world."""


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
            scene = Scene((Part(a, solids[a]), Part(b, solids[b], start)), CONTACT, 0.0, motions=(motion,))
            if any(row.verdict is not Verdict.CLEAR for row in check(scene, depths=False, cache=cache).rows):
                met[a, b] = f"{after.step} ({after.label})"
    return met
