"""Tables for README and docs, made from the JSON of `clamp3d compare` and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from clamp3d.errors import InputError

START, END = "<!-- from docs/compare.json -->", "<!-- end -->"
"""Around the table in a page."""

_NAMES = {
    "coal-cylinder": "coal (cylinder)",
    "coal-capsule": "coal (capsule)",
    "coal-axis": "coal (axis)",
    "coal-sector": "coal",
    "mujoco-cylinder": "MuJoCo (cylinder)",
    "mujoco-capsule": "MuJoCo (capsule)",
    "mujoco-sector": "MuJoCo",
    "fcl": "python-fcl",
    "fcl-axis": "python-fcl (axis)",
    "fcl-sector": "python-fcl",
    "hulls": "CoACD's hulls",
    "mesh": "meshes in FCL",
    "open-cascade": "Open CASCADE (cylinder)",
    "open-cascade-axis": "Open CASCADE (axis)",
    "open-cascade-face": "Open CASCADE",
}
_FACETED = 1e-9  # mm: methods with facets have larger errors
_LIMITS = (1e-7, 1e-3, 0.02, 0.2)
"""Largest errors (mm) for which the fastest library is named."""
_CLOSE = 1.03
"""Ratio of two times up to which they count as equal: as much as the machine's own noise."""
_HEADER = ("method", "largest error, mm", "one call, us", "in a batch, us", "false hits", "missed hits", "import, s")


def comparison_table(data: Mapping[str, Any]) -> str:
    """The closed form beside the fastest libraries for each accuracy, as a Markdown table.

    ``data`` is what `clamp3d compare --peers --json FILE` writes.
    """
    rows = [row for row in (*data["contact"], *data["peers"]) if "one" in row]
    arc = next(row for row in rows if row["method"] == "cas")
    others = [row for row in rows if row["method"] not in ("cas", "chords")]
    lines = [_line("**clamp3d, closed form**", arc)]
    lines += [_line(_name(row), row) for row in _fastest(others, chosen=False)]
    lines += [_line(f"{_name(row)}, nearest piece preselected", row) for row in _fastest(others, chosen=True)]
    return "\n".join([f"| {' | '.join(_HEADER)} |", "|---" + "|---:" * (len(_HEADER) - 1) + "|", *lines])


def update(page: Path, table: str) -> None:
    """Put ``table`` between the marks of a page. Raises InputError for a page without marks."""
    from clamp3d.output.files import write_text

    text = page.read_text(encoding="utf-8")
    if START not in text or END not in text[text.index(START) :]:
        raise InputError(f"{page.name} must have the marks {START} and {END}")
    before, rest = text.split(START, 1)
    write_text(page, f"{before}{START}\n{table}\n{END}{rest.split(END, 1)[1]}")


def assembly_table(data: Mapping[str, Any]) -> str:
    """The reference clamp assembled without a step by each method, as a Markdown table; the picture's two rows last."""
    rows = ["| grooves as | distance, mm | error, mm | set-up, s | assembly, s |", "|---|---|---|---|---|"]
    for row in data["assembly"]:
        if row.get("solver") == "exact":
            error = "-" if row["method"] == "cas" else f"{row['error']:.3f}"
            rows.append(
                f"| {row['label']} | {row['distance']:.3f} | {error} | {row['setup']:.2g} | {row['seconds']:.2g} |"
            )
        elif "reason" in row:
            rows.append(f"| {row['label']} | {row['reason']} | | | |")
    image = data["image"]
    if "reason" not in image:
        by_hand = f"{image['trials']} trials, median; marking error chosen"
        rows.append(f"| a drawn picture, marked by hand ({by_hand}) | - | {image['median_by_hand']:.2f} | | |")
        rows.append(f"| the same picture, end points found automatically | - | {image['automatic']:.3f} | | |")
    return "\n".join(dict.fromkeys(rows))


def _fastest(rows: list[Any], *, chosen: bool) -> list[Any]:
    """The fastest exact method, then the fastest one for each of the limits of error."""
    rows = [row for row in rows if _chosen(row) is chosen]
    bands = [(-1.0, _FACETED), *((_FACETED, limit) for limit in _LIMITS)]
    named: list[Any] = []
    for above, limit in bands:
        good = [row for row in rows if above < _error(row) <= limit]
        if good:
            fast = [row for row in good if _seconds(row) <= _CLOSE * min(map(_seconds, good))]
            best = min(fast, key=_error)
            if not any(_seconds(best) > _seconds(row) / _CLOSE for row in named[1:]):
                named.append(best)
    return named


def _line(name: str, row: Mapping[str, Any]) -> str:
    near = [band for band in row["bands"] if band["band"] <= 1e-4]
    hits = f"{sum(b['false_hits'] for b in near)} of {sum(b['free'] for b in near)}"
    missed = f"{sum(b['false_misses'] for b in near)} of {sum(b['hits'] for b in near)}"
    times = f"{_us(row['one'])} | {_us(row['many'])}"
    return f"| {name} | {_error(row):.2g} | {times} | {hits} | {missed} | {row['load']:.1g} |"


def _chosen(row: Mapping[str, Any]) -> bool:
    """Whether the caller preselected the piece of the groove that can be nearest."""
    return str(row["method"]).endswith(("-sector", "-face"))


def _error(row: Mapping[str, Any]) -> float:
    return max(float(row["worst_error"]), float(row["depth_error"] or 0.0))


def _seconds(row: Mapping[str, Any]) -> float:
    return float(row["one"])


def _name(row: Mapping[str, Any]) -> str:
    name = _NAMES.get(row["method"], str(row["method"]))
    return name if row["setting"] is None else f"{name}, pieces of {row['setting']:g} deg"


def _us(seconds: float) -> str:
    return f"{seconds * 1e6:.2g}" if seconds < 1e-4 else f"{seconds * 1e6:.0f}"
