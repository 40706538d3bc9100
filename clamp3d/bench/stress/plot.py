"""The matrix picture of a stress run: families x methods, colour by failure rate, the rate in the cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from clamp3d.bench.stress.outcome import Outcome
from clamp3d.bench.stress.registry import KINDS
from clamp3d.bench.stress.report import percent
from clamp3d.bench.stress.run import StressRun
from clamp3d.errors import InputError
from clamp3d.output.files import whole_file

_LEAST = 1e-4
_CELL_WIDTH, _CELL_HEIGHT, _LABELS, _HEAD = 0.78, 0.23, 1.75, 0.78
"""Inches."""
_TITLES = {"pose": "single poses", "motion": "motions", "mesh": "meshes", "assembly": "whole clamps"}

Matrix = dict[str, dict[str, Outcome]]
"""Family -> method -> outcome."""


def plot(run: StressRun, path: Path) -> None:
    """Write the picture (.png, .svg or .pdf by the name). Raises InputError for another ending."""
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"plot file must end in .png, .svg or .pdf, got {path.name}")
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    kinds = _by_kind(run)
    columns = [list(kinds)[:1], list(kinds)[1:]] if len(kinds) > 1 else [list(kinds)]
    wide = [max(len(_methods(kinds[k])) for k in column) * _CELL_WIDTH + _LABELS for column in columns]
    high = max(sum(len(kinds[k]) * _CELL_HEIGHT + _HEAD for k in column) for column in columns)
    foot, width = 0.85, max(9.6, sum(wide) + 0.6)
    height = high + foot
    figure = Figure(figsize=(width, height), dpi=150)

    def inches(left: float, bottom: float, across: float, up: float) -> Any:
        return figure.add_axes((left / width, bottom / height, across / width, up / height))

    mappable = ScalarMappable(LogNorm(_LEAST, 1.0), colormaps["YlOrRd"])
    left = 0.0
    for column, across in zip(columns, wide, strict=True):
        top = height
        for kind in column:
            matrix = kinds[kind]
            down = len(matrix) * _CELL_HEIGHT
            top -= _HEAD + down
            axes = inches(left + _LABELS, top, len(_methods(matrix)) * _CELL_WIDTH, down)
            _draw(axes, _TITLES[kind], matrix, mappable)
        left += across
    bar_width = min(3.0, 0.5 * width)
    bar = figure.colorbar(mappable, cax=inches(0.15, 0.45, bar_width, 0.1), orientation="horizontal")
    bar.ax.tick_params(labelsize=7)
    bar.set_label("share that went wrong", fontsize=7.5)
    legend = (
        "0: nothing wrong. White: not for this method. Grey: every case refused in words, or no time left.\n"
        f"†: the interpreter died. {run.n} cases a family (meshes and clamps a hundredth; other methods than cas\n"
        f"as many as their time allows), seed {run.seed}."
    )
    figure.text((bar_width + 0.4) / width, 0.62 / height, legend, fontsize=7.5, va="top")
    with whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix.lower().lstrip("."))


def _by_kind(run: StressRun) -> dict[str, Matrix]:
    """Outcomes by the kind of their family."""
    found: dict[str, Matrix] = {}
    for kind, families in KINDS.items():
        for o in run.outcomes:
            if o.family in families:
                found.setdefault(kind, {}).setdefault(o.family, {})[o.method] = o
    return found


def _methods(matrix: Matrix) -> list[str]:
    return list(dict.fromkeys(method for row in matrix.values() for method in row))


def _draw(axes: Any, title: str, matrix: Matrix, mappable: Any) -> None:
    methods = _methods(matrix)
    for i, row in enumerate(matrix.values()):
        for method, outcome in row.items():
            j, rate = methods.index(method), outcome.failure_rate
            face = "#e8e8e8" if rate is None else "#f4faf4" if rate == 0.0 else mappable.to_rgba(max(rate, _LEAST))
            axes.broken_barh([(j, 1)], (i, 1), facecolor=face, edgecolor="white", linewidth=1.2)
            style = {"color": "black" if rate is None or rate < 0.08 else "white", "fontsize": 7.5}
            style["weight"] = "bold" if method == "cas" else "normal"
            axes.text(j + 0.5, i + 0.53, _cell(outcome), ha="center", va="center", **style)
    axes.set_xlim(0, len(methods))
    axes.set_ylim(len(matrix), 0)
    axes.set_xticks([j + 0.5 for j in range(len(methods))], methods, rotation=25, ha="left", fontsize=7.5)
    axes.set_yticks([i + 0.5 for i in range(len(matrix))], [name.split(": ")[-1] for name in matrix], fontsize=7.5)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, pad=2)
    axes.spines[:].set_visible(False)
    place = {"xycoords": "axes fraction", "xytext": (-6, 8), "textcoords": "offset points"}
    axes.annotate(title, (0, 1), **place, ha="right", fontsize=9, weight="bold")


def _cell(o: Outcome) -> str:
    rate = o.failure_rate
    if rate is None:
        return "refused" if o.refused else "no time"
    return percent(rate) + (" †" if o.crashes else "")
