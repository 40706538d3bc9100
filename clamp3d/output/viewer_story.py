"""What the page shows, as data: stops on a time line with the pairs of that moment, and findings with their places."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from meshcat.animation import Animation
from meshcat.visualizer import Visualizer

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.contact import NONE, measure_contacts
from clamp3d.clamp.dimensions import TITLES, TOUCHING, Clamp
from clamp3d.clamp.parts import clamp_scene
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.engine.answer import Distance
from clamp3d.engine.distance import measure
from clamp3d.engine.model import ModelCache
from clamp3d.engine.result import BAD, CheckResult, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, rotation
from clamp3d.output.assembly_steps import between
from clamp3d.output.groups import grouped
from clamp3d.output.palette import VERDICT_COLOURS
from clamp3d.output.section import Poses as SectionPoses
from clamp3d.output.section import edge_openings, part_anchor
from clamp3d.output.wording import by_group, circumstances, contact_text, distance_text, sentence, titles, touching_at

Poses: TypeAlias = Mapping[str, Array]
Pair: TypeAlias = tuple[str, str]

CLEARANCE = 5.0
"""Gap in mm from which two parts of a clamp count as clear."""
LISTED = 500
"""Rows of a table on the page; a result's JSON has all."""
FIRST = "first contact"
_SEVERITY = {"error": "clash", "warning": "contact"}
"""The verdict whose colour a finding of an assembly has."""
_HOLD = 1.2  # s at each stop
_FASTEST, _SLOWEST = 0.9, 4.0  # s between two stops
_MOTION, _SAMPLES = 4.0, 24
"""Seconds of a motion of a scene from t = 0 to 1, and the moments of it that a curve of distances goes through."""
_MEASURED = 12
"""Moments of first contact that a motion stops at, and pairs of it that are measured at a moment, at most."""
_TURN = math.radians(3.0)
"""Largest turn between two keys: between them the viewer moves parts along chords."""
_SCREWED = math.pi / 3.0
"""Largest turn of the nut between two keys, short enough to be unambiguous, rad."""


@dataclass(frozen=True, slots=True)
class Row:
    """How a pair stands at a moment: whether it ``touches``, or overlaps, and what that is in words."""

    a: str
    b: str
    verdict: str
    distance: Distance
    touches: bool
    what: str = ""
    declared: bool = False

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

    Attributes
    ----------
    step, label, mark : str
        The motion or step that it belongs to, its name, and what the time line says there.
    way : callable
        Where all parts are (4, 4) at a fraction of the way here, from 0 to 1.
    rows : tuple of Row
        How pairs stand here.
    pairs : tuple of (str, str)
        Those to measure on the way here.
    keys : int
        Straight pieces that the way is drawn with.
    seconds : float, optional
        How long the way takes.
    t : float
        The motion's own time here, from 0 to 1.
    halts : bool
        Whether playing halts here.
    length : (ndarray, ndarray, str), optional
        One more length to draw: its ends and its name.
    """

    step: str
    label: str
    way: Callable[[float], Poses]
    rows: tuple[Row, ...]
    mark: str = ""
    pairs: tuple[Pair, ...] = ()
    keys: int = 1
    seconds: float | None = None
    t: float = 0.0
    halts: bool = False
    length: tuple[Array, Array, str] | None = None
    arrive: float = 0.0
    leave: float = 0.0

    @property
    def poses(self) -> Poses:
        """Where the parts are here."""
        return self.way(1.0)


@dataclass
class Timeline:
    """Stops as they come, each with its time; ``size`` mm is how far a part goes in about two seconds."""

    size: float
    stops: list[Stop] = field(default_factory=list)

    def add(self, stop: Stop) -> int:
        """Append a stop and return its number."""
        arrive = 0.0
        if self.stops:
            before = self.stops[-1].poses
            length = max(np.linalg.norm(T[:3, 3] - before[name][:3, 3]) for name, T in stop.poses.items())
            seconds = min(_SLOWEST, max(_FASTEST, 2.0 * float(length) / self.size))
            arrive = self.stops[-1].leave + (seconds if stop.seconds is None else stop.seconds)
        self.stops.append(replace(stop, arrive=arrive, leave=arrive + _HOLD))
        return len(self.stops) - 1

    def at(self, seconds: float) -> tuple[Stop, Poses]:
        """The stop where a moment is, or to which it leads, and where the parts are."""
        k = min(bisect.bisect_left(self.stops, seconds, key=lambda stop: stop.leave), len(self.stops) - 1)
        stop = self.stops[k]
        if k == 0 or seconds >= stop.arrive:
            return stop, stop.poses
        start = self.stops[k - 1].leave
        return stop, stop.way((seconds - start) / (stop.arrive - start))

    def moments(self, step: str | None) -> list[float]:
        """Moments of a motion, s, even in its own time and with its first contacts."""
        seconds = []
        for before, stop in pairwise(self.stops):
            if stop.step == step:
                t0 = before.t if before.step == step else 0.0
                n = max(1, round(_SAMPLES * (stop.t - t0)))
                seconds += np.linspace(before.leave, stop.arrive, n + 1)[1 if before.step == step else 0 :].tolist()
        return seconds

    def group(self, number: int) -> str:
        """What the marks of a stop are called in the scene."""
        return f"{number + 1} {self.stops[number].label}".replace("/", " ")

    def animation(self, root: Visualizer, paths: Mapping[str, str], groups: Iterable[str]) -> Animation:
        """The animation that plays all stops once.

        ``paths`` below ``root`` lead to the parts; the marks of a stop are below each of ``groups`` and show while the
        parts rest.
        """
        animation = Animation(default_framerate=1)
        first, last = self.stops[0], self.stops[-1]
        moving = [name for name, T in first.poses.items() if any(s.poses[name] is not T for s in self.stops)]

        def set_poses(seconds: float, poses: Poses) -> None:
            for name in moving:
                animation.at_frame(root[paths[name]], seconds).set_transform(poses[name])

        for before, stop in zip([first, *self.stops], self.stops, strict=False):
            for f in np.arange(1, stop.keys) / stop.keys:
                set_poses(before.leave + f * (stop.arrive - before.leave), stop.way(f))
            set_poses(stop.arrive, stop.poses)
            set_poses(stop.leave, stop.poses)
            for k, group in ((k, group) for k in range(len(self.stops)) for group in groups):
                is_here = self.stops[k] is stop
                marks = root[f"{group}/{self.group(k)}"]
                for seconds, shown in ((stop.arrive, is_here), (stop.leave, is_here and stop is last)):
                    animation.at_frame(marks, seconds).set_property("visible", "bool", shown)
        return animation


class Story:
    """A scene and its stops: a checked one at rest, then its motions one after the other, halting at first contact."""

    subtitle = ""
    anchors: Mapping[str, Array] | None = None
    accuracy = "How each distance was measured stands beside it."
    waiting = "checking ..."

    def __init__(self, scene: Scene, model: ContactModel | None = None) -> None:
        self.scene, self.title, self._model, self._cache = scene, scene.name, model, ModelCache()

    def measure(self, poses: Poses, pairs: Iterable[Pair]) -> list[Row]:
        """Pairs of the parts at some poses, by the engine that every command uses."""
        distances = measure(self.scene.moved(poses), pairs, model=self._model, cache=self._cache)
        return [self._row(*pair, distance) for pair, distance in distances.items()]

    def _row(self, a: str, b: str, distance: Distance, what: str = "", declared: bool = False) -> Row:
        """A pair with the verdict that its distance has in the scene; contact that is allowed may be open."""
        verdict = self.scene.thresholds.verdict(distance, self.scene.allowance(a, b))
        return Row(a, b, verdict.value, distance, distance.upper <= self.scene.contact, what, declared)

    def stops(self, result: CheckResult) -> list[Stop]:
        """All stops of a result."""
        motions, contact = self.scene.motions, self.scene.contact
        rows = tuple(Row(r.a, r.b, r.verdict.value, r.distance, r.distance.upper <= contact) for r in result.pairs)
        marks = [motion.name for motion in motions] + [""]
        poses: Poses = {part.name: part.T_world for part in self.scene.parts}
        stops = [Stop("at rest", "at rest", lambda _: poses, rows, marks[0])]
        for motion, mark in zip(motions, marks[1:], strict=True):
            stops += self._motion(result, motion, stops[-1].poses, mark)
        return stops

    def _motion(self, result: CheckResult, motion: Motion, start: Poses, next_mark: str) -> Iterator[Stop]:
        """The stops of a motion: where parts first touch, where they go on to, and the end."""
        going = motion.resolved(start[motion.parts[0]])
        rows = by_group(result, [row for row in result.motions if row.motion == motion.name])
        pairs = tuple((row.a, row.b) for row in rows[:_MEASURED])

        def between(t0: float, t1: float, f: float) -> Poses:
            t = t0 + f * (t1 - t0)
            return {**start, **{name: going.at(t, start[name]) for name in motion.parts}}

        contacts = first_contacts(rows)
        for k, (t0, t) in enumerate(pairwise([0.0, *contacts, 1.0])):
            meets = k < len(contacts)
            label = f"{motion.name}: end" + (", through the contact" if contacts else "")
            mark, watched, way = next_mark, pairs, partial(between, t0, t)
            if meets:
                label = f"{motion.name}: {'next' if k else 'first'} contact at t = {contact_text(contacts[t][0])}"
                mark, watched = "" if k else FIRST, tuple((row.a, row.b) for row in contacts[t])
            here = tuple(self.measure(way(1.0), watched))
            if meets:  # that they touch is certain; the distance there maybe to the contact threshold only
                here = tuple(replace(row, verdict="contact", what=FIRST, touches=True) for row in here)
            keys, seconds = max(1, math.ceil(abs(going.angle) * (t - t0) / _TURN)), max(0.3, _MOTION * (t - t0))
            yield Stop(motion.name, label, way, here, mark, pairs, keys, seconds, t, halts=meets and k == 0)


def first_contacts(rows: Iterable[PairResult]) -> dict[float, list[PairResult]]:
    """The pairs that come to touch during a motion where they are not meant to, by the moment; the first dozen."""
    contacts: dict[float, list[PairResult]] = {}
    for row in rows:
        if row.contact_at and row.verdict in (Verdict.CONTACT, *BAD):
            contacts.setdefault(touching_at(row), []).append(row)
    return dict(sorted(contacts.items())[:_MEASURED])


def findings_of(result: CheckResult, timeline: Timeline, *, brief: bool = False) -> Iterator[dict[str, Any]]:
    """The findings of a check, group by group, each with its stop and the corners of the box to look at.

    Where parts overlap takes long to compute: of a group it is said of the worst pair, and of none if ``brief``.
    """
    names, stops = titles(result.scene), timeline.stops
    for group in grouped(result):
        for row in group.rows:
            own = [k for k, stop in enumerate(stops) if row.motion and stop.step == row.motion]
            first = [k for k in own if any((r.a, r.b, r.what) == (row.a, row.b, FIRST) for r in stops[k].rows)]
            stop = [*first, *own[-1:], 0][0]
            here = [r.distance for r in stops[stop].rows if (r.a, r.b) == (row.a, row.b)] if own else []
            low, high = focus([*here, row.distance][0])
            yield {
                **{"a": row.a, "b": row.b, "motion": row.motion, "verdict": row.verdict.value, "group": group.id},
                "title": sentence(group.rows, names, group.a, group.b),
                "text": sentence([row], names),
                "detail": circumstances(row) if row is group.worst and not brief else "",
                "moments": timeline.moments(row.motion),
                **{"stop": stop, "low": low, "high": high},
            }


def findings_of_clamp(run: Assembly, timeline: Timeline, extent: tuple[Array, Array]) -> Iterator[dict[str, Any]]:
    """The findings of an assembly but the notes, each at the end: at the pair that it names, else at ``extent``."""
    for k, finding in enumerate(f for f in run.findings if f.severity != "note"):
        rows = [row for row in timeline.stops[-1].rows if (row.a, row.b) == (finding.a, finding.b)]
        low, high = focus(rows[0].distance) if rows else extent
        yield {
            **{"a": finding.a or "", "b": finding.b or "", "verdict": _SEVERITY[finding.severity], "group": str(k)},
            **{"title": finding.text, "text": finding.text, "detail": "", "moments": []},
            **{"stop": len(timeline.stops) - 1, "low": low, "high": high},
        }


def focus(distance: Distance) -> tuple[Array, Array]:
    """Corners of a box around the witness points of a distance."""
    points = [p for p in (distance.point_a, distance.point_b) if p is not None] or [np.zeros(3)]
    return np.min(points, axis=0), np.max(points, axis=0)


class ClampStory(Story):
    """The waypoints of a clamp's assembly as stops; ``clearance`` mm is the gap that counts as clear.

    Parameters
    ----------
    clamp : Clamp
    model : ContactModel, optional
        How grooves are measured; by default exactly.
    """

    waiting = "waiting for the first state"

    def __init__(self, clamp: Clamp, model: ContactModel | None = None, clearance: float | None = None) -> None:
        still = {name: np.eye(4) for name in TITLES}
        super().__init__(clamp_scene(clamp, still, clearance=CLEARANCE if clearance is None else clearance), model)
        self.clamp = clamp
        anchors = {name: part_anchor(clamp, name) for name in TITLES}
        self.anchors = {name: np.array([u, 0.0, -v]) for name, (u, v) in anchors.items()}
        self.title, self.subtitle = f"{clamp.name} clamp", f"line {clamp.line.label}, jumper {clamp.jumper.label}"
        by = "exactly" if model is None or model.name == "cas" else f"by {model.name}"
        self.accuracy = f"Measured {by}, not on the facets."
        self._latest: tuple[SectionPoses, float, float] | None = None
        """Where the parts were last, how far the nut was screwed on at first (mm), and how it was turned (rad)."""

    def stop(self, waypoint: Waypoint) -> Stop:
        """A waypoint with its 21 pairs; the nut is drawn turned by as much as it has been screwed on."""
        poses = waypoint.poses
        rows = [
            self._row(c.a, c.b, c.distance, "" if c.relation == NONE else c.relation, c.declared != 0)
            for c in measure_contacts(self.clamp, poses, self._model, cache=self._cache)
        ]
        rows.sort(key=lambda row: not row.declared)
        bolt, nut = poses["P4"], poses["P5"]
        is_on = max(abs(bolt.x - nut.x), abs(bolt.along - nut.along)) < TOUCHING
        on = max(0.0, nut.y - bolt.y + self.clamp.nut.height) if is_on else 0.0
        start, first, before = self._latest or (poses, on, 0.0)
        turn = -self.clamp.bolt.turn(on - first)  # clockwise
        self._latest = poses, first, turn

        def way(f: float) -> Poses:
            there = {name: pose.T() for name, pose in between(start, poses, f).items()}
            return there | {"P5": there["P5"] @ rotation((0.0, 0.0, 1.0), before + f * (turn - before))}

        pairs = tuple((row.a, row.b) for row in rows)
        keys, length = max(1, math.ceil(abs(turn - before) / _SCREWED)), self._opening(waypoint)
        words = waypoint.step, waypoint.label
        return Stop(*words, way, tuple(rows), mark=waypoint.step, pairs=pairs, keys=keys, length=length)

    def _opening(self, waypoint: Waypoint) -> tuple[Array, Array, str]:
        """The distance between the splints (Table 4): its ends, and its length in words."""
        height = edge_openings(self.clamp, waypoint.poses)[0]
        top = (waypoint.T_world("P1") @ [0.0, 0.0, -self.clamp.up_splint.thickness, 1.0])[:3]
        return top, top - [0.0, 0.0, height], f"splints {height:.3f} mm"
