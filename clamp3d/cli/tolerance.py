"""``clamp3d tolerance``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from clamp3d.clamp.sensitivity import sensitivity
from clamp3d.clamp.tolerance import monte_carlo
from clamp3d.cli.options import JSON, PICTURE, ClampSource, Quiet, command, option
from clamp3d.cli.terminal import bar, finish, save, show
from clamp3d.errors import NotClampedError, SolverError
from clamp3d.output.figures import save_figure
from clamp3d.output.tolerance_report import histogram_figure, tolerance_to_dict, tolerance_to_text


@command("tolerance")
class Tolerance(ClampSource, Quiet):
    """How the splint distance of CLAMP depends on its dimensions, and how it scatters within their tolerances.

    The same seed gives the same clamps and distances, however the work is spread. Exit code 1 if CLAMP itself does not
    close on both wires, 4 if an answer could not be proven.
    """

    n: int = option("Clamps to assemble.", type=click.IntRange(1, 100_000_000), default=1000)
    seed: int = option("Seed of the dimensions.", type=click.IntRange(0), default=0)
    tolerance: float | None = option("Plus or minus, for each dimension.  [default: ISO 2768-1 m]", metavar="MM")
    wire_tolerance_percent: float = option("Plus or minus, for the wire diameters.", default=1.0, metavar="P")
    distribution: Literal["uniform", "normal"] = option(
        "Within the tolerance, or with 3 sigma = tolerance.", default="uniform"
    )
    processes: int = option("Processes.", type=click.IntRange(1, 1024), default=1)
    scheduler: str | None = option("Spread over this Dask cluster (extra 'cluster').", metavar="ADDRESS")
    json_file: Path | None = JSON
    plot_file: Path | None = option("Draw the histogram (.png, .svg, .pdf).", "--plot", type=PICTURE)

    def run(self) -> None:
        """Assemble the clamps, print and draw."""
        clamp = self.clamp()
        try:
            rows, note = sensitivity(clamp), ""
        except (NotClampedError, SolverError) as error:
            rows, note = (), str(error)
        names = ("n", "seed", "tolerance", "wire_tolerance_percent", "distribution", "processes", "scheduler")
        settings = {name: getattr(self, name) for name in names}
        with bar(self.quiet) as report:
            result = monte_carlo(clamp, **settings, progress=lambda done, of: report("clamps", done, of))
        show(tolerance_to_text(result, rows, note))
        save(self.json_file, lambda: tolerance_to_dict(result, rows))
        if self.plot_file is not None:
            save_figure(histogram_figure(result), self.plot_file)
        finish(result.nominal is None, failed=bool(result.unproven))
