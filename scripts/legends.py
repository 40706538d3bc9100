"""Pictures for the documentation: Tables 2 and 3 of the paper, titled as the package answers, and the friction band."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d.clamp.friction import FrictionBand
from clamp3d.kernel.arc_and_circle import ArcRelation, arc_circle
from clamp3d.kernel.rectangle import HoleContact, HoleRelation, Rectangle, hole_bolt
from clamp3d.output.figures import blank
from clamp3d.output.palette import INK, PART_COLOURS, VERDICT_COLOURS, darker

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TOLERANCE = 1e-9
_TITLE: dict[str, Any] = {"x": 0.01, "ha": "left", "fontsize": 11, "fontweight": "bold", "color": INK}
_SMALL: dict[str, Any] = {"fontsize": 8, "color": INK}
_R, _r = 10.0, 3.6
_MINOR, _MAJOR = math.radians(62.0), math.radians(128.0)
_BOLT = Rectangle(0.0, 0.0, 5.0, 15.0)
_W, _H = 6.6, 6.0

# Table 3: half angle and circle centre of each cell.
_ARCS: tuple[tuple[float, tuple[tuple[float, float], ...]], ...] = (
    (_MINOR, ((1.2, -5.3), (-1.5, 1.5), (5.2, -8.4), (0.0, -_R - _r), (0.0, -_R + _r))),
    (_MAJOR, ((-1.2, 0.6), (0.0, 11.5), (-9.4, 0.0), (_R + _r, 0.0), (_R - _r, 0.0))),
)


def table2_figure() -> Figure:
    """Table 2: the hole of the down splint against the bolt, and overlap."""
    from matplotlib.figure import Figure

    grip = math.acos(_BOLT.half_width / math.hypot(_W, _H)) - math.atan2(_H, _W)
    half = grip / 2
    reach = _W * math.cos(half) - _H * math.sin(half) - _BOLT.half_width
    holes = (
        Rectangle(0.0, 0.0, _W, _H, half),
        Rectangle(reach, 0.0, _W, _H, half),
        Rectangle(_W - _BOLT.half_width, 0.0, _W, _H),
        Rectangle(0.0, 0.0, _W, _H, grip),
        Rectangle(1.2, 0.0, _W, _H, 1.45 * grip),
    )
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    for ax, hole in zip(figure.subplots(1, len(holes)), holes, strict=True):
        _hole_cell(ax, hole, hole_bolt(hole, _BOLT, tolerance=_TOLERANCE))
    figure.suptitle("bolt hole of a splint against the bolt", **_TITLE)
    return figure


def table3_figure() -> Figure:
    """Table 3: a minor and a major arc against a small circle, and contact at the end point M (Fig. 6)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 7.6), layout="constrained")
    axes = figure.subplots(3, 5, height_ratios=(1.0, 1.25, 1.25))
    for row, (half_angle, centres) in enumerate(_ARCS):
        for ax, (x, y) in zip(axes[row], centres, strict=True):
            _arc_cell(ax, half_angle, x, y)
            _frame(ax, (-17.6, 17.6), ((-20.5, 6.0), (-13.5, 17.0))[row])
        side = ("minor arc", "major arc")[row]
        axes[row, 0].annotate(side, (-0.04, 0.5), xycoords="axes fraction", rotation=90, va="center", fontsize=10)
    for ax, turn in ((axes[2, 3], 52.0), (axes[2, 4], 128.0)):
        m = (-_R * math.sin(_MINOR), -_R * math.cos(_MINOR))
        angle = math.atan2(m[1], m[0]) - math.radians(turn)  # from OM extended towards R, away from the arc
        _arc_cell(ax, _MINOR, m[0] + _r * math.cos(angle), m[1] + _r * math.sin(angle), fig_6=True)
        _frame(ax, (m[0] - 8.5, m[0] + 11.5), (m[1] - 9.0, m[1] + 10.0))
    for ax in axes[2, :3]:
        ax.set_axis_off()
    words = (
        "Contact at the end point M (Fig. 6): RM is the tangent in M.\n"
        "Centre on the arc PR: exterior; on the arc RQ: interior.\n\n"
        "shaded: region of the arc, closed by the chord MN (dashed)\n"
        "dot: nearest point of the arc; cross: centre of the circle"
    )
    style: dict[str, Any] = {"xycoords": "axes fraction", "va": "center", "annotation_clip": False}
    axes[2, 0].annotate(words, (0.0, 0.55), fontsize=9, color=INK, **style).set_in_layout(False)
    figure.suptitle("arc against small circle", **_TITLE)
    return figure


def _hole_cell(ax: Axes, hole: Rectangle, contact: HoleContact) -> None:
    from matplotlib.patches import Polygon

    green, grey = PART_COLOURS["P2"], PART_COLOURS["P4"]
    W, H = hole.half_width, hole.half_height
    for side in (-1, 1):
        wall = [hole.point(u, v) for u, v in ((side * W, -H), (side * W, H), (side * 13.0, H), (side * 13.0, -H))]
        patch = Polygon(wall, fc=green, ec=darker(green, 0.45), hatch="////", hatch_linewidth=0.45, lw=1.0)
        patch.set_hatchcolor(darker(green, 0.75))
        ax.add_patch(patch)
    w, h = _BOLT.half_width, _BOLT.half_height
    ax.add_patch(Polygon([(-w, -h), (w, -h), (w, h), (-w, h)], fc=grey, ec=darker(grey, 0.45), lw=1.0, alpha=0.85))
    ax.plot([0, 0], [-h - 1, h + 1], color=INK, lw=0.5, ls=(0, (10, 3, 2, 3)))
    for x, y in contact.points:
        _dot(ax, x, y, "contact")
    if contact.relation is HoleRelation.OVERLAP:
        for side in (-1, 1):  # the corner that is deepest in the bolt
            x, y = hole.point(side * W, -side * math.copysign(H, hole.angle))
            if side * x < w:
                _dot(ax, x, y, "clash")
    _frame(ax, (-17.0, 17.0), (20.5, -16.5))
    gaps = f"gap left {contact.gap_left:z.2f}, right {contact.gap_right:z.2f}"
    _caption(ax, contact.relation.value, gaps)


def _arc_cell(ax: Axes, half_angle: float, x: float, y: float, *, fig_6: bool = False) -> None:
    from matplotlib.patches import Arc, Circle

    blue, yellow = PART_COLOURS["P1"], PART_COLOURS["P6"]
    contact = arc_circle(_R, half_angle, _r, x, y, tolerance=_TOLERANCE)
    ends = (270.0 - math.degrees(half_angle), 270.0 + math.degrees(half_angle))
    m = np.array([-_R * math.sin(half_angle), -_R * math.cos(half_angle)])
    _region(ax, ends, blue)
    ax.plot([m[0], -m[0]], [m[1], m[1]], color=darker(blue), lw=0.8, ls="--")
    ax.add_patch(Arc((0, 0), 2 * _R, 2 * _R, theta1=ends[0], theta2=ends[1], ec=darker(blue, 0.5), lw=2.2))
    ax.add_patch(Circle((x, y), _r, fc=yellow, ec=darker(yellow, 0.45), lw=1.0, alpha=0.8))
    ax.plot([x], [y], "+", color=INK, ms=6, mew=0.8)
    for point, name, side in (((m[0], m[1]), "M", -1), ((-m[0], m[1]), "N", 1)):
        offset = (11, -3) if fig_6 and name == "M" else (6 * side, 5)
        ax.annotate(name, point, offset, textcoords="offset points", ha="center", **_SMALL)
    if fig_6:
        _construction(ax, m)
    if contact.relation not in (ArcRelation.INSIDE, ArcRelation.OUTSIDE):
        for px, py in contact.points:
            _dot(ax, px, py, "clash" if contact.relation is ArcRelation.INTERSECT else "contact")
    _caption(ax, contact.relation.value, f"gap {contact.gap:z.2f}")


def _region(ax: Axes, ends: tuple[float, float], colour: str) -> None:
    """The area between an arc and its chord; angles in degrees."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    arc = Path.arc(*ends)
    ax.add_patch(PathPatch(Path(np.asarray(arc.vertices) * _R, arc.codes), fc=colour, alpha=0.18, ec="none"))


def _construction(ax: Axes, m: Any) -> None:
    """P, Q and R of Fig. 6 about M: circle of the small circle's radius, line OM, tangent RM."""
    from matplotlib.patches import Circle

    out = m / np.hypot(*m)
    off = np.array([-out[1], out[0]]) if out[0] * out[1] < 0 else np.array([out[1], -out[0]])
    ax.add_patch(Circle(tuple(m), _r, fc="none", ec=INK, lw=0.6, ls=":"))
    points = {"P": m + _r * out, "Q": m - _r * out, "R": m + _r * off}
    ax.plot([0.0, points["P"][0]], [0.0, points["P"][1]], color=INK, lw=0.6)
    ax.plot([m[0], points["R"][0]], [m[1], points["R"][1]], color=INK, lw=0.6)
    ax.annotate("O", (0.0, 0.0), (4, 2), textcoords="offset points", **_SMALL)
    for name, point in points.items():
        ax.plot(*point, ".", color=INK, ms=3)
        place = point + 1.3 * (point - m) / _r
        ax.annotate(name, place, ha="center", va="center", fontweight="bold", **_SMALL)


def _dot(ax: Axes, x: float, y: float, verdict: str) -> None:
    ax.plot([x], [y], "o", ms=6, mec=INK, mew=0.7, mfc=VERDICT_COLOURS[verdict], zorder=10)


def _caption(ax: Axes, title: str, foot: str) -> None:
    ax.set_title(title, fontsize=9.5, color=INK)
    ax.annotate(foot, (0.5, 0.0), xycoords="axes fraction", ha="center", va="bottom", **_SMALL)


def _frame(ax: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_xlim(*x)
    ax.set_ylim(*y)


def friction_figure(finder: FrictionBand, measured: Mapping[str, Sequence[float]], *, most: float = 0.3) -> Figure:
    """The friction band over the coefficient of friction, with measured splint distances beside it.

    Parameters
    ----------
    finder : FrictionBand
    measured : dict of sequences of float
        Distances in mm by what they are; each group has its own mark at the right edge.
    most : float
        Up to which friction the band is drawn.
    """
    figure = blank(7.0, 4.6)
    axes = figure.add_subplot()
    friction = np.linspace(0.0, most, 61)
    ends = np.array([(finder.distance,) * 2, *(finder.ends(float(mu)) for mu in friction[1:])])
    axes.fill_between(friction, ends[:, 0], ends[:, 1], color=PART_COLOURS["P2"], alpha=0.45, label="equilibrium")
    for side in ends.T:
        axes.plot(friction, side, color=darker(PART_COLOURS["P2"]), linewidth=1.2)
    marks = zip(measured.items(), ("o", "s", "^", "D"), (INK, "#B5332E", "#4A4F9A", "#8A6D00"), strict=False)
    for (name, distances), mark, colour in marks:
        for distance in distances:
            axes.axhline(distance, color=colour, linewidth=0.6, linestyle=":")
        axes.plot([most] * len(distances), distances, mark, color=colour, clip_on=False, label=name)
        needed = [(mu, value) for value in distances if (mu := finder.friction_for(value)) is not None and mu <= most]
        axes.plot([mu for mu, _ in needed], [value for _, value in needed], mark, color=colour, fillstyle="none")
    axes.set(xlim=(0.0, most), xlabel="friction in the grooves", ylabel="distance between the splints (mm)")
    axes.legend(loc="upper left", frameon=False)
    return figure
