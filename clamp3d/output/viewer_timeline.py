"""A time line of stops: the waypoints of an assembly, or a scene at rest and its motions up to their contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from meshcat.animation import Animation, AnimationClip
from meshcat.path import Path

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.contact import NONE, measure_contacts
from clamp3d.clamp.dimensions import TITLES, Clamp
from clamp3d.clamp.result import Waypoint
from clamp3d.clamp.scene import CONTACT, clamp_scene
from clamp3d.engine.answer import Distance
from clamp3d.engine.model import ModelCache
from clamp3d.engine.result import BAD, CheckResult, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, rotation
from clamp3d.output.palette import VERDICT_COLOURS
from clamp3d.output.section import edge_openings, part_anchor
from clamp3d.output.wording import distance_text, first_text, worst_first

Poses = Mapping[str, Array]
Measure = Callable[[Scene, Sequence[tuple[str, str]]], Iterable["Row"]]
"""Measures pairs of a scene, as `clamp3d.engine.distance.measure` does, with their verdicts."""

FIRST = "first contact"
_HOLD = 1.2  # s at each stop
_FASTEST, _SLOWEST = 0.9, 4.0  # s between two stops
_MOTION = 4.0  # s of a motion of a scene from t = 0 to 1
_CURVES, _SAMPLES = 4, 24
"""So many pairs of a motion are drawn as curves, each through so many moments: what `view` may take beside `check`."""
_MEASURED = 12
"""Moments of first contact that a motion stops at, and pairs that are measured at its end, at most."""
_TURN = math.radians(3.0)
"""Largest turn between two keys: between them the viewer moves parts along chords."""
UNCUT = ("P4", "P5")
"""Bolts and nuts are not cut lengthwise in drawings (ISO 128)."""
_SCREWED = math.pi / 3.0  # rad of the nut between two keys, short enough for an unambiguous turn


@dataclass(frozen=True, slots=True)
class Row:
    """How a pair stands at a stop; ``drawn`` where the points are those of this very moment.

    ``contact`` is the scene's threshold, mm: an allowed contact may be open.
    """

    a: str
    b: str
    verdict: str
    distance: Distance
    contact: float
    what: str = ""
    declared: bool = False
    drawn: bool = True

    @classmethod
    def of(cls, scene: Scene, a: str, b: str, distance: Distance, what: str = "", *, declared: bool = False) -> Row:
        """A pair with the verdict that its distance has in a scene."""
        verdict = scene.thresholds.verdict(distance, scene.allowance(a, b)).value
        return cls(a, b, verdict, distance, scene.contact, what, declared)

    @property
    def touches(self) -> bool:
        """Whether the parts are in contact, or overlap."""
        return self.what == FIRST or self.distance.upper <= self.contact

    @property
    def gap(self) -> str:
        """The distance in words."""
        if self.touches and (self.what == FIRST or abs(self.distance.upper) < 5e-5):
            return "touching"
        return distance_text(self.distance, digits=4)

    @property
    def colour(self) -> str:
        """The verdict's colour; allowed contact that is not there has that of a gap."""
        return VERDICT_COLOURS["clearance" if self.verdict == "allowed" and not self.touches else self.verdict]

    @property
    def near(self) -> bool:
        """Whether the pair is worth a mark."""
        return self.declared or self.verdict != "clear"

    def data(self) -> dict[str, Any]:
        """The row as JSON data."""
        shown = {"gap": self.gap, "near": self.near, "colour": self.colour}
        names = {"a": self.a, "b": self.b, "verdict": self.verdict, "what": self.what}
        return names | self.distance.to_dict() | shown


@dataclass(frozen=True, slots=True)
class Stop:
    """A moment on the time line: reached at ``arrive`` s, left at ``leave`` s.

    ``poses`` are where the parts are drawn, ``via`` fractions of the way here with the poses of parts that do not go
    straight. Playing halts at a stop that ``halts``; ``mark`` is what the time line says there. ``t`` is the
    motion's own time, from 0 to 1.
    """

    step: str
    label: str
    poses: Poses
    rows: tuple[Row, ...] = ()
    mark: str = ""
    halts: bool = False
    via: tuple[tuple[float, Poses], ...] = ()
    seconds: float | None = None
    t: float = 0.0
    arrive: float = 0.0
    leave: float = 0.0


@dataclass
class Timeline:
    """Stops as they come, each with its time; ``size`` mm is how far a part goes in about two seconds."""

    size: float
    stops: list[Stop] = field(default_factory=list)

    def add(self, stop: Stop) -> int:
        """Append a stop and return its number."""
        arrive = 0.0
        if self.stops:
            before = self.stops[-1]
            way = max(np.linalg.norm(T[:3, 3] - before.poses[name][:3, 3]) for name, T in stop.poses.items())
            seconds = min(_SLOWEST, max(_FASTEST, 2.0 * float(way) / self.size))
            arrive = before.leave + (seconds if stop.seconds is None else stop.seconds)
        self.stops.append(replace(stop, arrive=arrive, leave=arrive + _HOLD))
        return len(self.stops) - 1

    def group(self, number: int) -> str:
        """What the marks of a stop are called in the scene."""
        return f"{number + 1} {self.stops[number].label}".replace("/", " ")

    def animation(self, followers: Mapping[str, Iterable[str]], groups: Iterable[str]) -> Animation:
        """The animation that plays all stops once.

        ``followers`` are the scene's paths that move with a part; the marks of a stop are below each of ``groups`` and
        show while the parts rest.
        """
        from scipy.spatial.transform import Rotation

        clips: dict[Path, AnimationClip] = {}

        def clip(path: str) -> AnimationClip:
            return clips.setdefault(Path().append(path.lstrip("/")), AnimationClip(fps=1))

        for part, paths in followers.items():
            times, poses = self._keys(part)
            turns = Rotation.from_matrix(np.array([T[:3, :3] for T in poses])).as_quat()
            for path in paths:
                for time, T, q in zip(times, poses, turns.tolist(), strict=True):
                    clip(path).set_property(time, "position", "vector3", T[:3, 3].tolist())
                    clip(path).set_property(time, "quaternion", "quaternion", q)
        for k in range(len(self.stops)):
            for group in groups:
                marks = clip(f"{group}/{self.group(k)}")
                for j, other in enumerate(self.stops):
                    marks.set_property(other.arrive, "visible", "bool", j == k)
                    if j + 1 < len(self.stops):
                        marks.set_property(other.leave, "visible", "bool", False)
                marks.set_property(self.stops[-1].leave, "visible", "bool", k == len(self.stops) - 1)
        return Animation(clips)

    def _keys(self, part: str) -> tuple[list[float], list[Array]]:
        times, poses = [], []
        for k, stop in enumerate(self.stops):
            start = self.stops[k - 1].leave
            for fraction, on_the_way in stop.via:
                if part in on_the_way:
                    times.append(start + fraction * (stop.arrive - start))
                    poses.append(on_the_way[part])
            times += [stop.arrive, stop.leave]
            poses += [stop.poses[part]] * 2
        return times, poses


def scene_stops(result: CheckResult, measure: Measure) -> Iterator[Stop]:
    """A checked scene at rest, then its motions one after the other, with a stop where parts first touch."""
    motions = result.scene.motions
    poses: Poses = {part.name: part.T_world for part in result.scene.parts}
    marks = [motion.name for motion in motions] + [""]
    yield Stop("at rest", "at rest", poses, tuple(_row(result, row) for row in result.pairs), marks[0])
    for motion, mark in zip(motions, marks[1:], strict=True):
        for stop in _motion_stops(result, motion, poses, measure, mark):
            yield stop
            last = stop.poses
        poses = last


def _motion_stops(
    result: CheckResult, motion: Motion, start: Poses, measure: Measure, next_mark: str
) -> Iterator[Stop]:
    """The stops of a motion: where parts first touch, where they go on to, and the end."""
    going = motion.resolved(start[motion.parts[0]])
    rows = [row for row in result.motions if row.motion == motion.name]

    def at(t: float) -> Poses:
        return {**start, **{name: going.at(t, start[name]) for name in motion.parts}}

    def way(t0: float, t1: float) -> tuple[tuple[float, Poses], ...]:
        n = max(1, math.ceil(abs(going.angle) * (t1 - t0) / _TURN))
        moved = [(k / n, at(t0 + (t1 - t0) * k / n)) for k in range(1, n)]
        return tuple((f, {name: poses[name] for name in motion.parts}) for f, poses in moved)

    contacts, before = first_contacts(rows), 0.0
    for k, (t, touching) in enumerate(contacts.items()):
        poses = at(t)
        # The moment is certain; the distance right there may be certain to the contact threshold only.
        touching_now = measure(result.scene.moved(poses), [(row.a, row.b) for row in touching])
        now = tuple(replace(row, verdict="contact", what=FIRST) for row in touching_now)
        label = f"{motion.name}: {'first' if k == 0 else 'next'} contact at t = {first_text(t)}"
        seconds = max(0.3, _MOTION * (t - before))
        yield Stop(motion.name, label, poses, now, "" if k else FIRST, k == 0, way(before, t), seconds, t)
        before = t
    # Parts whose least distance is at the end are as the check says; the others are measured where they stand now.
    at_end = {(row.a, row.b): _row(result, row) for row in rows if row.t == 1.0}
    elsewhere = [(row.a, row.b) for row in worst_first(rows) if (row.a, row.b) not in at_end][:_MEASURED]
    poses = at(1.0)
    ends = (*at_end.values(), *(measure(result.scene.moved(poses), elsewhere) if elsewhere else ()))
    end = f"{motion.name}: end" + (", through the contact" if contacts else "")
    seconds = max(0.3, _MOTION * (1.0 - before))
    yield Stop(motion.name, end, poses, ends, next_mark, via=way(before, 1.0), seconds=seconds, t=1.0)


def distance_curves(result: CheckResult, stops: Sequence[Stop], measure: Measure) -> Iterator[dict[str, Any]]:
    """The bounds of the distance (mm) of the worst findings of each motion at moments of the time line (s)."""
    for motion in result.scene.motions:
        rows = worst_first([row for row in result.findings if row.motion == motion.name])[:_CURVES]
        if not rows:
            continue
        pairs = [(row.a, row.b) for row in rows]
        own = [k for k, stop in enumerate(stops) if stop.step == motion.name]
        start = stops[own[0] - 1].poses
        going = motion.resolved(start[motion.parts[0]])
        moments = [moment for k in own for moment in _moments(stops[k - 1], stops[k], first=k == own[0])]
        measured = [
            measure(result.scene.moved({name: going.at(t, start[name]) for name in motion.parts}), pairs)
            for _, t in moments
        ]
        for row, distances in zip(rows, zip(*measured, strict=True), strict=True):
            yield {
                "motion": motion.name,
                "a": row.a,
                "b": row.b,
                "seconds": [seconds for seconds, _ in moments],
                "t": [t for _, t in moments],
                "bounds": [[d["at_least_mm"], d["at_most_mm"]] for d in (one.distance.to_dict() for one in distances)],
            }


def _moments(before: Stop, stop: Stop, *, first: bool) -> Iterator[tuple[float, float]]:
    """Times on the time line (s) and in the motion from one stop to the next, with its start where it is the first."""
    t0 = 0.0 if first else before.t
    n = max(1, round(_SAMPLES * (stop.t - t0)))
    for k in range(0 if first else 1, n + 1):
        yield before.leave + k / n * (stop.arrive - before.leave), t0 + k / n * (stop.t - t0)


def first_contacts(rows: Iterable[PairResult]) -> dict[float, list[PairResult]]:
    """The pairs that come to touch during a motion where they are not meant to, by the moment; the first dozen."""
    contacts: dict[float, list[PairResult]] = {}
    for row in rows:
        if row.contact_at and row.verdict in (Verdict.CONTACT, *BAD):
            contacts.setdefault(row.contact_at, []).append(row)
    return dict(sorted(contacts.items())[:_MEASURED])


def _row(result: CheckResult, row: PairResult) -> Row:
    return Row(row.a, row.b, row.verdict.value, row.distance, result.thresholds.contact)


class ClampStory:
    """The waypoints of a clamp's assembly as stops; ``clearance`` mm is the gap that counts as clear."""

    def __init__(self, clamp: Clamp, model: ContactModel | None, clearance: float) -> None:
        self.clamp, self._model, self._cache = clamp, model, ModelCache()
        still = {name: np.eye(4) for name in TITLES}
        self.scene: Scene = clamp_scene(clamp, still, clearance=clearance)
        anchors = {name: part_anchor(clamp, name) for name in TITLES}
        self.anchors = {name: np.array([u, 0.0, -v]) for name, (u, v) in anchors.items()}
        self.title, self.subtitle = f"{clamp.name} clamp", f"line {clamp.line.label}, jumper {clamp.jumper.label}"
        self._first: float | None = None
        self._turn = 0.0

    def stop(self, waypoint: Waypoint) -> Stop:
        """A waypoint with its 21 pairs; the nut is drawn turned by as much as it has been screwed on."""
        poses = {name: waypoint.T_world(name) for name in TITLES}
        rows = [
            Row.of(self.scene, c.a, c.b, c.distance, "" if c.relation == NONE else c.relation, declared=c.declared != 0)
            for c in measure_contacts(self.clamp, waypoint.poses, self._model, cache=self._cache)
        ]
        rows.sort(key=lambda row: not row.declared)
        beside = float(np.abs(poses["P4"][:2, 3] - poses["P5"][:2, 3]).max())
        on = max(0.0, float(poses["P4"][2, 3] - poses["P5"][2, 3]) + self.clamp.nut.height) if beside < CONTACT else 0.0
        self._first = on if self._first is None else self._first
        before, self._turn = self._turn, -self.clamp.bolt.turn(on - self._first)  # clockwise
        n = math.ceil(abs(self._turn - before) / _SCREWED)
        nut, turns = poses["P5"], np.linspace(before, self._turn, n + 1)
        via = [(k / n, {"P5": nut @ _about_z(turn)}) for k, turn in enumerate(turns[1:-1], 1)]
        poses["P5"] = nut @ _about_z(self._turn)
        return Stop(waypoint.step, waypoint.label, poses, tuple(rows), waypoint.step, via=tuple(via))

    def opening(self, waypoint: Waypoint) -> tuple[Array, Array, str]:
        """The distance between the splints (Table 4): its ends, and its length in words."""
        height = edge_openings(self.clamp, waypoint.poses)[0]
        top = (waypoint.T_world("P1") @ [0.0, 0.0, -self.clamp.up_splint.thickness, 1.0])[:3]
        return top, top - [0.0, 0.0, height], f"splints {height:.3f} mm"


def _about_z(angle: float) -> Array:
    return rotation((0.0, 0.0, 1.0), angle)
