"""``clamp3d fit``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import JSON, Quiet, Unit, argument, command, option
from clamp3d.cli.terminal import bar, save, show
from clamp3d.fit.fit import fit_file
from clamp3d.output.fit_report import fit_to_html, fit_to_text


@command("fit")
class Fit(Quiet):
    """Find round grooves, cylinders and holes in MESH (STL, OBJ, PLY, OFF, GLB, 3MF, STEP) each with its error bound.

    A mesh without any is no error: exit code 0.
    """

    mesh: Path = argument(metavar="MESH", type=click.Path(path_type=Path))
    unit: Unit | None = option("Unit of the file's numbers.  [default: the file's own; mm for STL, OBJ, PLY, OFF]")
    json_file: Path | None = JSON
    html_file: Path | None = option("Write a page: the mesh, its features, their errors.", "--html")

    def run(self) -> None:
        """Fit, print and write."""
        with bar(self.quiet) as report:
            result = fit_file(
                self.mesh, unit=self.unit, progress=lambda stage, done: report(f"looking for {stage}", done, 1.0)
            )
        for note in () if self.quiet else result.notes:
            show(f"note: {note}", err=True)
        show(fit_to_text(result))
        save(self.json_file, result.to_dict)
        save(self.html_file, lambda: fit_to_html(result))
