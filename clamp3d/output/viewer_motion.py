"""The waypoints of a run on a time line, and the meshcat animation that plays them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clamp3d.clamp.dimensions import PARTS, Clamp, PartName
from clamp3d.clamp.result import Waypoint
from clamp3d.clamp.screw import ScrewJoint
from clamp3d.core.pose import Array, SectionPose, rotation
from clamp3d.output.viewer_log import Command

_HOLD = 1.2  # s at each waypoint
_SPEED = 45.0  # mm/s
_FASTEST, _SLOWEST = 0.9, 3.0  # s of a motion
_TURN = math.pi / 3.0  # rad of the nut between two keys, short enough for an unambiguous turn


@dataclass(frozen=True, slots=True)
class Stop:
    """A waypoint on the time line: reached at ``arrive`` s, left at ``leave`` s; ``rows`` list its contacts."""

    waypoint: Waypoint
    arrive: float
    leave: float
    turn: float
    rows: Sequence[dict[str, str]]
    verdicts: dict[str, str]


@dataclass
class Timeline:
    """Waypoints as they come, each with its time; ``followers`` are the scene's paths that move with a part."""

    clamp: Clamp
    followers: dict[PartName, list[str]]
    stops: list[Stop] = field(default_factory=list)

    def add(self, waypoint: Waypoint, rows: Sequence[dict[str, str]], verdicts: dict[str, str]) -> int:
        """Append a waypoint and return its number."""
        arrive = turn = 0.0
        if self.stops:
            before, first = self.stops[-1], self.stops[0].waypoint.poses
            way = max(math.hypot(p.x - q.x, p.y - q.y) for p, q in _both(before.waypoint, waypoint))
            arrive = before.leave + min(_SLOWEST, max(_FASTEST, way / _SPEED))
            travel = _apart(waypoint.poses) - _apart(first)
            turn = -ScrewJoint(self.clamp.bolt.pitch).turn(travel)  # right-hand thread, tightened clockwise from above
        self.stops.append(Stop(waypoint, arrive, arrive + _HOLD, turn, rows, verdicts))
        return len(self.stops) - 1

    def name(self, number: int) -> str:
        """What the waypoint's groups are called in the scene."""
        return f"{number + 1} {self.stops[number].waypoint.label}"

    def poses(self, number: int) -> dict[str, Array]:
        """Pose (4, 4) in mm of every moving path of the scene at a waypoint."""
        stop = self.stops[number]
        out: dict[str, Array] = {}
        for part, pose in stop.waypoint.poses.items():
            T = pose.T() @ rotation((0.0, 0.0, 1.0), stop.turn) if part == "P5" else pose.T()
            out |= dict.fromkeys(self.followers[part], T)
        return out

    def data(self) -> list[dict[str, Any]]:
        """The stops for the page's time line."""
        return [
            {
                "arrive": stop.arrive,
                "leave": stop.leave,
                "step": stop.waypoint.step,
                "label": stop.waypoint.label,
                "rows": list(stop.rows),
            }
            for stop in self.stops
        ]

    def animation(self, root: str, grooves: Iterable[str]) -> Command:
        """The command that plays the run once: parts move straight and even, contacts show while the parts rest."""
        clips = []
        for part in PARTS:
            tracks = self._motion(part)
            clips += [_clip(path, tracks) for path in self.followers[part]]
        for number in range(len(self.stops)):
            track = _shown(self._times(), [i == number for i in range(len(self.stops))], holds=True)
            clips += [_clip(f"{root}/{group}/{self.name(number)}", [track]) for group in ("contacts", "gaps")]
        for path in sorted(grooves):
            _, pair, found = path.rsplit("/", 2)
            a, b = path.split("/")[3].split()[0], pair.split()[1]
            seen = [(s.verdicts.get(f"{a}-{b}") or s.verdicts.get(f"{b}-{a}") or "clear") == found for s in self.stops]
            clips.append(_clip(path, [_shown(self._times(), seen, holds=False)]))
        return {
            "type": "set_animation",
            "path": "",
            "animations": clips,
            "options": {"play": True, "repetitions": 1, "clampWhenFinished": True},
        }

    def _times(self) -> list[tuple[float, float]]:
        return [(stop.arrive, stop.leave) for stop in self.stops]

    def _motion(self, part: PartName) -> list[dict[str, Any]]:
        position, quaternion = [], []
        for i, stop in enumerate(self.stops):
            pose = stop.waypoint.poses[part]
            spin = stop.turn if part == "P5" else 0.0
            for time in (stop.arrive, stop.leave):
                position.append({"time": time, "value": [pose.x, 0.0, -pose.y]})
                quaternion.append({"time": time, "value": _quaternion(pose, spin)})
            if part == "P5" and i + 1 < len(self.stops):
                after = self.stops[i + 1]
                keys = math.ceil(abs(after.turn - stop.turn) / _TURN)
                for k in range(1, keys):
                    f = k / keys
                    time = stop.leave + f * (after.arrive - stop.leave)
                    value = _quaternion(pose, stop.turn + f * (after.turn - stop.turn))
                    quaternion.append({"time": time, "value": value})
        return [
            {"name": ".position", "type": "vector3", "keys": position},
            {"name": ".quaternion", "type": "quaternion", "keys": quaternion},
        ]


def _apart(poses: dict[PartName, SectionPose]) -> float:
    """How far the nut is screwed on, up to a constant: its height below the bolt's free end in mm."""
    return poses["P5"].y - poses["P4"].y


def _both(a: Waypoint, b: Waypoint) -> list[tuple[SectionPose, SectionPose]]:
    return [(a.poses[name], b.poses[name]) for name in a.poses]


def _quaternion(pose: SectionPose, spin: float) -> list[float]:
    """Three.js order (x, y, z, w): ``spin`` about the part's own Z, then the section's angle, X towards Z."""
    # A positive section angle turns about -Y.
    s, c = math.sin(pose.angle / 2), math.cos(pose.angle / 2)
    p, q = math.sin(spin / 2), math.cos(spin / 2)
    # (0, -s, 0; c) times (0, 0, p; q)
    return [-s * p, -s * q, c * p, c * q]


def _clip(path: str, tracks: list[dict[str, Any]]) -> dict[str, Any]:
    return {"path": path, "clip": {"fps": 1, "name": "default", "tracks": tracks}}


def _shown(times: Sequence[tuple[float, float]], seen: Sequence[bool], *, holds: bool) -> dict[str, Any]:
    """Visibility at the stops; between two stops nothing if ``holds``, else as at the one before."""
    keys = []
    for (arrive, leave), on in zip(times, seen, strict=True):
        keys.append({"time": arrive, "value": bool(on)})
        if holds:
            keys.append({"time": leave, "value": False})
    if holds:
        keys[-1]["value"] = bool(seen[-1])  # the last one stays
    else:
        keys.append({"time": times[-1][1], "value": bool(seen[-1])})
    assert np.all(np.diff([key["time"] for key in keys]) > 0.0)
    return {"name": ".visible", "type": "bool", "keys": keys}
