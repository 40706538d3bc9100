"""The matrix picture of a stress run: families x methods, colour by failure rate, numbers in the cells."""

from __future__ import annotations

import math
from pathlib import Path

from clamp3d.errors import InputError
from clamp3d.output.files import whole_file
from clamp3d.study.stress import Outcome, StressRun

_LEAST = 1e-5
_NONE = "#e8e8e8"


def plot(run: StressRun, path: Path) -> None:
    """Write the picture (.png, .svg or .pdf by the name). Raises InputError for another ending."""
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"plot file must end in .png, .svg or .pdf, got {path.name}")
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    methods = list(dict.fromkeys(o.method for o in run.outcomes))
    families = list(dict.fromkeys(o.family for o in run.outcomes))
    by = {(o.family, o.method): o for o in run.outcomes}
    norm, colours = LogNorm(_LEAST, 1.0), matplotlib.colormaps["cividis_r"]  # the same to colour-blind eyes
    figure, axes = plt.subplots(
        figsize=(3.2 + 1.35 * len(methods), 1.6 + 0.36 * len(families)), layout="constrained", dpi=150
    )
    for i, family in enumerate(families):
        for j, name in enumerate(methods):
            outcome = by[family, name]
            rate = outcome.failure_rate
            face = "white" if rate == 0.0 else _NONE if rate is None else colours(norm(max(rate, _LEAST)))
            axes.add_patch(Rectangle((j, i), 1, 1, facecolor=face, edgecolor="white", linewidth=1.5))
            light = sum(matplotlib.colors.to_rgb(face)) / 3.0 > 0.5
            axes.text(
                j + 0.5,
                i + 0.5,
                _cell(outcome),
                ha="center",
                va="center",
                fontsize=7.5,
                color="black" if light else "white",
            )
    axes.set_xlim(0, len(methods))
    axes.set_ylim(len(families), 0)
    axes.set_xticks([j + 0.5 for j in range(len(methods))], methods, rotation=25, ha="left", fontsize=8.5)
    axes.set_yticks([i + 0.5 for i in range(len(families))], families, fontsize=8.5)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, shrink=0.7, pad=0.02)
    bar.set_label("share of wrong verdicts, exceptions and crashes (white: none)", fontsize=8)
    bar.ax.tick_params(labelsize=8)
    figure.supxlabel(
        f"wrong / taken on, and the largest error in mm. {run.n} cases a family (cas; others as many as their time "
        f"allows), seed {run.seed}. Grey: refused in words.",
        fontsize=7.5,
    )
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary)
    finally:
        plt.close(figure)


def _cell(o: Outcome) -> str:
    taken = o.asked - o.refused
    if not taken:
        return "refused" if o.refused else "not asked"
    worst = "" if o.worst_error is None or math.isnan(o.worst_error) else f"\n{o.worst_error:.1e} mm"
    dead = f" ({o.crashes} dead)" if o.crashes else ""
    return f"{o.wrong} / {taken}{dead}{worst}"
