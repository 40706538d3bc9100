"""``clamp3d check`` and ``clamp3d accept``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from clamp3d.checks import note_read, short
from clamp3d.clamp.loader import builtin_clamps
from clamp3d.clamp.result import Assembly
from clamp3d.cli.options import JSON, SOURCE, Output, Quiet, Source, argument, command, couples, number, option
from clamp3d.cli.terminal import bar, finish, save, show
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.check import check
from clamp3d.errors import InputError
from clamp3d.output.baseline import compare, groups_csv
from clamp3d.output.groups import accept, accepted_file, grouped, read_accepted
from clamp3d.output.scene_report import check_to_dict, check_to_text
from clamp3d.scenefile.check import opened


def name_pairs(text: str) -> list[tuple[str, str]]:
    """Pairs of names, as the type of an option."""
    return couples(text, ":", "P1:P6,P2:P7")


def allowed_rule(text: str) -> Allowed:
    """A rule about contacts that are meant, as the type of an option."""
    rule, equals, depth = text.partition("=")
    a, colon, b = rule.partition(":")
    overlap = number(depth) if equals else 0.0
    return Allowed(a, b, overlap) if colon else Allowed(overlap=overlap, relation=rule)


@command("check")
class Check(Source, Quiet):
    """Check which parts of INPUT clash, touch or keep their clearance, at rest and in motion.

    INPUT is a scene file, a file or folder with the parts (STEP, GLB, 3MF, URDF, STL, OBJ, PLY, OFF), or a clamp (a
    built-in name or a TOML file), which is assembled first and measured in all its pairs. Findings with one cause are
    one line; those that `clamp3d accept` has written to INPUT.accepted.toml are not counted. Exit code 1 if parts
    clash or the clamp does not close as it should, else 4 if a pair failed, else 3 if one is undecided, and 2 for
    fewer than two parts.
    """

    source: str = argument(metavar="INPUT", required=True, type=SOURCE)
    pairs: list[tuple[str, str]] | None = option(
        "Only these pairs, for instance P1:P6,P2:P7.", type=name_pairs, metavar="A:B,..."
    )
    allow: tuple[Allowed, ...] = option(
        "Contact that is meant: in a kind of fit (running, press, thread, duplicate), or of parts by name or pattern, "
        "and up to which overlap. May be repeated.",
        multiple=True,
        type=allowed_rule,
        metavar="FIT|A:B[=MM]",
    )
    clearance: float | None = option("Gap that parts must keep; replaces the file's.", metavar="MM")
    distances: bool = option("Measure every pair, not only as finely as its verdict needs, and depths with more work.")
    baseline: Path | None = option(
        "Compare with this result of an earlier check --json; then only new findings count for the exit code.",
        type=click.Path(dir_okay=False, path_type=Path),  # no INPUT_FILE: the new result may replace it
        metavar="LAST.json",
    )
    json_file: Path | None = JSON
    csv_file: Path | None = option("Write the findings as CSV; - is stdout.", "--csv")
    bcf_file: Path | None = option(
        "Write the findings as BCF 2.1 topics, for review tools.", "--bcf", type=Output((".bcfzip", ".bcf"))
    )
    html_file: Path | None = option("Write a page in 3D; - is stdout.", "--html")

    def run(self) -> None:
        """Check, print and write."""
        note_read([accepted_file(self.source)])
        subject = opened(self.load())
        assembled = subject if isinstance(subject, Assembly) else None
        scene = subject.scene if isinstance(subject, Assembly) else subject
        clearance = scene.clearance if self.clearance is None else self.clearance
        scene = replace(scene, clearance=clearance, allowed=(*scene.allowed, *self.allow))
        accepted = read_accepted(accepted_file(self.source))
        compare(scene, (), self.baseline, accepted)  # a file that cannot be read is reported before the work
        with bar(self.quiet) as report:
            is_measured = self.distances or assembled is not None
            result = check(scene, pairs=self.pairs, distances=is_measured, progress=report)
        groups = grouped(result)
        comparison = compare(scene, groups, self.baseline, accepted)
        status = {}
        if assembled is not None:
            status = {"status": assembled.status}
            errors = (f.text for f in assembled.findings if f.severity == "error" and f.text != assembled.status)
            show("\n".join([assembled.status, *errors]))
        show(check_to_text(result, comparison))
        save(self.json_file, lambda: check_to_dict(result, comparison) | status)
        save(self.csv_file, lambda: groups_csv(groups, comparison))
        if self.html_file is not None:
            from clamp3d.output.viewer import check_to_html  # a page alone needs meshcat

            save(self.html_file, lambda: check_to_html(result))
        if self.bcf_file is not None:
            from clamp3d.output.bcf import write_bcf

            write_bcf(result, self.bcf_file, accepted)
        verdicts = {group.verdict for group in comparison.open(groups)}
        finish(assembled is not None and not assembled.passed, verdicts=verdicts)
        if not result.work.pairs:
            raise InputError("fewer than two parts: nothing to check")


@command("accept")
class Accept:
    """Accept findings of INPUT by their identifiers, as `clamp3d check INPUT` prints them, with the reason.

    They are written to INPUT.accepted.toml beside the file, and no longer count for the exit code of check.
    """

    source: str = argument(metavar="INPUT", type=SOURCE)
    identifiers: tuple[str, ...] = argument(metavar="ID...", nargs=-1, required=True)
    why: str = option("The reason.", required=True, metavar="TEXT")
    who: str = option("Who accepts it.  [default: the login name]", default="", show_default=False, metavar="NAME")

    def run(self) -> None:
        """Write them."""
        if not Path(self.source).exists() and self.source not in builtin_clamps():
            raise InputError(f"{short(Path(self.source))}: no such file or folder, so it has no findings")
        path = accepted_file(self.source)
        entries = accept(path, self.identifiers, why=self.why, who=self.who)
        before = len(set(self.identifiers)) - len(entries)
        show(f"{path}: {len(entries)} accepted" + (f", {before} already there and left as before" if before else ""))
