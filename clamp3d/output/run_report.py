"""An assembly as text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator

from clamp3d.clamp.dimensions import TITLES
from clamp3d.clamp.forces import HELD
from clamp3d.clamp.matrix import millimetres
from clamp3d.clamp.result import Assembly, Play
from clamp3d.clamp.sequence import as_published, parse_sequence
from clamp3d.output.tables import text_table


def run_to_text(assembly: Assembly) -> str:
    """The assembly as lines for a terminal, numbers to the paper's printed digits."""
    return "\n".join(_lines(assembly))


_PLAY = {
    "hole": "bolt in the up splint's hole",
    "saddle": "and round back in the saddle",
    "washer": "and saddle on bolt",
}


def _play(play: Play) -> str:
    said = play.status.partition(":")[0] if play.distance is None else f"{play.distance:.3f} mm"
    return f"{said} ({_PLAY[play.joints[-1]]})"


def _lines(assembly: Assembly) -> Iterator[str]:
    clamp, work = assembly.clamp, assembly.work
    line, jumper = (f"{wire.label} ({2 * wire.radius:g} mm)" for wire in (clamp.line, clamp.jumper))
    limits = f" ({'; '.join(assembly.limits)})" if assembly.limits else ""
    yield f"clamp {clamp.name}: line {line}, jumper {jumper}; method {assembly.method}, {assembly.solver}{limits}"
    yield (
        f"{assembly.status}; distance between the splints {assembly.distance:.3f} mm, "
        f"tilt {math.degrees(assembly.tilt):.2f} deg, nut turned {assembly.turns:.2f} times from open"
    )
    if assembly.with_play:
        yield "with play: " + ", ".join(map(_play, assembly.with_play))
    if assembly.forces:
        pushes = ", ".join(f"{f.a}-{f.b} {f.force:.3f}" for f in assembly.forces if f.feature != HELD)
        yield f"contact forces per newton of bolt force: {pushes}"
        yield from (
            f"sideways {f.force:.3f} is left over: the down splint is taken as {f.feature} (joints in the clamp file)"
            for f in assembly.forces
            if f.feature == HELD
        )
    yield from map(str, assembly.others or ())
    yield ""
    yield "final state (mm; x right, y down from the power line's centre, angle counter-clockwise)"
    yield text_table(
        ("part", "x", "y", "angle_deg"),
        [
            (f"{name} {TITLES[name]}", f"{p.x:z.3f}", f"{p.y:z.3f}", f"{math.degrees(p.angle):z.2f}")
            for name, p in assembly.poses.items()
        ],
        indent=2,
    )
    yield ""
    yield "contacts (gap in mm; x, y of the point)"
    yield text_table(
        ("pair", "type", "relation", "gap", "x", "y", "on"),
        [
            (
                f"{c.a}-{c.b}",
                c.type,
                c.relation,
                millimetres(c.gap),
                *(("", "") if c.point is None else (f"{c.point[0]:z.3f}", f"{-c.point[2]:z.3f}")),
                c.feature,
            )
            for c in assembly.contacts
            if c.declared or c.type
        ],
        indent=2,
    )
    yield ""
    yield "grooves"
    yield text_table(
        ("pair", "seated", ""),
        [(f"{s.splint}-{s.wire}", "yes" if s.seated else "no", s.detail) for s in assembly.seats],
        indent=2,
    )
    if not as_published(parse_sequence(clamp.sequence)):
        yield ""
        yield f"sequence {clamp.sequence}"
        yield text_table(("step", "reached"), [(w.step, w.label) for w in assembly.path], indent=2)
    yield ""
    yield "events (mm travelled in the step)"
    yield text_table(
        ("step", "pair", "relation", "after"),
        [(e.step, f"{e.a}-{e.b}", e.relation, f"{e.travel:.3f}") for e in assembly.events],
        indent=2,
    )
    for title, rows in (
        ("met although the connection matrix says otherwise", assembly.undeclared),
        ("measured contacts that differ from the connection matrix", assembly.matrix_differences),
    ):
        if rows:
            yield ""
            yield title
            yield from (f"  {row}" for row in rows)
    yield ""
    if assembly.violation is not None:
        yield f"proof: largest violated gap {assembly.violation:.1e} mm, optimality {assembly.optimality:.1e} mm"
    yield (
        f"work: {work.parts} parts, {work.pairs} pairs, {work.contact_queries} contact queries, "
        f"{work.motion_steps} motion steps, {work.meshes_built} meshes built"
    )
