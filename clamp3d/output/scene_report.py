"""A checked scene as text, as JSON data and as one page in 3D: all three list the groups of its findings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from clamp3d import __version__
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.result import CheckResult, PairResult, Work
from clamp3d.engine.verdict import Verdict
from clamp3d.output.baseline import Comparison, compare
from clamp3d.output.groups import Group, grouped
from clamp3d.output.tables import text_table
from clamp3d.output.wording import by_group, contact_text, counted, distance_text, group_text, headline, titles

_LISTED, _PAIRS, _NOTES = 60, 30, 12
"""Groups, pairs and notes that the text lists at most."""


def check_to_dict(result: CheckResult, comparison: Comparison | None = None) -> dict[str, Any]:
    """The result as JSON data; lengths in mm. Pairs that are not listed are clear."""
    comparison = comparison or compare(result.scene, grouped(result))
    groups = [
        g.to_dict() | {"status": comparison.status[g.id], "changed": comparison.changed.get(g.id, ())}
        for g in grouped(result)
    ]
    data: dict[str, Any] = {"clamp3d": __version__, "headline": headline(result), "groups": groups}
    if comparison.has_baseline:
        data["gone"] = list(comparison.gone)
        data["moved_mm"] = {name: mm if math.isfinite(mm) else None for name, mm in comparison.moved.items()}
    data["rules"] = [{"rule": str(rule), "pairs": count} for rule, count in _rules(result).items()]
    return data | result.to_dict() | {"work": asdict(result.work)}


def check_to_text(result: CheckResult, comparison: Comparison | None = None) -> str:
    """The result as lines for a terminal: the headline, the groups of findings, the pairs, the motions."""
    comparison = comparison or compare(result.scene, grouped(result))
    lines = [f"{result.scene.name}: {headline(result)}", _counts(result)]
    lines += _cut([f"  note: {note}" for note in result.scene.notes], _NOTES, "more notes (--json lists all)")
    rules = [f"  allowed: {rule}, {counted(count, 'pair')}" for rule, count in _rules(result).items()]
    lines += _cut(rules, _NOTES, "more rules")
    lines += comparison_text(comparison)
    lines += _cut(_findings(result, comparison), _LISTED, "more (--json or --html lists all)")
    others = comparison.accepted.keys() - comparison.status.keys()
    lines += [f"  note: accepted, and no finding now: {', '.join(sorted(others))}"] if others else []
    if result.pairs:
        rows = [(*_cells(row), row.distance.method) for row in by_group(result, result.pairs)[:_PAIRS]]
        lines += ["", text_table(("pair", "verdict", "distance", "by"), rows, indent=2)]
        if len(result.pairs) > _PAIRS:
            lines.append(f"  ... and {len(result.pairs) - _PAIRS} more (--json or --html lists all)")
    if result.motions:
        lines += ["", _motions(result)]
    return "\n".join([*lines, "", *work_text(result.work)])


def _rules(result: CheckResult) -> dict[Allowed, int]:
    """How many pairs each rule of the scene that speaks of more than one pair allows."""
    allowed = {(row.a, row.b): None for row in result.rows if row.verdict is Verdict.ALLOWED}
    return result.scene.pairs_by_rule(allowed)


def comparison_text(comparison: Comparison) -> list[str]:
    """How the findings differ from the baseline's, in lines."""
    status = list(comparison.status.values())
    n_accepted = status.count("accepted")
    if not comparison.has_baseline:
        return [f"  {counted(n_accepted, 'group of findings', 'groups of findings')} accepted"] if n_accepted else []
    summary = f"  since the baseline: {status.count('new')} new, {status.count('changed')} changed"
    summary += f", {len(comparison.gone)} gone, {status.count('same')} unchanged, {n_accepted} accepted"
    gone = [
        f"  gone: {', '.join(_cut([f'{a} and {b}' for a, b in old['pairs']], _NOTES, 'more'))}: {old['verdict']}"
        for old in comparison.gone
    ]
    return [summary, *_moved(comparison.moved), *gone]


def _moved(moved: Mapping[str, float]) -> list[str]:
    """The parts that moved and those that are new, each in a line."""
    far = [
        f"{name} by {mm:.4g} mm" if mm > 0.0 else f"{name} turned" for name, mm in moved.items() if math.isfinite(mm)
    ]
    new = [name for name, mm in moved.items() if math.isinf(mm)]
    lines = [("parts moved", far), ("new parts", new)]
    return [f"  {words}: {', '.join(_cut(items, _NOTES, 'more'))}" for words, items in lines if items]


def _counts(result: CheckResult) -> str:
    t = result.thresholds
    clearance = f"clearance {t.clearance:g} mm" if t.clearance else "no clearance set"
    moving = f" at rest and {len(result.motions)} in motion" if result.motions else ""
    counts = ", ".join(f"{count} {name}" for name, count in result.counts.items()) or "no pairs"
    return (
        f"{counted(len(result.scene.parts), 'part')}, {counted(result.work.pairs, 'pair')}{moving}: {counts}; "
        f"contact up to {t.contact:g} mm, {clearance}"
    )


def _findings(result: CheckResult, comparison: Comparison) -> list[str]:
    """A line for each group; what merely touches at rest, as before, is in the table of pairs."""
    names = titles(result.scene)

    def line(group: Group) -> str:
        status: str = comparison.status[group.id] if comparison.has_baseline else ""
        if entry := comparison.accepted.get(group.id):
            status = str(entry)
        pairs = comparison.changed.get(group.id, ())
        which = _cut([f"{a} and {b}" for a, b in pairs], _NOTES, "more")
        changed = f"; changed: {', '.join(which)}" if 0 < len(pairs) < len(group.rows) else ""
        return f"  {status}{': ' if status else ''}{group_text(group, names)}{changed}; id {group.id}"

    def matters(group: Group) -> bool:
        differs = comparison.has_baseline and comparison.status[group.id] != "same"
        return group.verdict is not Verdict.CONTACT or group.motion is not None or differs

    return [line(group) for group in grouped(result) if matters(group)]


def _cut(lines: Sequence[str], most: int, rest: str) -> list[str]:
    """The first lines, and how many more there are."""
    return [*lines[:most], *([f"  ... and {len(lines) - most} {rest}"] if len(lines) > most else [])]


def _motions(result: CheckResult) -> str:
    head = ("motion", "pair", "verdict", "least distance", "at t", "first contact at t", "by")
    rows = []
    for row in by_group(result, result.motions):
        t = "" if row.t is None else f"{row.t:.4f}"
        rows.append((row.motion, *_cells(row), t, contact_text(row), row.distance.method))
    return text_table(head, rows, indent=2)


def _cells(row: PairResult) -> tuple[str, str, str]:
    """A pair, its verdict and its distance, as both tables show them."""
    return f"{row.a} - {row.b}", row.verdict.value, distance_text(row.distance)


def work_text(work: Work) -> list[str]:
    """What the answer took, in lines."""
    decided = ", ".join(f"{count} by {level}" for level, count in work.decided.items())
    queries = ", ".join(f"{count} {level}" for level, count in work.queries.items() if count)
    return [
        f"decided: {decided or 'nothing'}",
        f"built for that: {counted(work.meshes, 'mesh', 'meshes')} ({counted(work.triangles, 'triangle')}), "
        f"{counted(work.hulls, 'hull')}, {counted(work.fits, 'fit')} for {counted(work.shapes, 'shape')}; "
        f"queries: {queries or 'none'}; {sum(work.seconds.values()):.2f} s",
    ]
