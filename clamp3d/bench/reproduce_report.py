"""The reproduced tables as text for the terminal and as plain data for JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from clamp3d.bench import published
from clamp3d.bench.reproduce import PoseRow, Reproduction
from clamp3d.clamp.dimensions import TITLES
from clamp3d.clamp.matrix import gap_text
from clamp3d.collide.distance import Distance
from clamp3d.core.pose import Array
from clamp3d.output.tables import text_table


def reproduction_to_dict(found: Reproduction) -> dict[str, Any]:
    """The tables as JSON data; lengths in mm, angles in degrees."""
    return {
        "table1": [
            asdict(row) | {"distance": row.distance.to_dict(), "gap": row.distance.value, "difference": row.difference}
            for row in found.table1
        ],
        "table2": [asdict(row) for row in found.table2],
        "table3": [asdict(row) for row in found.table3],
        "final_state": [_pose_to_dict(row) for row in found.final_state],
        "table4": [
            {
                "method": row.method,
                "solver": row.solver,
                "unit_angle_deg": row.unit_angle_deg,
                "distance_mm": row.distance,
                "published_mm": row.published,
                "error_mm": row.error,
                "published_error_mm": row.published_error,
            }
            for row in found.table4
        ],
        "measured_mm": published.ACTUAL_DISTANCE,
        "image_trials_mm": list(found.image_trials),
        "table5": [asdict(row) for row in found.table5],
        "table5_orders": [asdict(row) | {"refuted": row.refuted} for row in found.orders],
        "plateau": found.plateau,
    }


def _pose_to_dict(row: PoseRow) -> dict[str, Any]:
    names = ("x", "y", "angle_deg")
    ours, theirs = row.matrices
    return {
        "part": row.part,
        **dict(zip(names, row.found, strict=True)),
        **{f"published_{name}": value for name, value in zip(names, row.published, strict=True)},
        "matrix": ours.tolist(),
        "published_matrix": theirs.tolist(),
        "T_P6_part": row.T_line_part.tolist(),
    }


def reproduction_to_text(found: Reproduction) -> str:
    """The tables as lines for a terminal."""
    relations = ((2, "Hole against bolt", found.table2), (3, "Arc against circle", found.table3))
    tables = [_table1(found)]
    for number, title, rows in relations:
        cells = [(r.published, r.found, "same" if r.published == r.found else "DIFFERS", r.example) for r in rows]
        tables.append(f"Table {number}. {title}\n" + text_table(["row", "found", "", "example"], cells, indent=2))
    return "\n\n".join([*tables, _final_state(found), _table4(found), _table5(found)])


def _table1(found: Reproduction) -> str:
    shown = [row for row in found.table1 if row.published or row.declared or row.measured]
    cells = [
        (f"{r.a}-{r.b}", r.published, r.declared, r.measured, _gap(r.distance), r.relation, r.difference or "same")
        for r in shown
    ]
    head = ["pair", "published", "declared", "measured", "gap, mm", "relation", ""]
    return "\n".join(
        [
            "Table 1. Connection matrix: types published, declared in the clamp's file, measured in the final state",
            text_table(head, cells, indent=2),
            f"  the other {len(found.table1) - len(shown)} pairs: 0 in all three",
        ]
    )


def _gap(distance: Distance) -> str:
    """A distance to the digits that are certain, or the interval that holds it."""
    low, high = gap_text(distance.lower), gap_text(distance.upper)
    return high if low == high or distance.uncertainty <= 1e-6 else f"{low} to {high}"


def _final_state(found: Reproduction) -> str:
    poses, matrices = [], []
    for p in found.final_state:
        apart = [f - w for f, w in zip(p.found, p.published, strict=True)]
        numbers = [f"{v + 0.0:z.3f}" for v in (*p.found, *p.published)]
        poses.append([f"{p.part} {TITLES[p.part]}", *numbers, *(f"{v:+z.3f}" for v in apart)])
        ours, theirs = p.matrices
        for k in range(4):
            flat = [_row(matrix[k]) if k < 3 else "" for matrix in (theirs, ours)]
            matrices.append([p.part if k == 0 else "", *flat, _row(p.T_line_part[k])])
        matrices.append([""])
    head = ["part", *("x", "y", "angle") * 2, "x", "y", "angle"]
    return "\n".join(
        [
            "Final state relative to the power line (mm, deg): found, published, difference",
            text_table(head, poses, indent=2),
            "",
            "The paper's six matrices: as it prints them (x right, y down), as found in its convention, and this",
            "program's T_P6_part (X right, Y along the wires, Z up)",
            text_table(["part", "published", "found", "T_P6_part"], matrices[:-1], indent=2),
        ]
    )


def _row(values: Array) -> str:
    return " ".join(f"{v:z8.3f}" for v in np.asarray(values))


def _table4(found: Reproduction) -> str:
    rows = []
    for d in found.table4:
        # The paper's figures are stepped; the exact rows show what they would be without the step.
        compared = d.solver == "stepped" or d.unit_angle_deg is None
        theirs = (d.published, d.published_error) if compared else (None, None)
        apart = None if theirs[0] is None else f"{d.distance - theirs[0]:+z.3f}"
        lengths = [d.distance, theirs[0], d.error, theirs[1]]
        cells = [None if v is None else f"{v:.3f}" for v in lengths]
        unit = None if d.unit_angle_deg is None else f"{d.unit_angle_deg:g} deg"
        rows.append([d.method, unit, d.solver, *cells[:2], apart, *cells[2:]])
    for number, (trial, theirs5) in enumerate(zip(found.image_trials, published.IMAGE_DISTANCES, strict=True), 1):
        errors = [f"{abs(v - published.ACTUAL_DISTANCE):.3f}" for v in (trial, theirs5)]
        rows.append(["image", f"trial {number}", "", f"{trial:.3f}", f"{theirs5:.3f}", None, *errors])
    head = ["method", "unit", "solver", "found", "published", "difference", "error", "published error"]
    return "\n".join(
        [
            f"Table 4. Distance between the splints (mm); errors against {published.ACTUAL_DISTANCE:.3f}, which the "
            "paper measured on a real clamp",
            text_table(head, rows, indent=2),
            "  image: marked by hand in a drawn picture with a chosen error: compare the spread, not the trials",
            f"  {found.plateau}",
        ]
    )


def _table5(found: Reproduction) -> str:
    rows = []
    for w in found.table5:
        unit = None if w.unit_angle_deg is None else f"{w.unit_angle_deg:g} deg"
        formula = ", ".join(published.TABLE_5[w.method]) if w.solver == "stepped" else "no steps: closed-form gradients"
        rows.append([w.method, unit, w.solver, w.motion_steps, w.contact_queries, w.segments, formula])
    orders = []
    for o in found.orders:
        exponents = f"{o.variable}^{o.published:g}", f"{o.variable}^{o.measured:z.2f}"
        orders.append([o.search, o.parts, o.quantity, *exponents, "REFUTED" if o.refuted else "as published"])
    return "\n".join(
        [
            "Table 5. Work: positions tried (M), groove queries (C; one arc or its chords), segments m of all arcs",
            text_table(["method", "unit", "solver", "M", "C", "m", "published M, C, total"], rows, indent=2),
            "  Orders of growth, published and fitted to counts; a moving parts:",
            text_table(["search", "a", "count", "published", "measured", ""], orders, indent=4),
            "  grid: the paper's search, every combination of places of the parts: the segments of an arc do not add",
            "  to its positions, so the contact tests grow with m and not with m^a. stepped: this program's, one",
            "  way along the bolt on which the wires settle: the steps of the parts do not multiply either.",
        ]
    )
