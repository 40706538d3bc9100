"""How a clamp comes together, as a line worker checks it: the state after each motion, and the nut's own step."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import astuple, dataclass

import numpy as np

from clamp3d.clamp.contact import measure_contacts
from clamp3d.clamp.dimensions import TOUCHING, PartName
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.clamp.section import WIRES, Section
from clamp3d.clamp.status import Seat, seats
from clamp3d.geometry.pose import SectionPose
from clamp3d.output.section import Poses, edge_openings

TIGHTENING_STAGES = 4
_PARALLEL = math.radians(0.005)  # the angle that prints as 0.00 deg


@dataclass(frozen=True, slots=True)
class StepRow:
    """The state at the end of a motion, as a line worker checks it; lengths in mm, tilt in rad.

    ``opening_line`` and ``opening_jumper`` are the heights between the splints' inner edges on either side,
    ``turns`` those of the nut from open. ``seats`` say for each groove whether its wire lies in it, ``outside`` which
    wires are not between the splints yet.
    """

    waypoint: Waypoint
    opening_line: float
    opening_jumper: float
    tilt: float
    turns: float
    seats: tuple[Seat, ...]
    outside: tuple[PartName, ...]

    @property
    def parallel(self) -> bool:
        """Whether the splints are parallel, to the printed digits."""
        return abs(self.tilt) < _PARALLEL

    def seated(self, wire: PartName) -> bool:
        """Whether a wire lies in both its grooves."""
        return all(s.seated for s in self.seats if s.wire == wire)

    def seat(self, wire: PartName) -> str:
        """A wire's place in words."""
        if wire in self.outside:
            return "not in the clamp yet"
        if self.seated(wire):
            return "fully in both grooves"
        own = [s for s in self.seats if s.wire == wire]
        held = [s.splint for s in own if s.seated]
        rests = [f"{s.splint}: {s.detail}" for s in own if not s.seated and s.detail != "loose"]
        words = [f"in {' and '.join(held)}'s groove"] if held else []
        loose = [f"{s.gap:.1f} mm from {s.splint}" for s in own if s.detail == "loose"]
        return "; ".join([*words, *rests, *loose])


def step_rows(assembly: Assembly) -> Iterator[StepRow]:
    """The state at every waypoint of an assembly."""
    clamp, start, last = assembly.clamp, *_last_step(assembly)
    # A solver that tries positions leaves small gaps; what it counted as seated is seated here.
    tolerance = max([TOUCHING, *(s.gap for s in assembly.seats if s.seated)])
    section = Section(clamp, assembly.model)
    for waypoint in assembly.path:
        poses = waypoint.poses
        line, jumper = edge_openings(clamp, poses)
        left = poses["P1"].x
        way = _screwed(poses) - _screwed(start) if waypoint in last else 0.0
        yield StepRow(
            waypoint=waypoint,
            opening_line=line,
            opening_jumper=jumper,
            tilt=poses["P2"].angle - poses["P1"].angle,
            turns=round(way / clamp.bolt.pitch, 9) + 0.0,
            seats=seats(section, section.state(poses), tolerance),
            outside=tuple(w for w in WIRES if not left < poses[w].x < left + clamp.up_splint.width),
        )


def tightening(assembly: Assembly) -> Iterator[dict[str, float]]:
    """The nut's own step: in equal stages where it is one straight way, else where that changes.

    Turns of the nut in it, by how much the bolt is drawn up, and the gap of the saddle; mm.
    """
    before, last = _last_step(assembly)
    ways = np.linspace(0.0, 1.0, TIGHTENING_STAGES + 1)
    stages = [between(before, last[0].poses, float(f)) for f in ways]
    for poses in stages if len(last) == 1 else [before, *(waypoint.poses for waypoint in last)]:
        way = _screwed(poses) - _screwed(before)
        (saddle,) = measure_contacts(assembly.clamp, poses, assembly.model, pairs=[("P2", "P3")])
        gap = 0.0 if abs(saddle.gap) <= TOUCHING else saddle.gap
        yield {"nut_turns": way / assembly.clamp.bolt.pitch, "way_mm": way, "saddle_gap_mm": gap}


def between(start: Poses, end: Poses, f: float) -> dict[PartName, SectionPose]:
    """Parts at a fraction of the way from one waypoint to the next, straight and even."""

    def mix(a: SectionPose, b: SectionPose) -> SectionPose:
        ends = zip(astuple(a), astuple(b), strict=True)
        return SectionPose(*((1.0 - f) * x + f * y for x, y in ends))

    return {name: mix(start[name], end[name]) for name in end}


def _last_step(assembly: Assembly) -> tuple[dict[PartName, SectionPose], list[Waypoint]]:
    """Poses before the nut's own step, and its waypoints."""
    last = [waypoint for waypoint in assembly.path if waypoint.step == assembly.path[-1].step]
    return assembly.path[-len(last) - 1].poses, last


def _screwed(poses: dict[PartName, SectionPose]) -> float:
    """Height of the nut's free face below the bolt's free end in mm: by how much it is screwed on, up to a constant."""
    return poses["P5"].y - poses["P4"].y
