"""Pictures of a checked scene: all its parts with the findings numbered, and each finding by itself, enlarged."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.engine.result import PairResult
from clamp3d.engine.scene import Scene
from clamp3d.errors import Clamp3dError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import MIN_MESH_ERROR
from clamp3d.geometry.shapes import Solid
from clamp3d.output.common import overlap
from clamp3d.output.figures import blank
from clamp3d.output.palette import INK, VERDICT_COLOURS
from clamp3d.output.placed import PosedMesh, place, posed
from clamp3d.output.view3d import Camera, draw_solids

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MESH_ERROR = 3e-4
"""Chord error of drawn solids, in parts of the scene's extent: below a pixel."""
_CAMERAS = [
    Camera(math.radians(azimuth), math.radians(elevation))
    for elevation, azimuth in itertools.product((24.0, 55.0, -24.0), (32.0, -32.0, 122.0, 212.0))
]
"""Where a finding is looked at from, the usual one first."""
_ENLARGED = 0.12
"""Half the width of an enlargement, in parts of the extent of the two parts."""


def scene_figure(scene: Scene, marks: Sequence[tuple[int, PairResult]] = ()) -> Figure:
    """All parts of a scene where they stand, with the findings at rest as dots with their numbers."""
    figure = blank(9.0, 5.6)
    ax = figure.add_subplot()
    camera = _CAMERAS[0]
    solids = _solids(scene, [part.name for part in scene.parts])
    draw_solids(ax, list(solids.values()), camera)
    for number, row in marks:
        place = _place(row)
        if place is not None and row.motion is None:
            _mark(ax, camera.project(place[None])[0], row, str(number))
    _legend(ax, solids)
    return figure


def finding_figure(scene: Scene, row: PairResult) -> Figure:
    """The two parts of a finding, where they stand at its moment: whole, and enlarged about the place.

    What the two have in common is drawn in red over them.
    """
    figure = blank(9.0, 4.4)
    shown = _solids(_at(scene, row), [row.a, row.b])
    solids = [shown[row.a], shown[row.b]]
    common = _common(*solids) if row.distance.upper < 0.0 else None
    place = _place(row)
    if place is None and common is not None:
        place = common.T[:3, :3] @ common.mesh.center_mass + common.T[:3, 3]
    camera = _best_camera(solids, place)
    outlines = np.vstack([camera.view(s)[:, :2] for s in solids])
    size = float(np.ptp(outlines, axis=0).max())
    windows = [(outlines.min(axis=0) - 0.01 * size, outlines.max(axis=0) + 0.01 * size)]
    if place is not None:
        half = _ENLARGED * size
        if common is not None:
            half = max(half, 0.6 * float(np.ptp(camera.view(common)[:, :2], axis=0).max()))
        at, reach = camera.project(place[None])[0, :2], np.array([1.2, 1.0]) * half
        windows.append((at - reach, at + reach))
    axes = figure.subplots(1, len(windows), squeeze=False)[0]
    for ax, window in zip(axes, windows, strict=True):
        draw_solids(ax, solids, camera, pixels=800, window=window)
        if common is not None:
            draw_solids(ax, [common], camera, pixels=800, window=window, zorder=10.0)
        if place is not None:
            _mark(ax, camera.project(place[None])[0], row)
    if place is not None:
        axes[1].set_axis_on()
        axes[1].set_xticks([])
        axes[1].set_yticks([])
        axes[1].set_title("enlarged", fontsize=8, loc="left", color=INK)
    _legend(axes[0], shown)
    return figure


def view_of(scene: Scene, row: PairResult) -> tuple[Array, Array, Array, float]:
    """How `finding_figure` looks at a finding: the place, unit vectors to the viewer and up (3,), and a size in mm."""
    solids = list(_solids(_at(scene, row), [row.a, row.b]).values())
    corners = np.vstack([solid.world for solid in solids])
    place = _place(row)
    target = corners.mean(axis=0) if place is None else place
    _, up, towards_viewer = _best_camera(solids, place).axes()
    return target, towards_viewer, up, float(np.ptp(corners, axis=0).max())


def _best_camera(solids: Sequence[PosedMesh], place: Array | None) -> Camera:
    """The camera that the fewest faces hide the place from."""
    return _CAMERAS[0] if place is None else min(_CAMERAS, key=lambda camera: _hidden(camera, solids, place))


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
        shared = overlap(a.mesh, a.T, b.mesh, b.T)
    except (Clamp3dError, RuntimeError, ValueError):
        return None
    return None if shared is None else PosedMesh(shared, a.T, VERDICT_COLOURS["clash"])


def _hidden(camera: Camera, solids: Sequence[PosedMesh], place: Array) -> int:
    """How many faces lie between a place and the viewer."""
    count = 0
    for solid in solids:
        R = solid.T[:3, :3]
        towards = camera.axes()[2]
        origin = R.T @ (place + 1e-3 * towards - solid.T[:3, 3])
        count += len(solid.mesh.ray.intersects_location(origin[None], (R.T @ towards)[None])[0])
    return count


def _mark(ax: Axes, at: Array, row: PairResult, text: str = "") -> None:
    colour = VERDICT_COLOURS[row.verdict.value]
    ax.plot([at[0]], [at[1]], "o", ms=13, mfc="none", mec="white", mew=3.2, zorder=40)
    ax.plot([at[0]], [at[1]], "o", ms=13, mfc="none", mec=colour, mew=1.8, zorder=41)
    if text:
        box = {"boxstyle": "circle,pad=0.2", "fc": "white", "ec": colour, "lw": 1.4}
        style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 8, "fontweight": "bold", "zorder": 42}
        ax.annotate(text, (at[0], at[1]), (14, 14), textcoords="offset points", bbox=box, color=INK, **style)


def _legend(ax: Axes, solids: dict[str, PosedMesh]) -> None:
    """Names of the parts by their colours; of many, none: the colours repeat."""
    from matplotlib.patches import Patch

    if len(solids) <= 12:
        handles = [Patch(fc=solid.colour, ec=INK, lw=0.5, label=name) for name, solid in solids.items()]
        ax.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=(0.0, 0.0),
            ncols=4,
            frameon=False,
            fontsize=8,
            labelcolor=INK,
        )
