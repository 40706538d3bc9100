"""``clamp3d report``."""

from __future__ import annotations

from pathlib import Path

from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly
from clamp3d.cli.options import CLEARANCE, FOLDER, Method, Source, command, option
from clamp3d.cli.terminal import bar, finish, show
from clamp3d.engine.scene import Scene
from clamp3d.errors import need
from clamp3d.output.groups import accepted_file, read_accepted


@command("report")
class Report(Source, Method):
    """Write a report for a reviewer into DIR: report.html, report.json, pairs.csv.

    INPUT is a clamp (a built-in name or a TOML file), which is assembled first, a scene file, or a file with parts;
    --method and --solver go with a clamp. Prints the paths of the files. Exit codes are those of check; 1
    also if a clamp does not close on both wires, or parts of it meet that should not.
    """

    clearance: float | None = CLEARANCE
    output: Path = option("Folder for the three files.", "--output", "-o", type=FOLDER, required=True, metavar="DIR")

    def run(self) -> None:
        """Review and write."""
        need("matplotlib", "a report")
        from clamp3d.output.files import check_folder
        from clamp3d.output.report import make_report
        from clamp3d.output.report_page import write_report

        settings, accepted = self.settings(), read_accepted(accepted_file(self.source))
        check_folder(self.output)
        subject: Assembly | Clamp | Scene = self.load()
        if isinstance(subject, Clamp):
            subject = self.assemble(subject, self.model(subject), settings)
        else:
            self.refuse_method()
        with bar(self.quiet) as report:
            review = make_report(subject, clearance=self.clearance, accepted=accepted, progress=report)
            paths = write_report(review, self.output, progress=report)
        for path in paths:
            show(str(path))
        groups = [f.group for f in review.findings if f.group is not None and f.group.id not in accepted]
        verdicts = {row.verdict for row in (review.rows if review.assembly else groups)}
        finish(review.assembly is not None and not review.passed, verdicts=verdicts)
