"""The section through the middle of the clamp, to scale: parts, names and dimensions on one matplotlib axes.

Everything is drawn in the paper's section frame (x right, y down, mm). The splints, the saddle and the wires are cut;
bolt and nut are shown whole, as drawing practice has it (ISO 128).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
import shapely.affinity
from shapely.plotting import patch_from_polygon

from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp, PartName
from clamp3d.clamp.parts import parts
from clamp3d.clamp.section import WIRES
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import SectionPose
from clamp3d.geometry.profile import Arc, Point, Profile
from clamp3d.geometry.shapes import Solid
from clamp3d.output.palette import DIMENSION, INK, PART_COLOURS, darker, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import PathPatch

Poses = Mapping[PartName, SectionPose]

ARROW: dict[str, Any] = {
    "arrowstyle": "-|>,head_width=0.18,head_length=0.45",
    "color": DIMENSION,
    "lw": 0.8,
    "shrinkA": 0.0,
    "shrinkB": 0.0,
}
_HATCH: dict[PartName, str] = {"P1": "////", "P2": "\\\\\\\\", "P3": "////"}
_LINE: dict[str, Any] = {"color": DIMENSION, "lw": 0.6, "zorder": 25}
_NUMBER: dict[str, Any] = {"color": DIMENSION, "fontsize": 9, "zorder": 26}
_ORDER: tuple[PartName, ...] = ("P6", "P7", "P1", "P2", "P3", "P4", "P5")
_CHORD_ERROR = 1e-3
"""mm by which a drawn outline may leave its arc: far below a pixel, enlarged too."""


def draw_section(
    ax: Axes,
    clamp: Clamp,
    poses: Poses,
    *,
    only: Collection[PartName] = PARTS,
    holes: bool = True,
    line_width: float = 0.9,
) -> None:
    """Draw the parts of ``only`` at ``poses``; without ``holes`` it is the section beside the bolt."""
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.margins(0.02)
    ax.yaxis.set_inverted(True)
    bodies = parts(clamp)
    for zorder, name in enumerate(_ORDER, 2):
        if name in only and name in poses:
            _draw_part(ax, bodies[name], poses[name], holes, {"lw": line_width, "zorder": zorder})
    ax.autoscale_view()


def _draw_part(ax: Axes, part: Solid, pose: SectionPose, holes: bool, style: dict[str, Any]) -> None:
    """What is cut is hatched; the far wall of a hole is pale behind it."""
    colour = PART_COLOURS[part.name]
    style = style | {"ec": darker(colour, 0.45)}
    pale = "#" + "".join(f"{round(255 - 0.4 * (255 - channel)):02X}" for channel in rgb(colour))
    for body in part.bodies:
        whole = _polygon(body)
        cut = whole.difference(_drilled(part)) if holes and body.axis == "Y" else whole
        ax.add_patch(_patch(whole, pose, fc=pale, **style))
        patch = _patch(cut, pose, fc=colour, hatch=_HATCH.get(part.name), hatch_linewidth=0.45, **style)
        patch.set_hatchcolor(darker(colour, 0.75))
        ax.add_patch(patch)
        for u in () if body.axis == "Y" else _front_edges(body.profile):
            ends = np.array([pose.point(u, -body.end), pose.point(u, -body.start)])
            ax.plot(*ends.T, color=style["ec"], lw=0.6 * style["lw"], zorder=style["zorder"])


def _polygon(body: Extrusion) -> Any:
    return shapely.Polygon(outline(body).polygon(_CHORD_ERROR))


def _drilled(part: Solid) -> Any:
    """Where the section cuts the holes of a part, which run down it."""
    spans = [(hole.profile.bounds, hole) for hole in part.holes]
    return shapely.union_all([shapely.box(u0, -h.end, u1, -h.start) for ((u0, _), (u1, _)), h in spans])


def _patch(region: Any, pose: SectionPose, **style: Any) -> PathPatch:
    """A region (u, v) of a part as a patch of the axes."""
    c, s = math.cos(pose.angle), math.sin(pose.angle)
    placed = shapely.affinity.affine_transform(region, [c, s, -s, c, pose.x, pose.y])
    patch: PathPatch = patch_from_polygon(placed, **style)
    return patch


def outline(body: Extrusion) -> Profile:
    """Outline in (u, v) of a body as it is seen along the wires."""
    if body.axis == "Y":
        return body.profile
    (a0, _), (a1, _) = body.profile.bounds
    return Profile.rectangle(a1 - a0, body.length, (0.5 * (a0 + a1), -0.5 * (body.start + body.end)))


def _front_edges(profile: Profile) -> list[float]:
    """Where corners of a body drawn along Z show on its front between its two silhouette lines."""
    (a0, _), (a1, _) = profile.bounds
    corners = [edge.start for edge in profile.edges if not isinstance(edge, Arc)]
    return [a for a, b in corners if b < 0.0 and a0 + 1e-9 < a < a1 - 1e-9]


def part_anchor(clamp: Clamp, name: PartName, *, right: bool = True) -> tuple[float, float]:
    """A point (u, v) in the part's material as the section shows it, for its name; ``right``: near its right end."""
    part = parts(clamp)[name]
    area = shapely.union_all([_polygon(body) for body in part.bodies]).difference(_drilled(part))
    if right and name not in WIRES:
        u0, v0, u1, v1 = area.bounds
        area = shapely.clip_by_rect(area, u1 - 0.15 * (u1 - u0), v0, u1, v1)
    point = area.representative_point()
    return float(point.x), float(point.y)


def draw_labels(ax: Axes, clamp: Clamp, poses: Poses) -> None:
    """Names of the parts: a column of balloons on the right, each with a line to its part; wires carry theirs."""
    label_wires(ax, poses)
    points = {name: poses[name].point(*part_anchor(clamp, name)) for name in PARTS if name in poses}
    (left, low), (edge, high) = ax.dataLim.get_points()
    column = edge + 0.27 * (edge - left)
    label_column(ax, clamp, points, column, min((high - low) / len(points), 0.1 * (high - low)), without_line=WIRES)
    ax.update_datalim([(column + 0.3 * (edge - left), low)])
    ax.autoscale_view()


def label_column(
    ax: Axes,
    clamp: Clamp,
    points: Mapping[PartName, Point],
    column: float,
    spacing: float,
    without_line: Collection[PartName] = (),
) -> None:
    """Names of the parts in a column of balloons at x = ``column``, each with a line to its point."""
    order = sorted(points, key=lambda name: points[name][1])
    heights = spread([points[name][1] for name in order], spacing)
    for name, y in zip(order, heights, strict=True):
        if name not in without_line:
            x0, y0 = points[name]
            ax.plot([x0, column], [y0, y], color=INK, lw=0.5, marker=".", markevery=[0], ms=3.5, zorder=30)
        balloon(ax, name, column, y, size=8.0)
        note(ax, label(clamp, name), (column, y), (13, 0), va="center")
        ax.update_datalim([(column, y)])


def note(ax: Axes, text: str, at: Point, offset: Point = (0.0, 0.0), **style: Any) -> None:
    """A text in ink at a point of the axes, or as ``style`` says, ``offset`` (pt) to the right and up of it."""
    look: dict[str, Any] = {"color": INK, "fontsize": 8, **style}
    ax.annotate(text, at, offset, textcoords="offset points", **look)


def label(clamp: Clamp, name: PartName) -> str:
    """What a part is; of a wire, which one."""
    wires = {"P6": clamp.line, "P7": clamp.jumper}
    return f"{TITLES[name]}\n{wires[name].label}" if name in wires else TITLES[name]


def label_wires(ax: Axes, poses: Poses) -> None:
    """The names of the wires in the middle of each."""
    for name in WIRES:
        if name in poses:
            balloon(ax, name, poses[name].x, poses[name].y, size=7.0)


def balloon(ax: Axes, name: PartName, x: float, y: float, *, size: float) -> None:
    """The name of a part in a circle of its colour."""
    box = {"boxstyle": "circle,pad=0.2", "fc": PART_COLOURS[name], "ec": INK, "lw": 0.7}
    ax.annotate(name, (x, y), ha="center", va="center", fontsize=size, fontweight="bold", zorder=31, bbox=box)


def spread(values: list[float], spacing: float) -> list[float]:
    """The ascending ``values`` moved apart to at least ``spacing``, in all as little as can be (least squares).

    >>> spread([0.0, 1.0, 10.0], 3.0)
    [-1.0, 2.0, 10.0]
    """
    from scipy.optimize import isotonic_regression

    even = spacing * np.arange(len(values))
    return (isotonic_regression(np.array(values) - even).x + even).tolist()  # type: ignore[no-any-return]


def draw_dimensions(ax: Axes, clamp: Clamp, poses: Poses, *, sides: Iterable[int] = (-1, 1)) -> None:
    """Distance between the splints at the edges (-1 line side, 1 jumper side), and the tilt of the down splint."""
    edges = inner_edges(clamp, poses)
    for side in sides:
        above, below = edges[side > 0]
        x = (min if side < 0 else max)(above[0], below[0]) + side * 0.09 * clamp.up_splint.width
        _dimension(ax, above, below, x, side)
    _draw_tilt(ax, clamp, poses["P2"])


def edge_openings(clamp: Clamp, poses: Poses) -> tuple[float, float]:
    """Height in mm between the splints' inner edges, on the line side (Table 4's distance) and the jumper side."""
    left, right = ((below[1] - above[1]) for above, below in inner_edges(clamp, poses))
    return left, right


def inner_edges(clamp: Clamp, poses: Poses) -> list[tuple[Point, Point]]:
    """Ends of the splints' inner edges in the section, the up splint's and the down splint's: left, then right."""
    up, down = clamp.up_splint, clamp.down_splint
    return [
        (poses["P1"].point(u, up.thickness), poses["P2"].point(v, down.face_depth))
        for u, v in ((0.0, -down.width / 2), (up.width, down.width / 2))
    ]


def _dimension(ax: Axes, above: Point, below: Point, x: float, side: int) -> None:
    """A vertical dimension at ``x`` between the heights of two points; small ones get their arrows outside."""
    for px, py in (above, below):
        ax.plot([px + 1.5 * side, x + 2.0 * side], [py, py], **_LINE)
    top, bottom = sorted((above[1], below[1]))
    reach = 9.0 if bottom - top <= 9.0 else 0.5 * (top - bottom)
    for tip, tail in ((top, top - reach), (bottom, bottom + reach)):
        ax.annotate("", (x, tip), (x, tail), arrowprops=ARROW)
    at = (x + 2.0 * side, 0.5 * (top + bottom))
    align = "right" if side < 0 else "left"
    note(ax, f"{below[1] - above[1]:.3f}", at, (3 * side, 0), ha=align, va="center", **_NUMBER)


def _draw_tilt(ax: Axes, clamp: Clamp, pose: SectionPose) -> None:
    """The angle between the down splint and the horizontal, at its lower corner."""
    down = clamp.down_splint
    inward = 1.0 if pose.angle >= 0.0 else -1.0  # the lower corner is on the left if the tilt is positive
    corner = pose.point(-inward * down.width / 2, down.underside_depth)
    if abs(math.degrees(pose.angle)) < 5e-3:
        note(ax, "parallel", corner, (0, -11), va="center", **_NUMBER)
        return
    reach = inward * 0.19 * down.width
    ax.plot(corner[0] + reach * np.array([-0.06, 1.15]), [corner[1]] * 2, ls=(0, (8, 2, 1, 2)), **_LINE)
    t = np.linspace(0.0, pose.angle, 30)
    ax.plot(corner[0] + reach * np.cos(t), corner[1] - reach * np.sin(t), **_LINE)
    at = (corner[0] + 0.45 * reach, max(corner[1], corner[1] - reach * math.sin(pose.angle)))
    text = f"{abs(math.degrees(pose.angle)):.2f}\N{DEGREE SIGN}"
    note(ax, text, at, (0, -10), ha="center", va="center", **_NUMBER)
