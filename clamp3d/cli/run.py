"""``clamp3d run``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import FILE, clamp_arguments, contact_model, method_options
from clamp3d.cli.progress import narrator

if TYPE_CHECKING:
    from clamp3d.assembly.result import Solver


@click.command("run")
@clamp_arguments
@method_options
@click.option(
    "--solver",
    type=click.Choice(["exact", "stepped", "bisection"]),
    help="[default: exact for cas and chords, bisection for the others; stepped if a step is given]",
)
@click.option("--step", type=float, metavar="MM", help="Move along the bolt of the stepped solver.  [default: 1/3]")
@click.option("--tilt-step-deg", type=float, metavar="A", help="Turn of the stepped solver.  [default: 1]")
@click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write the result as JSON.")
@click.option("--quiet", "-q", is_flag=True, help="No progress.")
def command(
    clamp: str,
    line: str | None,
    jumper: str | None,
    method: str,
    solver: Solver | None,
    step: float | None,
    tilt_step_deg: float | None,
    json_file: Path | None,
    quiet: bool,
    **method_settings: float | None,
) -> None:
    """Assemble CLAMP (a built-in name or a TOML file) with its wires, and print where every part ends up.

    Exit code 1 if the clamp does not close on both wires, or parts meet that should not.
    """
    if solver == "exact" and (step is not None or tilt_step_deg is not None):
        raise click.UsageError("--step and --tilt-step-deg go with --solver stepped, not exact")
    from clamp3d.assembly.run import STEP, TILT_STEP, assemble
    from clamp3d.clamp.loader import load_clamp
    from clamp3d.output.files import write_json
    from clamp3d.output.run_report import run_to_dict, run_to_text

    loaded = load_clamp(clamp, line=line, jumper=jumper)
    if solver is None:
        by_step = step is not None or tilt_step_deg is not None
        solver = "stepped" if by_step else "exact" if method in ("cas", "chords") else "bisection"
    model = contact_model(method, loaded, quiet=quiet, **method_settings)
    with narrator(quiet) as tell:
        result = assemble(
            loaded,
            model,
            solver=solver,
            step=STEP if step is None else step,
            tilt_step=TILT_STEP if tilt_step_deg is None else math.radians(tilt_step_deg),
            listen=lambda waypoint: tell.line(f"{waypoint.step:14s} {waypoint.label}"),
            progress=lambda tried, distance: tell.status(f"closing: {tried} positions tried, {distance:.3f} mm"),
        )
    if json_file is not None:
        write_json(json_file, run_to_dict(result))
    click.echo(run_to_text(result))
    if not result.clamped or result.undeclared:
        raise click.exceptions.Exit(1)
