"""A sweep of misplaced wires as text, JSON data, and a map of its outcomes."""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d import __version__
from clamp3d.clamp.placement import FREEDOMS, Freedom, Limits, Outcome, Outcomes, Placement, PlacementTolerance
from clamp3d.core.distance import Feature
from clamp3d.output.figures import blank, save_figure
from clamp3d.output.palette import INK

ANGLES: tuple[Freedom, ...] = ("yaw", "pitch")

# Okabe and Ito's colours (Color Universal Design, 2008), distinct for colour-blind readers, light to dark.
COLOURS = {Outcome.CLOSES: "#009E73", Outcome.TOUCHES_WRONGLY: "#E69F00", Outcome.CANNOT_SEAT: "#4A4F55"}
_TITLES = {"offset": "offset (mm)", "height": "height (mm)", "yaw": "yaw (deg)", "pitch": "pitch (deg)"}


def shown(freedom: Freedom, value: float) -> float:
    """A value as the user reads it: mm, or degrees."""
    return math.degrees(value) if freedom in ANGLES else value


def limits_text(limit: Limits) -> str:
    """One line: how far one freedom may go.

    >>> limits_text(Limits("offset", -1.5, 2.0, False, True))
    'offset   -1.500 to > +2.000 mm'
    """
    unit = "deg" if limit.freedom in ANGLES else "mm"
    low, high = shown(limit.freedom, limit.low), shown(limit.freedom, limit.high)
    below, above = "< " if limit.low_open else "", "> " if limit.high_open else ""
    return f"{limit.freedom:8s} {below}{low:+.3f} to {above}{high:+.3f} {unit}"


def sweep_to_text(closing: Placement, tolerances: PlacementTolerance, cloud: Outcomes | None) -> str:
    """PlacementTolerance, and the shares of a random cloud if there is one."""
    clamp = closing.clamp
    wire = clamp.line if closing.wire == "P6" else clamp.jumper
    lines = [
        f"clamp {clamp.name}, wire {closing.wire} {wire.label} ({2 * wire.radius:g} mm): closes up to "
        f"{closing.seat_tolerance:g} mm opening",
        "tolerance of each freedom alone",
        *(f"  {limits_text(limit)}" for limit in tolerances.limits),
        f"all at once: {100 * tolerances.together:.1f} % of these limits "
        f"(corners and {tolerances.samples} random points)",
    ]
    if cloud is not None:
        n = len(cloud.outcome)
        shares = [f"{o.label} {100 * float((cloud.outcome == o).mean()):.1f} %" for o in Outcome]
        lines.append(f"{n} random misplacements: {', '.join(shares)}")
    return "\n".join(lines)


def sweep_to_dict(
    closing: Placement,
    tolerances: PlacementTolerance,
    grids: dict[tuple[Freedom, Freedom], Outcomes],
    cloud: Outcomes | None,
) -> dict[str, Any]:
    """The sweep as JSON data; lengths in mm, angles in degrees."""
    data: dict[str, Any] = {
        "clamp3d": __version__,
        "clamp": closing.clamp.name,
        "wire": closing.wire,
        "seat_tolerance_mm": closing.seat_tolerance,
        "tolerances": [
            asdict(x)
            | {"unit": "deg" if x.freedom in ANGLES else "mm"}
            | {"low": shown(x.freedom, x.low), "high": shown(x.freedom, x.high)}
            for x in tolerances.limits
        ],
        "together": tolerances.together,
        "grids": [{"over": [x, y], "points": _points(outcomes)} for (x, y), outcomes in grids.items()],
    }
    if cloud is not None:
        data["random"] = _points(cloud)
    return data


def _points(outcomes: Outcomes) -> dict[str, Any]:
    """Columns, one entry per point."""
    columns: dict[str, Any] = {
        f: [shown(f, v) for v in outcomes.misplacement[:, k].tolist()] for k, f in enumerate(FREEDOMS)
    }
    columns["outcome"] = [Outcome(o).label for o in outcomes.outcome]
    columns["opening_mm"] = [v if math.isfinite(v) else None for v in outcomes.opening.tolist()]
    columns["touches_up"] = [Feature(f).name.lower() for f in outcomes.feature[:, 0]]
    columns["touches_down"] = [Feature(f).name.lower() for f in outcomes.feature[:, 1]]
    return columns


def grid(closing: Placement, x: Freedom, y: Freedom, ranges: dict[Freedom, float], steps: int) -> Outcomes:
    """Outcomes (steps * steps) over two freedoms, y slowest, the others at nominal."""
    m = np.zeros((steps * steps, len(FREEDOMS)))
    a, b = (np.linspace(-ranges[f], ranges[f], steps) for f in (x, y))
    m[:, FREEDOMS.index(x)], m[:, FREEDOMS.index(y)] = np.tile(a, steps), np.repeat(b, steps)
    return closing.close(m)


def planes(ranges: dict[Freedom, float]) -> list[tuple[Freedom, Freedom]]:
    """Pairs of freedoms that a map shows: all pairs of those with a range."""
    return list(itertools.combinations(ranges, 2))


def draw_map(
    path: Path,
    closing: Placement,
    tolerances: PlacementTolerance,
    grids: dict[tuple[Freedom, Freedom], Outcomes],
    ranges: dict[Freedom, float],
) -> None:
    """Write the map as PNG, SVG or PDF by the file's name: one field per pair of freedoms, the limits marked."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    figure = blank(4.3 * len(grids) + 0.6, 5.2)
    colours = ListedColormap([COLOURS[o] for o in Outcome])
    norm = BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3)
    limits = {x.freedom: x for x in tolerances.limits}
    for k, ((x, y), outcomes) in enumerate(grids.items()):
        axes = figure.add_subplot(1, len(grids), k + 1)
        steps = math.isqrt(len(outcomes.outcome))
        a, b = shown(x, ranges[x]), shown(y, ranges[y])
        across, along = np.linspace(-a, a, steps), np.linspace(-b, b, steps)
        field, opening = outcomes.outcome.reshape(steps, steps), outcomes.opening.reshape(steps, steps)
        axes.pcolormesh(across, along, field, cmap=colours, norm=norm, shading="nearest")
        wrong = field == Outcome.TOUCHES_WRONGLY
        axes.contourf(across, along, wrong, levels=[0.5, 1.5], colors="none", hatches=["///"])
        opening = np.where(np.isfinite(opening), opening, np.nan)
        levels = [v for v in (0.1, 0.25, 1.0, 2.0, 5.0, 10.0) if v < np.nanmax(opening)]
        lines = axes.contour(across, along, opening, levels=levels, colors="white", linewidths=0.9)
        axes.clabel(lines, fmt="%g mm", fontsize=7)
        for limit, mark in ((limits[x], axes.axvline), (limits[y], axes.axhline)):
            for value, is_open in ((limit.low, limit.low_open), (limit.high, limit.high_open)):
                if not is_open:
                    mark(shown(limit.freedom, value), color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
        axes.set_xlim(-a, a)
        axes.set_ylim(-b, b)
        axes.set_xlabel(_TITLES[x])
        axes.set_ylabel(_TITLES[y])
    wire = closing.clamp.line if closing.wire == "P6" else closing.clamp.jumper
    figure.suptitle(
        f"{closing.clamp.name}: where the clamp closes on {closing.wire} ({wire.label}) held misplaced", fontsize=11
    )
    legend = [Patch(fc=COLOURS[o], hatch="//" * (o is Outcome.TOUCHES_WRONGLY), label=o.label) for o in Outcome]
    figure.legend(
        handles=legend,
        loc="outside lower center",
        ncols=3,
        frameon=False,
        title=f"closes: in both grooves, opening up to {closing.seat_tolerance:g} mm. "
        "White lines: opening. Dashed: limit of one freedom alone.",
        title_fontsize=8,
    )
    save_figure(figure, path)
