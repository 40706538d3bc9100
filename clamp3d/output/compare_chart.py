"""The chart of a comparison: error against time per query, and beside it against set-up time; every method labelled.

Colours are Okabe and Ito's, told apart by colour-blind readers; each method also has a marker of its own and its name
beside its curve, so the chart reads in grey.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from clamp3d.errors import InputError
from clamp3d.output.compare_report import comparison_to_text
from clamp3d.output.figures import save_figure
from clamp3d.output.files import write_text
from clamp3d.output.palette import INK
from clamp3d.study.compare import Comparison, pareto
from clamp3d.study.compare_jobs import Imaged
from clamp3d.study.compare_measure import Measured

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".html")

_STYLE: dict[str, tuple[str, str, str]] = {
    "cas": ("#D55E00", "*", "clamp3d (CAS): exact arc"),
    "chords": ("#56B4E9", "v", "chords in the section\n(parallel axes only)"),
    "wedges": ("#0072B2", "s", "wedges (FCL)"),
    "hulls": ("#CC79A7", "D", "CoACD hulls (FCL)"),
    "mesh": ("#009E73", "o", "mesh (FCL)"),
    "coal": ("#000000", "P", "coal"),
    "mujoco": ("#8A6D00", "X", "MuJoCo"),
    "trimesh": ("#5B7F95", "<", "trimesh"),
    "manifold3d": ("#7A5195", ">", "manifold3d"),
    "open-cascade": ("#7F2704", "h", "Open CASCADE\n(B-rep)"),
}
"""Family: colour, marker, name on the chart."""

_SMALLEST = 1e-17
"""mm: errors below are drawn here, on the chart's lower edge."""


def save_comparison(found: Comparison, path: str | Path, command: str) -> Path:
    """Write the chart to ``path``: .png, .svg, or .html (one page of its own with the chart and the tables).

    ``command`` is what made it, for the note under the chart. Raises InputError for another suffix.
    """
    path = check_format(path)
    figure = comparison_figure(found, command)
    if path.suffix.lower() != ".html":
        return save_figure(figure, path, dpi=200)
    write_text(path, _page(found, figure))
    return path


def check_format(path: str | Path) -> Path:
    """``path`` if its suffix is one of `FORMATS`. Raises InputError."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"chart file must end in {', '.join(FORMATS)}, got {path.name!r}")
    return path


def comparison_figure(found: Comparison, command: str) -> Figure:
    """The chart as a matplotlib figure; see the module."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 7.4))
    ax, setup = figure.subplots(1, 2, sharey=True, width_ratios=(2.5, 1.0))
    figure.subplots_adjust(left=0.075, right=0.985, top=0.86, bottom=0.185, wspace=0.05)
    rows = found.measured
    for axes in (ax, setup):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.grid(True, which="major", color="#E3E6EA", lw=0.7)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    _front(ax, rows)
    for family in dict.fromkeys(row.method for row in rows):
        members = sorted((r for r in rows if r.method == family), key=lambda r: r.worst_error)
        _curve(ax, members, [r.one * 1e6 for r in members], label=True)
        _curve(setup, members, [max(r.setup, 1e-3) for r in members], label=False)
    _batch(ax, rows)
    if isinstance(found.image, Imaged):
        _images(ax, found.image)
    ax.set_xlabel("time per query, microseconds (CPU time, one call from Python)", fontsize=10, color=INK)
    ax.set_ylabel("largest error of the distance, mm", fontsize=10, color=INK)
    setup.set_xlabel("set-up, seconds", fontsize=10, color=INK)
    setup.tick_params(labelleft=False)
    low = min((r.worst_error for r in rows), default=1e-15)
    ax.set_ylim(max(_SMALLEST, low) / 30.0, 20.0)
    left = min((min(r.one, r.many) for r in rows), default=1e-7) * 1e6
    ax.set_xlim(left / 3.0, max((r.one for r in rows), default=1e-2) * 1e6 * 5.0)
    slowest = max((r.setup for r in rows), default=1.0)
    setup.set_xlim(4e-4, slowest * 4.0)
    figure.text(
        0.075, 0.945, "How exact, how fast: a wire in a round groove", fontsize=15, fontweight="bold", color=INK
    )
    figure.text(
        0.075,
        0.905,
        "Each mark is one method at one setting; further down is more exact, further left is faster. "
        "140 degree groove, R 12, wire 10.5 mm.",
        fontsize=10,
        color=INK,
    )
    figure.text(0.075, 0.02, _note(found, command), fontsize=7.5, color="#4A525C", va="bottom", linespacing=1.45)
    return figure


def _curve(ax: Axes, members: Sequence[Measured], x: Sequence[float], *, label: bool) -> None:
    """One family: its settings joined by a line, in the order of their error."""
    family = members[0].method
    colour, marker, name = _STYLE.get(family, ("#444444", "o", family))
    y = [max(r.worst_error, _SMALLEST) for r in members]
    line = ":" if family == "chords" else "-"
    size = 17 if family == "cas" else 7
    ax.plot(
        x,
        y,
        line,
        color=colour,
        marker=marker,
        ms=size,
        lw=1.4,
        mec="white",
        mew=0.7,
        zorder=6 if family == "cas" else 4,
    )
    if not label:
        return
    for row, a, b in zip(members, x, y, strict=True):
        if row.setting is not None and family in ("wedges", "hulls", "mesh"):
            ax.annotate(_setting(row), (a, b), (5, -9), textcoords="offset points", fontsize=6.5, color=colour)
    places = _LABELS.get(family, (10, 0, "left", 0))
    dx, dy, align, which = places
    anchor = (x[which], y[which])
    ax.annotate(
        name,
        anchor,
        (dx, dy),
        textcoords="offset points",
        fontsize=9.5 if family != "cas" else 11,
        fontweight="bold",
        color=colour,
        ha=align,
        va="center",
        linespacing=1.1,
        zorder=8,
    )


_LABELS: dict[str, tuple[float, float, str, int]] = {
    "cas": (14, 0, "left", 0),
    "chords": (-12, -4, "right", 0),
    "wedges": (0, -16, "center", 0),
    "mesh": (0, -16, "center", 0),
    "hulls": (0, 14, "center", -1),
}
"""Where a family's name stands: offset in points and alignment from the mark of its least (0) or greatest error."""


def _setting(row: Measured) -> str:
    if row.method == "wedges":
        return f"{row.setting:g}°"
    return f"{row.setting:g}" + (" mm" if row.method == "mesh" else "")


def _batch(ax: Axes, rows: Iterable[Measured]) -> None:
    """Methods whose batch is more than a loop: a hollow mark at the time in a batch."""
    for row in rows:
        if row.many < 0.3 * row.one and row.method == "cas":
            colour, marker, _ = _STYLE[row.method]
            y = max(row.worst_error, _SMALLEST)
            x = row.many * 1e6
            ax.plot([x, row.one * 1e6], [y, y], color=colour, lw=1.4, zorder=3)
            ax.plot([x], [y], marker=marker, ms=17, mfc="white", mec=colour, mew=1.4, zorder=6)
            ax.annotate(
                "in a batch", (x, y), (0, 14), textcoords="offset points", fontsize=8.5, color=colour, ha="center"
            )
            ax.annotate(
                "one call",
                (row.one * 1e6, y),
                (0, 14),
                textcoords="offset points",
                fontsize=8.5,
                color=colour,
                ha="center",
            )


def _front(ax: Axes, rows: Sequence[Measured]) -> None:
    """Pareto front of all methods, and of all but the exact one."""
    fronts = (
        ("best of all", pareto(rows), "-"),
        ("best of the others", pareto([r for r in rows if r.method != "cas"]), "--"),
    )
    for name, front, line in fronts:
        if not front:
            continue
        far, high = 1e9, 1e9
        x, y = [front[0].one * 1e6], [high]
        for row, after in zip(front, [*front[1:], None], strict=True):
            level = max(row.worst_error, _SMALLEST)
            x += [row.one * 1e6, after.one * 1e6 if after else far]
            y += [level, level]
        ax.plot(x, y, line, color="#9AA3AE", lw=2.2 if line == "-" else 1.4, zorder=2)
        ax.annotate(
            f"Pareto front: {name}",
            (x[-2] if len(front) > 1 else x[0], y[-1]),
            (70 if line == "-" else 8, -10),
            textcoords="offset points",
            fontsize=8,
            color="#6B7480",
        )


def _images(ax: Axes, image: Imaged) -> None:
    """Image measurement has no poses: its error of the assembled clamp as lines across."""
    from matplotlib.transforms import blended_transform_factory

    across = blended_transform_factory(ax.transAxes, ax.transData)
    for value, words in (
        (image.median_by_hand, "clamp measured in a picture, marked by hand"),
        (image.automatic, "same picture, measured automatically"),
    ):
        ax.axhline(value, color="#6B7480", lw=1.0, ls=(0, (1, 2)), zorder=1)
        ax.text(0.008, value * 1.25, words, transform=across, fontsize=8, color="#6B7480", va="bottom", zorder=1)


def _note(found: Comparison, command: str) -> str:
    m = found.machine
    versions = ", ".join(f"{name} {version}" for name, version in m.versions.items())
    return (
        "Errors: 120 poses with up to 1 mm of room, parallel and tilted by up to 1.7 degrees, against distances found "
        "at 50 digits. Settings: unit angle (wedges, chords), CoACD threshold (hulls), chord error (mesh).\n"
        "Set-up: meshing, decomposing, building trees, libraries already loaded; below 1 ms drawn at 1 ms; CoACD by "
        f"the clock. {m.processor}, {m.cores} cores, {m.system}, Python {m.python},\n"
        f"clamp3d {m.clamp3d}, {versions}. Made by: {command}"
    )


def _page(found: Comparison, figure: Figure) -> str:
    """One HTML page without anything outside itself."""
    import io

    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "clamp3d"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    style = "body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#20262E}"
    style += "svg{width:100%;height:auto}pre{overflow-x:auto;font-size:13px}"
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'><title>clamp3d compare</title>"
        "<meta name='viewport' content='width=device-width'>"
        f"<style>{style}</style></head><body>\n{svg}\n<pre>{html.escape(comparison_to_text(found))}</pre>\n</body></html>\n"
    )
