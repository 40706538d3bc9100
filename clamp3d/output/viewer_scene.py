"""A scene and its stops as meshcat commands: parts, marks where they touch or clash, gaps, labels, animation.

The tree, all of it in mm under ``/clamp3d``: ``parts/NAME`` holds a part (``solid``, ``edges``, ``label``, and convex
pieces of a baseline); ``contacts``, ``gaps`` and ``forces`` hold a group for each stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from meshcat.commands import SetAnimation
from meshcat.path import Path
from meshcat.visualizer import Visualizer
from numpy.typing import ArrayLike

from clamp3d.clamp.result import Force
from clamp3d.engine.model import box_corners
from clamp3d.engine.result import BAD
from clamp3d.geometry.pose import Array, to_target, translation
from clamp3d.output import viewer_objects as draw
from clamp3d.output.palette import FORCE, INK, VERDICT_COLOURS, darker
from clamp3d.output.placed import overlap, place, posed
from clamp3d.output.serving import CommandLog
from clamp3d.output.viewer_story import Poses, Row, Stop, Story, Timeline, focus

Pieces = Mapping[str, Sequence[trimesh.Trimesh]]
"""Convex pieces of a baseline by part, each in its part's frame."""

_SIZE = 2.5
"""The scene's extent in the viewer's units: meshcat's camera and lights are made for scenes of a few units."""
_FIELD_OF_VIEW = 25.0  # deg
_FRONT, _CORNER = (0.2, 0.24, 1.0), (0.55, 0.5, 1.0)
"""Where the camera stands: to the right, up, and towards the viewer; of a clamp, of a scene."""
_MARKED, _LABELLED = 200, 12
"""So many pairs are marked at a stop; the lengths of more than the last would hide each other: each is seen when its
finding is picked."""
_MARKS = ("contacts", "gaps", "forces")
"""What is marked at a stop and seen there only."""
_FORCE, _SHAFT = 0.2, 0.008
"""Length of an arrow for the whole bolt force, and thickness of its shaft, in parts of the scene's size."""
_OVERLAY_COLOURS = ("#4477AA", "#EE6677", "#228833", "#CCBB44", "#66CCEE", "#AA3377")  # Tol's bright scheme


class SceneDrawing:
    """Sends a story's parts to ``log`` at once, each stop of its time line by `show`, and the animation at the end."""

    def __init__(self, story: Story, log: CommandLog, mesh_error: float, overlays: Mapping[str, Pieces]) -> None:
        self._log, self._eye = log, np.array(_CORNER if story.anchors is None else _FRONT)
        self._world = Visualizer.view_into(log, Path())
        self._root = self._world["clamp3d"]
        placed = place(story.scene)
        self._meshes = dict(zip((part.name for part in placed), posed(placed, mesh_error), strict=True))
        self.colours = {part.name: part.colour for part in placed}
        self.paths = {name: f"parts/{_node(name)}" for name in self._meshes}
        self._start = {part.name: part.T_world for part in story.scene.parts}
        low, high = self.extent(self._start)
        self.size = float((high - low).max())
        self._unit = _SIZE / self.size
        self.timeline = Timeline(self.size)
        self._shared: dict[tuple[int, str, str], tuple[Array, Array]] = {}
        """Corners of the box around what a pair shares at a stop."""
        self._stage()
        self._draw_parts(story.anchors)
        for title, pieces in overlays.items():
            self._draw_overlay(title, pieces)
        self.frame(low, high)

    def extent(self, poses: Poses) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of a box around the parts, in the world."""
        boxes = [to_target(T, box_corners(self._meshes[name].mesh.bounds)) for name, T in poses.items()]
        points = np.vstack(boxes or [np.zeros((1, 3)), np.ones((1, 3))])
        return points.min(axis=0), points.max(axis=0)

    def _all_stops(self) -> tuple[Array, Array]:
        states = [stop.poses for stop in self.timeline.stops] or [self._start]
        boxes = np.array([self.extent(poses) for poses in states])
        return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)

    def show(self, stop: Stop) -> None:
        """Add a stop to the time line and go there."""
        number = self.timeline.add(stop)
        group = self.timeline.group(number)
        marked = [row for row in stop.rows if row.near][:_MARKED]
        for row in marked:
            marks = self._root[f"{'contacts' if row.touches else 'gaps'}/{group}/{_node(f'{row.a}-{row.b}')}"]
            self._mark(marks, row, number)
            if len(marked) > _LABELLED:
                marks["value"].set_property("visible", False)
        if stop.length is not None:
            self._gap(self._root[f"gaps/{group}/length"], *stop.length)
        self._go(number)

    def _go(self, number: int) -> None:
        """Parts and marks as they are at a stop."""
        for name, T in self.timeline.stops[number].poses.items():
            self._root[self.paths[name]].set_transform(T)
        for k in range(len(self.timeline.stops)):
            for group in _MARKS:
                self._root[f"{group}/{self.timeline.group(k)}"].set_property("visible", k == number)

    def play(self, caption: str) -> None:
        """Rewind and play all stops once; ``caption`` is for meshcat's own page, ours says it in its panel."""
        low, high = self._all_stops()
        self.frame(low, high)
        below = [*(0.5 * (low + high))[:2], low[2] - 0.05 * self.size]
        self._label(self._root["caption"], caption, below, "#FFFFFF", 0.8)
        self._go(0)
        if len(self.timeline.stops) > 1:
            # A meshcat server sends the scene node by node to a page that connects later: at the root the animation
            # would be first, and the transforms after it would take the parts back to the start of what already plays.
            animation = SetAnimation(self.timeline.animation(self._root, self.paths, _MARKS)).lower()
            animation["path"] = self._root["animation"].path.lower()
            self._log.forward(animation)

    def frame(self, low: Array, high: Array) -> None:
        """Put the camera in front of a box."""
        reach = 0.5 * max(high[2] - low[2], (high[0] - low[0]) / 1.6, (high[1] - low[1]) / 1.6) * self._unit
        far = 1.2 * reach / math.tan(math.radians(_FIELD_OF_VIEW / 2)) + 0.5 * (high[1] - low[1]) * self._unit
        camera = self._world["Cameras/default/rotated/<object>"]  # its axes: right, up, towards the viewer
        camera.set_property("fov", _FIELD_OF_VIEW)
        camera.set_property("zoom", 1.0)
        camera.set_property("position", (far * self._eye / np.linalg.norm(self._eye)).tolist())
        T = np.diag([self._unit] * 3 + [1.0])
        T[:3, 3] = -0.5 * self._unit * (low + high)
        self._root.set_transform(T)

    def framed(self) -> dict[str, Any]:
        """What the camera is to show, as data for the page."""
        low, high = self._all_stops()
        return {"low": low.tolist(), "high": high.tolist(), "eye": self._eye.tolist()}

    def with_margin(self, finding: dict[str, Any]) -> dict[str, Any]:
        """A finding with a margin around the box that the camera frames: the common part, else the nearest points."""
        place = (finding["stop"], finding["a"], finding["b"])
        low, high = self._shared.get(place, (finding["low"], finding["high"]))
        margin = 0.1 * self.size
        return finding | {"low": (low - margin).tolist(), "high": (high + margin).tolist()}

    def _stage(self) -> None:
        """Light background, softer light, no grid."""
        self._root.delete()
        for key, colour in (("top_color", [0.93, 0.95, 0.97]), ("bottom_color", [1.0, 1.0, 1.0])):
            self._world["Background"].set_property(key, colour)
        for path in ("Grid", "Axes"):
            self._world[path].set_property("visible", False)
        for light, intensity in (("AmbientLight", 0.5), ("FillLight", 0.25)):
            self._world[f"Lights/{light}/<object>"].set_property("intensity", intensity)

    def _draw_parts(self, anchors: Mapping[str, ArrayLike] | None) -> None:
        """Parts of one shape share their geometry."""
        drawn = {id(item.mesh): item.mesh for item in self._meshes.values()}
        shared = {key: (draw.smooth_faces(mesh), draw.sharp_edges(mesh)) for key, mesh in drawn.items()}
        for name, item in self._meshes.items():
            part, (faces, edges) = self._root[self.paths[name]], shared[id(item.mesh)]
            part["solid"].set_object(draw.solid(faces, item.colour))
            part["edges"].set_object(draw.lines(edges, darker(item.colour, 0.4)))
            anchor = item.mesh.bounds.mean(axis=0) if anchors is None else anchors[name]
            self._label(part["label"], name, anchor, item.colour, 0.85)
            part.set_transform(self._start[name])

    def _draw_overlay(self, title: str, pieces: Pieces) -> None:
        for part, meshes in pieces.items():
            node = self._root[f"{self.paths[part]}/{title}"]
            node.set_property("visible", False)
            for i, colour in enumerate(_OVERLAY_COLOURS):  # neighbours differ; a part may have hundreds of pieces
                some = meshes[i :: len(_OVERLAY_COLOURS)]
                if some:
                    joined: Any = trimesh.util.concatenate(list(some))
                    node[f"pieces {i + 1}"].set_object(draw.facets(joined, colour, opacity=0.35))
                    node[f"edges {i + 1}"].set_object(draw.lines(draw.sharp_edges(joined), darker(colour, 0.6)))

    def _mark(self, marks: Visualizer, row: Row, number: int) -> None:
        """A dot and an arrow where parts touch, the volume that they share, or a line with its length across a gap."""
        d = row.distance
        if row.verdict in BAD:
            self._clash(marks, row, number)
        elif d.point_a is None or d.point_b is None:
            return
        elif not row.touches:
            self._gap(marks, d.point_a, d.point_b, row.gap, row.colour)
        elif d.upper <= d.lower + 0.01 * self.size:  # else they touch, but it is not certain where
            self._dot(marks["point"], 0.5 * (d.point_a + d.point_b), row.colour)
            if d.normal is not None and not row.what.startswith("screw"):
                length, colour = 0.06 * self.size, darker(row.colour, 0.55)
                marks["normal"].set_object(draw.arrow(d.point_a, d.normal, length, 0.07 * length, colour, on_top=False))

    def _clash(self, marks: Visualizer, row: Row, number: int) -> None:
        red, a, b, poses = VERDICT_COLOURS["clash"], row.a, row.b, self.timeline.stops[number].poses
        for name, point in (("point a", row.distance.point_a), ("point b", row.distance.point_b)):
            if point is not None:
                self._dot(marks[name], point, red)
        common = overlap(*(replace(self._meshes[name], T=poses[name]) for name in (a, b)))
        low, high = focus(row.distance)
        if common is not None:
            marks["overlap"].set_object(draw.facets(common, red, opacity=0.6, on_top=True))
            low, high = self._shared[number, a, b] = common.bounds
        elif row.distance.point_a is None:
            return
        margin = 0.01 * self.size
        marks["box"].set_object(draw.box(low - margin, high + margin, red))
        depth = row.gap.partition(",")[0]  # without the move that separates: a label has one number
        self._label(marks["value"], depth, high + margin, "#FFFFFF", 0.7)

    def _dot(self, node: Visualizer, point: Array, colour: str) -> None:
        node.set_object(draw.dot(0.006 * self.size, colour))
        node.set_transform(translation(*point))

    def _gap(self, marks: Visualizer, a: Array, b: Array, text: str, colour: str = INK) -> None:
        """A line from ``a`` to ``b`` and its length beside it, so that the text does not hide a small gap."""
        middle = 0.5 * (a + b)
        upright = abs(b[2] - a[2]) >= abs(b[0] - a[0])
        beside = middle + 0.08 * self.size * np.array([-1.0, 0.0, 0.0] if upright else [-1.0, 0.0, 0.7])
        ends = draw.points([a, b, middle, beside])
        marks["line"].set_object(draw.lines(ends, darker(colour, 0.85), on_top=True))
        text = text if text.startswith("gap or") else text.removeprefix("gap ")
        self._label(marks["value"], text, beside, "#FFFFFF", 0.7)

    @property
    def force_length(self) -> float:
        """Length of the arrow of a force as large as the bolt's, mm."""
        return _FORCE * self.size

    def forces(self, forces: Iterable[Force]) -> None:
        """An arrow at the last stop for each force, its tip where the first part pushes the second."""
        group = self.timeline.group(len(self.timeline.stops) - 1)
        for k, f in enumerate(forces):
            marks = self._root[f"forces/{group}/{f.a}-{f.b}/{k}"]
            length, thickness = f.force * self.force_length, _SHAFT * self.size
            tail = f.point - length * f.direction
            marks["arrow"].set_object(draw.arrow(tail, f.direction, length, thickness, FORCE, on_top=True))
            beside = tail - 0.025 * self.size * f.direction
            self._label(marks["value"], f"force {f.force:.3f}", beside, "#F3E5F7", 0.7)

    def _label(self, node: Visualizer, text: str, at: ArrayLike, colour: str, size: float) -> None:
        node.set_object(draw.label(text, colour, at, size=0.01 * size / self._unit))


def _node(name: str) -> str:
    """A name as that of one node of meshcat's tree."""
    return name.replace("/", " ")
