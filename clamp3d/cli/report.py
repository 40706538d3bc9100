"""``clamp3d report``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clamp3d.cli.options import CLEARANCE, FOLDER, METHOD, QUIET, SOURCE, Method, Source, declared, option
from clamp3d.cli.progress import narrated, narrator
from clamp3d.cli.terminal import finish, show
from clamp3d.errors import need

if TYPE_CHECKING:
    from clamp3d.clamp.result import Assembly
    from clamp3d.engine.scene import Scene


@declared("report")
def command(
    source: Source = SOURCE,
    method: Method = METHOD,
    clearance: float | None = CLEARANCE,
    output: Path = option("Folder for the three files.", "--output", "-o", type=FOLDER, required=True, metavar="DIR"),
    quiet: bool = QUIET,
) -> None:
    """Write a report for a reviewer into DIR: report.html, report.json, pairs.csv.

    INPUT is a clamp (a built-in name or a TOML file), which is assembled first, a scene file, or a file with parts;
    --method and --solver go with a clamp. Prints the paths of the files. Exit codes are those of check; 1
    also if a clamp does not close on both wires, or parts of it meet that should not.
    """
    need("matplotlib", "a report")
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.output.files import check_folder
    from clamp3d.output.report import make_report
    from clamp3d.output.report_page import write_report

    settings = method.settings()
    check_folder(output)
    loaded = source.load()
    if isinstance(loaded, Clamp):
        subject: Assembly | Scene = narrated(loaded, method.model(loaded, quiet=quiet), settings, quiet)
    else:
        method.refuse()
        subject = loaded
    with narrator(quiet) as narrate:
        review = make_report(subject, clearance=clearance, progress=narrate)
        paths = write_report(review, output, progress=narrate)
    for path in paths:
        show(str(path))
    if review.assembly is not None:
        finish(not review.passed)
    else:
        finish(verdicts={row.result.verdict for row in (*review.rows, *review.motions)})
