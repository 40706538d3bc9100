"""A stress run as text, for the terminal and for a document, and as a picture of families x methods."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from clamp3d.bench.stress.assemblies.family import ASSEMBLIES, COUNTS
from clamp3d.bench.stress.outcome import REFERENCE, Outcome
from clamp3d.bench.stress.run import FAMILIES, METHODS, StressRun
from clamp3d.output.figures import save_figure
from clamp3d.output.pages import render
from clamp3d.output.tables import text_table

_LEAST = 1e-4
_CELL_WIDTH, _CELL_HEIGHT = 0.9, 0.23
"""Inches."""


def _length(x: float | None) -> str:
    return "-" if x is None else f"{x:.2g}"


def percent(rate: float) -> str:
    """A share to two digits.

    >>> percent(0.0), percent(0.0312), percent(0.126), percent(1.0)
    ('0', '3.1 %', '13 %', '100 %')
    """
    x = 100.0 * rate
    return "0" if x == 0.0 else f"{x:.0f} %" if x >= 9.95 else f"{x:.2g} %"


def _rate(outcome: Outcome) -> str:
    rate = outcome.failure_rate
    if rate is None:
        return "refused" if outcome.refused else "not run"
    return f"{percent(rate)} of {outcome.asked - outcome.refused}"


def _errors(outcome: Outcome) -> str:
    if outcome.worst_error is None:
        return "-"
    ratio = "" if outcome.worst_ratio is None else f" ({outcome.worst_ratio:.2g})"
    return f"{_length(outcome.worst_error)} / {_length(outcome.median_error)}{ratio}"


_MATRICES = (
    (
        "Share of wrong verdicts (false hits, false misses, exceptions, crashes, no answer in time) among the "
        "cases that the method takes on:",
        _rate,
    ),
    ("Largest and median error in mm (largest in parts of the method's own bound):", _errors),
)
"""Title and cell of the matrices of families and methods."""


def table(run: StressRun) -> str:
    """One line per family and method, fixed width."""
    head = ["family", "method", "cases", "refused", "false hit", "false miss", "> bound", "worst mm", "median"]
    rows = []
    for o in run.outcomes:
        troubles = ((o.exceptions, "raised"), (o.crashes, "crashed"), (o.timeouts, "timed out"))
        failures = ", ".join(f"{count} {what}" for count, what in troubles if count)
        row = (o.family, o.method, o.asked, o.refused, o.false_hits, o.false_misses, o.beyond_bound)
        each = f"{1e6 * o.seconds / max(o.asked, 1):.1f}"
        rows.append([*row, _length(o.worst_error), _length(o.median_error), each, failures])
    lines = [
        text_table([*head, "us each", "failures"], rows),
        f"seed {run.seed}, {run.n} cases a family; {run.checked_50_digits} truths a family of poses worked out again "
        f"at 50 digits: largest difference {run.worst_truth_difference:.1g} of the scene",
    ]
    if any(o.family in ASSEMBLIES for o in run.outcomes):
        lines.append(f"assemblies: {COUNTS}")
    return "\n".join(lines)


def markdown(run: StressRun, command: str) -> str:
    """The matrix of failure rates, what each family is, and the worst case of each method with its reproducer."""
    families = list(dict.fromkeys(o.family for o in run.outcomes))
    return render(
        "stress.md",
        "clamp3d.bench",
        run=run,
        command=command,
        matrices=_MATRICES,
        methods=list(dict.fromkeys(o.method for o in run.outcomes)),
        families=families,
        by={(o.family, o.method): o for o in run.outcomes},
        family_about={name: family.about for name, family in FAMILIES.items()},
        method_about=METHODS,
        counts=COUNTS if any(f in ASSEMBLIES for f in families) else "",
        findings=[finding(o, run) for o in run.outcomes if o.examples],
    )


def finding(o: Outcome, run: StressRun) -> str:
    """One line: what a method got wrong in a family, and how to see it."""
    first = o.examples[0]
    failures = o.failures
    if o.beyond_bound:
        failures["errors beyond its bound"] = o.beyond_bound
    counts = ", ".join(f"{n} {what}" for what, n in failures.items() if n)
    answer = "none" if first.answer != first.answer else f"{first.answer:.6g} mm"
    return (
        f"- {o.method}, {o.family}: {counts} of {o.asked - o.refused}; {first.what}: truth "
        f"{first.truth:.6g} mm, answer {answer} "
        f'(`clamp3d stress --family "{o.family}" --n {run.n} --seed {run.seed} --case {first.case}`)'
    )


def plot(run: StressRun, path: Path) -> None:
    """Write the picture (.svg, .png or .pdf by the name). Raises InputError for another ending."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    families, methods = (list(dict.fromkeys(getattr(o, key) for o in run.outcomes)) for key in ("family", "method"))
    height = len(families) * _CELL_HEIGHT + 1.7
    figure = Figure(figsize=(max(9.6, len(methods) * _CELL_WIDTH + 3.0), height), dpi=150)
    axes = figure.add_axes((0.27, 0.9 / height, 0.71, 1.0 - 1.7 / height))
    colours, norm = colormaps["YlOrRd"], LogNorm(_LEAST, 1.0)
    for o in run.outcomes:
        i, j, rate = families.index(o.family), methods.index(o.method), o.failure_rate
        face = "#e8e8e8" if rate is None else "#f4faf4" if rate == 0.0 else colours(norm(max(rate, _LEAST)))
        axes.broken_barh([(j, 1)], (i, 1), facecolor=face, edgecolor="white", linewidth=1.2)
        colour, weight = "black" if (rate or 0.0) < 0.08 else "white", "bold" if o.method == REFERENCE else "normal"
        axes.text(j + 0.5, i + 0.53, _cell(o), ha="center", va="center", fontsize=7.5, color=colour, weight=weight)
    axes.set(xlim=(0, len(methods)), ylim=(len(families), 0))
    axes.set_xticks(np.arange(len(methods)) + 0.5, methods, rotation=25, ha="left", fontsize=7.5)
    axes.set_yticks(np.arange(len(families)) + 0.5, families, fontsize=7.5)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, pad=2)
    axes.spines[:].set_visible(False)
    legend = (
        "Share that went wrong. 0: nothing. White: not for this method. Grey: every case refused in words, or no time\n"
        f"left. †: the interpreter died. {run.n} cases a family, clamps a hundredth, methods other than cas as many\n"
        f"as their time allows; seed {run.seed}."
    )
    figure.text(0.02, 0.7 / height, legend, fontsize=7.5, va="top")
    save_figure(figure, path)


def _cell(o: Outcome) -> str:
    rate = o.failure_rate
    if rate is None:
        return "refused" if o.refused else "no time"
    return percent(rate) + (" †" if o.crashes else "")
