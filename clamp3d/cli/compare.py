"""``clamp3d compare``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import OUTPUT


@click.command("compare")
@click.option("--json", "json_file", type=OUTPUT, metavar="FILE", help="Write all figures as JSON.")
@click.option("--plot", "plot_file", type=OUTPUT, metavar="FILE", help="Draw the chart: .png, .svg or .html.")
@click.option("--peers", is_flag=True, help="Also measure coal, trimesh, MuJoCo, manifold3d and Open CASCADE.")
@click.option("--quiet", "-q", is_flag=True, help="No progress.")
def command(json_file: Path | None, plot_file: Path | None, peers: bool, quiet: bool) -> None:
    """Measure every contact method on the same poses and the same assembly: accuracy against speed.

    Takes some minutes. Each method runs in a process of its own; one that fails or does not finish is a row that says
    so.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from clamp3d.bench.compare.chart import check_format, save_comparison
    from clamp3d.bench.compare.report import comparison_to_dict, comparison_to_text
    from clamp3d.bench.compare.run import compare
    from clamp3d.output.files import check_writable, write_json

    if plot_file is not None:
        check_format(plot_file)
    for path in (json_file, plot_file):
        if path is not None:
            check_writable(path)  # minutes of measuring must not end in a wrong folder
    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.completed:.0f}/{task.total:.0f}"), TimeElapsedColumn())
    shown = console.is_terminal and not quiet
    with Progress(
        *columns, TextColumn("{task.description}"), console=console, transient=True, disable=not shown
    ) as bar:
        task = bar.add_task("", total=1)
        found = compare(
            peers=peers,
            progress=lambda done, total, what: bar.update(task, completed=done, total=total, description=what),
        )
    if json_file is not None:
        write_json(json_file, comparison_to_dict(found))
    if plot_file is not None:
        save_comparison(
            found, plot_file, "clamp3d compare" + (" --peers" if peers else "") + f" --plot {plot_file.name}"
        )
    click.echo(comparison_to_text(found))
