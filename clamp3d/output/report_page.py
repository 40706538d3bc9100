"""The report as a self-contained page, as JSON and as CSV."""

from __future__ import annotations

import base64
import csv
import datetime
import importlib.metadata
import io
import json
import math
import os
import platform
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clamp3d import __version__
from clamp3d.clamp.contacts import CONTACT
from clamp3d.clamp.dimensions import PARTS, TITLES
from clamp3d.clamp.verdict import VERDICTS
from clamp3d.output.files import write_files
from clamp3d.output.pair_rows import SEVERITIES, PairRow
from clamp3d.output.palette import PART_COLOURS, VERDICT_COLOURS
from clamp3d.output.report import Report, StepRow, contacts_to_draw
from clamp3d.output.run_report import run_to_dict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIBRARIES = ("numpy", "scipy", "numba", "matplotlib")
FILES = ("report.html", "report.json", "pairs.csv")

MEANINGS = {
    "clash": "parts overlap",
    "contained": "one part lies inside the other",
    "uncertain": "the error bound reaches over a threshold",
    "contact": "parts touch that are not declared to",
    "allowed": "parts touch as the connection matrix declares",
    "clearance": "gap up to the clearance",
    "clear": "gap larger than the clearance",
}


def write_report(
    report: Report, folder: str | Path, *, progress: Callable[[str], None] = lambda what: None
) -> list[Path]:
    """Write report.html, report.json and pairs.csv into ``folder``, all or none; ``progress`` hears of each picture.

    Raises InputError if the folder cannot be written to.
    """
    page = report_html(report, progress=progress)
    data = json.dumps(report_to_dict(report), indent=2, allow_nan=False) + "\n"
    files = dict(zip(FILES, (page, data, report_csv(report)), strict=True))
    return write_files(Path(folder), {name: text.encode("utf-8") for name, text in files.items()})


def report_to_dict(report: Report) -> dict[str, Any]:
    """The report as JSON data: the run's own, and all pairs and steps; lengths in mm, angles in degrees."""
    return run_to_dict(report.run) | {
        "made": made_at(),
        "versions": versions(),
        "settings": settings(report),
        "passed": report.passed,
        "findings": list(report.findings),
        "pairs": [_pair_to_dict(row) for row in report.rows],
        "steps": [
            {
                "number": s.number,
                "step": s.step,
                "label": s.label,
                "opening_line_mm": s.opening_line,
                "opening_jumper_mm": s.opening_jumper,
                "tilt_deg": math.degrees(s.tilt),
                "parallel": s.parallel,
                "nut_turns": s.turns,
                "seats": [{"splint": x.splint, "wire": x.wire, "seated": x.seated, "gap_mm": x.gap} for x in s.seats],
            }
            for s in report.steps
        ],
        "tightening": [
            {"nut_turns": t.turns, "way_mm": t.way, "saddle_gap_mm": t.saddle_gap} for t in report.tightening
        ],
        "modelled": list(report.modelled),
        "not_modelled": list(report.not_modelled),
    }


def report_csv(report: Report) -> str:
    """One line for each pair, with a header; lengths in mm."""
    rows = [_flat(row) for row in report.rows]
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def report_html(report: Report, *, progress: Callable[[str], None] = lambda what: None) -> str:
    """The report as one HTML page with its pictures inside."""
    import jinja2

    folder = resources.files("clamp3d.output").joinpath("templates")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters |= {
        "mm": _mm,
        "bound": _bound,
        "vector": _vector,
        "deg": lambda rad: f"{math.degrees(rad) + 0.0:.2f}",
    }
    template = environment.from_string(folder.joinpath("report.html").read_text(encoding="utf-8"))
    by_pair = {(row.a, row.b): row for row in report.rows}
    return template.render(
        report=report,
        run=report.run,
        clamp=report.run.clamp,
        made=made_at(),
        versions=versions(),
        settings=settings(report),
        style=folder.joinpath("report.css").read_text(encoding="utf-8"),
        pictures=_pictures(report, progress),
        names=PARTS,
        titles=TITLES,
        colours=PART_COLOURS,
        verdict_colours=VERDICT_COLOURS,
        verdicts=[(name, MEANINGS[name]) for name in VERDICTS],
        severities=SEVERITIES,
        cell=lambda a, b: by_pair.get((a, b)),
        checks=_checks,
        contact=CONTACT,
    )


def settings(report: Report) -> dict[str, str]:
    """What the run and the report were asked for."""
    run = report.run
    return {
        "method": run.method,
        "solver": run.solver,
        "contact tolerance": f"{CONTACT:g} mm",
        "clearance": f"{report.clearance:g} mm",
        "mesh error": f"{report.mesh_error:g} mm (outlines of pairs without a groove; grooves and pictures: true arcs)",
    }


def versions() -> dict[str, str]:
    """Versions of what computed the report."""
    own = {"clamp3d": __version__, "Python": platform.python_version()}
    return own | {name: importlib.metadata.version(name) for name in LIBRARIES}


def made_at() -> str:
    """The time in UTC; SOURCE_DATE_EPOCH, if set, so that equal reports can be equal files."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    zone = datetime.UTC
    now = datetime.datetime.fromtimestamp(int(epoch), zone) if epoch else datetime.datetime.now(zone)
    return now.strftime("%Y-%m-%d %H:%M UTC")


def _pictures(report: Report, progress: Callable[[str], None]) -> dict[str, str]:
    """Pictures as data addresses: 'states', 'steps', and one for each pair that touches or is declared to."""
    from clamp3d.output.assembly_figures import steps_figure
    from clamp3d.output.figures import contact_figure, states_figure

    run = report.run
    out = {}
    for name, draw in (("states", states_figure), ("steps", steps_figure)):
        progress(f"picture of the {name}")
        out[name] = _data_address(draw(run))
    for contact in contacts_to_draw(report.rows):
        progress(f"picture of {contact.a}-{contact.b}")
        out[f"{contact.a}-{contact.b}"] = _data_address(contact_figure(run, contact))
    return out


def _data_address(figure: Figure) -> str:
    import matplotlib as mpl

    out = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "clamp3d"}):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(out.getvalue()).decode("ascii")


def _checks(step: StepRow, last: bool) -> list[tuple[str, str, str]]:
    """What a line worker looks at after a step: (what, value, state), state 'good', 'bad' or '' while under way."""
    both = all(s.seated for s in step.seats)
    state = ("good" if both else "bad") if last else ""
    splints = "parallel" if step.parallel else f"tilted {abs(math.degrees(step.tilt)):.2f}\N{DEGREE SIGN}"
    return [
        ("power line", step.seat("P6"), state and ("good" if _seated(step, "P6") else "bad")),
        ("jumper", step.seat("P7"), state and ("good" if _seated(step, "P7") else "bad")),
        ("splints", splints, ""),
        ("gap left, right", f"{step.opening_line:.2f}, {step.opening_jumper:.2f} mm", ""),
        ("nut", f"{step.turns:.2f} turns", ""),
    ]


def _seated(step: StepRow, wire: str) -> bool:
    return all(s.seated for s in step.seats if s.wire == wire)


def _pair_to_dict(row: PairRow) -> dict[str, Any]:
    return {
        "a": row.a,
        "b": row.b,
        "declared": row.declared,
        "verdict": row.verdict,
        "severity": row.severity,
        "relation": row.relation,
        "feature": row.feature,
        "distance_mm": row.distance,
        "lower_bound": row.lower_bound,
        "error_bound_mm": row.error_bound,
        "point": row.point.tolist(),
        "normal": row.normal.tolist(),
        "method": row.method,
        "remark": row.remark,
    }


def _flat(row: PairRow) -> dict[str, Any]:
    """The pair as one line: vectors as three columns."""
    out: dict[str, Any] = {}
    for key, value in _pair_to_dict(row).items():
        if isinstance(value, list):
            out |= {f"{key}_{axis}": v for axis, v in zip("xyz", value, strict=True)}
        else:
            out[key] = "" if value is None else value
    return out


def _mm(value: float) -> str:
    return "0" if abs(value) <= CONTACT else f"{value:.3f}"


def _bound(value: float | None) -> str:
    return "not stated" if value is None else f"{value:.1e}"


def _vector(values: Any) -> str:
    return ", ".join(f"{v:.3f}" if abs(v) >= 5e-4 else "0" for v in values)
