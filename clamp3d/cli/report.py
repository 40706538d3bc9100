"""``clamp3d report``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import (
    CLEARANCE_OPTION,
    clamp_arguments,
    contact_model,
    method_options,
    solver_options,
    solver_settings,
)
from clamp3d.cli.progress import narrator


@click.command("report")
@clamp_arguments
@method_options
@solver_options
@CLEARANCE_OPTION
@click.option(
    "--outline-error", type=float, default=0.001, show_default=True, metavar="MM", help="Chord error of outlines."
)
@click.option("--output", "-o", type=click.Path(file_okay=False, path_type=Path), required=True, metavar="DIR")
@click.option("--quiet", "-q", is_flag=True, help="No progress.")
def command(
    clamp: str,
    line: str | None,
    jumper: str | None,
    method: str,
    unit_angle_deg: float | None,
    threshold: float | None,
    mesh_error: float | None,
    solver: str | None,
    step: float | None,
    tilt_step_deg: float | None,
    clearance: float,
    outline_error: float,
    output: Path,
    quiet: bool,
) -> None:
    """Assemble CLAMP and write a report for an assembly reviewer into DIR: report.html, report.json, pairs.csv.

    Prints the paths of the files. Exit code 1 if the clamp does not close on both wires, or parts meet that should not.
    """
    settings = solver_settings(method, solver, step, tilt_step_deg)
    from clamp3d.clamp.assemble import assemble
    from clamp3d.clamp.contacts import CONTACT
    from clamp3d.clamp.loader import load_clamp
    from clamp3d.clamp.verdict import verdict
    from clamp3d.core.profile import check_mesh_error
    from clamp3d.output.files import check_folder
    from clamp3d.output.report import report
    from clamp3d.output.report_page import write_report

    check_folder(output)
    check_mesh_error(outline_error)
    verdict(0.0, contact=CONTACT, clearance=clearance)
    loaded = load_clamp(clamp, line=line, jumper=jumper)
    model = contact_model(
        method, loaded, unit_angle_deg=unit_angle_deg, threshold=threshold, mesh_error=mesh_error, quiet=quiet
    )

    with narrator(quiet) as tell:
        run = assemble(loaded, model, on_waypoint=tell.waypoint, progress=tell.position, **settings)
        made = report(run, model, clearance=clearance, mesh_error=outline_error)
        paths = write_report(made, output, progress=tell.status)
    for path in paths:
        click.echo(str(path))
    if not made.passed:
        raise click.exceptions.Exit(1)
