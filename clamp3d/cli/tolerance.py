"""``clamp3d tolerance``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import JSON, OUTPUT, PICTURE, QUIET, Source, clamp_argument, number
from clamp3d.cli.terminal import show


@click.command("tolerance")
@clamp_argument
@click.option("--n", type=click.IntRange(1, 100_000_000), default=1000, show_default=True, help="Clamps to assemble.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the dimensions.")
@click.option("--tolerance", type=number, metavar="MM", help="Either way, each dimension.  [default: ISO 2768-1 m]")
@click.option(
    "--wire-tolerance-percent", type=number, default=1.0, show_default=True, metavar="P", help="Of the diameters."
)
@click.option(
    "--distribution",
    type=click.Choice(("uniform", "normal")),
    default="uniform",
    show_default=True,
    help="Within the tolerance, or with 3 sigma = tolerance.",
)
@click.option("--processes", type=click.IntRange(1, 1024), default=1, show_default=True, help="Processes.")
@click.option("--scheduler", metavar="ADDRESS", help="Spread over this Dask cluster (extra 'cluster').")
@click.option("--resume", type=OUTPUT, metavar="FILE", help="Keep finished work here; go on from it if it exists.")
@JSON
@click.option("--plot", "plot_file", type=PICTURE, metavar="FILE", help="Draw the histogram (.png, .svg, .pdf).")
@QUIET
def command(
    source: Source,
    n: int,
    seed: int,
    tolerance: float | None,
    wire_tolerance_percent: float,
    distribution: str,
    processes: int,
    scheduler: str | None,
    resume: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
    quiet: bool,
) -> None:
    """How the splint distance of CLAMP depends on its dimensions, and how it scatters within their tolerances.

    The same seed gives the same clamps and distances, however the work is spread.
    """
    from clamp3d.clamp.sensitivity import sensitivity
    from clamp3d.clamp.tolerance import monte_carlo
    from clamp3d.cli.progress import bar
    from clamp3d.errors import SolverError
    from clamp3d.output.files import write_json
    from clamp3d.output.tolerance_report import draw_histogram, tolerance_to_dict, tolerance_to_text

    loaded = source.clamp()
    note = ""
    try:
        rows = sensitivity(loaded)
    except SolverError as error:
        rows, note = (), str(error)
    with bar(quiet) as report:
        result = monte_carlo(
            loaded,
            n=n,
            seed=seed,
            tolerance=tolerance,
            wire_tolerance_percent=wire_tolerance_percent,
            distribution="normal" if distribution == "normal" else "uniform",
            processes=processes,
            scheduler=scheduler,
            resume=resume,
            progress=lambda done, of: report("clamps", done, of),
        )
    if json_file is not None:
        write_json(json_file, tolerance_to_dict(result, rows))
    if plot_file is not None:
        draw_histogram(plot_file, result)
    show(tolerance_to_text(result, rows, note))
