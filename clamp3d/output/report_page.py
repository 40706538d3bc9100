"""A report as a self-contained page, as JSON and as CSV."""

from __future__ import annotations

import base64
import math
import platform
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clamp3d import __version__
from clamp3d.output.files import json_text, write_files
from clamp3d.output.manifest import versions
from clamp3d.output.pages import now, render
from clamp3d.output.palette import DIMENSION, INK, part_colours
from clamp3d.output.report import LISTED, SEVERITIES, PairRow, Report
from clamp3d.output.tables import csv_table
from clamp3d.output.wording import meanings, titles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIBRARIES = ("numpy", "scipy", "numba", "matplotlib")
PICTURES = 24
"""Findings of a scene that get a picture, the worst ones."""
_DARK = (
    "@media (prefers-color-scheme: dark) {"
    + "".join(
        f'[style*="{kind}: {light}"] {{ {kind}: {dark} !important }}'
        for kind in ("fill", "stroke")
        for light, dark in ((INK.lower(), "#dfe4ea"), (DIMENSION.lower(), "#ff9fcb"), ("#ffffff", "#1d2329"))
    )
    + "}"
)
"""Colours of a picture on a dark page: what is drawn in ink becomes light, what is white dark."""
MATRIX = 12
"""Parts that the page's matrix shows at most."""


def write_report(report: Report, folder: Path, *, progress: Callable[[str], None] = lambda step: None) -> list[Path]:
    """Write report.html, report.json and pairs.csv into ``folder``, all or none; ``progress`` gets each picture.

    Raises InputError if the folder cannot be written to.
    """
    page = report_html(report, progress=progress)
    data = json_text(report_to_dict(report))
    files = {"report.html": page, "report.json": data, "pairs.csv": report_csv(report)}
    return write_files(folder, {name: text.encode("utf-8", "backslashreplace") for name, text in files.items()})


def report_to_dict(report: Report) -> dict[str, Any]:
    """The report as JSON data; lengths in mm, angles in degrees. A clamp's holds what ``run --json`` does."""
    scene = report.scene
    data: dict[str, Any] = {
        "scene": scene.name,
        "parts": {part.name: {"T_world": part.T_world.tolist()} for part in scene.parts},
        "thresholds": {"contact_mm": scene.thresholds.contact, "clearance_mm": scene.thresholds.clearance},
    }
    if report.assembly is not None:
        data |= report.assembly.to_dict()
        data["steps"] = [
            {
                "number": number,
                "step": s.waypoint.step,
                "label": s.waypoint.label,
                "opening_line_mm": s.opening_line,
                "opening_jumper_mm": s.opening_jumper,
                "tilt_deg": math.degrees(s.tilt),
                "parallel": s.parallel,
                "nut_turns": s.turns,
                "seats": [{"splint": x.splint, "wire": x.wire, "seated": x.seated, "gap_mm": x.gap} for x in s.seats],
            }
            for number, s in enumerate(report.steps, 1)
        ]
        data["tightening"] = report.tightening
    return data | {
        "made": f"{now():%Y-%m-%d %H:%M} UTC",
        "versions": _versions(),
        "settings": report.settings,
        "headline": report.headline,
        "passed": report.passed,
        "findings": [
            {"severity": f.severity, "text": f.text}
            | ({"id": f.group.id, "count": len(f.group.rows)} if f.group else {})
            for f in report.findings
        ],
        "pairs": [_pair_to_dict(row) for row in report.rows],
        "motions": [_pair_to_dict(row) for row in report.motions],
        "modelled": report.items("modelled.txt"),
        "not_modelled": report.items("not_modelled.txt"),
    }


def report_csv(report: Report) -> str:
    """One line for each pair at rest, then those in motion, with a header; lengths in mm, vectors as three columns."""
    rows = [dict(_cells(_pair_to_dict(row))) for row in (*report.rows, *report.motions)]
    return csv_table(rows, () if rows else ("a", "b", "verdict", "distance_mm", "error_bound_mm"))


def _cells(data: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """The cells of a row of the table: a vector has three, an interval two, and what is unknown is empty."""
    for key, value in data.items():
        if key in ("point", "point_a", "point_b", "normal", "direction"):
            yield from zip((f"{key}_{axis}" for axis in "xyz"), value or (None,) * 3, strict=True)
        elif key == "interference_mm":
            yield from zip(("interference_at_least_mm", "interference_at_most_mm"), value or (None, None), strict=True)
        elif key == "where":
            (low, high), inside = value["box_mm"], value["point"] or (None,) * 3
            yield from ((name, value[name]) for name in value if name.startswith("volume"))
            for axis, least, most, at in zip("xyz", low, high, inside, strict=True):
                yield from ((f"box_{axis}_min", least), (f"box_{axis}_max", most), (f"inside_{axis}", at))
        else:
            yield key, value


def report_html(report: Report, *, progress: Callable[[str], None] = lambda step: None) -> str:
    """The report as one HTML page with its pictures inside."""
    cells = {(row.a, row.b): row for row in report.rows}
    names = [part.name for part in report.scene.parts]
    if len(names) > MATRIX:
        seen = {n for row in report.rows if row.verdict != "clear" for n in (row.a, row.b)}
        names = [name for name in names if name in seen][:MATRIX]
    return render(
        "report.html",
        report=report,
        made=f"{now():%Y-%m-%d %H:%M} UTC",
        versions=_versions(),
        bound=lambda value: f"{value:.1e}" if math.isfinite(value) else "unknown",
        vector=lambda v: "" if v is None else ", ".join(f"{x:z.3f}" if abs(x) >= 5e-4 else "0" for x in v),
        pictures=_pictures(report, progress),
        shown=[row for row in report.rows if len(report.rows) <= LISTED or row.verdict != "clear"],
        names=names,
        titles=titles(report.scene),
        colours=part_colours([part.name for part in report.scene.parts]),
        verdicts=meanings(report.scene),
        severities=SEVERITIES,
        cell=lambda a, b: cells.get((a, b)),
    )


def _versions() -> dict[str, str]:
    """Versions of what computed the report."""
    return {"clamp3d": __version__, "Python": platform.python_version(), **versions(LIBRARIES)}


def _pictures(report: Report, progress: Callable[[str], None]) -> dict[str, list[tuple[str, PairRow | None]]]:
    """Pictures as data addresses, each with the pair that it shows: 'overview', 'pairs' and, of a clamp, 'steps'."""
    from clamp3d.output.assembly_figures import steps_figure
    from clamp3d.output.figures import contact_figure, picture, states_figure
    from clamp3d.output.scene_figures import finding_figure, scene_figure

    scene, assembly = report.scene, report.assembly
    out: dict[str, list[tuple[str, PairRow | None]]] = {"overview": [], "steps": [], "pairs": []}

    def add(kind: str, name: str, figure: Callable[..., Figure], *shown: Any, row: PairRow | None = None) -> None:
        progress(f"picture of {name}")
        svg = picture(figure(*shown), "svg").replace(b"</style>", f"{_DARK}</style>".encode(), 1)
        out[kind].append(("data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii"), row))

    if assembly is not None:
        add("overview", "the states", states_figure, assembly)
        add("steps", "the steps", steps_figure, assembly)
        for row in report.rows:
            # Every pair that touches, overlaps, or is declared to; a thread has nothing to show.
            if row.contact is not None and (row.contact.type or row.contact.declared) > 1:
                add("pairs", row.name, contact_figure, assembly, row.contact, row=row)
    elif scene.parts:
        rows = [finding.row for finding in report.findings if finding.row is not None][:PICTURES]
        add("overview", "the scene", scene_figure, scene, [*enumerate(rows, 1)])
        for row in rows:
            add("pairs", row.name, finding_figure, scene, row, row=row)
    return out


def _pair_to_dict(row: PairRow) -> dict[str, Any]:
    data = row.to_dict() | {
        "severity": row.severity,
        "lower_bound": not (math.isfinite(row.distance.lower) and math.isfinite(row.distance.upper)),
        "remark": row.remark,
        "point": None if row.distance.point_a is None else row.distance.point_a.tolist(),
    }
    if row.contact is not None:
        c = row.contact
        data |= {"declared": c.declared, "measured": c.type, "relation": c.relation, "feature": c.feature}
    return data
