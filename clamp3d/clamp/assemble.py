"""The virtual assembly: the sequence's motions one after the other, each ending at a contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.model import ContactModel
from clamp3d.checks import array, choice, function, text
from clamp3d.clamp.closing import open_start
from clamp3d.clamp.contact import Contact, measure_contacts
from clamp3d.clamp.dimensions import PAIRS, PARTS, TOUCHING, Clamp, Joints
from clamp3d.clamp.equilibria import describe, equilibria, same
from clamp3d.clamp.final_state import FinalState, solve_final_state
from clamp3d.clamp.loader import WireSize, load_clamp
from clamp3d.clamp.play import Log, meetings, play
from clamp3d.clamp.result import Assembly, Difference, Equilibrium, Event, Play, Solver, Start, Waypoint, Work
from clamp3d.clamp.section import HELD, D, S, Section
from clamp3d.clamp.sequence import Step, parse_sequence
from clamp3d.clamp.status import closing_status
from clamp3d.clamp.stepped import SteppedState, solve_stepped
from clamp3d.clamp.ways import Closing, Meetings
from clamp3d.errors import SolverError

STEP, TILT_STEP = 1.0 / 3.0, math.radians(1.0)
"""Move along the bolt (mm) and turn (rad) of the paper's program, derived from its Table 4."""
RESOLUTION = 1e-3
"""Where bisection stops, mm."""


def assemble(
    clamp: Clamp | str | Path = "reference",
    model: ContactModel | None = None,
    *,
    line: WireSize | None = None,
    jumper: WireSize | None = None,
    sequence: str | None = None,
    solver: Solver = "exact",
    moves: tuple[float, float] = (STEP, TILT_STEP),
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
    moves : (float, float)
        Step (mm) and tilt step (rad) of the stepped solver, and the first ones of bisection.
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
    clamp, model = load_clamp(clamp, line=line, jumper=jumper), model or Cas()
    choice("solver", solver, ("exact", "stepped", "bisection"))
    moves = tuple(array("moves", moves, (2,), finite=False).tolist())
    function("on_waypoint", on_waypoint)
    function("progress", progress)
    if sequence is not None:
        clamp = replace(clamp, sequence=text("sequence", sequence))
    steps, section = parse_sequence(clamp.sequence), Section(clamp, model)
    log = Log(section, on_waypoint)
    closed = _close(section, solver, moves, progress)
    play(steps, closed.motions, log)
    contacts = measure_contacts(clamp, section.poses(closed.final.q), model, cache=log.cache)
    _add_silent_contacts(log, steps, closed, contacts)
    return _assembly(section, closed, contacts, log, others)


class _Closed(NamedTuple):
    """A closed clamp: its state, that again if it is proven, the motions to it, and to how many mm they are known."""

    solver: Solver
    final: FinalState | SteppedState
    proven: FinalState | None
    motions: Closing
    resolution: float


def _close(
    section: Section, solver: Solver, moves: tuple[float, float], progress: Callable[[int, float], None] | None
) -> _Closed:
    """Close a clamp from its open state."""
    start = open_start(section)
    if solver == "exact":
        met: Meetings = []
        final = solve_final_state(section, start, on_contact=lambda pair, q: met.append((pair, q)))
        met = [(pair, q) for pair, q in met if pair not in (("P1", "P6"), ("P1", "P7"))]
        return _Closed(solver, final, final, Closing(start, final.held, final.q, met), TOUCHING)
    step, tilt_step = moves
    resolution, until = (step, math.inf) if solver == "stepped" else (10.0 * RESOLUTION, RESOLUTION)
    tried = solve_stepped(section, step=step, tilt_step=tilt_step, resolution=until, progress=progress)
    return _Closed(solver, tried, None, Closing(start, tried.q, tried.q, []), resolution)


def _assembly(section: Section, closed: _Closed, contacts: tuple[Contact, ...], log: Log, others: bool) -> Assembly:
    """What was measured of a closed clamp; with ``others`` also where else it can close to."""
    clamp, model, queries = section.clamp, section.model, section.queries  # of the assembly itself, without others
    final, proven, start = closed.final, closed.proven, closed.motions.start
    return Assembly(
        clamp=clamp,
        model=model,
        solver=closed.solver,
        closing_status=closing_status(section, final, closed.resolution),
        distance=section.splint_distance(final.q),
        closing=section.down_splint(final.q).y,
        tilt=float(final.q[S]) / section.lever,
        turns=clamp.bolt.turn(closed.motions.travel) / (2.0 * math.pi),
        poses=section.poses(final.q),
        contacts=contacts,
        events=tuple(log.events),
        path=tuple(log.path),
        undeclared=_undeclared(clamp, contacts, log),
        resolution=closed.resolution,
        violation=proven.violation if proven else None,
        optimality=proven.optimality if proven else None,
        work=Work(len(PARTS), len(PAIRS), queries, getattr(final, "motion_steps", 0), model.meshes_built),
        start=Start(float(start[D]), 0.0, (float(start[0]), float(start[1])), (float(start[2]), float(start[3]))),
        forces=proven.forces(section) if proven else (),
        others=_others(section, proven) if proven and others else None,
        with_play=_with_play(section, proven) if proven and others else None,
    )


def _add_silent_contacts(log: Log, steps: tuple[Step, ...], closed: _Closed, contacts: Sequence[Contact]) -> None:
    """Add to the events what touches in the end though no force says when, and put them in order."""
    travel = float(closed.motions.start[D] - closed.motions.held[D])
    names, logged = [step.name for step in steps], {(e.a, e.b) for e in log.events}
    closes = next(step.name for step in steps if step.kind != "bring")
    for c in contacts:
        if c.gap <= closed.resolution and (c.declared or c.type) not in (0, 1) and (c.a, c.b) not in logged:
            log.events.append(Event(closes, c.a, c.b, c.relation, c.point, travel))
    log.events.sort(key=lambda e: (names.index(e.step), e.travel))


def _with_play(section: Section, final: FinalState) -> tuple[Play, ...]:
    """What the clamp closes to from its final state when its joints have play, one after the other."""
    if section.free != HELD:
        return ()
    ends = []
    for joints in (("hole",), ("hole", "saddle"), ("hole", "saddle", "washer")):
        free = Section(replace(section.clamp, joints=Joints(**dict.fromkeys(joints, True))), section.model)
        try:
            end = solve_final_state(free, final.q)
        except SolverError as error:
            ends.append(Play(joints, f"not proven: {error}", None))
        else:
            status = closing_status(free, end)
            ends.append(Play(joints, status.text, free.splint_distance(end.q) if status.clamped else None))
    return tuple(ends)


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
    on_the_way = (Difference(*pair, 0, 2, None, None, where) for pair, where in met.items())
    return (*touching.values(), *on_the_way)


def _others(section: Section, final: FinalState) -> tuple[Equilibrium, ...]:
    """The equilibria beside the final state."""
    return tuple(
        Equilibrium(
            distance=section.splint_distance(state.q),
            closing=float(state.q[D]),
            tilt=float(state.q[S]) / section.lever,
            status=closing_status(section, state).text,
            detail=describe(state, section.escaped(state.q)),
            is_equilibrium=not section.escaped(state.q),
        )
        for state in equilibria(section)
        if not same(state, final)
    )
