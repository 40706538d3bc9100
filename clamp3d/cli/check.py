"""``clamp3d check``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from clamp3d.cli.options import JSON, OUTPUT, QUIET, number
from clamp3d.cli.progress import bar
from clamp3d.cli.terminal import finish, show


@click.command("check")
@click.argument("scene", metavar="SCENE.toml", type=click.Path(path_type=Path))
@click.option("--pairs", metavar="A:B,...", help="Only these pairs, for instance P1:P6,P2:P7.")
@click.option("--clearance", type=number, metavar="MM", help="Gap that parts must keep; replaces the file's.")
@click.option("--full", is_flag=True, help="Also ask every model at its finest for every pair, and compare (slow).")
@JSON
@click.option("--html", "html_file", type=OUTPUT, metavar="FILE", help="Write the result as a page.")
@QUIET
def command(
    scene: Path,
    pairs: str | None,
    clearance: float | None,
    full: bool,
    json_file: Path | None,
    html_file: Path | None,
    quiet: bool,
) -> None:
    """Check which parts of a scene clash, touch or keep their clearance, at rest and in motion.

    Each pair is measured only as finely as its verdict needs. Exit code 1 if parts clash.
    """
    from clamp3d.collide.check import check, check_full
    from clamp3d.output.files import write_json, write_text
    from clamp3d.output.scene_report import check_to_dict, check_to_html, check_to_text
    from clamp3d.scenefile.file import load_scene

    loaded = load_scene(scene)
    if clearance is not None:
        loaded = replace(loaded, clearance=clearance)
    asked = _pairs(pairs) if pairs is not None else None
    with bar(quiet) as report:
        result = check(loaded, pairs=asked, progress=report)
        complete = check_full(loaded, result, progress=report) if full else None
    if json_file is not None:
        write_json(json_file, check_to_dict(result, complete))
    if html_file is not None:
        write_text(html_file, check_to_html(result, complete))
    show(check_to_text(result, complete))
    finish(finding=not result.clean, undecided="uncertain" in result.counts)


def _pairs(text: str) -> list[tuple[str, str]]:
    found = []
    for item in text.split(","):
        names = [name.strip() for name in item.split(":")]
        if len(names) != 2 or not all(names):
            raise click.BadParameter(f"must read like P1:P6,P2:P7, got {item!r}", param_hint="--pairs")
        found.append((names[0], names[1]))
    return found
