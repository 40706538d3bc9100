"""``clamp3d reproduce``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import JSON, QUIET, declared
from clamp3d.cli.terminal import save, show


@declared("reproduce")
def command(
    json_file: Path | None = JSON,
    quiet: bool = QUIET,
) -> None:
    """Print Tables 1-5 of the paper beside this program's values, with the difference of each."""
    from clamp3d.bench.reproduce import reproduce
    from clamp3d.bench.reproduce_report import reproduction_to_dict, reproduction_to_text

    tables = reproduce(lambda message: None if quiet else click.echo(message, err=True))
    save(json_file, lambda: reproduction_to_dict(tables))
    show(reproduction_to_text(tables))
