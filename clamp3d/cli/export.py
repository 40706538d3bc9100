"""``clamp3d export``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly
from clamp3d.cli.options import SEQUENCE, Quiet, Source, Unit, command, option
from clamp3d.cli.terminal import bar, finish, show
from clamp3d.engine.check import check
from clamp3d.engine.result import CheckResult
from clamp3d.engine.scene import Scene
from clamp3d.output.export import DEFAULT_MESH_ERROR, Format, Layout, default_layout, destination, export
from clamp3d.output.files import check_folder


@command("export")
class Export(Source, Quiet):
    """Write the parts of INPUT for CAD review, with a manifest beside them.

    INPUT is a clamp (a built-in name or a TOML file), a scene file, or a file with parts. Prints the paths of the
    files. World axes are Z up, a clamp's wires along Y; GLB is metres and Y up, as its specification requires.
    STEP holds true arcs, not facets. Exit code 1 if the clamp does not close on both wires; also 1, and no file, if a
    step of the sequence is blocked.
    """

    format: Format | None = option("By default the suffix of FILE.", "--format", "-f")
    output: Path = option(
        "A folder, or one file that ends in a format's suffix.",
        "--output",
        "-o",
        type=click.Path(path_type=Path),
        required=True,
        metavar="DIR|FILE",
    )
    layout: Layout | None = option(
        "One file per part, or one for all.  [default: assembly for a FILE and for glb, 3mf, step; else parts]"
    )
    state: str | None = option(
        "Place a clamp's parts as they stand there; a step by name or number.  [default: final for an assembly; "
        "separate parts keep their own frames]",
        metavar="open|final|STEP",
    )
    sequence: str | None = SEQUENCE
    mesh_error: float = option("Chord error of meshes.", default=DEFAULT_MESH_ERROR, metavar="MM")
    clashes: bool = option("Check the parts, and add what clashing parts have in common as red bodies.", "--clashes")
    file_unit: Unit | None = option("Unit of the file.  [default: mm; m for glb]", "--unit")

    def run(self) -> None:
        """Place the parts and write them."""
        form, file = destination(self.output, self.format)
        if file is None:
            check_folder(self.output)
        loaded = self.load()
        whole = file is not None or (self.layout or default_layout(form)) == "assembly"
        placed = isinstance(loaded, Clamp) and (whole or self.state is not None)
        if self.sequence is not None and not placed:
            raise click.UsageError("--sequence goes with a clamp, and with --state or one file for all parts")
        state = (self.state or "final") if placed else self.state
        source: Clamp | Scene | Assembly | CheckResult = self._checked(loaded) if self.clashes else loaded
        if isinstance(source, Clamp) and state is not None:
            source = self._assembled(source, state)
        settings: dict[str, Any] = {"layout": self.layout, "mesh_error": self.mesh_error, "unit": self.file_unit}
        written = export(source, self.output, format=form, state=state, **settings)
        for path in (*written.files, written.manifest):
            show(str(path))
        finish(isinstance(source, Assembly) and not source.passed)

    def _checked(self, scene: Clamp | Scene) -> CheckResult:
        """The scene with its findings."""
        if not isinstance(scene, Scene):
            raise click.UsageError("--clashes goes with a scene or a file with parts, not with a clamp")
        with bar(self.quiet) as report:
            return check(scene, depths=False, progress=report)

    def _assembled(self, clamp: Clamp, state: str) -> Assembly:
        """The assembled clamp, and on stderr the ``state`` in which it is written."""
        from clamp3d.clamp.assemble import assemble  # takes long to import, and most files need none of it

        run = assemble(clamp, sequence=self.sequence)
        label = run.waypoint(state).label
        if not self.quiet:
            show(f"state {state}: {label} ({run.status})", err=True)
        return run
