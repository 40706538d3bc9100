"""``clamp3d report``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import CLEARANCE, FOLDER, QUIET, Method, Source, clamp_argument, method_options, number
from clamp3d.cli.progress import narrator
from clamp3d.cli.terminal import finish, show


@click.command("report")
@clamp_argument
@method_options
@CLEARANCE
@click.option(
    "--outline-error", type=number, default=0.001, show_default=True, metavar="MM", help="Chord error of outlines."
)
@click.option("--output", "-o", type=FOLDER, required=True, metavar="DIR")
@QUIET
def command(
    source: Source,
    method: Method,
    clearance: float,
    outline_error: float,
    output: Path,
    quiet: bool,
) -> None:
    """Assemble CLAMP and write a report for an assembly reviewer into DIR: report.html, report.json, pairs.csv.

    Prints the paths of the files. Exit code 1 if the clamp does not close on both wires, or parts meet that should not.
    """
    settings = method.settings()
    from clamp3d.clamp.assemble import assemble
    from clamp3d.clamp.contacts import CONTACT
    from clamp3d.clamp.verdict import verdict
    from clamp3d.core.profile import check_mesh_error
    from clamp3d.output.files import check_folder
    from clamp3d.output.report import report
    from clamp3d.output.report_page import write_report

    check_folder(output)
    check_mesh_error(outline_error)
    verdict(0.0, contact=CONTACT, clearance=clearance)
    loaded = source.clamp()
    model = method.model(loaded, quiet=quiet)

    with narrator(quiet) as tell:
        run = assemble(loaded, model, on_waypoint=tell.waypoint, progress=tell.position, **settings)
        made = report(run, model, clearance=clearance, mesh_error=outline_error)
        paths = write_report(made, output, progress=tell.status)
    for path in paths:
        show(str(path))
    finish(finding=not made.passed)
