"""What may be said of a comparison: sentences and a table for README and docs, made from its JSON and nothing else."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from clamp3d.errors import InputError

START, END = "<!-- from docs/compare.json -->", "<!-- end -->"
"""Around the sentences in a page."""

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
_FACETED = 1e-9  # mm: methods with facets err by more
_CLOSE = 0.3  # two times that differ by less, relatively, are "about the same": as much as the machine's own noise


def claims(data: Mapping[str, Any]) -> list[str]:
    """One sentence or two on each of: the arc, whole parts, pieces chosen by hand, wrong verdicts, start-up.

    ``data`` is what `clamp3d compare --peers --json FILE` writes.
    """
    rows = [row for row in (*data["contact"], *data["peers"]) if "one" in row]
    arc = next(row for row in rows if row["method"] == "cas")
    others = [row for row in rows if row["method"] not in ("cas", "chords")]
    return [_arc(arc), _whole(arc, others), _by_hand(arc, others), _verdicts(arc, others), _start(arc, others)]


def update(page: Path, made: str) -> None:
    """Put ``made`` between the marks of a page. Raises InputError for a page without marks."""
    from clamp3d.output.files import write_text

    text = page.read_text(encoding="utf-8")
    if START not in text or END not in text[text.index(START) :]:
        raise InputError(f"{page.name} must have the marks {START} and {END}")
    before, rest = text.split(START, 1)
    write_text(page, f"{before}{START}\n{made}\n{END}{rest.split(END, 1)[1]}")


def as_list(data: Mapping[str, Any]) -> str:
    """The sentences as a Markdown list."""
    return "\n".join(textwrap.fill(f"- {line}", 124, subsequent_indent="  ") for line in claims(data))


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


def _arc(arc: Mapping[str, Any]) -> str:
    batch = f"{_us(arc['many'])} in a batch on one core"
    return (
        f"Against distances known to 25 digits the arc errs by at most {_error(arc):.1e} mm, apart and in overlaps of "
        f"up to 0.3 mm, and takes {_us(arc['one'])} for a call from Python, {batch}."
    )


def _whole(arc: Mapping[str, Any], others: list[Any]) -> str:
    whole = [row for row in others if not _chosen(row) and row["worst_error"] > _FACETED]
    told = []
    for limit in (1e-7, 1e-3, 0.02, 0.2):
        best = min((row for row in whole if _error(row) <= limit), key=lambda row: float(row["one"]), default=None)
        if best is not None:
            told.append(f"{_us(best['one'])} for {_error(best):.2g} mm ({_name(best)})")
    exact = min(
        (row for row in others if not _chosen(row) and row["worst_error"] <= _FACETED),
        key=lambda row: float(row["one"]),
    )
    return (
        f"Other libraries, asked about the whole part, take at least {', '.join(told)}; exact is also {_name(exact)}, "
        f"in {_us(exact['one'])}, {exact['one'] / arc['one']:.0f} times as long as the arc."
    )


def _by_hand(arc: Mapping[str, Any], others: list[Any]) -> str:
    chosen = [row for row in others if _chosen(row)]
    pieces = [row for row in chosen if row["worst_error"] > _FACETED]
    best = min(pieces, key=lambda row: (round(_error(row), 7), float(row["one"])))
    face = min((row for row in chosen if row not in pieces), key=lambda row: float(row["one"]))
    return (
        f"Where somebody looks up by hand which piece can be nearest, {_name(best)} takes {_us(best['one'])} for "
        f"{_error(best):.1e} mm, {_beside(best['one'], arc['one'])} one call of the arc, and {_name(face)}, told "
        f"where, {_us(face['one'])} without an error ({face['one'] / arc['one']:.1f} times as long)."
    )


def _verdicts(arc: Mapping[str, Any], others: list[Any]) -> str:
    fine = [row for row in others if row["setting"] == 1.0 and row["worst_error"] > _FACETED]
    band = [next(b for b in row["bands"] if b["band"] == 1e-4) for row in fine]
    least = min(b["false_hits"] for b in band)
    missed = sorted({_name(row).split(" (")[0] for row in others for b in row["bands"] if b["false_misses"]})
    wrong = sum(b["false_hits"] + b["false_misses"] for b in arc["bands"])
    asked = sum(b["free"] + b["hits"] for b in arc["bands"])
    return (
        f"Facets call free wires a hit: at most 1e-4 mm from contact, pieces of 1 degree at least {least} of "
        f"{band[0]['free']}. Some hits down to 1e-6 mm deep were missed by {', '.join(missed) or 'none'}. The arc gave "
        f"{wrong or 'no'} wrong verdict{'' if wrong < 2 else 's'} of {asked}."
    )


def _start(arc: Mapping[str, Any], others: list[Any]) -> str:
    light = min(others, key=lambda row: float(row["load"]))
    return (
        f"The arc is *not* the best choice for anything but round grooves and cylinders, nor for a script that asks "
        f"once: its library loads in {arc['load']:.2g} s ({_name(light).split(' (')[0]}: {light['load']:.1g} s)."
    )


def _chosen(row: Mapping[str, Any]) -> bool:
    """Whether somebody told the method which piece can be nearest."""
    return str(row["method"]).endswith(("-sector", "-face"))


def _error(row: Mapping[str, Any]) -> float:
    return max(float(row["worst_error"]), float(row["depth_error"] or 0.0))


def _name(row: Mapping[str, Any]) -> str:
    return _NAMES.get(row["method"], str(row["method"]))


def _us(seconds: float) -> str:
    return f"{seconds * 1e6:.2g} us" if seconds < 1e-4 else f"{seconds * 1e6:.0f} us"


def _beside(one: float, other: float) -> str:
    if abs(one - other) <= _CLOSE * other:
        return "about as long as"
    return f"{one / other:.1f} times as long as"
