"""A scene and its stops as meshcat commands: parts, marks where they touch or clash, gaps, labels, animation.

The tree, all of it in mm under ``/clamp3d``: ``whole`` and ``cutaway`` hold the parts (one of the two is seen),
``contacts``, ``gaps`` and ``forces`` a group for each stop, ``labels`` the names, ``overlay ...`` convex pieces of a
baseline.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import trimesh
from meshcat.commands import SetAnimation
from meshcat.geometry import Object
from numpy.typing import ArrayLike

from clamp3d.clamp.forces import Force
from clamp3d.engine.answer import Distance
from clamp3d.engine.result import BAD
from clamp3d.engine.scene import Part, Scene
from clamp3d.geometry.pose import Array
from clamp3d.output import viewer_objects as draw
from clamp3d.output.common import cut_open, overlap
from clamp3d.output.palette import FORCE, INK, VERDICT_COLOURS, darker
from clamp3d.output.placed import place, posed
from clamp3d.output.viewer_timeline import FIRST, Row, Stop, Timeline
from clamp3d.output.wording import part_title

ROOT = "/clamp3d"
Command = dict[str, Any]
Send = Callable[[Command], None]
Pieces = Mapping[str, Sequence[trimesh.Trimesh]]
"""Convex pieces of a baseline by part, each in its part's frame."""

_SIZE = 2.5
"""The scene's extent in the viewer's units: meshcat's camera and lights are made for scenes of a few units."""
_FIELD_OF_VIEW = 25.0  # deg
_FRONT, _CORNER = (0.2, 0.24, 1.0), (0.55, 0.5, 1.0)
"""Where the camera stands: to the right, up, and towards the viewer."""
_CUTTABLE, _MARKED, _LABELLED = 60, 200, 12
"""So many parts are also drawn cut open, and so many pairs marked at a stop; a scene of more is slow to look at. The
lengths of more marks than the last would hide each other: each is seen when its finding is picked."""
_MARKS = ("contacts", "gaps", "forces")
"""What is marked at a stop and seen there only."""
_FORCE, _SHAFT = 0.2, 0.008
"""Length of an arrow for the whole bolt force, and thickness of its shaft, in parts of the scene's size."""
_OVERLAY_COLOURS = ("#4477AA", "#EE6677", "#228833", "#CCBB44", "#66CCEE", "#AA3377")  # Tol's bright scheme


class SceneDrawing:
    """Sends a scene's parts to ``send`` at once, each stop of its time line by `show`, and the animation at the end.

    ``cut_y`` is the world's plane Y that parts are cut at where they stand (None: not), but not those of ``uncut``;
    ``anchors`` (3,) are where labels stand in the frames of their parts.
    """

    def __init__(
        self,
        scene: Scene,
        send: Send,
        *,
        mesh_error: float = 0.01,
        cut_y: float | None = None,
        uncut: Sequence[str] = (),
        anchors: Mapping[str, ArrayLike] | None = None,
        overlays: Mapping[str, Pieces] | None = None,
    ) -> None:
        self._send = send
        placed = place(scene)
        self._meshes = {part.name: p.mesh for part, p in zip(placed, posed(placed, mesh_error), strict=True)}
        shared = {id(mesh): mesh for mesh in self._meshes.values()}
        self._drawn = {key: draw.Drawn(mesh) for key, mesh in shared.items()}
        self._corners = {key: np.array(list(itertools.product(*mesh.bounds.T))) for key, mesh in shared.items()}
        self.colours = {part.name: part.colour for part in placed}
        self.cut = cut_y is not None and len(scene.parts) <= _CUTTABLE
        self._trees = ("whole", "cutaway") if self.cut else ("whole",)
        self.overlays = dict(overlays or {})
        self._keys = {part.name: part_title(part).replace("/", " ") for part in scene.parts}
        low, high = self.extent([{part.name: part.T_world for part in scene.parts}])
        self.size = float((high - low).max())
        self._unit = _SIZE / self.size
        self.timeline = Timeline(self.size)
        self._stage()
        for part in scene.parts:
            self._draw_part(part, cut_y, part.name in uncut)
            middle = self._corners[id(self._meshes[part.name])].mean(axis=0)
            anchor = middle if anchors is None else anchors[part.name]
            self._label(f"{ROOT}/labels/{part.name}", part.name, anchor, self.colours[part.name], 0.85)
        for name, pieces in self.overlays.items():
            self._draw_overlay(f"{ROOT}/overlay {name}", pieces)

    def paths(self, part: str) -> list[str]:
        """The nodes of the scene that move with a part."""
        trees = [f"{ROOT}/{tree}/{self._keys[part]}" for tree in self._trees]
        over = [f"{ROOT}/overlay {name}/{part}" for name, pieces in self.overlays.items() if part in pieces]
        return [*trees, f"{ROOT}/labels/{part}", *over]

    def extent(self, states: Sequence[Mapping[str, Array]]) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of a box around the parts at some states, in the world."""
        corners = []
        for poses in states:
            for name, T in poses.items():
                corners.append(self._corners[id(self._meshes[name])] @ T[:3, :3].T + T[:3, 3])
        points = np.vstack(corners or [np.zeros((1, 3)), np.ones((1, 3))])
        return points.min(axis=0), points.max(axis=0)

    def show(self, stop: Stop) -> None:
        """Add a stop to the time line and go there."""
        number = self.timeline.add(stop)
        if number == 0:
            self.frame()
        self._draw_marks(number)
        self.go(number)

    def go(self, number: int) -> None:
        """Parts and marks as they are at a stop."""
        for name, T in self.timeline.stops[number].poses.items():
            for path in self.paths(name):
                self.transform(path, T)
        for k in range(len(self.timeline.stops)):
            for group in _MARKS:
                self.visible(f"{ROOT}/{group}/{self.timeline.group(k)}", k == number)

    def play(self) -> None:
        """Rewind and play all stops once."""
        self.frame()
        self.go(0)
        followers = {name: self.paths(name) for name in self._meshes}
        groups = [f"{ROOT}/{marks}" for marks in _MARKS]
        if len(self.timeline.stops) > 1:
            # A meshcat server tells a page that comes later node by node: at the root the animation would be the first,
            # and the transforms after it would take the parts back to the start of what already plays.
            command = SetAnimation(self.timeline.animation(followers, groups)).lower()
            self._send(command | {"path": f"{ROOT}/animation"})

    def frame(self) -> dict[str, Any]:
        """Put the camera in front of all stops; what it is aimed at."""
        low, high = self.extent([stop.poses for stop in self.timeline.stops])
        eye = np.array(_FRONT if self.cut else _CORNER)
        reach = 0.5 * max(high[2] - low[2], (high[0] - low[0]) / 1.6, (high[1] - low[1]) / 1.6) * self._unit
        far = 1.2 * reach / math.tan(math.radians(_FIELD_OF_VIEW / 2)) + 0.5 * (high[1] - low[1]) * self._unit
        camera = "/Cameras/default/rotated/<object>"  # its axes: right, up, towards the viewer
        self.property(camera, "fov", _FIELD_OF_VIEW)
        self.property(camera, "zoom", 1.0)
        self.property(camera, "position", (far * eye / np.linalg.norm(eye)).tolist())
        T = np.diag([self._unit] * 3 + [1.0])
        T[:3, 3] = -0.5 * self._unit * (low + high)
        self.transform(ROOT, T)
        return {"low": low.tolist(), "high": high.tolist(), "eye": eye.tolist(), "unit": self._unit}

    def _stage(self) -> None:
        """Light background, softer light, no grid."""
        self._send({"type": "delete", "path": ROOT})
        for key, colour in (("top_color", [0.93, 0.95, 0.97]), ("bottom_color", [1.0, 1.0, 1.0])):
            self.property("/Background", key, colour)
        self.visible("/Grid", False)
        self.visible("/Axes", False)
        for light, intensity in (("AmbientLight", 0.5), ("FillLight", 0.25)):
            self.property(f"/Lights/{light}/<object>", "intensity", intensity)

    def _draw_part(self, part: Part, cut_y: float | None, uncut: bool) -> None:
        whole, colour, key = self._meshes[part.name], self.colours[part.name], self._keys[part.name]
        edge = darker(colour, 0.4)
        halves = cut_open(whole, part.T_world, cut_y) if self.cut and not uncut and cut_y is not None else (whole, None)
        for tree, (body, cap) in zip(self._trees, ((whole, None), halves), strict=False):
            if body is not None:
                drawn = self._drawn[id(whole)] if body is whole else draw.Drawn(body)
                self.put(f"{ROOT}/{tree}/{key}/solid", drawn.solid(colour))
                self.put(f"{ROOT}/{tree}/{key}/edges", drawn.edges(edge))
            if cap is not None:
                self.put(f"{ROOT}/{tree}/{key}/cut", draw.facets(cap, colour, lit=False))
        if self.cut:
            self.visible(f"{ROOT}/whole", False)

    def _draw_overlay(self, path: str, pieces: Pieces) -> None:
        self.visible(path, False)
        for part, meshes in pieces.items():
            for i, colour in enumerate(_OVERLAY_COLOURS):  # neighbours differ; a part may have hundreds of pieces
                some = meshes[i :: len(_OVERLAY_COLOURS)]
                if some:
                    joined = draw.joined(some)
                    self.put(f"{path}/{part}/pieces {i + 1}", draw.facets(joined, colour, opacity=0.35))
                    self.put(f"{path}/{part}/edges {i + 1}", draw.Drawn(joined).edges(darker(colour, 0.6)))

    def _draw_marks(self, number: int) -> None:
        """Dots and arrows where parts touch, red volumes where they clash, lines with their length across gaps."""
        stop, group = self.timeline.stops[number], self.timeline.group(number)
        marked = [row for row in stop.rows if row.drawn and row.near][:_MARKED]
        for row in marked:
            d, where = row.distance, f"{ROOT}/{'contacts' if row.touches else 'gaps'}/{group}/{row.a}-{row.b}"
            if row.verdict in BAD:
                self._clash(where, row, stop.poses)
            elif d.point_a is None or d.point_b is None:
                continue
            elif not row.touches:
                self._gap(where, d.point_a, d.point_b, row.gap, row.colour)
            elif d.upper <= d.lower + 0.01 * self.size:  # else they touch, but it is not certain where
                self._dot(f"{where}/point", 0.5 * (d.point_a + d.point_b), row.colour)
                if d.normal is not None and not row.what.startswith("screw"):
                    arrow = draw.arrow(d.point_a, d.normal, 0.06 * self.size, darker(row.colour, 0.55))
                    self.put(f"{where}/normal", arrow)
            if len(marked) > _LABELLED:
                self.visible(f"{where}/value", False)

    def mark_meeting(self, number: int) -> tuple[Array, Array] | None:
        """Box in red where parts meet that first touch at a stop: where their facets overlap soon after it."""
        stops, row = self.timeline.stops, self.timeline.stops[number].rows[0]
        for _, moved in stops[number + 1].via:
            poses = {**stops[number].poses, **moved}
            common = overlap(self._meshes[row.a], poses[row.a], self._meshes[row.b], poses[row.b])
            if common is not None:
                common.apply_transform(poses[row.a])
                low, high = common.bounds
                path = f"{ROOT}/contacts/{self.timeline.group(number)}/{row.a}-{row.b}"
                self._box(path, low, high, FIRST)
                return low, high
        return None

    def _clash(self, path: str, row: Row, poses: Mapping[str, Array]) -> None:
        red, (a, b) = VERDICT_COLOURS["clash"], (row.a, row.b)
        for name, point in (("point a", row.distance.point_a), ("point b", row.distance.point_b)):
            if point is not None:
                self._dot(f"{path}/{name}", point, red)
        common = overlap(self._meshes[a], poses[a], self._meshes[b], poses[b])
        low, high = focus(row.distance)
        if common is not None:
            common.apply_transform(poses[a])
            self.put(f"{path}/overlap", draw.facets(common, red, opacity=0.6, on_top=True))
            low, high = common.bounds
        if common is not None or row.distance.point_a is not None:
            self._box(path, low, high, row.gap)

    def _box(self, path: str, low: Array, high: Array, text: str) -> None:
        margin = 0.01 * self.size
        self.put(f"{path}/box", draw.box(low - margin, high + margin, VERDICT_COLOURS["clash"]))
        self._label(f"{path}/value", text, high + margin, "#FFFFFF", 0.7)

    def _dot(self, path: str, point: Array, colour: str) -> None:
        T = np.eye(4)
        T[:3, 3] = point
        self.put(path, draw.dot(0.006 * self.size, colour))
        self.transform(path, T)

    def _gap(self, path: str, a: Array, b: Array, text: str, colour: str = INK) -> None:
        """A line from ``a`` to ``b`` and its length beside it, so that the text does not hide a small gap."""
        middle = 0.5 * (a + b)
        upright = abs(b[2] - a[2]) >= abs(b[0] - a[0])
        beside = middle + 0.08 * self.size * np.array([-1.0, 0.0, 0.0] if upright else [-1.0, 0.0, 0.7])
        self.put(f"{path}/line", draw.segments([a, b, middle, beside], darker(colour, 0.85), on_top=True))
        self._label(
            f"{path}/value", text if text.startswith("gap or") else text.removeprefix("gap "), beside, "#FFFFFF", 0.7
        )

    def _label(self, path: str, text: str, at: ArrayLike, colour: str, size: float) -> None:
        self.put(path, draw.label(text, colour, at, size=0.01 * size / self._unit))

    def caption(self, text: str) -> None:
        """A line below everything, for meshcat's own page; ours says it in its panel."""
        if self.timeline.stops:
            low, high = self.extent([stop.poses for stop in self.timeline.stops])
            self._label(f"{ROOT}/caption", text, [*(0.5 * (low + high))[:2], low[2] - 0.05 * self.size], "#FFFFFF", 0.8)

    def dimension(self, number: int, name: str, a: Array, b: Array, text: str) -> None:
        """One more length at a stop, from ``a`` to ``b``."""
        self._gap(f"{ROOT}/gaps/{self.timeline.group(number)}/{name}", a, b, text)

    @property
    def force_length(self) -> float:
        """Length of the arrow of a force as large as the bolt's, mm."""
        return _FORCE * self.size

    def forces(self, number: int, forces: Iterable[Force]) -> None:
        """An arrow at a stop for each force, its tip where the first part pushes the second."""
        for k, f in enumerate(forces):
            path = f"{ROOT}/forces/{self.timeline.group(number)}/{f.a}-{f.b}/{k}"
            length = f.force * self.force_length
            tail = f.point - length * f.direction
            thickness = _SHAFT * self.size
            arrow = draw.arrow(tail, f.direction, length, FORCE, thickness=thickness, on_top=True)
            self.put(f"{path}/arrow", arrow)
            beside = tail - 0.025 * self.size * f.direction
            self._label(f"{path}/value", f"force {f.force:.3f}", beside, "#F3E5F7", 0.7)

    def put(self, path: str, what: Object) -> None:
        """Set the object at a path."""
        self._send(draw.command(path, what))

    def transform(self, path: str, T: Array) -> None:
        """Set the pose (4, 4) of a path."""
        self._send({"type": "set_transform", "path": path, "matrix": T.T.ravel().tolist()})

    def property(self, path: str, key: str, value: object) -> None:
        """Set a property of a path."""
        self._send({"type": "set_property", "path": path, "property": key, "value": value})

    def visible(self, path: str, on: bool) -> None:
        """Show or hide a path."""
        self.property(path, "visible", on)


def focus(d: Distance) -> tuple[Array, Array]:
    """Corners of a box around the witness points of a distance."""
    points = [p for p in (d.point_a, d.point_b) if p is not None] or [np.zeros(3)]
    return np.min(points, axis=0), np.max(points, axis=0)
