"""Torque and friction of a clamp as text, and the friction band as a picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from clamp3d.clamp.friction import Band, FrictionBand
from clamp3d.clamp.torque import Range, Tightening
from clamp3d.output.figures import blank
from clamp3d.output.palette import INK, PART_COLOURS, darker
from clamp3d.output.tables import text_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def tightening_to_text(tight: Tightening) -> str:
    """What a torque does, as lines for a terminal."""
    return "\n".join(_tightening(tight))


def _tightening(tight: Tightening) -> Iterator[str]:
    preloads = ", ".join(f"{newton / 1e3:.1f} kN at friction {mu:.2f}" for mu, newton in tight.preloads)
    yield f"torque {tight.torque:g} Nm: bolt preload {preloads} (VDI 2230; wire forces without friction in the grooves)"
    rows = [
        (f"{load.force.a}-{load.force.b}", _span(load.newton, 1e-3, 1), _span(load.line_load))
        for load in tight.contacts
    ]
    yield text_table(("contact", "force (kN)", "line load (N/mm)"), rows, indent=2)
    yield "  line load: force over the groove's length; strands are no solid bar, so no Hertz pressure is given"
    for wire, pull in tight.slip.items():
        yield f"  {wire} slips lengthwise at a pull of {_span(pull, 1e-3, 1)} kN"
    for limit in tight.limits:
        yield f"  {limit.limit}: reached at {_span(limit.torque, digits=1)} Nm"
    rows = [(c.name, c.value, c.source) for c in tight.coefficients]
    yield text_table(("coefficient", "value", "source"), rows, indent=2)


def _span(span: Range | None, factor: float = 1.0, digits: int = 0) -> str:
    return "" if span is None else f"{span.low * factor:.{digits}f} to {span.high * factor:.{digits}f}"


def bands_to_text(bands: Sequence[Band]) -> str:
    """The bands of some frictions, a line each.

    The ends are rounded inwards: equilibrium exists at what is printed.
    """
    lines = []
    for band in bands:
        tried = band.least.states_beyond + band.greatest.states_beyond
        lines.append(
            f"friction {band.friction:g} in the grooves: equilibrium at splint distances from "
            f"{np.ceil(1e3 * band.least.distance) / 1e3:.3f} to {np.floor(1e3 * band.greatest.distance) / 1e3:.3f} mm "
            f"(forces at both ends; {tried} Farkas certificates 0.001 mm beyond)"
        )
    return "\n".join(lines)


def measured_to_text(finder: FrictionBand, bands: Sequence[Band], measured: float) -> str:
    """One line: whether a measured splint distance lies in the friction band, and from which friction on."""
    least = finder.friction_for(measured)
    where = ", ".join(f"{'inside' if measured in band else 'outside'} at friction {band.friction:g}" for band in bands)
    needs = (
        "no friction up to 1 explains it"
        if least is None
        else f"it needs a friction of at least {np.ceil(1e3 * least) / 1e3:.3f}"
    )
    return f"measured {measured:g} mm: {needs}; {where} (without friction {finder.distance:.3f} mm)"


def friction_figure(finder: FrictionBand, measured: Mapping[str, Sequence[float]], *, most: float = 0.3) -> Figure:
    """The friction band over the coefficient of friction, with measured splint distances beside it.

    Parameters
    ----------
    finder : FrictionBand
    measured : dict of sequences of float
        Distances in mm by what they are; each group has its own mark at the right edge.
    most : float
        Up to which friction the band is drawn.
    """
    figure = blank(7.0, 4.6)
    axes = figure.add_subplot()
    friction = np.linspace(0.0, most, 61)
    ends = np.array([(finder.distance,) * 2, *(finder.ends(float(mu)) for mu in friction[1:])])
    axes.fill_between(friction, ends[:, 0], ends[:, 1], color=PART_COLOURS["P2"], alpha=0.45, label="equilibrium")
    for side in ends.T:
        axes.plot(friction, side, color=darker(PART_COLOURS["P2"]), linewidth=1.2)
    marks = zip(measured.items(), ("o", "s", "^", "D"), (INK, "#B5332E", "#4A4F9A", "#8A6D00"), strict=False)
    for (name, distances), mark, colour in marks:
        for distance in distances:
            axes.axhline(distance, color=colour, linewidth=0.6, linestyle=":")
        axes.plot([most] * len(distances), distances, mark, color=colour, clip_on=False, label=name)
        needed = [(mu, value) for value in distances if (mu := finder.friction_for(value)) is not None and mu <= most]
        axes.plot([mu for mu, _ in needed], [value for _, value in needed], mark, color=colour, fillstyle="none")
    axes.set(xlim=(0.0, most), xlabel="friction in the grooves", ylabel="distance between the splints (mm)")
    axes.legend(loc="upper left", frameon=False)
    return figure
