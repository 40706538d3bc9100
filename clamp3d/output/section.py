"""The section through the middle of the clamp, to scale, arcs as arcs: parts, names and dimensions on one axes.

Everything is drawn in the paper's section frame (x right, y down, mm). The splints, the saddle and the wires are cut;
bolt and nut are shown whole, as drawing practice has it (ISO 128). Needs matplotlib; nothing of pyplot is used.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.clamp.dimensions import PARTS, Clamp, PartName
from clamp3d.clamp.parts import parts
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import SectionPose
from clamp3d.geometry.profile import Arc, Point, Profile
from clamp3d.geometry.shapes import Solid
from clamp3d.output.palette import DIMENSION, INK, PART_COLOURS, darker, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path as MplPath

Poses = Mapping[PartName, SectionPose]

_HATCH: dict[PartName, str] = {"P1": "////", "P2": "\\\\\\\\", "P3": "////"}
WIRES: tuple[PartName, ...] = ("P6", "P7")
_LINE: dict[str, Any] = {"color": DIMENSION, "lw": 0.6, "zorder": 25}
_NUMBER: dict[str, Any] = {"color": DIMENSION, "fontsize": 9, "zorder": 26}
_HEAD = "-|>,head_width=0.18,head_length=0.45"
ARROW: dict[str, Any] = {"arrowstyle": _HEAD, "color": DIMENSION, "lw": 0.8, "shrinkA": 0.0, "shrinkB": 0.0}
_ORDER: tuple[PartName, ...] = ("P6", "P7", "P1", "P2", "P3", "P4", "P5")


def arc_path(profile: Profile) -> MplPath:
    """The outline as a closed path; each arc as cubic curves of at most 10 degrees, within 1e-8 radii of the arc."""
    from matplotlib.path import Path

    vertices: list[ArrayLike] = [profile.edges[0].start]
    codes = [int(Path.MOVETO)]
    for edge in profile.edges:
        if isinstance(edge, Arc):
            low, high = sorted((math.degrees(edge.start_angle), math.degrees(edge.end_angle)))
            curve = np.asarray(Path.arc(low, high, max(1, math.ceil((high - low) / 10.0))).vertices, dtype=float)
            vertices += [*(edge.radius * (curve if edge.sweep > 0.0 else curve[::-1])[1:] + edge.centre)]
            codes += [int(Path.CURVE4)] * (len(curve) - 1)
        else:
            vertices.append(edge.end)
            codes.append(int(Path.LINETO))
    vertices.append(vertices[0])
    codes.append(int(Path.CLOSEPOLY))
    return Path(np.array(vertices), codes)


def draw_section(
    ax: Axes,
    clamp: Clamp,
    poses: Poses,
    *,
    only: Iterable[PartName] = PARTS,
    holes: bool = True,
    line_width: float = 0.9,
    window: tuple[Point, Point] | None = None,
) -> None:
    """Draw the parts of ``only`` at ``poses``; without ``holes`` it is the section beside the bolt.

    ``window`` is the part of the section ((x, y) least, largest) that the axes show, if not all of it.
    """
    shown, bodies = set(only), parts(clamp)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.margins(0.02)
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    for i, name in enumerate(_ORDER):
        if name in shown and name in poses:
            _draw_part(ax, bodies[name], poses[name], 2 + i, holes, line_width, window)
    ax.autoscale_view()


def draw_labels(ax: Axes, clamp: Clamp, poses: Poses) -> None:
    """Names of the parts: a column of balloons on the right, each with a line to its part; wires carry theirs."""
    label_wires(ax, poses)
    points = {name: poses[name].point(*part_anchor(clamp, name)) for name in PARTS if name in poses}
    (left, low), (edge, high) = ax.dataLim.get_points()
    column = edge + 0.27 * (edge - left)
    order = sorted(points, key=lambda name: points[name][1])
    heights = spread([points[name][1] for name in order], min((high - low) / len(order), 0.1 * (high - low)))
    bodies, wires = parts(clamp), {"P6": clamp.line, "P7": clamp.jumper}
    for name, y in zip(order, heights, strict=True):
        title = bodies[name].title
        if name in wires:
            title += f"\n{wires[name].label}"
        else:
            x0, y0 = points[name]
            ax.plot([x0, column - 4.0], [y0, y], color=INK, lw=0.5, zorder=30)
            ax.plot([x0], [y0], ".", color=INK, ms=3.5, zorder=30)
        balloon(ax, name, column, y, size=8.0)
        ax.annotate(title, (column, y), (13, 0), textcoords="offset points", va="center", fontsize=8, color=INK)
    ax.update_datalim([(column + 0.3 * (edge - left), heights[0]), (column, heights[-1])])
    ax.autoscale_view()


def label_wires(ax: Axes, poses: Poses) -> None:
    """The names of the wires in the middle of each."""
    for name in WIRES:
        if name in poses:
            balloon(ax, name, poses[name].x, poses[name].y, size=7.0)


def balloon(ax: Axes, name: PartName, x: float, y: float, *, size: float) -> None:
    """The name of a part in a circle of its colour."""
    box = {"boxstyle": "circle,pad=0.2", "fc": PART_COLOURS[name], "ec": INK, "lw": 0.7}
    ax.annotate(name, (x, y), ha="center", va="center", fontsize=size, fontweight="bold", zorder=31, bbox=box)


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
    text, align = f"{below[1] - above[1]:.3f}", "right" if side < 0 else "left"
    ax.annotate(text, at, (3 * side, 0), textcoords="offset points", ha=align, va="center", **_NUMBER)


def part_anchor(clamp: Clamp, name: PartName, *, right: bool = True) -> tuple[float, float]:
    """A point (u, v) in the part's material as the section shows it, for its name; ``right``: near its right end."""
    import shapely

    part = parts(clamp)[name]
    fine = 0.01 * clamp.bolt.diameter
    area = shapely.union_all([shapely.Polygon(outline(body).polygon(fine)) for body in part.bodies])
    for hole in part.holes:
        (u0, _), (u1, _) = hole.profile.bounds
        area = area.difference(shapely.box(u0, -hole.end, u1, -hole.start))
    u0, v0, u1, v1 = area.bounds
    if right and name not in WIRES:
        area = shapely.clip_by_rect(area, u1 - 0.15 * (u1 - u0), v0, u1, v1)
    point = area.representative_point()
    return float(point.x), float(point.y)


def _draw_tilt(ax: Axes, clamp: Clamp, pose: SectionPose) -> None:
    down = clamp.down_splint
    degrees = math.degrees(pose.angle)
    inward = 1.0 if pose.angle >= 0.0 else -1.0  # the lower corner is on the left if the tilt is positive
    corner = pose.point(-inward * down.width / 2, down.underside_depth)
    reach = inward * 0.19 * down.width
    if abs(degrees) < 5e-3:
        ax.annotate("parallel", corner, (0, -11), textcoords="offset points", va="center", **_NUMBER)
        return
    ax.plot([corner[0] - 0.06 * reach, corner[0] + reach * 1.15], [corner[1]] * 2, ls=(0, (8, 2, 1, 2)), **_LINE)
    t = np.linspace(0.0, pose.angle, 30)
    xs, ys = corner[0] + reach * np.cos(t), corner[1] - reach * np.sin(t)
    ax.plot(xs, ys, **_LINE)
    for tip, tail in ((0, 3), (-1, -4)):
        ax.annotate("", (xs[tip], ys[tip]), (xs[tail], ys[tail]), arrowprops=ARROW)
    at = (corner[0] + 0.45 * reach, max(corner[1], float(ys.max())))
    text = f"{abs(degrees):.2f}\N{DEGREE SIGN}"
    ax.annotate(text, at, (0, -10), textcoords="offset points", ha="center", va="center", **_NUMBER)


def _draw_part(
    ax: Axes,
    part: Solid,
    pose: SectionPose,
    z: int,
    holes: bool,
    line_width: float,
    window: tuple[Point, Point] | None,
) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D, Bbox

    colour = PART_COLOURS[part.name]
    edge = darker(colour, 0.45)
    c, s = math.cos(pose.angle), math.sin(pose.angle)
    place = Affine2D(np.array([[c, s, pose.x], [-s, c, pose.y], [0.0, 0.0, 1.0]]))
    where = place + ax.transData
    style: dict[str, Any] = {"lw": line_width, "ec": edge, "zorder": z}
    for body in part.bodies:
        path = arc_path(outline(body))
        patch = PathPatch(path, fc=colour, hatch=_HATCH.get(part.name), hatch_linewidth=0.45, transform=where, **style)
        patch.set_hatchcolor(darker(colour, 0.75))
        ax.add_patch(patch)
        ax.update_datalim(place.transform(path.vertices))
        if body.axis == "Y":
            for hole in part.holes if holes else ():  # its far wall, seen behind the cut
                (u0, _), (u1, _) = hole.profile.bounds
                corners = [(u0, -hole.end), (u1, -hole.end), (u1, -hole.start), (u0, -hole.start), (u0, -hole.end)]
                wall = Path(place.transform(corners), closed=True)
                if window is not None:  # SVG clips by the part's outline or by the axes, not by both
                    wall = wall.clip_to_bbox(Bbox(np.array(window)))
                if np.size(wall.vertices):
                    wall_patch = PathPatch(wall, fc=_pale(colour), transform=ax.transData, **style)
                    wall_patch.set_clip_path(patch)
                    ax.add_patch(wall_patch)
            ax.add_patch(PathPatch(path, fc="none", transform=where, **style))
        else:
            for u in _front_edges(body.profile):
                ax.plot([u, u], [-body.end, -body.start], color=edge, lw=0.6 * line_width, transform=where, zorder=z)


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


def _pale(colour: str) -> str:
    return "#" + "".join(f"{round(255 - 0.4 * (255 - channel)):02X}" for channel in rgb(colour))


def spread(values: list[float], spacing: float) -> list[float]:
    """The ascending ``values`` moved apart to at least ``spacing``, in all as little as can be (least squares).

    >>> spread([0.0, 1.0, 10.0], 3.0)
    [-1.0, 2.0, 10.0]
    """
    from scipy.optimize import isotonic_regression

    even = spacing * np.arange(len(values))
    return (isotonic_regression(np.array(values) - even).x + even).tolist()  # type: ignore[no-any-return]
