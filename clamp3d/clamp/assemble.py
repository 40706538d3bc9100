"""The virtual assembly: the sequence's motions one after the other, each ending at a contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import choice, function, number, text
from clamp3d.clamp.closing import HELD, open_start
from clamp3d.clamp.contact import Contact, seats
from clamp3d.clamp.dimensions import PARTS, Clamp, Joints
from clamp3d.clamp.equilibria import describe, equilibria, same
from clamp3d.clamp.final_state import FinalState, solve_final_state
from clamp3d.clamp.follow import Closing, follow
from clamp3d.clamp.forces import contact_forces
from clamp3d.clamp.loader import WireSize, load_clamp
from clamp3d.clamp.matrix import PAIRS, Difference, contact_type
from clamp3d.clamp.meetings import meetings
from clamp3d.clamp.result import Assembly, Equilibrium, Event, Solver, Start, Waypoint, Work
from clamp3d.clamp.scene import CONTACT
from clamp3d.clamp.section import B, D, S, Section, W
from clamp3d.clamp.sequence import as_published, parse_sequence
from clamp3d.clamp.status import CLAMPED, final_status
from clamp3d.clamp.stepped import SteppedState, solve_bisection, solve_stepped
from clamp3d.clamp.steps import (
    Log,
    Meetings,
    approach_line,
    close_splints,
    first_touch,
    insert_jumper,
    section_poses,
    tighten_nut,
)
from clamp3d.errors import InputError, SolverError

STEP = 1.0 / 3.0
"""Move along the bolt of the paper's program in mm (derived from its Table 4)."""
TILT_STEP = math.radians(1.0)
"""Turn of the paper's program in rad (derived from its Table 4)."""
RESOLUTION = 1e-3
"""Where bisection stops, mm."""

_WIDEST = 1000.0
"""The most that a clamp is opened further than it needs, mm: descents are short."""


def assemble(
    clamp: Clamp | str | Path = "reference",
    model: ContactModel | None = None,
    *,
    line: WireSize | None = None,
    jumper: WireSize | None = None,
    sequence: str | None = None,
    solver: Solver = "exact",
    step: float = STEP,
    tilt_step: float = TILT_STEP,
    open_by: float = 0.0,
    open_tilt: float = 0.0,
    others: bool = False,
    on_waypoint: Callable[[Waypoint], None] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Assembly:
    """Assemble a clamp with its wires and measure where every part ends up.

    Parameters
    ----------
    clamp : Clamp, str or Path
        A clamp, the name of a built-in one, or a clamp file.
    model : ContactModel, optional
        How grooves are measured; by default `Cas`, the exact arcs.
    line, jumper : str or float, optional
        Wires in place of the clamp's own: catalogue name, or diameter in mm.
    sequence : str, optional
        Order of assembly in place of the clamp's own, in the paper's notation (see `clamp3d.clamp.sequence`).
    solver : {"exact", "stepped", "bisection"}
        How the closed position is found.
    step, tilt_step : float
        Moves of the stepped solver, and the first ones of bisection; mm and rad.
    open_by, open_tilt : float
        How much further than needed the clamp stands open before it comes in; mm and rad.
    others : bool
        Also find the other states that closing can end in, and the distance with the joints' play (exact solver only).
    on_waypoint : callable, optional
        Called with every `Waypoint` as it is reached.
    progress : callable, optional
        Called with the number of positions tried and the distance in mm, by the solvers that try positions.

    Returns
    -------
    Assembly

    Raises
    ------
    InputError
        For bad settings, dimensions or sequence.
    SolverError
        If an answer cannot be proven.
    SequenceError
        If a step of the sequence is blocked.

    Examples
    --------
    >>> assembly = assemble("reference", line="LJ-630", jumper="LJ-120")
    >>> assembly.status, round(assembly.distance, 3)
    ('clamped', 31.53)
    """
    clamp = load_clamp(clamp, line=line, jumper=jumper)
    if sequence is not None:
        clamp = replace(clamp, sequence=text("sequence", sequence))
    model = Cas() if model is None else model
    choice("solver", solver, ("exact", "stepped", "bisection"))
    check_model(model)
    step, tilt_step = number("step", step), number("tilt step", tilt_step)
    open_by, open_tilt = number("open_by", open_by), number("open_tilt", open_tilt)
    if not 0.0 <= open_by <= _WIDEST:
        raise InputError(f"open_by must be between 0 and {_WIDEST:g} mm, got {open_by:g}")
    function("on_waypoint", on_waypoint)
    function("progress", progress)
    steps = parse_sequence(clamp.sequence)
    names, published = [step.name for step in steps], as_published(steps)
    section = Section(clamp, model)
    log = Log(section, on_waypoint)
    opened = section.open_state(section.open_distance() + open_by, open_tilt)
    start = open_start(section, open_by=open_by, open_tilt=open_tilt)
    if published:
        approach_line(section, opened, start, names[0], log)
        insert_jumper(section, opened, start, names[1], log)
    final: FinalState | SteppedState
    met: Meetings = []
    if solver == "exact":
        final = solve_final_state(section, start, on_contact=lambda pair, q: met.append((pair, q)))
        held = final.held
        met = [(pair, q) for pair, q in met if pair not in (("P1", "P6"), ("P1", "P7"))]
    else:
        if solver == "stepped":
            final = solve_stepped(section, step=step, tilt_step=tilt_step, progress=progress)
        else:
            final = solve_bisection(section, resolution=RESOLUTION, step=step, tilt_step=tilt_step, progress=progress)
        held = final.q
        met = first_touch(section, start, float(start[D] - held[D]))
    by_hand = [(pair, q) for pair, q in met if not q[B : W + 1].any()]
    taken = [(pair, q) for pair, q in met if q[B : W + 1].any()]
    if published:
        close_splints(section, start, held, by_hand, names[2], log)
        travel = tighten_nut(section, start, held, final.q, taken, names[3], log)
    else:
        travel = follow(section, steps, Closing(start, held, final.q, by_hand, taken), log)
    poses = section_poses(section, final.q)
    contacts = log.contacts(poses)
    resolution = {"exact": CONTACT, "stepped": step, "bisection": 10.0 * RESOLUTION}[solver]
    found = {(e.a, e.b) for e in log.events}
    closes = next(step.name for step in steps if step.kind != "bring")
    for c in contacts:  # what touches in the end though no force says when
        if c.gap <= resolution and (c.declared or c.type) not in (0, 1) and (c.a, c.b) not in found:
            log.events.append(Event(closes, c.a, c.b, c.relation, c.point, float(start[D] - held[D])))
    log.events.sort(key=lambda e: (names.index(e.step), e.travel))
    queries = section.queries.contact  # what the assembly itself asked, without the other equilibria
    proof = (final.violation, final.optimality) if isinstance(final, FinalState) else (None, None)
    motion_steps = final.motion_steps if isinstance(final, SteppedState) else 0
    return Assembly(
        clamp=clamp,
        model=model,
        solver=solver,
        status=final_status(section, final, resolution, contacts),
        distance=section.splint_distance(final.q),
        closing=float(final.q[D]),
        tilt=float(final.q[S]) / section.lever,
        turns=clamp.bolt.turn(travel) / (2.0 * math.pi),
        poses=poses,
        contacts=contacts,
        seats=seats(contacts, resolution),
        events=tuple(log.events),
        path=tuple(log.path),
        undeclared=_undeclared(clamp, contacts, log),
        resolution=resolution,
        violation=proof[0],
        optimality=proof[1],
        work=Work(len(PARTS), len(PAIRS), queries, motion_steps, model.meshes_built),
        start=Start(float(start[D]), open_tilt, (float(start[0]), float(start[1])), (float(start[2]), float(start[3]))),
        **(_solved(section, final, others) if isinstance(final, FinalState) else {}),
    )


def _solved(section: Section, final: FinalState, others: bool) -> dict[str, Any]:
    """What only an exact answer has: forces and, if asked, what else closing could end in."""
    found: dict[str, Any] = {"forces": contact_forces(section, final)}
    if others:
        found["others"] = _others(section, final)
        found["with_play"] = _with_play(section, final)
    return found


def _with_play(section: Section, final: FinalState) -> dict[str, float | None] | None:
    """Distances that the clamp closes to from its final state when its joints have play, one after the other."""
    if section.free != HELD:
        return None
    found: dict[str, float | None] = {}
    for joints in (("hole",), ("hole", "saddle"), ("hole", "saddle", "washer")):
        clamp = replace(section.clamp, joints=Joints(**dict.fromkeys(joints, True)))
        free = Section(clamp, section.model)
        try:
            end = solve_final_state(free, final.q)
        except SolverError:
            found[", ".join(joints)] = None
            continue
        clamped = final_status(free, end) == CLAMPED
        found[", ".join(joints)] = free.splint_distance(end.q) if clamped else None
    return found


def _undeclared(clamp: Clamp, contacts: Sequence[Contact], log: Log) -> tuple[Difference, ...]:
    """Pairs declared 0 that touch or overlap in the final state, or do so on the way."""
    step = {(e.a, e.b): e.step for e in reversed(log.events)}
    last = log.path[-1].step
    touching = {
        (c.a, c.b): Difference(c.a, c.b, 0, c.type, c.gap, c.point, step.get((c.a, c.b), last))
        for c in contacts
        if c.declared == 0 and c.type
    }
    waiting = [pair for pair in PAIRS if clamp.connection(*pair) == 0 and pair not in touching]
    met = meetings(clamp, log.path, waiting, log.cache)
    on_the_way = (Difference(*pair, 0, contact_type(pair), None, None, where) for pair, where in met.items())
    return (*touching.values(), *on_the_way)


def _others(section: Section, final: FinalState) -> tuple[Equilibrium, ...]:
    """The equilibria beside the final state."""
    return tuple(
        Equilibrium(
            distance=section.splint_distance(state.q),
            closing=float(state.q[D]),
            tilt=float(state.q[S]) / section.lever,
            status=final_status(section, state),
            detail=describe(state, section.escaped(state.q)),
            is_equilibrium=not section.escaped(state.q),
        )
        for state in equilibria(section)
        if not same(state, final)
    )
