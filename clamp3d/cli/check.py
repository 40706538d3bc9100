"""``clamp3d check``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import JSON, QUIET, Source, argument, declared, group, option
from clamp3d.cli.progress import bar
from clamp3d.cli.results import write_result
from clamp3d.cli.terminal import finish_checked, show

if TYPE_CHECKING:
    from clamp3d.clamp.result import Assembly


@declared("check")
def command(
    source: Source = group(Source, source=argument(metavar="INPUT", required=True)),
    pairs: str | None = option("Only these pairs, for instance P1:P6,P2:P7.", metavar="A:B,..."),
    clearance: float | None = option("Gap that parts must keep; replaces the file's.", metavar="MM"),
    distances: bool = option("Measure every pair, not only as finely as its verdict needs."),
    full: bool = option("Also ask every model at its finest for every pair, and compare (slow)."),
    json_file: Path | None = JSON,
    html_file: Path | None = option("Write a page in 3D; - is stdout.", "--html"),
    quiet: bool = QUIET,
) -> None:
    """Check which parts of INPUT clash, touch or keep their clearance, at rest and in motion.

    INPUT is a scene file, a file or folder with the parts (STEP, GLB, 3MF, URDF, STL, OBJ, PLY, OFF), or a clamp (a
    built-in name or a TOML file), which is assembled first and measured in all its pairs. Exit code 1 if parts clash
    or the clamp does not close as it should, else 4 if a pair failed, else 3 if one is undecided, and 2 if there are
    no two parts.
    """
    from clamp3d.collide.check import check, check_full
    from clamp3d.collide.scene import Scene
    from clamp3d.output.files import write_text
    from clamp3d.output.scene_report import check_to_dict, check_to_html, check_to_text

    asked = _pairs(pairs) if pairs is not None else None
    loaded = source.load()
    run: Assembly | None = None
    if isinstance(loaded, Scene):
        scene = loaded
    else:
        from clamp3d.clamp.assemble import assemble  # takes long to import, and most scenes need none of it

        run = assemble(loaded)
        scene = run.scene
    if clearance is not None:
        scene = replace(scene, clearance=clearance)
    with bar(quiet) as report:
        result = check(scene, pairs=asked, distances=distances or run is not None, progress=report)
        complete = check_full(scene, result, progress=report) if full else None
    if run is not None:
        show("\n".join([run.status, *(str(f) for f in run.findings if f.severity == "error" and f.text != run.status)]))
    show(check_to_text(result, complete))
    if json_file is not None:
        status = {} if run is None else {"status": run.status}
        write_result(json_file, check_to_dict(result, complete) | status)
    if html_file is not None:
        write_text(html_file, check_to_html(result, complete))
    finish_checked(result.counts, finding=run is not None and not run.passed, empty=not result.work.pairs)


def _pairs(text: str) -> list[tuple[str, str]]:
    found = []
    for item in text.split(","):
        names = [name.strip() for name in item.split(":")]
        if len(names) != 2 or not all(names):
            raise click.BadParameter(f"must read like P1:P6,P2:P7, got {item!r}", param_hint="--pairs")
        found.append((names[0], names[1]))
    return found
