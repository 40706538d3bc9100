"""``clamp3d tolerance``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from clamp3d.cli.options import CLAMP, JSON, PICTURE, QUIET, ClampSource, declared, group, option
from clamp3d.cli.terminal import finish, save, show


@dataclass(frozen=True)
class Workers:
    """Who assembles the clamps."""

    processes: int = option("Processes.", type=click.IntRange(1, 1024), default=1)
    scheduler: str | None = option("Spread over this Dask cluster (extra 'cluster').", metavar="ADDRESS")


@declared("tolerance")
def command(
    source: ClampSource = CLAMP,
    n: int = option("Clamps to assemble.", type=click.IntRange(1, 100_000_000), default=1000),
    seed: int = option("Seed of the dimensions.", type=click.IntRange(0), default=0),
    tolerance: float | None = option("Plus or minus, for each dimension.  [default: ISO 2768-1 m]", metavar="MM"),
    wire_tolerance_percent: float = option("Plus or minus, for the wire diameters.", default=1.0, metavar="P"),
    distribution: str = option(
        "Within the tolerance, or with 3 sigma = tolerance.",
        type=click.Choice(("uniform", "normal")),
        default="uniform",
    ),
    workers: Workers = group(Workers),
    json_file: Path | None = JSON,
    plot_file: Path | None = option("Draw the histogram (.png, .svg, .pdf).", "--plot", type=PICTURE),
    quiet: bool = QUIET,
) -> None:
    """How the splint distance of CLAMP depends on its dimensions, and how it scatters within their tolerances.

    The same seed gives the same clamps and distances, however the work is spread. Exit code 1 if CLAMP itself does not
    close on both wires, 4 if an answer could not be proven.
    """
    from clamp3d.clamp.sensitivity import sensitivity
    from clamp3d.clamp.tolerance import monte_carlo
    from clamp3d.cli.progress import bar
    from clamp3d.errors import NotClampedError, SolverError
    from clamp3d.output.figures import save_figure
    from clamp3d.output.tolerance_report import histogram_figure, tolerance_to_dict, tolerance_to_text

    loaded = source.clamp()
    note = ""
    try:
        rows = sensitivity(loaded)
    except (NotClampedError, SolverError) as error:
        rows, note = (), str(error)
    with bar(quiet) as report:
        result = monte_carlo(
            loaded,
            n=n,
            seed=seed,
            tolerance=tolerance,
            wire_tolerance_percent=wire_tolerance_percent,
            distribution="normal" if distribution == "normal" else "uniform",
            processes=workers.processes,
            scheduler=workers.scheduler,
            progress=lambda done, of: report("clamps", done, of),
        )
    show(tolerance_to_text(result, rows, note))
    save(json_file, lambda: tolerance_to_dict(result, rows))
    if plot_file is not None:
        save_figure(histogram_figure(result), plot_file)
    finish(result.nominal is None, failed=bool(result.unproven))
