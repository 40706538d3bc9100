"""The command ``clamp3d fit``: parse, call, print."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.errors import Clamp3dError

if TYPE_CHECKING:
    from clamp3d.fit.fit import FitResult


@click.command("fit")
@click.argument("mesh", metavar="MESH", type=click.Path(path_type=Path))
@click.option(
    "--unit",
    type=click.Choice(["mm", "cm", "m", "inch"]),
    help="Unit of the file's numbers. Default: mm for STL, OBJ, PLY (they carry none), the file's own for 3MF, m for GLB.",
)
@click.option("--json", "json_file", metavar="FILE", type=click.Path(path_type=Path), help="Write the result as JSON.")
@click.option("--html", "html_file", metavar="FILE", type=click.Path(path_type=Path), help="Write a page with the mesh.")
@click.option("--quiet", is_flag=True, help="No progress and no notes on stderr.")
def fit(mesh: Path, unit: str | None, json_file: Path | None, html_file: Path | None, quiet: bool) -> None:
    """Find grooves, cylinders and holes in MESH (STL, OBJ, PLY, GLB, 3MF).

    Prints radius, arc, length and error bound of each; lengths in mm. Exit code 0 also when nothing is found, 2 for
    bad input.
    """
    try:
        with _progress(show=not quiet and sys.stderr.isatty()) as tell:
            from clamp3d.fit.fit import fit_file

            result = fit_file(mesh, unit=unit, progress=tell)
        if json_file is not None:
            _write(json_file, json.dumps(result.to_dict(), indent=1) + "\n")
        if html_file is not None:
            from clamp3d.fit.page import page

            _write(html_file, page(result))
    except Clamp3dError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(2)
    if not quiet:
        for note in result.notes:
            click.echo(f"note: {note}", err=True)
    click.echo(table(result))


def table(result: FitResult) -> str:
    """The features as text, one line each."""
    if not result.features:
        return f"{result.mesh.name}: no groove, no cylinder, no hole in {len(result.mesh.faces)} triangles"
    head = ("", "what", "radius", "+-", "arc deg", "length", "axis at x, y, z", "axis direction", "rms", "bound")
    rows = [head]
    for f in result.features:
        what = {"G": "groove", "C": "cylinder", "H": "hole"}[f.name[0]]
        if not getattr(f, "through", True):
            what = "blind hole"
        x, y, z = f.T_part_feature[:3, 3]
        i, j, k = f.T_part_feature[:3, 2]
        arc = "360" if f.half_angle > 3.14159 else f"{2 * f.half_angle * 57.29577951308232:.3f}"
        rows.append(
            (
                f.name,
                what,
                f"{f.radius:.4f}",
                f"{f.radius_std:.1e}",
                arc,
                f"{f.length:.4f}",
                f"{x:.4f}, {y:.4f}, {z:.4f}",
                f"{i:+.5f}, {j:+.5f}, {k:+.5f}",
                f"{f.residual_rms:.1e}",
                f"{f.error_bound:.4f}",
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    left = {0, 1}
    return "\n".join(
        "  ".join(c.ljust(w) if i in left else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True)))
        for row in rows
    )


@contextlib.contextmanager
def _progress(*, show: bool) -> Iterator[Callable[[str, float], None] | None]:
    if not show:
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        tasks = {}

        def tell(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=fraction)

        yield tell


def _write(file: Path, text: str) -> None:
    """Write the whole file or nothing: into a temporary file beside it, then renamed."""
    from clamp3d.errors import InputError

    try:
        handle, temporary = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    except OSError as error:
        raise InputError(f"cannot write {file}: {error.strerror}") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
        os.replace(temporary, file)
    except OSError as error:
        os.unlink(temporary)
        raise InputError(f"cannot write {file}: {error.strerror}") from None
    except BaseException:
        os.unlink(temporary)
        raise
