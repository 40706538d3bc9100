"""What the viewer knows of a clamp beyond its scene: its waypoints in the paper's words, and the turning nut."""

from __future__ import annotations

import math

import numpy as np

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.contact import NONE, measure_contacts
from clamp3d.clamp.dimensions import TITLES, Clamp
from clamp3d.clamp.result import Waypoint
from clamp3d.clamp.scene import CONTACT, clamp_scene
from clamp3d.collide.model import ModelCache
from clamp3d.collide.scene import Scene
from clamp3d.core.pose import Array, rotation
from clamp3d.output.section import edge_openings, part_anchor
from clamp3d.output.viewer_timeline import Row, Stop

UNCUT = ("P4", "P5")
"""Bolts and nuts are not cut lengthwise in drawings (ISO 128)."""
_TURN = math.pi / 3.0  # rad of the nut between two keys, short enough for an unambiguous turn


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
        n = math.ceil(abs(self._turn - before) / _TURN)
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
