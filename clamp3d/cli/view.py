"""``clamp3d view``."""

from __future__ import annotations

from typing import Any

import click

from clamp3d.cli.options import (
    clamp_arguments,
    contact_model,
    method_options,
    solver_options,
    solver_settings,
    viewer_options,
)


@click.command("view")
@clamp_arguments
@method_options
@solver_options
@viewer_options
@click.option("--quiet", "-q", is_flag=True, help="No progress; the page's address is printed all the same.")
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
    quiet: bool,
    **viewing: Any,
) -> None:
    """Assemble CLAMP (a built-in name or a TOML file) before your eyes, step by step, in a browser.

    Prints the page's address and serves it until Ctrl-C (or --timeout). With --html the page is written to a file
    instead; with --url the scene goes to a meshcat server, which keeps it. Exit code 1 as for run.
    """
    from clamp3d.clamp.loader import load_clamp
    from clamp3d.cli.viewing import run_and_view

    settings = solver_settings(method, solver, step, tilt_step_deg)
    loaded = load_clamp(clamp, line=line, jumper=jumper)
    model = contact_model(
        method, loaded, unit_angle_deg=unit_angle_deg, threshold=threshold, mesh_error=mesh_error, quiet=quiet
    )
    run = run_and_view(loaded, model, settings, quiet=quiet, serve=viewing["html_file"] is None, **viewing)
    if not run.clamped or run.undeclared:
        raise click.exceptions.Exit(1)
