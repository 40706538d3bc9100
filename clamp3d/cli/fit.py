"""``clamp3d fit``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from clamp3d.cli.options import OUTPUT


@click.command("fit")
@click.argument("mesh", metavar="MESH", type=click.Path(path_type=Path))
@click.option(
    "--unit",
    type=click.Choice(["mm", "cm", "m", "in"]),
    help="Unit of the file's numbers.  [default: the file's own; mm for STL, OBJ, PLY]",
)
@click.option("--json", "json_file", type=OUTPUT, metavar="FILE", help="Write the result as JSON.")
@click.option(
    "--html", "html_file", type=OUTPUT, metavar="FILE", help="Write a page: the mesh, its features, their errors."
)
@click.option("--quiet", "-q", is_flag=True, help="No progress and no notes.")
def command(mesh: Path, unit: str | None, json_file: Path | None, html_file: Path | None, quiet: bool) -> None:
    """Find round grooves, cylinders and holes in MESH (STL, OBJ, PLY, GLB, 3MF, STEP) and say how well they are known.

    A mesh without any is said to have none, with exit code 0.
    """
    from clamp3d.fit.fit import fit_file
    from clamp3d.output.files import write_json, write_text
    from clamp3d.output.fit_report import fit_to_html, fit_to_text

    with _progress(show=not quiet and sys.stderr.isatty()) as tell:
        result = fit_file(mesh, unit=unit, progress=tell)
    if json_file is not None:
        write_json(json_file, result.to_dict())
    if html_file is not None:
        write_text(html_file, fit_to_html(result))
    if not quiet:
        for note in result.notes:
            click.echo(f"note: {note}", err=True)
    click.echo(fit_to_text(result))


@contextmanager
def _progress(*, show: bool) -> Iterator[Callable[[str, float], None] | None]:
    if not show:
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress, TaskID

    with Progress(console=Console(stderr=True), transient=True) as bar:
        tasks: dict[str, TaskID] = {}

        def tell(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(f"looking for {stage}", total=1.0)
            bar.update(tasks[stage], completed=fraction)

        yield tell
