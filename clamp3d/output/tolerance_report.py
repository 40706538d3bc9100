"""Sensitivities and a Monte Carlo over tolerances as text, JSON data, and a histogram."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from clamp3d import __version__
from clamp3d.clamp.sensitivity import DIMENSIONS, Sensitivity
from clamp3d.clamp.tolerance import MonteCarlo
from clamp3d.output.figures import blank
from clamp3d.output.palette import INK
from clamp3d.output.section import note
from clamp3d.output.tables import text_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PERCENTILES = (0.1, 1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0, 99.9)
_SHARE = {"uniform": 1.0 / 3.0, "normal": 1.0 / 9.0}  # variance by the square of the tolerance


def shares(result: MonteCarlo, rows: tuple[Sensitivity, ...]) -> dict[str, float]:
    """Each dimension's variance (derivative * standard deviation)^2 in mm^2: their sum is the linear prediction."""
    tolerance = dict(zip(DIMENSIONS, result.spec.tolerance, strict=True))
    return {row.name: (row.derivative * tolerance[row.name]) ** 2 * _SHARE[result.spec.distribution] for row in rows}


def tolerance_to_text(result: MonteCarlo, rows: tuple[Sensitivity, ...], note: str = "") -> str:
    """Table of sensitivities, percentiles, and what does not clamp; ``note`` stands where there are no ``rows``."""
    spec, tolerance = result.spec, dict(zip(DIMENSIONS, result.spec.tolerance, strict=True))
    variance = shares(result, rows)
    total = sum(variance.values())
    n, m, unproven = len(result.status), len(result.clamped), result.unproven
    nominal = result.nominal_status if result.nominal is None else f"{result.nominal:.4f} mm"
    cells = [
        (
            row.name,
            f"{row.value:.4f}",
            f"{tolerance[row.name]:.4f}",
            f"{row.derivative:+.5f}",
            f"{100 * variance[row.name] / total:.1f} %" if total > 0.0 else None,
        )
        for row in rows
    ]
    lines = [
        f"clamp {spec.clamp.name}: splint distance {nominal}",
        text_table(("dimension", "mm", "+-mm", "mm per mm", "variance"), cells) if rows else note,
        f"{n} clamps within these tolerances (chosen, {spec.distribution}), seed {spec.seed}:",
    ]
    if m:
        linear = f" (linear: {math.sqrt(total):.4f} mm)" if rows else ""
        spread = f"mean {result.clamped.mean():.4f} mm, standard deviation {result.clamped.std():.4f} mm{linear}"
        values = zip(PERCENTILES, result.percentiles(PERCENTILES), strict=True)
        lines += [spread, text_table(("percentile", "mm"), [(f"{p:.1f} %", f"{v:.4f}") for p, v in values], indent=2)]
    lines.append(f"not clamped: {n - m - unproven} of {n} ({100 * (n - m - unproven) / n:.2f} %)")
    if unproven:
        lines.append(f"not proven: {unproven} of {n}")
    return "\n".join([*lines, *(f"  {count:6d}  {reason}" for reason, count in result.reasons().items())])


def tolerance_to_dict(result: MonteCarlo, rows: tuple[Sensitivity, ...]) -> dict[str, Any]:
    """All of it as JSON data; lengths in mm, null for a sample that does not clamp."""
    return {
        "clamp3d": __version__,
        "clamp": result.spec.clamp.name,
        "seed": result.spec.seed,
        "n": len(result.status),
        "distribution": result.spec.distribution,
        "tolerances_mm": dict(zip(DIMENSIONS, result.spec.tolerance, strict=True)),
        "nominal_mm": result.nominal,
        "status": result.nominal_status,
        "sensitivities": [asdict(row) for row in rows],
        "percentiles_mm": dict(zip(map(str, PERCENTILES), result.percentiles(PERCENTILES), strict=False)),
        "not_clamped": result.reasons(),
        "distance_mm": [None if math.isnan(d) else d for d in result.distance.tolist()],
    }


def histogram_figure(result: MonteCarlo) -> Figure:
    """The histogram of the splint distances; nominal, median, 5 and 95 % are marked and named."""
    figure = blank(7.5, 4.4)
    axes = figure.add_subplot()
    n, m = len(result.status), len(result.clamped)
    if m:
        axes.hist(result.clamped, bins=min(80, max(5, round(2.0 * m ** (1 / 3)))), color="#56B4E9", edgecolor="white")
        axes.set_ylim(0.0, 1.22 * axes.get_ylim()[1])
        by_height: Any = ("data", "axes fraction")
        names = ("5 % below", "median", "95 % below")
        for name, value in zip(names, result.percentiles((5.0, 50.0, 95.0)), strict=True):
            axes.axvline(value, color=INK, linestyle=(0, (4, 3)), linewidth=1.3)
            note(axes, f"{name} {value:.3f}", (value, 0.88), (4, 0), xycoords=by_height, ha="left")
        if result.nominal is not None:
            axes.axvline(result.nominal, color="#D55E00", linewidth=1.3)
            text, at = f"nominal {result.nominal:.3f}", (result.nominal, 0.95)
            note(axes, text, at, (-4, 0), xycoords=by_height, ha="right")
    else:
        axes.text(0.5, 0.5, "no sample clamps", transform=axes.transAxes, ha="center")
    axes.set(xlabel="splint distance (mm)", ylabel="clamps")
    axes.spines[["top", "right"]].set_visible(False)
    heading = f"{result.spec.clamp.name}: {n} clamps within tolerances, {n - m} not clamped (seed {result.spec.seed})"
    axes.set_title(heading, fontsize=10)
    return figure
