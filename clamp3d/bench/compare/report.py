"""A comparison as text for the terminal and as plain data for JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from clamp3d.bench import published
from clamp3d.bench.compare.jobs import Assembled
from clamp3d.bench.compare.measure import Measured
from clamp3d.bench.compare.methods import Method
from clamp3d.bench.compare.run import KNOWN, Comparison, NotMeasured, exact_distance


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
    lines = [
        str(found.machine),
        "",
        *_contact(found),
        "",
        *_assembly(found),
        "",
        *_complexity(found),
        "",
        f"{found.seconds:.0f} s on the clock",
    ]
    return "\n".join(lines)


def _contact(found: Comparison) -> Iterator[str]:
    yield "A wire in a 140 degree groove (R 12, wire 10.5, block 137 x 30 x 60) at known poses"
    yield "  errors in mm against 50-digit values: of the distance when clear (median, worst), of the depth (worst);"
    yield "  known: from elsewhere; false hits / false misses of 80 poses (chords: 40) within the band of contact;"
    yield "  times in CPU microseconds per query; MB of the process, libraries included"
    yield (
        f"  {'method':17s} {'pieces':>6s} {'median':>8s} {'worst':>8s} {'depth':>8s} {'known':>8s}  "
        f"{'0.02 mm':>7s} {'1e-4':>7s} {'1e-6':>7s}  {'one':>8s} {'many':>8s} {'set-up s':>8s} {'load s':>6s} "
        f"{'MB':>5s}"
    )
    for row in (*found.contact, *found.peers):
        if isinstance(row, NotMeasured):
            yield f"  {row.label:17s} {row.reason}"
            continue
        known = KNOWN.get(Method(row.method, row.setting).key)
        bands = " ".join(f"{f'{b.false_hits}/{b.false_misses}':>7s}" for b in row.bands)
        depth = "none" if row.depth_error is None else f"{row.depth_error:.2g}"
        memory = "-" if row.memory is None or row.library_memory is None else f"{row.memory + row.library_memory:.0f}"
        elsewhere = f"{known[0]:g}" if known else "-"
        figures = f"{row.pieces:6d} {row.median_error:8.2g} {row.worst_error:8.2g} {depth:>8s} {elsewhere:>8s}"
        times = f"{row.one * 1e6:8.3g} {row.many * 1e6:8.3g} {row.setup:8.2g} {row.load:6.2f} {memory:>5s}"
        yield f"  {row.label:17s} {figures}  {bands}  {times}"
    yield "  CoACD's cuts move with the tessellation: 4 to 6 hulls and 0.4 to 1.0 mm at 0.02, 13 to 165 hulls at 0.01"


def _assembly(found: Comparison) -> Iterator[str]:
    truth = exact_distance(found)
    yield "Distance between the splints of the reference clamp, mm (Table 4); stepped: by 1/3 mm and 1 degree"
    yield (
        f"  {'method':16s} {'exact':>9s} {'error':>9s} {'CPU s':>7s} {'queries':>7s}  "
        f"{'stepped':>9s} {'published':>9s} {'CPU s':>7s} {'queries':>7s} {'set-up s':>8s}"
    )
    for exact, stepped in zip(found.exact, found.stepped, strict=True):
        if isinstance(exact, NotMeasured) or isinstance(stepped, NotMeasured):
            reason = exact.reason if isinstance(exact, NotMeasured) else ""
            yield f"  {exact.label:16s} {reason}"
            continue
        theirs = _published(stepped)
        yield (
            f"  {exact.label:16s} {exact.distance:9.4f} {_signed(exact.distance - truth):>9s} {exact.seconds:7.3f} "
            f"{exact.contact_queries:7d}  {stepped.distance:9.3f} {f'{theirs:.3f}' if theirs else '-':>9s} "
            f"{stepped.seconds:7.2f} {stepped.contact_queries:7d} {exact.setup:8.2g}"
        )
        if exact.status != "clamped":
            yield f"  {'':16s} {exact.status}"
    image = found.image
    if isinstance(image, NotMeasured):
        yield f"  {image.label:16s} {image.reason}"
        return
    five = ", ".join(f"{v:.3f}" for v in image.first_five)
    theirs_five = ", ".join(f"{v:.3f}" for v in published.IMAGE_DISTANCES)
    yield (
        f"  in a picture, marked by hand ({image.marking_error_px:g} px, {image.px_per_mm:g} px/mm): "
        f"error {image.median_by_hand:.2f} median, {image.worst_by_hand:.1f} worst of {image.trials}"
    )
    yield f"    first five {five}; published {theirs_five}"
    yield f"  in a picture, found automatically: error {image.automatic:.4f}, {image.automatic_seconds:.2f} CPU s"


def _complexity(found: Comparison) -> Iterator[str]:
    yield "Table 5 measured: exponents p in ~ v^p of positions tried (M), contact tests in all (M C) and CPU time"
    yield (
        f"  {'search':8s} {'method':7s} {'v':>4s} {'with':28s} {'M':>6s} {'M C':>6s} {'time':>6s}   {'published':>13s}"
        "   from .. to: M, M C, CPU s"
    )
    if isinstance(found.complexity, NotMeasured):
        yield f"  {found.complexity.reason}"
        return
    for s in found.complexity:
        several = len(s.values) > 1
        fits = " ".join(f"{round(e, 2) + 0.0:6.2f}" if several else "     -" for e in s.exponents)
        paper = "-" if s.published is None else f"{s.published[0]:g}, {s.published[1]:g}, {s.published[2]:g}"
        spread = f"{_span(s.positions)}, {_span(s.tests)}, {_span(s.seconds)}"
        yield f"  {s.search:8s} {s.method:7s} {s.varied:>4s} {s.fixed:28s} {fits}   {paper:>13s}   {spread}"
    yield "  grid: the paper's search, every combination of n places for each of a moving parts"
    yield "  stepped: one way along the bolt, wires settle; exact: gradients; test: an arc or chord and a wire"


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
