"""The reproduced tables as text for the terminal and as plain data for JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from clamp3d.bench import published
from clamp3d.bench.reproduce import Reproduction
from clamp3d.clamp.dimensions import TITLES


def reproduction_to_dict(found: Reproduction) -> dict[str, Any]:
    """The tables as JSON data; lengths in mm, angles in degrees."""
    return {
        "table1": [asdict(row) for row in found.table1],
        "table2": [asdict(row) for row in found.table2],
        "table3": [asdict(row) for row in found.table3],
        "final_state": [
            {
                "part": row.part,
                "x": row.found[0],
                "y": row.found[1],
                "angle_deg": row.found[2],
                "published_x": row.published[0],
                "published_y": row.published[1],
                "published_angle_deg": row.published[2],
            }
            for row in found.final_state
        ],
        "table4": [
            {
                "method": row.method,
                "solver": row.solver,
                "unit_angle_deg": row.unit_angle_deg,
                "distance_mm": row.distance,
                "published_mm": row.published,
            }
            for row in found.table4
        ],
        "image_trials_mm": list(found.image_trials),
        "table5": [asdict(row) for row in found.table5],
        "plateau": found.plateau,
    }


def reproduction_to_text(found: Reproduction) -> str:
    """The tables as lines for a terminal."""
    lines = ["Table 1. Connection matrix: type published / by this program; gap in the final state, mm"]
    for c in found.table1:
        if c.published or c.found:
            verdict = "same" if c.published == c.found else "DIFFERS"
            gap = "" if c.gap is None else f"gap {abs(round(c.gap, 6)):.3f}"
            lines.append(f"  {c.a}-{c.b}   {c.published} / {c.found}   {verdict:8s} {gap}")
    zeros = sum(1 for c in found.table1 if not c.published and not c.found)
    lines += [f"  the other {zeros} pairs   0 / 0   same", ""]
    for number, title, rows in ((2, "Hole against bolt", found.table2), (3, "Arc against circle", found.table3)):
        lines.append(f"Table {number}. {title}: row / what this program calls its example")
        for r in rows:
            verdict = "same" if r.published == r.found else "DIFFERS"
            lines.append(f"  {r.published:30s} {r.found:30s} {verdict:8s} {r.example}")
        lines.append("")
    lines.append("Final state relative to the power line (mm, deg): found, published, difference")
    for p in found.final_state:
        title = f"{p.part} {TITLES[p.part]}"
        ours = "".join(f"{round(v, 3) + 0.0:10.3f}" for v in p.found)
        theirs = "".join(f"{v:10.3f}" for v in p.published)
        apart = "".join(f"{_tidy(f - w):>9s}" for f, w in zip(p.found, p.published, strict=True))
        lines.append(f"  {title:16s} {ours}  |{theirs}  |{apart}")
    lines += ["", "Table 4. Distance between the splints (mm); the paper measured 31.630 on a real clamp"]
    lines.append(f"  {'method':10s} {'unit':>8s} {'solver':>9s} {'found':>10s} {'published':>10s} {'difference':>10s}")
    for d in found.table4:
        unit = "-" if d.unit_angle_deg is None else f"{d.unit_angle_deg:g} deg"
        # The paper's figures are stepped; the exact row shows what they would be without the step.
        known = d.published is not None and (d.solver == "stepped" or d.unit_angle_deg is None)
        theirs, apart = (f"{d.published:.3f}", _tidy(d.distance - (d.published or 0.0))) if known else ("-", "-")
        lines.append(f"  {d.method:10s} {unit:>8s} {d.solver:>9s} {d.distance:10.3f} {theirs:>10s} {apart:>10s}")
    image = ", ".join(f"{v:.3f}" for v in published.IMAGE_DISTANCES)
    trials = ", ".join(f"{v:.3f}" for v in found.image_trials)
    lines += [
        f"  image detection, published: {image}",
        f"  image detection, found:     {trials} (marking error chosen)",
    ]
    lines += [f"  {found.plateau}", ""]
    lines.append(
        "Table 5. Work: positions tried (M), groove queries (C; each one arc or its chords), segments m of all arcs"
    )
    lines.append(f"  {'method':10s} {'unit':>8s} {'solver':>9s} {'M':>6s} {'C':>7s} {'m':>5s}  published M, C, total")
    for w in found.table5:
        unit = "-" if w.unit_angle_deg is None else f"{w.unit_angle_deg:g} deg"
        formula = ", ".join(published.TABLE_5[w.method]) if w.solver == "stepped" else "no steps: closed-form gradients"
        counts = f"{w.motion_steps:6d} {w.contact_queries:7d} {w.segments:5d}"
        lines.append(f"  {w.method:10s} {unit:>8s} {w.solver:>9s} {counts}  {formula}")
    return "\n".join(lines)


def _tidy(value: float) -> str:
    """Three digits, without a negative zero."""
    return f"{round(value, 3) + 0.0:+.3f}"
