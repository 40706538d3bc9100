"""Pictures of a checked scene: all its parts with the findings numbered, and each finding by itself, enlarged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.engine.result import PairResult
from clamp3d.engine.scene import Scene
from clamp3d.errors import Clamp3dError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import MIN_MESH_ERROR
from clamp3d.geometry.shapes import Solid
from clamp3d.output.figures import blank, numbered
from clamp3d.output.palette import INK, VERDICT_COLOURS
from clamp3d.output.placed import PosedMesh, overlap, place, posed
from clamp3d.output.view3d import Camera, draw_solids

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MESH_ERROR = 3e-4
"""Chord error of drawn solids, in parts of the scene's extent: below a pixel."""
_ENLARGED = 0.12
"""Half the width of an enlargement, in parts of the extent of the two parts."""


def scene_figure(scene: Scene, marks: Sequence[tuple[int, PairResult]] = ()) -> Figure:
    """All parts of a scene where they stand, with the findings at rest as circles with their numbers.

    The circle of a finding that parts hide is dashed.
    """
    figure = blank(9.0, 5.6)
    ax = figure.add_subplot()
    solids = _solids(scene, [part.name for part in scene.parts])
    raster = draw_solids(ax, list(solids.values()), Camera())
    for number, row in marks:
        place = _place(row)
        if place is not None and row.motion is None:
            on_top = place + 2.0 / raster.pixels_per_mm * raster.camera.axes()[2]  # a place on a face is not behind it
            is_seen = raster.seen(raster.pixels(on_top[None]))[0]
            at = _mark(ax, raster.camera, place, row, "solid" if is_seen else (0, (1.5, 0.8)))
            numbered(ax, number, at, VERDICT_COLOURS[row.verdict.value], offset=14.0)
    _legend(ax, solids)
    return figure


def finding_figure(scene: Scene, row: PairResult) -> Figure:
    """The two parts of a finding, where they stand at its moment: whole, and enlarged about the place.

    The parts are ghosts, what the two have in common is red.
    """
    figure = blank(9.0, 4.4)
    shown = _solids(_at(scene, row), [row.a, row.b])
    solids = [shown[row.a], shown[row.b]]
    common = _common(*solids) if row.distance.upper < 0.0 else None
    place = _place(row)
    if place is None and common is not None:
        place = common.world.mean(axis=0)
    camera = Camera()
    outlines = camera.project(np.vstack([solid.world for solid in solids]))[:, :2]
    low, high = outlines.min(axis=0), outlines.max(axis=0)
    size = float((high - low).max())
    windows = [(low - 0.01 * size, high + 0.01 * size)]
    if place is not None:
        extent = 0.0 if common is None else float(np.ptp(camera.project(common.world)[:, :2], axis=0).max())
        half = np.clip(0.6 * extent, _ENLARGED * size, 2.0 * _ENLARGED * size)
        at, reach = camera.project(place)[:2], np.array([1.2, 1.0]) * half
        windows.append((at - reach, at + reach))
    axes = figure.subplots(1, len(windows), squeeze=False)[0]
    for ax, window in zip(axes, windows, strict=True):
        draw_solids(ax, solids, camera, pixels=800, window=window, inside=[] if common is None else [common])
        if place is not None:
            _mark(ax, camera, place, row)
    if place is not None:
        axes[1].set_axis_on()
        axes[1].set(xticks=[], yticks=[])
        axes[1].set_title("enlarged", fontsize=8, loc="left", color=INK)
    _legend(axes[0], shown)
    return figure


def view_of(scene: Scene, row: PairResult) -> tuple[Array, Array, Array, float]:
    """How `finding_figure` looks at a finding: the place, unit vectors to the viewer and up (3,), and a size in mm."""
    solids = list(_solids(_at(scene, row), [row.a, row.b]).values())
    corners = np.vstack([solid.world for solid in solids])
    place = _place(row)
    target = corners.mean(axis=0) if place is None else place
    _, up, towards_viewer = Camera().axes()
    return target, towards_viewer, up, float(np.ptp(corners, axis=0).max())


def _at(scene: Scene, row: PairResult) -> Scene:
    """The scene at the moment of a row: that of its least distance in a motion."""
    poses = {part.name: part.T_world for part in scene.parts}
    for motion in scene.motions if row.motion is not None else ():
        # Each motion starts where the one before has left the parts.
        going = motion.resolved(poses[motion.parts[0]])
        t = row.t if motion.name == row.motion and row.t is not None else 1.0
        poses |= {name: going.at(t, poses[name]) for name in motion.parts}
        if motion.name == row.motion:
            break
    return scene.moved(poses)


def _solids(scene: Scene, names: Sequence[str]) -> dict[str, PosedMesh]:
    solids = {}
    for item in place(scene, names):
        extent = float(np.ptp(item.shape.bounds, axis=0).max()) if isinstance(item.shape, Solid) else 0.0
        (solids[item.name],) = posed([item], max(MIN_MESH_ERROR, _MESH_ERROR * extent))
    return solids


def _place(row: PairResult) -> Array | None:
    """A point inside the overlap where one is known, else the middle between the two witness points."""
    if row.where is not None and row.where.point is not None:
        return row.where.point
    p, q = row.distance.point_a, row.distance.point_b
    return None if p is None or q is None else 0.5 * (p + q)


def _common(a: PosedMesh, b: PosedMesh) -> PosedMesh | None:
    """What two overlapping parts have in common; None where their facets do not meet or cannot be cut."""
    try:
        shared = overlap(a, b)
    except (Clamp3dError, RuntimeError, ValueError):
        return None
    return None if shared is None else PosedMesh(shared, np.eye(4), VERDICT_COLOURS["clash"])


def _mark(ax: Axes, camera: Camera, place: Array, row: PairResult, dashes: Any = "solid") -> tuple[float, float]:
    """A circle about a place; returns where that is on the axes."""
    x, y, _ = camera.project(place).tolist()
    for colour, width in (("white", 3.2), (VERDICT_COLOURS[row.verdict.value], 1.8)):
        ax.scatter([x], [y], s=170, facecolors="none", edgecolors=colour, lw=width, linestyles=[dashes], zorder=41)
    return x, y


def _legend(ax: Axes, solids: dict[str, PosedMesh]) -> None:
    """Names of the parts by their colours; of many, none: the colours repeat."""
    from matplotlib.patches import Patch

    if len(solids) <= 12:
        handles = [Patch(fc=solid.colour, ec=INK, lw=0.5, label=name) for name, solid in solids.items()]
        below: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.0, 0.0)}
        ax.legend(handles=handles, ncols=4, frameon=False, fontsize=8, labelcolor=INK, **below)
