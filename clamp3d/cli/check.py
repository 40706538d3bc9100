"""``clamp3d check`` and ``clamp3d accept``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import (
    INPUT_FILE,
    JSON,
    QUIET,
    Output,
    Source,
    argument,
    complete_inputs,
    declared,
    group,
    number,
    option,
)
from clamp3d.cli.progress import bar
from clamp3d.cli.terminal import finish, save, show
from clamp3d.errors import InputError

if TYPE_CHECKING:
    from clamp3d.clamp.result import Assembly
    from clamp3d.engine.allowed import Allowed
    from clamp3d.engine.scene import Scene

BCF = Output((".bcfzip", ".bcf"))


def name_pairs(text: str) -> list[tuple[str, str]]:
    """Pairs of names, as the type of an option."""
    pairs = []
    for item in text.split(","):
        a, _, b = (name.strip() for name in item.partition(":"))
        if not a or not b or ":" in b:
            raise click.BadParameter(f"must read like P1:P6,P2:P7, got {item!r}")
        pairs.append((a, b))
    return pairs


def allowed_rule(text: str) -> Allowed:
    """A rule about contacts that are meant, as the type of an option."""
    from clamp3d.engine.allowed import Allowed

    rule, _, depth = text.partition("=")
    a, colon, b = rule.partition(":")
    overlap = number(depth) if depth else 0.0
    return Allowed(a, b, overlap) if colon else Allowed(overlap=overlap, relation=rule)


@dataclass(frozen=True)
class Files:
    """Where the result is written."""

    json_file: Path | None = JSON
    csv_file: Path | None = option("Write the findings as CSV; - is stdout.", "--csv")
    bcf_file: Path | None = option("Write the findings as BCF 2.1 topics, for review tools.", "--bcf", type=BCF)
    html_file: Path | None = option("Write a page in 3D; - is stdout.", "--html")


@declared("check")
def command(
    source: Source = group(Source, source=argument(metavar="INPUT", required=True, shell_complete=complete_inputs)),
    pairs: list[tuple[str, str]] | None = option(
        "Only these pairs, for instance P1:P6,P2:P7.", type=name_pairs, metavar="A:B,..."
    ),
    allow: tuple[Allowed, ...] = option(
        "Contact that is meant: in a kind of fit (running, press, thread, duplicate), or of parts by name or pattern, "
        "and up to which overlap. May be repeated.",
        multiple=True,
        type=allowed_rule,
        metavar="FIT|A:B[=MM]",
    ),
    clearance: float | None = option("Gap that parts must keep; replaces the file's.", metavar="MM"),
    distances: bool = option("Measure every pair, not only as finely as its verdict needs."),
    baseline: Path | None = option(
        "Compare with this result of an earlier check --json; then only new findings count for the exit code.",
        type=INPUT_FILE,
        metavar="LAST.json",
    ),
    files: Files = group(Files),
    quiet: bool = QUIET,
) -> None:
    """Check which parts of INPUT clash, touch or keep their clearance, at rest and in motion.

    INPUT is a scene file, a file or folder with the parts (STEP, GLB, 3MF, URDF, STL, OBJ, PLY, OFF), or a clamp (a
    built-in name or a TOML file), which is assembled first and measured in all its pairs. Findings with one cause are
    one line; those that `clamp3d accept` has written to INPUT.accepted.toml are not counted. Exit code 1 if parts
    clash or the clamp does not close as it should, else 4 if a pair failed, else 3 if one is undecided, and 2 if there
    are no two parts.
    """
    from clamp3d.engine.check import check
    from clamp3d.output.baseline import compare, groups_csv
    from clamp3d.output.groups import accepted_file, grouped, read_accepted
    from clamp3d.output.scene_report import check_to_dict, check_to_text

    scene, run = _scene(source)
    clearance = scene.clearance if clearance is None else clearance
    scene = replace(scene, clearance=clearance, allowed=(*scene.allowed, *allow))
    accepted = read_accepted(accepted_file(source.source))
    compare(scene, (), baseline, accepted)  # a file that cannot be read is reported before the work
    with bar(quiet) as report:
        result = check(scene, pairs=pairs, distances=distances or run is not None, progress=report)
    groups = grouped(result)
    comparison = compare(scene, groups, baseline, accepted)
    if run is not None:
        show("\n".join([run.status, *(f.text for f in run.findings if f.severity == "error" and f.text != run.status)]))
    show(check_to_text(result, comparison, accepted))
    status = {} if run is None else {"status": run.status}
    save(files.json_file, lambda: check_to_dict(result, comparison) | status)
    save(files.csv_file, lambda: groups_csv(groups, comparison))
    if files.html_file is not None:
        from clamp3d.output.viewer import check_to_html  # a page alone needs meshcat

        save(files.html_file, lambda: check_to_html(result))
    if files.bcf_file is not None:
        from clamp3d.output.bcf import write_bcf

        write_bcf(result, files.bcf_file)
    finish(run is not None and not run.passed, verdicts={group.verdict for group in comparison.open(groups)})
    if not result.work.pairs:
        raise InputError("there is no pair of parts to judge")


def _scene(source: Source) -> tuple[Scene, Assembly | None]:
    """The scene to check, and the clamp that it is of."""
    from clamp3d.engine.scene import Scene

    loaded = source.load()
    if isinstance(loaded, Scene):
        return loaded, None
    from clamp3d.clamp.assemble import assemble  # takes long to import, and most scenes need none of it

    run = assemble(loaded)
    return run.scene, run


@declared("accept")
def accept_command(
    source: str = argument(metavar="INPUT", shell_complete=complete_inputs),
    identifiers: tuple[str, ...] = argument(metavar="ID...", nargs=-1, required=True),
    why: str = option("The reason.", required=True, metavar="TEXT"),
    who: str = option("Who accepts it.  [default: the login name]", default="", show_default=False, metavar="NAME"),
) -> None:
    """Accept findings of INPUT by their identifiers, as `clamp3d check INPUT` prints them, with the reason.

    They are written to INPUT.accepted.toml beside the file, and no longer count for the exit code of check.
    """
    from clamp3d.output.groups import accept, accepted_file

    path = accepted_file(source)
    entries = accept(path, identifiers, why=why, who=who)
    show(f"{path}: {len(entries)} accepted" + (f", {n} before" if (n := len(set(identifiers)) - len(entries)) else ""))
