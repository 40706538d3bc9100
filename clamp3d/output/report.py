"""A report for a reviewer, of a checked scene or of an assembled clamp: report.html, report.json and pairs.csv.

The findings are gathered here, all distances and verdicts from the engine; `report_page` writes them down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from clamp3d.checks import function, instance
from clamp3d.checks import path as checked_path
from clamp3d.clamp.contact import Contact
from clamp3d.clamp.result import Assembly
from clamp3d.engine.check import check
from clamp3d.engine.result import BAD, CheckResult, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Thresholds, Verdict
from clamp3d.output import assembly_steps
from clamp3d.output.groups import Accepted, Group, grouped
from clamp3d.output.pages import render
from clamp3d.output.wording import distance_text, group_text, headline, sentence, titles
from clamp3d.scenefile.check import opened

Severity = Literal["error", "warning", "note", "ok"]

CLEARANCE = 5.0
"""Gap in mm below which two parts of a clamp are listed as near, if none is chosen."""
LISTED = 400
"""With more rows than these the page leaves out those that are clear."""

SEVERITIES: dict[Severity, str] = {
    "error": "must be corrected",
    "warning": "to be checked: undecided within the error bound, or apart though declared to touch in an arc",
    "note": "worth knowing",
    "ok": "as it should be",
}


@dataclass(frozen=True, slots=True, eq=False)
class PairRow(PairResult):
    """A pair as a reviewer reads of it: the engine's row, what it amounts to, and what a clamp knows beyond it."""

    severity: Severity = "ok"
    remark: str = ""
    contact: Contact | None = None

    @classmethod
    def of(cls, row: PairResult) -> PairRow:
        """A row of the engine."""
        return cls(**{key.name: getattr(row, key.name) for key in fields(row)}, severity=_severity(row.verdict))

    @property
    def name(self) -> str:
        """Short name of the pair."""
        return f"{self.a}-{self.b}"


@dataclass(frozen=True, slots=True)
class Finding:
    """What a reviewer has to look at: ``text`` in words, the pair that it is about, if any, and its group."""

    severity: Severity
    text: str
    row: PairRow | None = None
    group: Group | None = None


@dataclass(frozen=True, eq=False)
class Report:
    """Everything that a report says.

    Attributes
    ----------
    scene : Scene
        Parts, thresholds and motions.
    headline : str
        The result in one line.
    passed : bool
        Whether nothing must be corrected.
    findings : tuple of Finding
        The worst first.
    rows, motions : tuple of PairRow
        The pairs at rest and in motion.
    n_pairs : int
        Number of all pairs; those without a row are clear, parted by their boxes.
    assembly : Assembly or None
        The clamp, with its way together.
    """

    scene: Scene
    headline: str
    passed: bool
    findings: tuple[Finding, ...]
    rows: tuple[PairRow, ...]
    motions: tuple[PairRow, ...]
    n_pairs: int
    assembly: Assembly | None = None

    @cached_property
    def steps(self) -> tuple[assembly_steps.StepRow, ...]:
        """How a clamp comes together."""
        return tuple(assembly_steps.step_rows(self.assembly)) if self.assembly else ()

    @cached_property
    def tightening(self) -> list[dict[str, float]]:
        """The stages of the nut's own step."""
        return list(assembly_steps.tightening(self.assembly)) if self.assembly else []

    def items(self, template: str) -> list[str]:
        """The items of a text in ``templates``, one a line: what the numbers stand on, or what they leave out."""
        names = {name: " ".join(title.split()) for name, title in titles(self.scene).items()}
        lines = render(template, scene=self.scene, assembly=self.assembly, titles=names).splitlines()
        return [line for line in lines if line.strip()]

    @property
    def settings(self) -> dict[str, str]:
        """The settings, in words."""
        t = self.scene.thresholds
        of_clamp = {} if self.assembly is None else {"method": self.assembly.method, "solver": self.assembly.solver}
        clearance = f"{t.clearance:g} mm" if t.clearance else "not set"
        return of_clamp | {"contact": f"gap or overlap up to {t.contact:g} mm", "clearance": clearance}


def report(
    source: Any,
    folder: str | Path,
    *,
    clearance: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[Path]:
    """Check all pairs and write a report: a page with pictures, its data as JSON, and the pairs as CSV.

    The distances of a scene are those of `check`, as fine as the verdicts need; a clamp's are exact.

    Parameters
    ----------
    source
        What to report on: what `check` takes, its result, or an assembly.
    folder : str or Path
        Where report.html, report.json and pairs.csv go; all of them or none.
    clearance : float, optional
        Gap in mm that parts must keep; by default the scene's own, 5 mm for a clamp.
    progress : callable, optional
        Called with what is being done.

    Returns
    -------
    list of Path
        The three files.

    Raises
    ------
    InputError
        For what cannot be read, a bad clearance, or a folder that cannot be written to.

    Examples
    --------
    >>> import tempfile
    >>> from clamp3d.geometry import shapes
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in report(Scene().add("pin", shapes.cylinder(5.0, 40.0)), folder)]
    ['report.html', 'report.json', 'pairs.csv']
    """
    from clamp3d.output.report_page import write_report

    folder = checked_path("folder", folder)
    subject = source if isinstance(source, CheckResult) else opened(source)
    review = make_report(subject, clearance=clearance, progress=progress)
    return write_report(review, folder, progress=progress or (lambda step: None))


def make_report(
    source: Scene | Assembly | CheckResult,
    *,
    clearance: float | None = None,
    accepted: Mapping[str, Accepted] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Report:
    """What `report` writes down; findings of a scene that are ``accepted``, by their identifiers, say so.

    >>> from clamp3d.clamp.assemble import assemble
    >>> clamp_report = make_report(assemble())
    >>> len(clamp_report.rows), clamp_report.passed
    (21, True)
    """
    instance("source", source, Scene, Assembly, CheckResult)
    function("progress", progress)
    if isinstance(source, Assembly):
        scene = replace(source.scene, clearance=CLEARANCE if clearance is None else clearance)
        return _of_assembly(source, scene)
    if isinstance(source, CheckResult) and clearance is None:
        return _of_result(source, accepted or {})
    scene = source.scene if isinstance(source, CheckResult) else source
    on_stage = None if progress is None else lambda stage, done, of: progress(f"{stage}: {done} of {of}")
    scene = scene if clearance is None else replace(scene, clearance=clearance)
    return _of_result(check(scene, progress=on_stage), accepted or {})


def _of_result(result: CheckResult, accepted: Mapping[str, Accepted]) -> Report:
    scene = result.scene
    names, findings = titles(scene), list[Finding]()
    for group in grouped(result):
        text = (f"{accepted[group.id]}: " if group.id in accepted else "") + group_text(group, names)
        findings.append(Finding(_severity(group.verdict), text, PairRow.of(group.worst), group))
    at_rest, moving = (tuple(map(PairRow.of, rows)) for rows in (result.pairs, result.motions))
    return Report(scene, headline(result), result.clean, tuple(findings), at_rest, moving, result.work.pairs)


def _of_assembly(assembly: Assembly, scene: Scene) -> Report:
    different = {(d.a, d.b) for d in assembly.matrix_differences if not d.measured}
    rows = tuple(_contact_row(scene, contact, (contact.a, contact.b) in different) for contact in assembly.contacts)
    findings = [
        Finding(f.severity, f.text, next((r for r in rows if (r.a, r.b) == (f.a, f.b)), None))
        for f in assembly.findings
    ]
    named = {finding.row for finding in findings}
    names = titles(scene)
    for row in sorted(rows, key=lambda row: row.distance.upper):
        if row.severity != "ok" and row not in named:
            text = f"{names[row.a]} and {names[row.b]} {row.remark}: {distance_text(row.distance)}"
            findings.append(Finding(row.severity, text if row.remark else sentence([row], names), row))
    findings.sort(key=lambda finding: list(SEVERITIES).index(finding.severity))
    passed = assembly.clamped and not any(finding.severity == "error" for finding in findings)
    line = "Clamped: both wires are held and nothing meets that should not."
    if not passed:
        line = f"Not passed: {'see the findings' if assembly.clamped else assembly.status}."
    elif any(f.severity == "warning" for f in findings):
        line += " Some verdicts are uncertain: see the findings."
    return Report(scene, line, passed, tuple(findings), rows, (), len(rows), assembly)


def _contact_row(scene: Scene, contact: Contact, apart: bool) -> PairRow:
    """A pair of a clamp: the engine's verdict; ``apart`` if it is declared to touch and does not."""
    a, b = contact.a, contact.b
    verdict = scene.thresholds.verdict(contact.distance, scene.allowance(a, b))
    if verdict is Verdict.CLASH:
        verdict = check(scene, pairs=[(a, b)]).verdict(a, b)
    severity, remark = _severity(verdict), ""
    if verdict is Verdict.CONTACT:
        severity, remark = "error", "touch though the connection matrix declares no connection"
    elif verdict is Verdict.CLEARANCE:
        remark = f"are nearer than {scene.clearance:g} mm, and nothing joins them"
    elif apart and severity == "ok":
        severity, remark = "warning" if contact.declared == 3 else "note", "are declared to touch, and do not"
    elif contact.declared == 3 and Thresholds(scene.contact).verdict(contact.distance) is Verdict.UNCERTAIN:
        severity, remark = "warning", "touch or not, within the error bound of the method"
    return PairRow(a, b, verdict, contact.distance, severity=severity, remark=remark, contact=contact)


def _severity(verdict: Verdict) -> Severity:
    if verdict in BAD or verdict is Verdict.FAILED:
        return "error"
    if verdict is Verdict.UNCERTAIN:
        return "warning"
    return "note" if verdict in (Verdict.CONTACT, Verdict.CLEARANCE) else "ok"
