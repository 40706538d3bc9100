"""A time line of stops: the waypoints of an assembly, or a scene at rest and its motions up to their contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from clamp3d.collide.distance import Distance
from clamp3d.collide.motion import Motion
from clamp3d.collide.result import CheckResult, PairResult
from clamp3d.collide.scene import Scene
from clamp3d.core.pose import Array
from clamp3d.output.wording import gap_text

if TYPE_CHECKING:
    from meshcat.animation import Animation

Poses = Mapping[str, Array]
Shown = Mapping[str, list[bool]]
Measured = Callable[[Scene, Sequence[tuple[str, str]]], Iterable["Row"]]
"""Measures pairs of a scene, as `clamp3d.collide.distance.measure` does, with their verdicts."""

_HOLD = 1.2  # s at each stop
_FASTEST, _SLOWEST = 0.9, 4.0  # s between two stops
_MOTION = 4.0  # s of a motion of a scene from t = 0 to 1
_JUMP = 0.01  # s: back to the start for the next motion
_TURN = math.radians(3.0)
"""Largest turn between two keys: between them the viewer moves parts along chords."""


@dataclass(frozen=True, slots=True)
class Row:
    """How a pair stands at a stop; ``drawn`` where the points are those of this very moment."""

    a: str
    b: str
    verdict: str
    distance: Distance
    what: str = ""
    declared: bool = False
    drawn: bool = True

    @property
    def gap(self) -> str:
        """The distance in words."""
        return gap_text(self.distance.lower, self.distance.upper, digits=4)

    def data(self) -> dict[str, Any]:
        """The row as JSON data."""
        return {"a": self.a, "b": self.b, "verdict": self.verdict, "what": self.what} | self.distance.to_dict()


@dataclass(frozen=True, slots=True)
class Stop:
    """A moment on the time line: reached at ``arrive`` s, left at ``leave`` s.

    ``poses`` are where the parts are drawn, ``via`` fractions of the way here with the poses of parts that do not go
    straight. Playing halts at a stop that ``halts``; ``mark`` is what the time line says there.
    """

    step: str
    label: str
    poses: Poses
    rows: tuple[Row, ...] = ()
    mark: str = ""
    halts: bool = False
    via: tuple[tuple[float, Poses], ...] = ()
    seconds: float | None = None
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

    def animation(self, followers: Mapping[str, Iterable[str]], groups: Iterable[str], shown: Shown) -> Animation:
        """The animation that plays all stops once.

        ``followers`` are the scene's paths that move with a part; the marks of a stop are below each of ``groups`` and
        show while the parts rest; ``shown`` has paths that are seen only at some stops.
        """
        from meshcat.animation import Animation, AnimationClip
        from meshcat.path import Path

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
        for k, stop in enumerate(self.stops):
            for group in groups:
                marks = clip(f"{group}/{self.group(k)}")
                for j, other in enumerate(self.stops):
                    marks.set_property(other.arrive, "visible", "bool", j == k)
                    if j + 1 < len(self.stops):
                        marks.set_property(other.leave, "visible", "bool", False)
                marks.set_property(self.stops[-1].leave, "visible", "bool", k == len(self.stops) - 1)
        for path, seen in shown.items():
            for stop, on in zip(self.stops, seen, strict=True):
                clip(path).set_property(stop.arrive, "visible", "bool", on)
            clip(path).set_property(self.stops[-1].leave, "visible", "bool", seen[-1])
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


def scene_stops(result: CheckResult, measured: Measured) -> Iterator[Stop]:
    """A checked scene at rest, then each of its motions with a stop where parts first touch."""
    scene = result.scene
    rest = {part.name: part.T_world for part in scene.parts}
    yield Stop("at rest", "at rest", rest, tuple(_row(row) for row in result.pairs))
    for motion in scene.motions:
        yield from _motion_stops(result, motion, rest, measured)


def _motion_stops(result: CheckResult, motion: Motion, rest: Poses, measured: Measured) -> Iterator[Stop]:
    going = motion.from_pose(rest[motion.parts[0]])
    rows = [row for row in result.motions if row.motion == motion.name]
    least = tuple(_row(row, f"least on the way, at t = {row.t:.4f}", drawn=False) for row in rows)

    def at(t: float) -> Poses:
        M = going.at(t)
        return {name: M @ T if name in motion.parts else T for name, T in rest.items()}

    def way(t0: float, t1: float) -> tuple[tuple[float, Poses], ...]:
        n = max(1, math.ceil(abs(going.angle) * (t1 - t0) / _TURN))
        moved = [(k / n, at(t0 + (t1 - t0) * k / n)) for k in range(1, n)]
        return tuple((f, {name: poses[name] for name in motion.parts}) for f, poses in moved)

    contacts = first_contacts(rows)
    yield Stop(motion.name, f"{motion.name}: start", at(0.0), least, mark=motion.name, seconds=_JUMP)
    before = 0.0
    for k, (t, touching) in enumerate(contacts.items()):
        poses = at(t)
        scene = result.scene.moved({name: poses[name] for name in motion.parts})
        now = tuple(measured(scene, [(row.a, row.b) for row in touching]))
        label = f"{motion.name}: {'first' if k == 0 else 'next'} contact at t = {t:.4f}"
        mark = "first contact" if k == 0 else ""
        stop = Stop(motion.name, label, poses, now, mark, k == 0, way(before, t), _MOTION * (t - before))
        yield stop
        before = t
    end = f"{motion.name}: end" + (", through the contact" if contacts else "")
    yield Stop(motion.name, end, at(1.0), least, via=way(before, 1.0), seconds=max(0.2, _MOTION * (1.0 - before)))


def first_contacts(rows: Iterable[PairResult]) -> dict[float, list[PairResult]]:
    """The pairs that come to touch during a motion where they are not meant to, by the moment; the first dozen."""
    found: dict[float, list[PairResult]] = {}
    for row in sorted((r for r in rows if r.contact_at and r.verdict in ("contact", "clash", "contained")), key=_first):
        found.setdefault(_first(row), []).append(row)
    return dict(list(found.items())[:12])


def _first(row: PairResult) -> float:
    return row.contact_at or 0.0


def _row(row: PairResult, what: str = "", *, drawn: bool = True) -> Row:
    return Row(row.a, row.b, row.verdict.value, row.distance, what, drawn=drawn)
