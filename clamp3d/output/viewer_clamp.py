"""What the viewer knows of a clamp beyond its scene: its waypoints, the turning nut, grooves in the verdict's colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from clamp3d.clamp.dimensions import TITLES, Clamp
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.clamp.scene import clamp_scene
from clamp3d.clamp.screw import ScrewJoint
from clamp3d.collide.scene import Scene
from clamp3d.core.pose import Array, rotation
from clamp3d.output.palette import VERDICT_COLOURS
from clamp3d.output.section import edge_openings, part_anchor
from clamp3d.output.viewer_cut import groove_surface
from clamp3d.output.viewer_scene import SceneDrawing
from clamp3d.output.viewer_timeline import Row, Stop

UNCUT = ("P4", "P5")
"""Bolts and nuts are not cut lengthwise in drawings (ISO 128)."""
_KINDS = {1: "screw joint", 2: "seat", 3: "groove"}
_TURN = math.pi / 3.0  # rad of the nut between two keys, short enough for an unambiguous turn


class ClampStory:
    """The waypoints of a clamp's assembly as stops; ``clearance`` mm is the gap that counts as clear."""

    def __init__(self, clamp: Clamp, clearance: float) -> None:
        self.clamp, self.clearance = clamp, clearance
        self._seen: dict[tuple[str, str], list[str]] = {pair: [] for pair in groove_pairs(clamp)}
        self._made: set[tuple[tuple[str, str], str]] = set()
        self._first: float | None = None
        self._turn = 0.0

    def scene(self, waypoint: Waypoint | None = None) -> Scene:
        """The clamp at a waypoint; without one every part at the origin of its own frame."""
        poses = {name: np.eye(4) if waypoint is None else waypoint.T_world(name) for name in TITLES}
        return clamp_scene(self.clamp, poses, clearance=self.clearance)

    def anchors(self) -> dict[str, Array]:
        """Where the labels of the parts stand in their frames."""
        at = {name: part_anchor(self.clamp, name) for name in TITLES}
        return {name: np.array([u, 0.0, -v]) for name, (u, v) in at.items()}

    def stop(self, waypoint: Waypoint, scene: Scene, rows: Sequence[Row]) -> Stop:
        """A waypoint as a stop: the nut is drawn turned by as much as it has been screwed on."""
        poses = {part.name: part.T_world for part in scene.parts}
        on = float(poses["P4"][2, 3] - poses["P5"][2, 3])  # up to a constant
        self._first = on if self._first is None else self._first
        before, self._turn = self._turn, -ScrewJoint(self.clamp.bolt.pitch).turn(on - self._first)  # clockwise
        nut = poses["P5"]
        poses["P5"] = nut @ rotation((0.0, 0.0, 1.0), self._turn)
        n = math.ceil(abs(self._turn - before) / _TURN)
        via = tuple(
            (k / n, {"P5": nut @ rotation((0.0, 0.0, 1.0), before + (self._turn - before) * k / n)})
            for k in range(1, n)
        )
        told = [replace(row, what=_KINDS.get(kind, ""), declared=kind != 0) for row, kind in self._kinds(rows)]
        told.sort(key=lambda row: (not row.declared, row.what != "groove"))
        return Stop(waypoint.step, waypoint.label, poses, tuple(told), waypoint.step, via=via)

    def decorate(self, drawing: SceneDrawing, number: int, waypoint: Waypoint, mesh_error: float) -> None:
        """Colour the grooves by their verdicts at a stop, and draw the distance between the splints."""
        verdicts = {frozenset((row.a, row.b)): row.verdict for row in drawing.timeline.stops[number].rows}
        for pair, groove in groove_pairs(self.clamp).items():
            found = verdicts[frozenset(pair)]
            self._seen[pair].append(found)
            name = f"groove {pair[1]} {found}"
            if (pair, found) not in self._made:
                self._made.add((pair, found))
                whole, half = (
                    groove_surface(groove.groove, groove.T_a_groove, mesh_error, half=half) for half in (False, True)
                )
                drawing.groove(pair[0], name, whole, half, VERDICT_COLOURS[found])
        self.recolour(drawing, number)
        opening = edge_openings(self.clamp, waypoint.poses)[0]
        top = waypoint.T_world("P1") @ [0.0, 0.0, -self.clamp.up_splint.thickness, 1.0]
        drawing.dimension(number, "splints", top[:3], top[:3] - [0.0, 0.0, opening], f"splints {opening:.3f} mm")

    def recolour(self, drawing: SceneDrawing, number: int) -> None:
        """Show the grooves' colours of a stop."""
        for path, seen in self.shown(drawing).items():
            drawing.visible(path, seen[number])

    def shown(self, drawing: SceneDrawing) -> dict[str, list[bool]]:
        """At which stops each coloured groove is seen, by its path."""
        return {
            path: [verdict == found for verdict in self._seen[pair]]
            for pair, found in sorted(self._made)
            for path in drawing.groove_paths(pair[0], f"groove {pair[1]} {found}")
        }

    def told(self) -> dict[str, Any]:
        """The head of the page."""
        wires = f"line {self.clamp.line.label}, jumper {self.clamp.jumper.label}"
        return {"title": f"{self.clamp.name} clamp", "subtitle": wires}

    def _kinds(self, rows: Sequence[Row]) -> list[tuple[Row, int]]:
        return [(row, self.clamp.connection(row.a, row.b)) for row in rows]  # type: ignore[arg-type]


def facts(assembly: Assembly) -> list[str]:
    """An assembly in a few short lines."""
    return [
        f"distance between splints {assembly.distance:.3f} mm",
        f"tilt of the down splint {abs(math.degrees(assembly.tilt)):.2f}\N{DEGREE SIGN}",
        f"nut turned {assembly.turns:.2f} times from open",
        f"method {assembly.method}, {assembly.solver} solver",
    ]
