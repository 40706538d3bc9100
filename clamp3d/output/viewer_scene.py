"""A scene and its stops as meshcat commands: parts, marks where they touch or clash, gaps, labels, animation.

The tree, all of it in mm under ``/clamp3d``: ``parts/NAME`` holds a part (``solid``, ``edges``, ``label``, and convex
pieces of a baseline); ``contacts``, ``gaps`` and ``forces`` hold a group for each stop.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from meshcat.commands import SetAnimation
from meshcat.geometry import Geometry, Object
from numpy.typing import ArrayLike

from clamp3d.clamp.forces import Force
from clamp3d.engine.result import BAD
from clamp3d.engine.scene import Scene
from clamp3d.geometry.pose import Array
from clamp3d.output import viewer_objects as draw
from clamp3d.output.palette import FORCE, INK, VERDICT_COLOURS, darker
from clamp3d.output.placed import PosedMesh, overlap, place, posed
from clamp3d.output.viewer_story import Poses, Row, Stop, Timeline, focus

Command = dict[str, Any]
Pieces = Mapping[str, Sequence[trimesh.Trimesh]]
"""Convex pieces of a baseline by part, each in its part's frame."""

ROOT = "/clamp3d"
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
    """Sends a scene's parts to ``send`` at once, each stop of its time line by `show`, and the animation at the end.

    ``anchors`` (3,) are where labels stand in the frames of their parts; a scene with them is seen from the front.
    """

    def __init__(
        self,
        scene: Scene,
        send: Callable[[Command], None],
        *,
        mesh_error: float = 0.01,
        anchors: Mapping[str, ArrayLike] | None = None,
        overlays: Mapping[str, Pieces] | None = None,
    ) -> None:
        self._send, self._eye = send, np.array(_CORNER if anchors is None else _FRONT)
        placed = place(scene)
        self._meshes = dict(zip((part.name for part in placed), posed(placed, mesh_error), strict=True))
        self._drawn: dict[int, tuple[Geometry, Geometry, Array]] = {}
        for mesh in (solid.mesh for solid in self._meshes.values()):
            if id(mesh) not in self._drawn:
                corners = np.array(list(itertools.product(*mesh.bounds.T)))
                self._drawn[id(mesh)] = draw.smooth_faces(mesh), draw.sharp_edges(mesh), corners
        self.colours = {part.name: part.colour for part in placed}
        self.paths = {name: f"parts/{name.replace('/', ' ')}" for name in self._meshes}
        self._start = {part.name: part.T_world for part in scene.parts}
        low, high = self.extent(self._start)
        self.size = float((high - low).max())
        self._unit = _SIZE / self.size
        self.timeline = Timeline(self.size)
        self._shared: dict[tuple[int, str, str], tuple[Array, Array]] = {}
        """Corners of the box around what a pair shares at a stop."""
        self._stage()
        for name, solid in self._meshes.items():
            self._draw_part(name, solid, None if anchors is None else anchors[name])
            self._transform(self._path(name), self._start[name])
        for title, pieces in (overlays or {}).items():
            self._draw_overlay(title, pieces)
        self.frame(low, high)

    def _path(self, part: str) -> str:
        return f"{ROOT}/{self.paths[part]}"

    def extent(self, poses: Poses) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of a box around the parts, in the world."""
        corners = [self._drawn[id(self._meshes[name].mesh)][2] @ T[:3, :3].T + T[:3, 3] for name, T in poses.items()]
        points = np.vstack(corners or [np.zeros((1, 3)), np.ones((1, 3))])
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
            path = f"{ROOT}/{'contacts' if row.touches else 'gaps'}/{group}/{row.a}-{row.b}"
            self._mark(path, row, number)
            if len(marked) > _LABELLED:
                self._visible(f"{path}/value", False)
        if stop.length is not None:
            self._gap(f"{ROOT}/gaps/{group}/length", *stop.length)
        self._go(number)

    def _go(self, number: int) -> None:
        """Parts and marks as they are at a stop."""
        for name, T in self.timeline.stops[number].poses.items():
            self._transform(self._path(name), T)
        for k in range(len(self.timeline.stops)):
            for group in _MARKS:
                self._visible(f"{ROOT}/{group}/{self.timeline.group(k)}", k == number)

    def play(self, caption: str) -> None:
        """Rewind and play all stops once; ``caption`` is for meshcat's own page, ours says it in its panel."""
        low, high = self._all_stops()
        self.frame(low, high)
        self._label(f"{ROOT}/caption", caption, [*(0.5 * (low + high))[:2], low[2] - 0.05 * self.size], "#FFFFFF", 0.8)
        self._go(0)
        if len(self.timeline.stops) > 1:
            # A meshcat server sends the scene node by node to a page that connects later: at the root the animation
            # would be first, and the transforms after it would take the parts back to the start of what already plays.
            animation = self.timeline.animation(ROOT.lstrip("/"), self.paths, _MARKS)
            self._send(SetAnimation(animation).lower() | {"path": f"{ROOT}/animation"})

    def frame(self, low: Array, high: Array) -> None:
        """Put the camera in front of a box."""
        reach = 0.5 * max(high[2] - low[2], (high[0] - low[0]) / 1.6, (high[1] - low[1]) / 1.6) * self._unit
        far = 1.2 * reach / math.tan(math.radians(_FIELD_OF_VIEW / 2)) + 0.5 * (high[1] - low[1]) * self._unit
        camera = "/Cameras/default/rotated/<object>"  # its axes: right, up, towards the viewer
        self._property(camera, "fov", _FIELD_OF_VIEW)
        self._property(camera, "zoom", 1.0)
        self._property(camera, "position", (far * self._eye / np.linalg.norm(self._eye)).tolist())
        T = np.diag([self._unit] * 3 + [1.0])
        T[:3, 3] = -0.5 * self._unit * (low + high)
        self._transform(ROOT, T)

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
        self._send({"type": "delete", "path": ROOT})
        for key, colour in (("top_color", [0.93, 0.95, 0.97]), ("bottom_color", [1.0, 1.0, 1.0])):
            self._property("/Background", key, colour)
        self._visible("/Grid", False)
        self._visible("/Axes", False)
        for light, intensity in (("AmbientLight", 0.5), ("FillLight", 0.25)):
            self._property(f"/Lights/{light}/<object>", "intensity", intensity)

    def _draw_part(self, name: str, solid: PosedMesh, anchor: ArrayLike | None) -> None:
        faces, edges, corners = self._drawn[id(solid.mesh)]
        self._put(f"{self._path(name)}/solid", draw.solid(faces, solid.colour))
        self._put(f"{self._path(name)}/edges", draw.lines(edges, darker(solid.colour, 0.4)))
        at = corners.mean(axis=0) if anchor is None else anchor
        self._label(f"{self._path(name)}/label", name, at, solid.colour, 0.85)

    def _draw_overlay(self, title: str, pieces: Pieces) -> None:
        for part, meshes in pieces.items():
            path = f"{self._path(part)}/{title}"
            self._visible(path, False)
            for i, colour in enumerate(_OVERLAY_COLOURS):  # neighbours differ; a part may have hundreds of pieces
                some = meshes[i :: len(_OVERLAY_COLOURS)]
                if some:
                    joined: Any = trimesh.util.concatenate(list(some))
                    self._put(f"{path}/pieces {i + 1}", draw.facets(joined, colour, opacity=0.35))
                    self._put(f"{path}/edges {i + 1}", draw.lines(draw.sharp_edges(joined), darker(colour, 0.6)))

    def _mark(self, path: str, row: Row, number: int) -> None:
        """A dot and an arrow where parts touch, the volume that they share, or a line with its length across a gap."""
        d = row.distance
        if row.verdict in BAD:
            self._clash(path, row, number)
        elif d.point_a is None or d.point_b is None:
            return
        elif not row.touches:
            self._gap(path, d.point_a, d.point_b, row.gap, row.colour)
        elif d.upper <= d.lower + 0.01 * self.size:  # else they touch, but it is not certain where
            self._dot(f"{path}/point", 0.5 * (d.point_a + d.point_b), row.colour)
            if d.normal is not None and not row.what.startswith("screw"):
                self._put(f"{path}/normal", draw.arrow(d.point_a, d.normal, 0.06 * self.size, darker(row.colour, 0.55)))

    def _clash(self, path: str, row: Row, number: int) -> None:
        red, a, b, poses = VERDICT_COLOURS["clash"], row.a, row.b, self.timeline.stops[number].poses
        for name, point in (("point a", row.distance.point_a), ("point b", row.distance.point_b)):
            if point is not None:
                self._dot(f"{path}/{name}", point, red)
        common = overlap(*(replace(self._meshes[name], T=poses[name]) for name in (a, b)))
        low, high = focus(row.distance)
        if common is not None:
            self._put(f"{path}/overlap", draw.facets(common, red, opacity=0.6, on_top=True))
            low, high = self._shared[number, a, b] = common.bounds
        elif row.distance.point_a is None:
            return
        margin = 0.01 * self.size
        self._put(f"{path}/box", draw.box(low - margin, high + margin, red))
        depth = row.gap.partition(",")[0]  # without the move that separates: a label has one number
        self._label(f"{path}/value", depth, high + margin, "#FFFFFF", 0.7)

    def _dot(self, path: str, point: Array, colour: str) -> None:
        T = np.eye(4)
        T[:3, 3] = point
        self._put(path, draw.dot(0.006 * self.size, colour))
        self._transform(path, T)

    def _gap(self, path: str, a: Array, b: Array, text: str, colour: str = INK) -> None:
        """A line from ``a`` to ``b`` and its length beside it, so that the text does not hide a small gap."""
        middle = 0.5 * (a + b)
        upright = abs(b[2] - a[2]) >= abs(b[0] - a[0])
        beside = middle + 0.08 * self.size * np.array([-1.0, 0.0, 0.0] if upright else [-1.0, 0.0, 0.7])
        line = draw.lines(draw.points([a, b, middle, beside]), darker(colour, 0.85), on_top=True)
        self._put(f"{path}/line", line)
        text = text if text.startswith("gap or") else text.removeprefix("gap ")
        self._label(f"{path}/value", text, beside, "#FFFFFF", 0.7)

    @property
    def force_length(self) -> float:
        """Length of the arrow of a force as large as the bolt's, mm."""
        return _FORCE * self.size

    def forces(self, forces: Iterable[Force]) -> None:
        """An arrow at the last stop for each force, its tip where the first part pushes the second."""
        group = self.timeline.group(len(self.timeline.stops) - 1)
        for k, f in enumerate(forces):
            path = f"{ROOT}/forces/{group}/{f.a}-{f.b}/{k}"
            length = f.force * self.force_length
            tail = f.point - length * f.direction
            thickness = _SHAFT * self.size
            self._put(f"{path}/arrow", draw.arrow(tail, f.direction, length, FORCE, thickness=thickness, on_top=True))
            beside = tail - 0.025 * self.size * f.direction
            self._label(f"{path}/value", f"force {f.force:.3f}", beside, "#F3E5F7", 0.7)

    def _label(self, path: str, text: str, at: ArrayLike, colour: str, size: float) -> None:
        self._put(path, draw.label(text, colour, at, size=0.01 * size / self._unit))

    def _put(self, path: str, what: Object) -> None:
        self._send(draw.command(path, what))

    def _transform(self, path: str, T: Array) -> None:
        self._send({"type": "set_transform", "path": path, "matrix": T.T.ravel().tolist()})

    def _property(self, path: str, key: str, value: object) -> None:
        self._send({"type": "set_property", "path": path, "property": key, "value": value})

    def _visible(self, path: str, on: bool) -> None:
        self._property(path, "visible", on)
