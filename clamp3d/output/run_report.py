"""An assembly as text for the terminal, and what torque and friction do to it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from clamp3d.clamp.contact import Contact
from clamp3d.clamp.dimensions import TITLES
from clamp3d.clamp.result import HELD_ON_AXIS, Assembly, Play
from clamp3d.clamp.sequence import as_published, parse_sequence
from clamp3d.output.tables import text_table
from clamp3d.output.wording import distance_text

if TYPE_CHECKING:  # SciPy's optimisers take long to import
    from clamp3d.clamp.friction import Band, FrictionBand
    from clamp3d.clamp.torque import Range, Tightening

_PLAY = {
    "hole": "bolt in the up splint's hole",
    "saddle": "and round back in the saddle",
    "washer": "and saddle on bolt",
}


def run_to_text(assembly: Assembly) -> str:
    """The assembly as lines for a terminal, numbers to the paper's printed digits."""
    blocks = ["\n".join(_summary(assembly)), *_tables(assembly), "\n".join(_footer(assembly))]
    return "\n\n".join(blocks)


def _summary(assembly: Assembly) -> Iterator[str]:
    clamp = assembly.clamp
    line, jumper = (f"{wire.label} ({2 * wire.radius:g} mm)" for wire in (clamp.line, clamp.jumper))
    limits = f" ({'; '.join(assembly.limits)})" if assembly.limits else ""
    yield f"clamp {clamp.name}: line {line}, jumper {jumper}; method {assembly.method}, {assembly.solver}{limits}"
    yield (
        f"{assembly.status}; distance between the splints {assembly.distance:.3f} mm, "
        f"tilt {math.degrees(assembly.tilt):z.2f} deg, nut turned {assembly.turns:.2f} times from open"
    )
    if assembly.with_play:
        yield "with play: " + ", ".join(map(_play, assembly.with_play))
    if assembly.forces:
        pushes = ", ".join(f"{f.a}-{f.b} {f.force:.3f}" for f in assembly.forces if f.feature != HELD_ON_AXIS)
        yield f"contact forces per newton of bolt force: {pushes}"
        yield from (
            f"a sideways force of {f.force:.3f} is not balanced: the down splint is assumed {f.feature} (see [joints])"
            for f in assembly.forces
            if f.feature == HELD_ON_AXIS
        )
    yield from map(str, assembly.others or ())


def _play(play: Play) -> str:
    said = play.status.partition(":")[0] if play.distance is None else f"{play.distance:.3f} mm"
    return f"{said} ({_PLAY[play.joints[-1]]})"


def _tables(assembly: Assembly) -> Iterator[str]:
    """The tables of a run, each under its title."""
    clamp = assembly.clamp
    poses = [
        (f"{name} {TITLES[name]}", f"{p.x:z.3f}", f"{p.y:z.3f}", f"{math.degrees(p.angle):z.2f}")
        for name, p in assembly.poses.items()
    ]
    heading = "final state (mm; x right, y down from the power line's centre, angle counter-clockwise)"
    yield _titled(heading, ("part", "x", "y", "angle_deg"), poses)
    contacts = [_contact(contact) for contact in assembly.contacts if contact.declared or contact.type]
    columns = ("pair", "type", "relation", "gap", "x", "y", "on")
    yield _titled("contacts (gap in mm; x, y of the point)", columns, contacts)
    seats = [(f"{s.splint}-{s.wire}", "yes" if s.seated else "no", s.detail) for s in assembly.seats]
    yield _titled("grooves", ("pair", "seated", ""), seats)
    if not as_published(parse_sequence(clamp.sequence)):
        yield _titled(f"sequence {clamp.sequence}", ("step", "reached"), [(w.step, w.label) for w in assembly.path])
    events = [(e.step, f"{e.a}-{e.b}", e.relation, f"{e.travel:.3f}") for e in assembly.events]
    yield _titled("events (mm travelled in the step)", ("step", "pair", "relation", "after"), events)
    for title, differences in (
        ("met although the connection matrix says otherwise", assembly.undeclared),
        ("measured contacts that differ from the connection matrix", assembly.matrix_differences),
    ):
        if differences:
            yield "\n".join([title, *(f"  {difference}" for difference in differences)])


def _titled(title: str, head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    return f"{title}\n{text_table(head, rows, indent=2)}"


def _contact(contact: Contact) -> tuple[object, ...]:
    place = ("", "") if contact.point is None else (f"{contact.point[0]:z.3f}", f"{-contact.point[2]:z.3f}")
    pair = f"{contact.a}-{contact.b}"
    gap = distance_text(contact.distance, digits=3).removeprefix("gap ").removesuffix(" mm")
    return (pair, contact.type, contact.relation, gap, *place, contact.feature)


def _footer(assembly: Assembly) -> Iterator[str]:
    work = assembly.work
    if assembly.violation is not None:
        yield f"proof: largest violated gap {assembly.violation:.1e} mm, optimality {assembly.optimality:.1e} mm"
    yield (
        f"work: {work.parts} parts, {work.pairs} pairs, {work.contact_queries} contact queries, "
        f"{work.motion_steps} motion steps, {work.meshes_built} meshes built"
    )


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
