"""A checked scene as text, as JSON data and as one self-contained page."""

from __future__ import annotations

import math
from typing import Any

from clamp3d import __version__
from clamp3d.collide.result import CheckResult, PairResult, Work
from clamp3d.collide.verdict import Verdict
from clamp3d.output.palette import VERDICT_COLOURS

_ORDER = {verdict: k for k, verdict in enumerate(Verdict)}
_MATRIX = 14
"""More parts than this and the matrix no longer fits a terminal."""
_PAGE_MATRIX = 60
_ROWS = 60
_MARK = {
    Verdict.CLEAR: ".",
    Verdict.CLEARANCE: "g",
    Verdict.CONTACT: "t",
    Verdict.CLASH: "X",
    Verdict.CONTAINED: "C",
    Verdict.ALLOWED: "a",
    Verdict.UNCERTAIN: "?",
}


def check_to_dict(result: CheckResult, full: CheckResult | None = None) -> dict[str, Any]:
    """The result as JSON data; lengths in mm. Pairs that are not listed are clear."""
    data: dict[str, Any] = {
        "clamp3d": __version__,
        "scene": result.scene.name,
        "thresholds": {"contact_mm": result.thresholds.contact, "clearance_mm": result.thresholds.clearance},
        "clean": result.clean,
        "counts": result.counts,
        "parts": {part.name: {"T_world": part.T_world.tolist()} for part in result.scene.parts},
        "pairs": [row.to_dict() for row in result.pairs],
        "motions": [row.to_dict() for row in result.motions],
        "work": _work(result.work),
    }
    if full is not None:
        data["full"] = {"pairs": [row.to_dict() for row in full.pairs], "work": _work(full.work)}
    return data


def _work(work: Work) -> dict[str, Any]:
    return {
        "parts": work.parts,
        "shapes": work.shapes,
        "pairs": work.pairs,
        "candidates": work.candidates,
        "meshes": work.meshes,
        "triangles": work.triangles,
        "hulls": work.hulls,
        "fits": work.fits,
        "queries": dict(work.queries),
        "decided": dict(work.decided),
        "seconds": dict(work.seconds),
        "fixed_fidelity": {
            "mesh_error_mm": work.fixed_error,
            "meshes": work.fixed_meshes,
            "triangles": work.fixed_triangles,
            "queries": work.fixed_queries,
        },
        "full": work.full,
    }


def distance_text(row: PairResult) -> str:
    """The distance with its error bound, or the one bound that is known.

    >>> distance_text(PairResult("a", "b", Verdict.CLEAR, Distance(2.5)))
    '> 2.5'
    """
    d = row.distance
    if not math.isfinite(d.uncertainty):
        return f"> {d.lower:.4g}" if d.lower > -math.inf else f"< {d.upper:.4g}" if d.upper < math.inf else "?"
    middle, error = 0.5 * (d.lower + d.upper), 0.5 * d.uncertainty
    # As many decimals as the bound gives, no more than 1e-6 mm.
    digits = 6
    while digits > 1 and 0.5 * 10.0**-digits < error / 10.0:
        digits -= 1
    value = round(middle, digits) + 0.0
    return f"{value:.{digits}f} +- {error:.1e}" if error > 5e-7 else f"{value:.{digits}f}"


def listed(result: CheckResult) -> list[PairResult]:
    """Pairs worth reading: all but the clear ones, worst first."""
    rows = [row for row in result.pairs if row.verdict is not Verdict.CLEAR]
    return sorted(rows, key=lambda row: (_ORDER[row.verdict], row.a, row.b))


def check_to_text(result: CheckResult, full: CheckResult | None = None) -> str:
    """The result as lines for a terminal."""
    t, n = result.thresholds, len(result.scene.parts)
    clearance = f"clearance {t.clearance:g} mm" if t.clearance else "no clearance asked for"
    lines = [
        f"scene {result.scene.name}: {n} parts, {result.work.pairs} pairs; contact up to {t.contact:g} mm, {clearance}",
        ", ".join(f"{count} {name}" for name, count in result.counts.items()) or "no pairs",
    ]
    if 2 <= n <= _MATRIX and result.asked is None:
        lines += ["", *_matrix(result)]
    rows = result.pairs if len(result.pairs) <= _ROWS // 2 else listed(result)
    rows = tuple(sorted(rows, key=lambda row: _ORDER[row.verdict]))
    if rows:
        lines += ["", *_columns([_row_text(row) for row in rows[:_ROWS]], ("pair", "verdict", "distance mm", "by"))]
    if len(rows) > _ROWS:
        lines.append(f"... and {len(rows) - _ROWS} more (--json or --html lists all)")
    if result.motions:
        head = ("motion", "pair", "verdict", "least mm", "at t", "contact from t", "by")
        lines += ["", *_columns([_motion_text(row) for row in result.motions], head)]
    lines += ["", *_work_text(result.work)]
    if full is not None:
        total = full.work
        lines.append(
            f"full model: {total.meshes} meshes, {total.triangles} triangles, {total.hulls} hulls, "
            f"{sum(total.queries.values())} queries, {sum(total.seconds.values()):.2f} s; agrees in all "
            f"{total.pairs} verdicts"
        )
    return "\n".join(lines)


def _row_text(row: PairResult) -> tuple[str, ...]:
    return (f"{row.a} - {row.b}", row.verdict.value, distance_text(row), row.distance.method)


def _motion_text(row: PairResult) -> tuple[str, ...]:
    contact = "" if row.contact_at is None else f"{row.contact_at:.4f}"
    return (
        str(row.motion),
        f"{row.a} - {row.b}",
        row.verdict.value,
        distance_text(row),
        f"{row.t:.4f}",
        contact,
        row.distance.method,
    )


def _columns(rows: list[tuple[str, ...]], head: tuple[str, ...]) -> list[str]:
    table = [head, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(head))]
    return ["  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in table]


def _matrix(result: CheckResult) -> list[str]:
    names = [part.name for part in result.scene.parts]
    width = max(3, *(len(name) for name in names))
    marks = _marks(result)
    lines = [" " * (width + 2) + " ".join(name[:width].rjust(width) for name in names)]
    for i, a in enumerate(names):
        cells = [_MARK[marks[a, b]] if j > i else "" for j, b in enumerate(names)]
        lines.append(f"  {a:{width}s}" + " ".join(cell.rjust(width) for cell in cells).rstrip())
    used = {marks[a, b] for i, a in enumerate(names) for b in names[i + 1 :]}
    lines.append("  " + ", ".join(f"{_MARK[v]} {v.value}" for v in Verdict if v in used))
    return lines


def _marks(result: CheckResult) -> dict[tuple[str, str], Verdict]:
    names = [part.name for part in result.scene.parts]
    marks = {(a, b): Verdict.CLEAR for a in names for b in names}
    for row in result.pairs:
        marks[row.a, row.b] = marks[row.b, row.a] = row.verdict
    return marks


def _work_text(work: Work) -> list[str]:
    decided = ", ".join(f"{count} by {rung}" for rung, count in work.decided.items())
    queries = ", ".join(f"{count} {rung}" for rung, count in work.queries.items() if count)
    return [
        f"decided: {decided}",
        f"built: {work.meshes} meshes ({work.triangles} triangles), {work.hulls} hulls, {work.fits} fits "
        f"for {work.shapes} shapes; asked: {queries or 'nothing'}; {sum(work.seconds.values()):.2f} s",
        f"one fixed fidelity (every part meshed at {work.fixed_error:g} mm, every pair asked): {work.fixed_meshes} "
        f"meshes, {work.fixed_triangles} triangles, {work.fixed_queries} queries",
    ]


def check_to_html(result: CheckResult, full: CheckResult | None = None) -> str:
    """The result as one page that needs no other file and no network."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("clamp3d.output", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    names = [part.name for part in result.scene.parts]
    shown = names if len(names) <= _PAGE_MATRIX else sorted({n for row in listed(result) for n in (row.a, row.b)})
    shown = shown[:_PAGE_MATRIX]
    return environment.get_template("check.html").render(
        version=__version__,
        result=result,
        full=full,
        names=shown,
        marks=_marks(result) if shown else {},
        rows=sorted(result.pairs, key=lambda row: (_ORDER[row.verdict], row.a, row.b)),
        colours=VERDICT_COLOURS,
        symbols={v.value: _MARK[v] for v in Verdict},
        distance=distance_text,
        work=_work_text(result.work),
    )
