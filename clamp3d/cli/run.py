"""``clamp3d run``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from clamp3d.cli.options import (
    OUTPUT,
    clamp_arguments,
    contact_model,
    method_options,
    solver_options,
    solver_settings,
    viewer_options,
)
from clamp3d.cli.progress import narrator

if TYPE_CHECKING:
    from clamp3d.clamp.result import Assembly


@click.command("run")
@clamp_arguments
@method_options
@solver_options
@click.option(
    "--equilibria/--no-equilibria",
    default=None,
    help="Also tell the other states that the clamp can come to rest in.  [default: with method cas, exact solver]",
)
@click.option("--json", "json_file", type=OUTPUT, metavar="FILE", help="Write the result as JSON.")
@click.option("--view", is_flag=True, help="Show the run in a browser while it goes on; prints the page's address.")
@viewer_options
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
    equilibria: bool | None,
    json_file: Path | None,
    view: bool,
    quiet: bool,
    **viewing: Any,
) -> None:
    """Assemble CLAMP (a built-in name or a TOML file) with its wires, and print where every part ends up.

    Exit code 1 if the clamp does not close on both wires, or parts meet that should not.
    """
    settings = solver_settings(method, solver, step, tilt_step_deg)
    if equilibria and settings["solver"] != "exact":
        raise click.UsageError(f"--equilibria goes with --solver exact, not {settings['solver']}")
    settings["others"] = equilibria if equilibria is not None else method == "cas" and settings["solver"] == "exact"
    from clamp3d.clamp.assemble import assemble
    from clamp3d.clamp.loader import load_clamp
    from clamp3d.output.files import write_json
    from clamp3d.output.run_report import run_to_dict, run_to_text

    loaded = load_clamp(clamp, line=line, jumper=jumper)
    model = contact_model(
        method, loaded, unit_angle_deg=unit_angle_deg, threshold=threshold, mesh_error=mesh_error, quiet=quiet
    )

    def done(run: Assembly) -> None:
        if json_file is not None:
            write_json(json_file, run_to_dict(run))
        click.echo(run_to_text(run))

    if view or viewing["html_file"] is not None or viewing["url"] is not None:
        from clamp3d.cli.viewing import run_and_view

        result = run_and_view(loaded, model, settings, quiet=quiet, serve=view, done=done, **viewing)
    else:
        with narrator(quiet) as tell:
            result = assemble(loaded, model, on_waypoint=tell.waypoint, progress=tell.position, **settings)
        done(result)
    if not result.clamped or result.undeclared:
        raise click.exceptions.Exit(1)
