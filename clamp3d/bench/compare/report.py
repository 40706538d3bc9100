"""A comparison as text for the terminal and as plain data for JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from clamp3d.bench import published
from clamp3d.bench.compare.assemblies import Assembled, Imaged
from clamp3d.bench.compare.measure import Measured
from clamp3d.bench.compare.methods import Method
from clamp3d.bench.compare.run import KNOWN, Comparison, NotMeasured, exact_distance
from clamp3d.output.tables import text_table


def comparison_to_dict(found: Comparison) -> dict[str, Any]:
    """Everything measured as JSON data: mm, seconds, MB; ``known`` are figures from elsewhere for the same groove."""
    truth = exact_distance(found)

    def contact(row: Measured | NotMeasured) -> dict[str, Any]:
        known = KNOWN.get(Method(row.method, row.setting).key)
        data = asdict(row)
        if known is not None:
            data["known"] = {"error": known[0], "pieces": known[1]}
        return data

    def assembly(row: Assembled | NotMeasured) -> dict[str, Any]:
        data = asdict(row)
        if isinstance(row, Assembled):
            data |= {"error": row.distance - truth, "published": _published(row)}
        return data

    return {
        "machine": asdict(found.machine),
        "seconds": found.seconds,
        "contact": [contact(row) for row in found.contact],
        "peers": [contact(row) for row in found.peers],
        "assembly": [assembly(row) for row in (*found.exact, *found.stepped)],
        "image": asdict(found.image),
        "complexity": asdict(found.complexity)
        if isinstance(found.complexity, NotMeasured)
        else [asdict(sweep) for sweep in found.complexity],
    }


def comparison_to_text(found: Comparison) -> str:
    """The tables as lines for a terminal."""
    parts = [str(found.machine), _contact(found), _assembly(found), _complexity(found)]
    return "\n\n".join([*parts, f"{found.seconds:.0f} s on the clock"])


def _contact(found: Comparison) -> str:
    title = (
        "A wire in a 140 degree groove (R 12, wire 10.5, block 137 x 30 x 60) at known poses\n"
        "  errors in mm against 50-digit values: of the distance when clear (median, worst), of the depth (worst);\n"
        "  known: from elsewhere; false hits / false misses of 80 poses (chords: 40) within the band of contact;\n"
        "  times in CPU microseconds per query; MB of the process, libraries included"
    )
    head = ["method", "pieces", "median", "worst", "depth", "known", "0.02 mm", "1e-4", "1e-6"]
    rows = []
    for row in (*found.contact, *found.peers):
        if isinstance(row, Measured):
            known = KNOWN.get(Method(row.method, row.setting).key)
            depth = "none" if row.depth_error is None else f"{row.depth_error:.2g}"
            errors = [f"{row.median_error:.2g}", f"{row.worst_error:.2g}", depth, f"{known[0]:g}" if known else "-"]
            bands = [f"{b.false_hits}/{b.false_misses}" for b in row.bands]
            times = [f"{row.one * 1e6:.3g}", f"{row.many * 1e6:.3g}", f"{row.setup:.2g}", f"{row.load:.2f}"]
            both = (row.memory, row.library_memory)
            memory = "-" if None in both else f"{sum(filter(None, both)):.0f}"
            rows.append([row.label, row.pieces, *errors, *bands, *times, memory])
    note = "  CoACD's cuts move with the tessellation: 4 to 6 hulls and 0.4 to 1.0 mm at 0.02, 13 to 165 hulls at 0.01"
    table = text_table([*head, "one", "many", "set-up s", "load s", "MB"], rows, indent=2)
    return "\n".join([title, table, *_not_measured((*found.contact, *found.peers)), note])


def _assembly(found: Comparison) -> str:
    truth = exact_distance(found)
    rows = []
    for exact, stepped in zip(found.exact, found.stepped, strict=True):
        if isinstance(exact, Assembled) and isinstance(stepped, Assembled):
            theirs = _published(stepped)
            status = "" if exact.status == "clamped" else exact.status
            work = [f"{exact.seconds:.3f}", exact.contact_queries, f"{stepped.distance:.3f}"]
            times = [f"{stepped.seconds:.2f}", stepped.contact_queries, f"{exact.setup:.2g}", status]
            error = _signed(exact.distance - truth)
            rows.append(
                [exact.label, f"{exact.distance:.4f}", error, *work, f"{theirs:.3f}" if theirs else "-", *times]
            )
    head = ["method", "exact", "error", "CPU s", "queries", "stepped", "published", "CPU s", "queries", "set-up s", ""]
    return "\n".join(
        [
            "Distance between the splints of the reference clamp, mm (Table 4); stepped: by 1/3 mm and 1 degree",
            text_table(head, rows, indent=2),
            *_not_measured(found.exact),
            *_image(found.image),
        ]
    )


def _image(image: Imaged | NotMeasured) -> list[str]:
    if isinstance(image, NotMeasured):
        return _not_measured([image])
    five = ", ".join(f"{v:.3f}" for v in image.first_five)
    theirs = ", ".join(f"{v:.3f}" for v in published.IMAGE_DISTANCES)
    return [
        f"  in a picture, marked by hand ({image.marking_error_px:g} px, {image.px_per_mm:g} px/mm): "
        f"error {image.median_by_hand:.2f} median, {image.worst_by_hand:.1f} worst of {image.trials}",
        f"    first five {five}; published {theirs}",
        f"  in a picture, found automatically: error {image.automatic:.4f}, {image.automatic_seconds:.2f} CPU s",
    ]


def _not_measured(rows: Iterable[object]) -> list[str]:
    return [f"  {row.label}: {row.reason}" for row in rows if isinstance(row, NotMeasured)]


def _complexity(found: Comparison) -> str:
    title = "Table 5 measured: exponents p in ~ v^p of positions tried (M), contact tests in all (M C) and CPU time"
    if isinstance(found.complexity, NotMeasured):
        return f"{title}\n  {found.complexity.reason}"
    rows = []
    for s in found.complexity:
        fits = [f"{round(e, 2) + 0.0:.2f}" if len(s.values) > 1 else "-" for e in s.exponents]
        paper = "-" if s.published is None else ", ".join(f"{p:g}" for p in s.published)
        spread = ", ".join(_span(counts) for counts in (s.positions, s.tests, s.seconds))
        rows.append([s.search, s.method, s.varied, s.fixed, *fits, paper, spread])
    head = ["search", "method", "v", "with", "M", "M C", "time", "published", "from .. to: M, M C, CPU s"]
    return "\n".join(
        [
            title,
            text_table(head, rows, indent=2),
            "  grid: the paper's search, every combination of n places for each of a moving parts",
            "  stepped: one way along the bolt, wires settle; exact: gradients; test: an arc or chord and a wire",
        ]
    )


def _span(values: Sequence[float]) -> str:
    first, last = (f"{v:.3g}" if isinstance(v, float) else str(v) for v in (values[0], values[-1]))
    return first if first == last else f"{first}..{last}"


def _published(row: Assembled) -> float | None:
    if row.method == "cas":
        return published.CAS_DISTANCE
    if row.method in ("chords", "wedges") and row.solver == "stepped":
        return published.CHORD_DISTANCES.get(row.setting or 0.0)
    return None


def _signed(value: float) -> str:
    return f"{value:+.2g}" if value else "0"
