"""``clamp3d export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import FOLDER, UNITS, Source, clamp_argument, number
from clamp3d.cli.terminal import show

if TYPE_CHECKING:
    from clamp3d.output.export import Format, Layout

FORMATS = ("stl", "obj", "ply", "glb", "3mf", "step")


@click.command("export")
@clamp_argument
@click.option("--format", "-f", type=click.Choice(FORMATS), required=True, help="STEP holds true arcs, not facets.")
@click.option("--output", "-o", type=FOLDER, required=True, metavar="DIR")
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
@click.option("--mesh-error", type=number, default=0.01, show_default=True, metavar="MM", help="Chord error of meshes.")
@click.option("--unit", type=click.Choice(UNITS), help="Unit of the file.  [default: mm; m for glb]")
@click.option("--quiet", "-q", is_flag=True, help="No messages.")
def command(
    source: Source,
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
    from clamp3d.output.export import default_layout, export

    loaded = source.clamp()
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
            show(f"state {state}: {waypoint.label} ({status})", err=True)
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
        show(str(path))
