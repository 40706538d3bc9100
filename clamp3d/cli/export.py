"""``clamp3d export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import clamp_arguments

if TYPE_CHECKING:
    from clamp3d.output.export import Format, Layout

FORMATS = ("stl", "obj", "ply", "glb", "3mf", "step")


@click.command("export")
@clamp_arguments
@click.option("--format", "-f", type=click.Choice(FORMATS), required=True, help="STEP holds true arcs, not facets.")
@click.option("--output", "-o", type=click.Path(file_okay=False, path_type=Path), required=True, metavar="DIR")
@click.option(
    "--layout",
    type=click.Choice(["parts", "assembly"]),
    help="One file per part, or one for all.  [default: assembly for glb, 3mf, step; else parts]",
)
@click.option(
    "--state",
    metavar="open|final|STEP",
    help="Place the parts as they stand there; a step by name or number.  [default: final for an assembly; "
    "separate parts keep their own frames]",
)
@click.option("--mesh-error", type=float, default=0.01, show_default=True, metavar="MM", help="Chord error of meshes.")
@click.option("--unit", type=click.Choice(["mm", "cm", "m", "in"]), help="Unit of the file.  [default: mm; m for glb]")
@click.option("--quiet", "-q", is_flag=True, help="No messages.")
def command(
    clamp: str,
    line: str | None,
    jumper: str | None,
    format: Format,
    output: Path,
    layout: Layout | None,
    state: str | None,
    mesh_error: float,
    unit: str | None,
    quiet: bool,
) -> None:
    """Write the parts of CLAMP (a built-in name or a TOML file) for CAD review, with a manifest beside them.

    Prints the paths of the files. World axes are Z up with the wires along Y; GLB is metres and Y up, as its
    specification demands.
    """
    from clamp3d.clamp.loader import load_clamp
    from clamp3d.output.export import default_layout, export

    loaded = load_clamp(clamp, line=line, jumper=jumper)
    layout = layout or default_layout(format)
    if state is None and layout == "assembly":
        state = "final"
    poses = status = None
    if state is not None:
        from clamp3d.baselines.cas import Cas
        from clamp3d.clamp.assemble import assemble
        from clamp3d.clamp.states import state as find_state

        run = assemble(loaded, Cas())
        waypoint = find_state(run, state)
        poses = {name: pose.T() for name, pose in waypoint.poses.items()}
        status = run.status
        if not quiet:
            click.echo(f"state {state}: {waypoint.label} ({status})", err=True)
    written = export(
        loaded,
        format=format,
        output=output,
        poses=poses,
        state=state,
        status=status,
        layout=layout,
        mesh_error=mesh_error,
        unit=unit,
    )
    for path in (*written.files, written.manifest):
        click.echo(str(path))
