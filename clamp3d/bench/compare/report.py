"""A comparison as text for the terminal and as plain data for JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from clamp3d.bench import published
from clamp3d.bench.compare.assemblies import Assembled
from clamp3d.bench.compare.measure import Measured
from clamp3d.bench.compare.run import Comparison, NotMeasured, exact_distance
from clamp3d.output.pages import render
from clamp3d.output.tables import text_table


def comparison_to_dict(comparison: Comparison) -> dict[str, Any]:
    """Everything measured as JSON data: mm, seconds."""
    truth = exact_distance(comparison)

    def assembly(row: Assembled | NotMeasured) -> dict[str, Any]:
        data = asdict(row)
        return data | ({"error": row.distance - truth} if isinstance(row, Assembled) else {})

    return {
        "machine": asdict(comparison.machine),
        "seconds": comparison.seconds,
        "contact": [asdict(row) for row in comparison.contact],
        "peers": [asdict(row) for row in comparison.peers],
        "assembly": [assembly(row) for row in comparison.assemblies],
        "image": asdict(comparison.image),
    }


def comparison_to_text(comparison: Comparison) -> str:
    """The tables as lines for a terminal."""
    rows = (*comparison.contact, *comparison.peers)
    return render(
        "compare.txt",
        "clamp3d.bench",
        comparison=comparison,
        table=text_table,
        contact=[_contact(row) for row in rows if isinstance(row, Measured)],
        missing_contact=[row for row in rows if isinstance(row, NotMeasured)],
        assembly=_assembly(comparison),
        missing_assembly=[row for row in (*comparison.assemblies, comparison.image) if isinstance(row, NotMeasured)],
        published=published.IMAGE_DISTANCES,
        five=lambda values: ", ".join(f"{value:.3f}" for value in values),
    )


def _contact(row: Measured) -> list[object]:
    depth = "none" if row.depth_error is None else f"{row.depth_error:.2g}"
    bands = [f"{b.false_hits}/{b.false_misses}" for b in row.bands]
    times = [f"{row.one * 1e6:.3g}", f"{row.many * 1e6:.3g}", f"{row.setup:.2g}", f"{row.load:.2f}"]
    return [row.label, row.pieces, f"{row.median_error:.2g}", f"{row.worst_error:.2g}", depth, *bands, *times]


def _assembly(comparison: Comparison) -> list[list[object]]:
    truth, rows = exact_distance(comparison), [row for row in comparison.assemblies if isinstance(row, Assembled)]
    return [
        [
            row.label,
            f"{row.distance:.4f}",
            f"{row.distance - truth:+.2g}" if row.distance != truth else "0",
            f"{row.seconds:.3f}",
            row.contact_queries,
            f"{row.setup:.2g}",
            "" if row.status == "clamped" else row.status,
        ]
        for row in rows
    ]
