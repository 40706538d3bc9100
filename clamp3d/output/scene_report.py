"""A checked scene as text, as JSON data and as one page in 3D: all three say what `CheckResult.findings` says."""

from __future__ import annotations

from dataclasses import asdict
from itertools import combinations
from typing import Any

from clamp3d import __version__
from clamp3d.collide.result import CheckResult, Work
from clamp3d.collide.verdict import Verdict
from clamp3d.output.tables import text_table
from clamp3d.output.wording import (
    counted,
    distance_text,
    finding_text,
    first_text,
    headline,
    meaning,
    titles,
    worst_first,
)

_MATRIX = 14
"""More parts than this and the matrix no longer fits a terminal."""
_ROWS = 60
_NOTES = 12
_MARK = {
    Verdict.CLEAR: ".",
    Verdict.CLEARANCE: "g",
    Verdict.CONTACT: "t",
    Verdict.CLASH: "X",
    Verdict.CONTAINED: "C",
    Verdict.ALLOWED: "a",
    Verdict.UNCERTAIN: "?",
    Verdict.FAILED: "!",
}


def check_to_dict(result: CheckResult, full: CheckResult | None = None) -> dict[str, Any]:
    """The result as JSON data; lengths in mm. Pairs that are not listed are clear."""
    data = {"clamp3d": __version__, "headline": headline(result)} | result.to_dict() | {"work": asdict(result.work)}
    if full is not None:
        data["full"] = {"pairs": [row.to_dict() for row in full.pairs], "work": asdict(full.work)}
    return data


def check_to_text(result: CheckResult, full: CheckResult | None = None) -> str:
    """The result as lines for a terminal: the headline, the findings, the matrix, all pairs."""
    t, n, names = result.thresholds, len(result.scene.parts), titles(result.scene)
    clearance = f"clearance {t.clearance:g} mm" if t.clearance else "no clearance asked for"
    moving = f" at rest and {len(result.motions)} in motion" if result.motions else ""
    counts = ", ".join(f"{count} {name}" for name, count in result.counts.items()) or "no pairs"
    lines = [
        f"{result.scene.name}: {headline(result)}",
        f"{counted(n, 'part')}, {counted(result.work.pairs, 'pair')}{moving}: {counts}; "
        f"contact up to {t.contact:g} mm, {clearance}",
    ]
    lines += [f"  note: {note}" for note in result.scene.notes[:_NOTES]]
    if len(result.scene.notes) > _NOTES:
        lines.append(f"  ... and {len(result.scene.notes) - _NOTES} more notes (--json lists all)")
    # What merely touches at rest stands in the table of pairs.
    told = [row for row in result.findings if row.verdict is not Verdict.CONTACT or row.motion is not None]
    lines += [f"  {finding_text(row, names)}" for row in told[:_ROWS]]
    if len(told) > _ROWS:
        lines.append(f"  ... and {len(told) - _ROWS} more (--json or --html lists all)")
    if 2 <= n <= _MATRIX and result.asked is None:
        lines += ["", *_matrix(result)]
    pairs = worst_first(result.pairs)[: _ROWS // 2]
    if pairs:
        table = [(f"{r.a} - {r.b}", r.verdict.value, distance_text(r.distance), r.distance.method) for r in pairs]
        lines += ["", text_table(("pair", "verdict", "distance", "by"), table, indent=2)]
    if len(result.pairs) > len(pairs):
        lines.append(f"  ... and {len(result.pairs) - len(pairs)} more (--json or --html lists all)")
    if result.motions:
        head = ("motion", "pair", "verdict", "least distance", "at t", "first contact at t", "by")
        moved = [
            (
                str(r.motion),
                f"{r.a} - {r.b}",
                r.verdict.value,
                distance_text(r.distance),
                "" if r.t is None else f"{r.t:.4f}",
                "" if r.contact_at is None else first_text(r.contact_at),
                r.distance.method,
            )
            for r in result.motions
        ]
        lines += ["", text_table(head, moved, indent=2)]
    return "\n".join([*lines, "", *work_text(result.work, full)])


def _matrix(result: CheckResult) -> list[str]:
    names = [part.name for part in result.scene.parts]
    marks = {(a, b): result.verdict(a, b) for a, b in combinations(names, 2)}
    table = [(a, *(_MARK[marks[a, b]] if (a, b) in marks else "" for b in names)) for a in names]
    used = [v for v in Verdict if v in marks.values()]
    legend = ", ".join(f"{_MARK[v]} {v.value} ({meaning(v.value, result.scene)})" for v in used)
    return [text_table(("", *names), table, indent=2), f"  {legend}"]


def work_text(work: Work, full: CheckResult | None = None) -> list[str]:
    """What the answer took, in lines."""
    decided = ", ".join(f"{count} by {level}" for level, count in work.decided.items())
    queries = ", ".join(f"{count} {level}" for level, count in work.queries.items() if count)
    lines = [
        f"decided: {decided or 'nothing'}",
        f"built: {work.meshes} meshes ({work.triangles} triangles), {work.hulls} hulls, {work.fits} fits "
        f"for {work.shapes} shapes; asked: {queries or 'nothing'}; {sum(work.seconds.values()):.2f} s",
    ]
    if full is not None:
        total = full.work
        lines.append(
            f"full model: {total.meshes} meshes, {total.triangles} triangles, {total.hulls} hulls, "
            f"{sum(total.queries.values())} queries, {sum(total.seconds.values()):.2f} s; agrees in all "
            f"{total.pairs} verdicts"
        )
    return lines


def check_to_html(result: CheckResult, full: CheckResult | None = None) -> str:
    """The result as one page in 3D that needs no other file and no network."""
    from clamp3d.output.viewer import view

    with view(result, serve=False, notes=[*result.scene.notes, *work_text(result.work, full)]) as viewer:
        return viewer.html()
