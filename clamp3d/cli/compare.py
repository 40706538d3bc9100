"""``clamp3d compare``."""

from __future__ import annotations

from pathlib import Path

from clamp3d.cli.options import JSON, QUIET, Output, declared, option
from clamp3d.cli.progress import bar
from clamp3d.cli.terminal import command_line, save, show

CHART = Output((".png", ".svg", ".html"))


@declared("compare")
def command(
    json_file: Path | None = JSON,
    plot_file: Path | None = option("Draw the chart: .png, .svg or .html.", "--plot", type=CHART),
    peers: bool = option("Also measure coal, python-fcl, trimesh, MuJoCo, manifold3d and Open CASCADE."),
    quiet: bool = QUIET,
) -> None:
    """Measure every contact method on the same poses and the same assembly: accuracy against speed.

    Takes some minutes. Each method runs in a process of its own; one that fails or does not finish is a row that says
    so.
    """
    from clamp3d.bench.compare.chart import save_comparison
    from clamp3d.bench.compare.report import comparison_to_dict, comparison_to_text
    from clamp3d.bench.compare.run import compare

    with bar(quiet) as report:
        comparison = compare(peers=peers, progress=lambda done, total, what: report(what, done, total))
    show(comparison_to_text(comparison))
    save(json_file, lambda: comparison_to_dict(comparison))
    if plot_file is not None:
        save_comparison(comparison, plot_file, command_line())
