"""``clamp3d export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import SEQUENCE, SOURCE, UNITS, Source, declared, option
from clamp3d.cli.progress import bar
from clamp3d.cli.terminal import finish, show

if TYPE_CHECKING:
    from clamp3d.engine.result import CheckResult
    from clamp3d.output.export import Format, Layout

FORMATS = ("stl", "obj", "ply", "glb", "3mf", "step")


@declared("export")
def command(
    source: Source = SOURCE,
    format: Format | None = option("By default the suffix of FILE.", "--format", "-f", type=click.Choice(FORMATS)),
    output: Path = option(
        "A folder, or one file that ends in a format's suffix.",
        "--output",
        "-o",
        type=click.Path(path_type=Path),
        required=True,
        metavar="DIR|FILE",
    ),
    layout: Layout | None = option(
        "One file per part, or one for all.  [default: assembly for a FILE and for glb, 3mf, step; else parts]",
        type=click.Choice(["parts", "assembly"]),
    ),
    state: str | None = option(
        "Place a clamp's parts as they stand there; a step by name or number.  [default: final for an assembly; "
        "separate parts keep their own frames]",
        metavar="open|final|STEP",
    ),
    sequence: str | None = SEQUENCE,
    mesh_error: float = option("Chord error of meshes.", default=0.01, metavar="MM"),
    clashes: bool = option("Check the parts, and add what clashing parts have in common as red bodies.", "--clashes"),
    file_unit: str | None = option("Unit of the file.  [default: mm; m for glb]", "--unit", type=click.Choice(UNITS)),
    quiet: bool = option("No messages.", "--quiet", "-q"),
) -> None:
    """Write the parts of INPUT for CAD review, with a manifest beside them.

    INPUT is a clamp (a built-in name or a TOML file), a scene file, or a file with parts. Prints the paths of the
    files. World axes are Z up, a clamp's wires along Y; GLB is metres and Y up, as its specification requires.
    STEP holds true arcs, not facets. Exit code 1 if the clamp does not close on both wires; also 1, and no file, if a
    step of the sequence is blocked.
    """
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.clamp.result import Assembly
    from clamp3d.engine.scene import Scene
    from clamp3d.output.export import default_layout, destination, export

    chosen, file = destination(output, format)
    loaded: Clamp | Scene | Assembly | CheckResult = source.load()
    whole = file is not None or (layout or default_layout(chosen)) == "assembly"
    placed = isinstance(loaded, Clamp) and (whole or state is not None)
    if sequence is not None and not placed:
        raise click.UsageError("--sequence goes with a clamp, and with --state or one file for all parts")
    if clashes:
        if not isinstance(loaded, Scene):
            raise click.UsageError("--clashes goes with a scene or a file with parts, not with a clamp")
        from clamp3d.engine.check import check

        with bar(quiet) as report:
            loaded = check(loaded, depths=False, progress=report)
    if isinstance(loaded, Clamp) and placed:
        from clamp3d.clamp.assemble import assemble
        from clamp3d.clamp.states import state as find_state

        state = state or "final"
        loaded = assemble(loaded, sequence=sequence)
        label = find_state(loaded, state).label
        if not quiet:
            show(f"state {state}: {label} ({loaded.status})", err=True)
    written = export(loaded, output, format=chosen, layout=layout, state=state, mesh_error=mesh_error, unit=file_unit)
    for path in (*written.files, written.manifest):
        show(str(path))
    finish(isinstance(loaded, Assembly) and not loaded.passed)
