"""The chart of a comparison: error against time per query, and beside it against set-up time; every method labelled.

Colours are Okabe and Ito's, which colour-blind readers can distinguish; each method also has a marker of its own and
its name beside its curve, so the chart reads in grey.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from clamp3d.bench.compare.assemblies import Imaged
from clamp3d.bench.compare.measure import Measured
from clamp3d.bench.compare.report import comparison_to_text
from clamp3d.bench.compare.run import Comparison, pareto
from clamp3d.bench.compare.scene import chord_error
from clamp3d.output.figures import picture, save_figure
from clamp3d.output.files import write_text
from clamp3d.output.pages import render
from clamp3d.output.palette import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class _Look(NamedTuple):
    """How a family is drawn; its name stands at its least (0) or greatest (-1) error, moved by ``offset`` points.

    ``hollow``: somebody chose by hand what can be nearest.
    """

    colour: str = "#444444"
    marker: str = "o"
    name: str = ""
    which: int = 0
    offset: tuple[float, float] = (10.0, 0.0)
    align: str = "left"
    hollow: bool = False


_LOOKS: dict[str, _Look] = {
    "cas": _Look("#D55E00", "*", "clamp3d (CAS): exact arc", 0, (-8.0, 20.0), "right"),
    "chords": _Look("#3A9BD0", "v", "chords, for\nparallel axes", 0, (-2.0, -34.0), "right"),
    "wedges": _Look("#0072B2", "s", "wedges (FCL)", 0, (0.0, -36.0), "center"),
    "hulls": _Look("#CC79A7", "D", "CoACD hulls (FCL)", -1, (14.0, 0.0), "left"),
    "mesh": _Look("#009E73", "o", "mesh (FCL)", 0, (24.0, -24.0), "center"),
    "coal-cylinder": _Look("#000000", "P", "coal, cylinder", -1, (4.0, 12.0), "left"),
    "coal-capsule": _Look("#000000", "P", "coal, capsule", -1, (-20.0, 14.0), "right"),
    "coal-axis": _Look("#000000", "P", "coal, axis", 0, (-6.0, -12.0), "right"),
    "coal-sector": _Look("#000000", "P", "coal, one sector\nchosen by hand", 0, (-12.0, -16.0), "right", True),
    "mujoco-cylinder": _Look("#8A6D00", "X"),
    "mujoco-capsule": _Look("#8A6D00", "X", "MuJoCo, capsule", -1, (-24.0, 28.0), "right"),
    "mujoco-sector": _Look("#8A6D00", "X", "MuJoCo, one sector", 0, (-12.0, -36.0), "right", True),
    "fcl": _Look("#0072B2", "d", "FCL, cylinder", -1, (-14.0, 0.0), "right"),
    "fcl-axis": _Look("#0072B2", "d", "FCL, axis", 0, (10.0, 0.0), "left"),
    "fcl-sector": _Look("#0072B2", "d", "FCL, one sector", 0, (-16.0, -52.0), "right", True),
    "trimesh": _Look("#5B7F95", "<", "trimesh, axis", 0, (9.0, -11.0), "left"),
    "manifold3d": _Look("#7A5195", ">", "manifold3d, axis", 0, (2.0, -16.0), "left"),
    "open-cascade": _Look("#7F2704", "h", "Open CASCADE,\ncylinder", 0, (0.0, 26.0), "center"),
    "open-cascade-axis": _Look("#7F2704", "h", "axis", 0, (0.0, -24.0), "center"),
    "open-cascade-face": _Look("#7F2704", "h", "axis and arcs of\ngroove, by hand", 0, (8.0, 24.0), "left", True),
}

_QUIET = "#6B7480"
_SMALL: dict[str, Any] = {"fontsize": 8, "color": _QUIET}
_TEXT: dict[str, Any] = {"fontsize": 10, "color": INK}
_BREAK = 1e-9
"""mm: the error axis is broken here; methods with facets lie far above, exact ones far below."""
_SMALLEST = 1e-17
"""mm: errors below are drawn here."""


def save_comparison(comparison: Comparison, path: str | Path, command: str) -> Path:
    """Write the chart to ``path``: .png, .svg, or .html (one page of its own with the chart and the tables).

    ``command`` is what made it, for the note under the chart. Raises InputError for another suffix.
    """
    path = Path(path)
    figure = comparison_figure(comparison, command)
    if path.suffix.lower() != ".html":
        return save_figure(figure, path, dpi=200)
    write_text(path, _page(comparison, figure))
    return path


def comparison_figure(comparison: Comparison, command: str) -> Figure:
    """The chart as a matplotlib figure; see the module."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 8.2))
    grid = {"width_ratios": (2.7, 1.0), "height_ratios": (3.1, 1.0)}
    axes = figure.subplots(2, 2, sharex="col", sharey="row", gridspec_kw=grid)
    figure.subplots_adjust(left=0.08, right=0.985, top=0.875, bottom=0.185, wspace=0.05, hspace=0.07)
    rows = comparison.measured
    _frame(axes, rows)
    for time, _ in axes:
        _front(time, rows)
    for family in dict.fromkeys(row.method for row in rows):
        members = sorted((r for r in rows if r.method == family), key=lambda r: r.error)
        for time, setup in axes:
            _curve(time, members, _micro(members))
            _curve(setup, members, [max(r.setup, 1e-3) for r in members])
        _label(axes[0 if members[0].error > _BREAK else 1][0], members)
    _batch(axes[1][0], [row for row in rows if row.method == "cas"])
    _levels(axes[0][0])
    if isinstance(comparison.image, Imaged):
        _images(axes[0][0], comparison.image)
    axes[1][0].set_xlabel("time per query, microseconds (CPU time of one call from Python)", **_TEXT)
    axes[1][1].set_xlabel("set-up, seconds", **_TEXT)
    figure.text(0.018, 0.53, "largest error of the distance, mm", rotation=90, va="center", **_TEXT)
    title: dict[str, Any] = {"fontsize": 15, "fontweight": "bold", "color": INK}
    figure.text(0.08, 0.95, "How exact, how fast: a wire in a round groove", **title)
    subtitle = (
        "Each mark is a method at one setting: lower is more exact, further left is faster. "
        "140 degree groove of R 12 mm, wire of 10.5 mm."
    )
    figure.text(0.08, 0.912, subtitle, **_TEXT)
    figure.text(0.08, 0.018, _note(comparison, command), fontsize=7.5, color="#4A525C", va="bottom", linespacing=1.45)
    return figure


def _micro(rows: Iterable[Measured]) -> list[float]:
    """Microseconds per query."""
    return [row.one * 1e6 for row in rows]


def _errors(rows: Iterable[Measured]) -> list[float]:
    """Largest errors as they are drawn, mm."""
    return [max(row.error, _SMALLEST) for row in rows]


def _frame(axes: Any, rows: Sequence[Measured]) -> None:
    """Errors of methods with facets above, of exact ones below: between them the error axis is broken."""
    faceted = [error for error in _errors(rows) if error > _BREAK] or [1e-3, 1.0]
    exact = [error for error in _errors(rows) if error <= _BREAK] or [1e-15]
    axes[0, 0].set_ylim(min(faceted) / 8.0, max(faceted) * 3.0)
    axes[1, 0].set_ylim(min(exact) / 8.0, max(exact) * 15.0)
    times = [1e6 * time for row in rows for time in (row.one, row.many)] or [0.1, 1e4]
    axes[0, 0].set_xlim(min(times) / 3.0, max(_micro(rows), default=1e4) * 4.0)
    axes[0, 1].set_xlim(4e-4, max((row.setup for row in rows), default=1.0) * 4.0)
    slash = {"marker": [(-1, -0.6), (1, 0.6)], "ms": 9, "color": INK, "mew": 1.0, "clip_on": False}
    for ax in axes.flat:
        ax.set(xscale="log", yscale="log", axisbelow=True)
        ax.grid(True, which="major", color="#E3E6EA", lw=0.7)
        ax.minorticks_off()
        ax.spines[["top", "right"]].set_visible(False)
    for upper, lower in axes.T:
        upper.spines["bottom"].set_visible(False)
        upper.tick_params(axis="x", length=0)
        upper.plot([0], [0.0], transform=upper.transAxes, **slash)
        lower.plot([0], [1.0], transform=lower.transAxes, **slash)


def _curve(ax: Axes, members: Sequence[Measured], x: Sequence[float]) -> None:
    """One family: its settings joined by a line, in the order of their error."""
    family = members[0].method
    look = _LOOKS.get(family, _Look())
    size, order = (18, 6) if family == "cas" else (7.5, 4)
    edge = {"mfc": "white", "mec": look.colour, "mew": 1.4} if look.hollow else {"mec": "white", "mew": 0.7}
    marks: dict[str, Any] = {"marker": look.marker, "ms": size, **edge}
    style = ":" if family == "chords" else "-"
    ax.plot(x, _errors(members), style, color=look.colour, lw=1.3, zorder=order, **marks)


def _label(ax: Axes, members: Sequence[Measured]) -> None:
    family = members[0].method
    look = _LOOKS.get(family, _Look(name=family))
    row = [members[look.which]]
    leader = {"arrowstyle": "-", "color": look.colour, "lw": 0.8, "shrinkA": 1, "shrinkB": 5}
    style: dict[str, Any] = {"color": look.colour, "ha": look.align, "va": "center", "linespacing": 1.1, "zorder": 8}
    style |= {"fontsize": 11 if family == "cas" else 9.5, "fontweight": "bold", "textcoords": "offset points"}
    arrow = leader if math.hypot(*look.offset) > 19.0 else None
    ax.annotate(look.name, (_micro(row)[0], _errors(row)[0]), look.offset, arrowprops=arrow, **style)


def _levels(ax: Axes) -> None:
    """Chord errors of three unit angles, on the right edge: methods with chords of one size are equally exact."""
    for degrees in (1.0, 5.0, 20.0):
        value, across = chord_error(math.radians(degrees)), ax.get_yaxis_transform()
        ax.text(1.0, value, f"{degrees:g}° chords", transform=across, ha="right", va="center", zorder=1, **_SMALL)


def _batch(ax: Axes, exact: Sequence[Measured]) -> None:
    """The exact method's time in a batch: a hollow mark."""
    colour, marker, *_ = _LOOKS["cas"]
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8.5, "color": colour, "ha": "center"}
    for many, one, y in zip([1e6 * row.many for row in exact], _micro(exact), _errors(exact), strict=True):
        ax.plot([many, one], [y, y], color=colour, lw=1.3, zorder=3)
        ax.plot([many], [y], marker=marker, ms=18, mfc="white", mec=colour, mew=1.4, zorder=6)
        for words, x in (("in a batch", many), ("one call", one)):
            ax.annotate(words, (x, y), (0, -17), zorder=8, **style)


def _front(ax: Axes, rows: Sequence[Measured]) -> None:
    """Pareto front of all methods, and of all but clamp3d's own exact one."""
    for front, line, width in ((pareto(rows), "-", 3.0), (pareto([r for r in rows if r.method != "cas"]), "--", 1.3)):
        if front:
            x, y = _micro(front), _errors(front)
            ax.step([x[0], *x, 1e9], [1e9, *y, y[-1]], line, where="post", color="#A7AFB9", lw=width, zorder=2)
    front, bottom = pareto(rows), ax.get_ylim()[0]
    if front and front[0].error < bottom:
        words = "Pareto front: nothing is both\nleft of it and below it"
        place = (front[0].one * 1e6, math.sqrt(bottom * 1e-3))
        ax.annotate(words, place, (-7, 0), textcoords="offset points", ha="right", va="center", **_SMALL)


def _images(ax: Axes, image: Imaged) -> None:
    """Image measurement has no poses: its error of the assembled clamp as lines across."""
    for value, words in (
        (image.median_by_hand, "finished clamp measured\nin a picture, by hand"),
        (image.automatic, "same picture, automatically"),
    ):
        ax.axhline(value, color=_QUIET, lw=1.0, ls=(0, (1, 2)), zorder=1)
        ax.text(0.008, value * 1.15, words, transform=ax.get_yaxis_transform(), va="bottom", zorder=1, **_SMALL)


def _note(comparison: Comparison, command: str) -> str:
    text = (
        "Errors of the signed distance: 120 poses with up to 1 mm of clearance and 60 overlaps of up to 0.3 mm (where "
        "a method has a depth), parallel and tilted by up to 1.7 degrees, against distances found at 50 digits. Hollow "
        "marks but the star: which piece can be nearest was chosen by hand. Axis: the wire's axis less its radius. "
        "Grey line: Pareto front, nothing is both left of it and below it; dashes: the same without clamp3d. "
        "Set-up: meshing, decomposing, building trees, with libraries already loaded; below 1 ms drawn at 1 ms; "
        f"CoACD by the clock. {comparison.machine}. Made by: {command}"
    )
    return "\n".join(textwrap.wrap(text, 178))


def _page(comparison: Comparison, figure: Figure) -> str:
    """One HTML page without anything outside itself."""
    drawn = picture(figure, "svg").decode("utf-8")
    return render(
        "compare.html", "clamp3d.bench", svg=drawn[drawn.index("<svg") :], tables=comparison_to_text(comparison)
    )
