"""The reproduced tables as text for the terminal and as plain data for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import zip_longest
from typing import Any

from clamp3d.bench import published
from clamp3d.bench.reproduce import PoseRow, RelationRow, Reproduction, WorkRow
from clamp3d.clamp.dimensions import TITLES
from clamp3d.clamp.result import millimetres
from clamp3d.engine.distance import Distance
from clamp3d.output.pages import render
from clamp3d.output.tables import text_table


def reproduction_to_dict(tables: Reproduction) -> dict[str, Any]:
    """The tables as JSON data; lengths in mm, angles in degrees."""
    return {
        "table1": [
            asdict(row) | {"distance": row.distance.to_dict(), "gap": row.distance.value, "difference": row.difference}
            for row in tables.table1
        ],
        "table2": [asdict(row) for row in tables.table2],
        "table3": [asdict(row) for row in tables.table3],
        "final_state": [_pose_to_dict(row) for row in tables.final_state],
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
            for row in tables.table4
        ],
        "measured_mm": published.ACTUAL_DISTANCE,
        "image_trials_mm": list(tables.image_trials),
        "table5": [asdict(row) for row in tables.table5],
        "plateau": tables.plateau,
    }


def _pose_to_dict(row: PoseRow) -> dict[str, Any]:
    names = ("x", "y", "angle_deg")
    ours, theirs = row.matrices
    return {
        "part": row.part,
        **dict(zip(names, row.computed, strict=True)),
        **{f"published_{name}": value for name, value in zip(names, row.published, strict=True)},
        "matrix": ours.tolist(),
        "published_matrix": theirs.tolist(),
        "T_P6_part": row.T_line_part.tolist(),
    }


def reproduction_to_text(tables: Reproduction) -> str:
    """The tables as lines for a terminal."""
    connections = [row for row in tables.table1 if row.published or row.declared or row.measured]
    return render(
        "reproduce.txt",
        "clamp3d.bench",
        table=text_table,
        connections=[
            (f"{r.a}-{r.b}", r.published, r.declared, r.measured, _gap(r.distance), r.relation, r.difference or "same")
            for r in connections
        ],
        others=len(tables.table1) - len(connections),
        holes=_relations(tables.table2),
        arcs=_relations(tables.table3),
        poses=[_pose(pose) for pose in tables.final_state],
        matrices=[line for pose in tables.final_state for line in _matrices(pose)][:-1],
        actual=f"{published.ACTUAL_DISTANCE:.3f}",
        distances=_distances(tables),
        plateau=tables.plateau,
        work=[_work(row) for row in tables.table5],
    )


def _relations(rows: Sequence[RelationRow]) -> list[Sequence[object]]:
    return [(r.published, r.found, "same" if r.published == r.found else "DIFFERS", r.example) for r in rows]


def _gap(distance: Distance) -> str:
    """A distance to the digits that are certain, or the interval that holds it."""
    low, high = millimetres(distance.lower), millimetres(distance.upper)
    return high if low == high or distance.uncertainty <= 1e-6 else f"{low} to {high}"


def _pose(row: PoseRow) -> Sequence[object]:
    apart = [f"{f - w:+z.3f}" for f, w in zip(row.computed, row.published, strict=True)]
    return [f"{row.part} {TITLES[row.part]}", *(f"{v + 0.0:z.3f}" for v in (*row.computed, *row.published)), *apart]


def _matrices(row: PoseRow) -> list[Sequence[object]]:
    """Published and computed (3, 3) beside ``T_P6_part`` (4, 4), line by line, and a blank line."""
    ours, theirs = row.matrices
    columns = [[" ".join(f"{v:z8.3f}" for v in line) for line in M] for M in (theirs, ours, row.T_line_part)]
    return [
        [row.part, *(column[0] for column in columns)],
        *zip_longest([""], *(c[1:] for c in columns), fillvalue=""),
        [""],
    ]


def _distances(tables: Reproduction) -> list[Sequence[object]]:
    rows: list[Sequence[object]] = []
    for d in tables.table4:
        # The paper's figures are stepped; the exact rows show what they would be without the step.
        compared = d.solver == "stepped" or d.unit_angle_deg is None
        theirs = (d.published, d.published_error) if compared else (None, None)
        apart = None if theirs[0] is None else f"{d.distance - theirs[0]:+z.3f}"
        cells = [None if v is None else f"{v:.3f}" for v in (d.distance, theirs[0], d.error, theirs[1])]
        rows.append([d.method, _unit(d.unit_angle_deg), d.solver, *cells[:2], apart, *cells[2:]])
    for number, (trial, theirs5) in enumerate(zip(tables.image_trials, published.IMAGE_DISTANCES, strict=True), 1):
        errors = [f"{abs(v - published.ACTUAL_DISTANCE):.3f}" for v in (trial, theirs5)]
        rows.append(["image", f"trial {number}", "", f"{trial:.3f}", f"{theirs5:.3f}", None, *errors])
    return rows


def _work(row: WorkRow) -> Sequence[object]:
    theirs = ", ".join(published.TABLE_5[row.method])
    formula = theirs if row.solver == "stepped" else "no steps: closed-form gradients"
    counts = row.motion_steps, row.contact_queries, row.segments
    return [row.method, _unit(row.unit_angle_deg), row.solver, *counts, formula]


def _unit(angle_deg: float | None) -> str | None:
    return None if angle_deg is None else f"{angle_deg:g} deg"
