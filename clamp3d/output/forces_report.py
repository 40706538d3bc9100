"""Torque and friction of a clamp as text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clamp3d.clamp.friction import Band, FrictionBand
from clamp3d.clamp.torque import Range, Tightening
from clamp3d.output.tables import text_table


def tightening_to_text(tight: Tightening) -> str:
    """What a torque does, as lines for a terminal."""
    preloads = ", ".join(f"{newton / 1e3:.1f} kN at friction {mu:.2f}" for mu, newton in tight.preloads)
    loads = [
        (f"{load.force.a}-{load.force.b}", _span(load.newton, 1e-3, 1), _span(load.line_load))
        for load in tight.contacts
    ]
    lines = [
        f"torque {tight.torque:g} Nm: bolt preload {preloads} (VDI 2230; wire forces without friction in the grooves)",
        text_table(("contact", "force (kN)", "line load (N/mm)"), loads, indent=2),
        "  line load: force over the groove's length; strands are no solid bar, so no Hertz pressure is given",
    ]
    lines += [f"  {wire} slips lengthwise at a pull of {_span(s, 1e-3, 1)} kN" for wire, s in tight.slip.items()]
    lines += [f"  {limit.limit}: reached at {_span(limit.torque, digits=1)} Nm" for limit in tight.limits]
    coefficients = [(c.name, c.value, c.source) for c in tight.coefficients]
    return "\n".join([*lines, text_table(("coefficient", "value", "source"), coefficients, indent=2)])


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


def measured_to_text(finder: FrictionBand, bands: Sequence[Band], measured: float, least: float | None) -> str:
    """One line: whether a measured splint distance lies in the friction band, and from which friction on.

    ``least`` is what `FrictionBand.friction_for` says of it.
    """
    where = ", ".join(f"{'inside' if measured in band else 'outside'} at friction {band.friction:g}" for band in bands)
    needs = (
        "no friction up to 1 explains it"
        if least is None
        else f"it needs a friction of at least {np.ceil(1e3 * least) / 1e3:.3f}"
    )
    return f"measured {measured:g} mm: {needs}; {where} (without friction {finder.distance:.3f} mm)"
