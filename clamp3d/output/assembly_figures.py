"""Pictures of how the clamp goes together: exploded view (Fig. 1 of the paper) and assembly steps (Fig. 3)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from clamp3d.checks import instance
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Assembly
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.pose import Array, SectionPose
from clamp3d.geometry.profile import MIN_MESH_ERROR
from clamp3d.output.figures import blank, near, same_scale, title
from clamp3d.output.palette import DIMENSION, INK, PART_COLOURS
from clamp3d.output.placed import PosedMesh
from clamp3d.output.section import ARROW, Poses, balloon, draw_section, label, label_column, note, part_anchor
from clamp3d.output.view3d import Camera, draw_solids

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# In parts of the up splint's width:
_MESH_ERROR = 7e-5  # far below a pixel
_MOVED = 0.015  # smaller motions get no arrow
_ARROW = 0.45  # longest arrow


def exploded_figure(clamp: Clamp) -> Figure:
    """All seven parts drawn apart along the bolt, with names."""
    instance("clamp", clamp, Clamp)
    figure = blank(7.6, 6.4)
    ax = figure.add_subplot()
    camera = Camera()
    drawn = _placed(clamp, exploded_poses(clamp))
    draw_solids(ax, list(drawn.values()), camera)
    x0, x1 = ax.get_xlim()
    width = x1 - x0
    corners = {name: camera.project(solid.world)[:, :2] for name, solid in drawn.items()}
    points = {name: tuple(view[view[:, 0].argmax()].tolist()) for name, view in corners.items() if name != "P6"}
    label_column(ax, clamp, points, x1 + 0.07 * width, 0.085 * width)
    # The near end of the power line is the leftmost of all.
    x, y = corners["P6"][corners["P6"][:, 0].argmin()]
    ax.plot([x - 0.09 * width, x], [y, y], color=INK, lw=0.5, marker=".", markevery=[1], ms=3.5, zorder=30)
    balloon(ax, "P6", x - 0.09 * width, y, size=8.0)
    note(ax, label(clamp, "P6"), (x - 0.09 * width, y), (0, -13), ha="center", va="top")
    ax.set_xlim(x0 - 0.18 * width, x1 + 0.32 * width)
    title(ax, "exploded view", f"{clamp.name} clamp: seven parts")
    return figure


def exploded_poses(clamp: Clamp) -> dict[PartName, SectionPose]:
    """Parts apart along the bolt, as far as they stay threaded on it; line centre at the origin, splints straight."""
    up, down, saddle, bolt, nut = clamp.up_splint, clamp.down_splint, clamp.saddle, clamp.bolt, clamp.nut
    x = up.line_groove.offset
    gap = 0.16 * up.width
    r = max(clamp.line.radius, clamp.jumper.radius)
    p2 = r + gap - min(down.line_groove.centre_depth + down.line_groove.radius, down.face_depth)
    p3 = p2 + down.back_radius - saddle.radius + 0.8 * gap
    head = p3 + saddle.radius + saddle.apex_thickness + 0.6 * gap
    p1 = -r - gap - up.thickness
    p4 = head - bolt.shank_length
    p5 = min(p4, p1) - nut.height - 0.6 * gap
    return {
        "P1": SectionPose(x - up.width / 2, p1),
        "P2": SectionPose(x, p2),
        "P3": SectionPose(x, p3),
        "P4": SectionPose(x, p4),
        "P5": SectionPose(x, p5),
        "P6": SectionPose(0.0, 0.0),
        "P7": SectionPose(x + up.jumper_groove.offset, 0.0),
    }


def steps_figure(run: Assembly) -> Figure:
    """Each step of the sequence where it ends: in the view (upper row) and in the section (lower)."""
    instance("run", run, Assembly)
    ends = list({waypoint.step: i for i, waypoint in enumerate(run.path)}.items())
    figure = blank(3.1 * len(ends), 7.4)
    axes = figure.subplots(2, len(ends), squeeze=False, height_ratios=(1.0, 1.2))
    start = 0
    for i, (step, stop) in enumerate(ends):
        waypoint = run.path[stop]
        poses = near(run.clamp, waypoint.poses)
        draw_solids(axes[0, i], list(_placed(run.clamp, poses).values()), Camera(), pixels=600)
        title(axes[0, i], f"{i + 1}   {step}", waypoint.label)
        draw_section(axes[1, i], run.clamp, poses)
        for name, pose in poses.items():
            balloon(axes[1, i], name, *pose.point(*part_anchor(run.clamp, name, right=False)), size=6.0)
        _arrows(axes[1, i], run.clamp, [w.poses for w in run.path[start : stop + 1]], poses)
        start = stop
    same_scale(axes[0])
    same_scale(axes[1])
    return figure


def _arrows(ax: Axes, clamp: Clamp, path: Sequence[Poses], shown: Iterable[PartName]) -> None:
    """The way of what moved, ending where it stands now; parts that moved alike share one arrow. Not to scale."""
    style = ARROW | {"arrowstyle": "-|>,head_width=0.3,head_length=0.6", "lw": 1.8}
    drawn: list[Array] = []
    least = _MOVED * clamp.up_splint.width
    for name in shown:
        way = np.array([poses[name].point(*part_anchor(clamp, name)) for poses in path])
        moved = way - way[-1]
        length = float(np.hypot(*np.diff(way, axis=0).T).sum())
        if length < least or any(np.abs(moved - other).max() < least for other in drawn):
            continue
        drawn.append(moved)
        way = way[-1] + moved * min(1.0, _ARROW * clamp.up_splint.width / length)
        ax.plot(*way.T, color=DIMENSION, lw=1.8, zorder=50)
        ax.annotate("", way[-1], way[-2], arrowprops=style, zorder=50)


def _placed(clamp: Clamp, poses: Poses) -> dict[PartName, PosedMesh]:
    error = max(MIN_MESH_ERROR, _MESH_ERROR * clamp.up_splint.width)
    solids = parts(clamp)
    return {name: PosedMesh(mesh(solids[name], error), pose.T(), PART_COLOURS[name]) for name, pose in poses.items()}
