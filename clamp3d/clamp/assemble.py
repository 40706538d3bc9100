"""The virtual assembly: the sequence's motions one after the other, each ending at a contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import choice, function, number
from clamp3d.clamp.contacts import CONTACT, measure_pairs, seats, undeclared_meetings
from clamp3d.clamp.dimensions import PARTS, Clamp, PartName
from clamp3d.clamp.equilibria import describe, equilibria, same, slipping
from clamp3d.clamp.final_state import FinalState, solve_final_state
from clamp3d.clamp.loader import WireSize, load_clamp
from clamp3d.clamp.motion import travel_to_contact
from clamp3d.clamp.result import Assembly, Equilibrium, Event, Solver, Waypoint, Work
from clamp3d.clamp.screw import ScrewJoint
from clamp3d.clamp.section import WIRES, D, S, Section
from clamp3d.clamp.sequence import parse_sequence
from clamp3d.clamp.status import final_status
from clamp3d.clamp.stepped import SteppedState, solve_bisection, solve_stepped
from clamp3d.core.pose import Array, SectionPose
from clamp3d.errors import InputError

STEP = 1.0 / 3.0
"""Move along the bolt of the paper's program in mm (derived from its Table 4)."""
TILT_STEP = math.radians(1.0)
"""Turn of the paper's program in rad (derived from its Table 4)."""
RESOLUTION = 1e-3
"""Where bisection stops, mm."""

Poses = dict[PartName, SectionPose]
_WIDEST = 1000.0
"""The most that a clamp is opened further than it needs, mm: it closes by small strides."""
_ROOM = 20.0
"""Free way in mm between a wire and the open clamp before it comes in."""


@dataclass
class _Log:
    """What happens on the way; ``on_waypoint(waypoint)`` is called as it happens."""

    on_waypoint: Callable[[Waypoint], None] | None
    events: list[Event] = field(default_factory=list)
    path: list[Waypoint] = field(default_factory=list)

    def stop(self, step: str, label: str, poses: Poses) -> None:
        self.path.append(Waypoint(step, label, dict(poses)))
        if self.on_waypoint is not None:
            self.on_waypoint(self.path[-1])


def assemble(
    clamp: Clamp | str | Path = "reference",
    model: ContactModel | None = None,
    *,
    line: WireSize | None = None,
    jumper: WireSize | None = None,
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
    solver : {"exact", "stepped", "bisection"}
        How the closed position is found.
    step, tilt_step : float
        Moves of the stepped solver, and the first ones of bisection; mm and rad.
    open_by, open_tilt : float
        How much further than needed the clamp stands open before it comes in; mm and rad.
    others : bool
        Also find the other states that closing can end in (exact solver only).
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

    Examples
    --------
    >>> assembly = assemble("reference", line="LJ-630", jumper="LJ-120")
    >>> assembly.status, round(assembly.distance, 3)
    ('clamped', 31.53)
    """
    clamp = load_clamp(clamp, line=line, jumper=jumper)
    model = Cas() if model is None else model
    choice("solver", solver, ("exact", "stepped", "bisection"))
    check_model(model)
    step, tilt_step = number("step", step), number("tilt step", tilt_step)
    open_by, open_tilt = number("open_by", open_by), number("open_tilt", open_tilt)
    if not 0.0 <= open_by <= _WIDEST:
        raise InputError(f"open_by must be between 0 and {_WIDEST:g} mm, got {open_by:g}")
    function("on_waypoint", on_waypoint)
    function("progress", progress)
    sequence = [str(s) for s in parse_sequence(clamp.sequence)]
    section = Section(clamp, model)
    log = _Log(on_waypoint)
    q = section.open_state(section.open_distance() + open_by, open_tilt)
    q = _come_in(section, q, sequence[0], log)
    q = _put_in_jumper(section, q, sequence[1], log)
    d_open = float(q[D])
    final: FinalState | SteppedState
    if solver == "exact":
        final = solve_final_state(section, q)
    elif solver == "stepped":
        final = solve_stepped(section, step=step, tilt_step=tilt_step, progress=progress)
    else:
        final = solve_bisection(section, resolution=RESOLUTION, step=step, tilt_step=tilt_step, progress=progress)
    travel = d_open - float(final.q[D])
    _first_touch(section, q, sequence[2], log, travel)
    closed = _poses(section, final.q, saddle_d=d_open)
    log.stop(sequence[2], "splints closed", closed)
    poses = _poses(section, final.q)
    log.stop(sequence[3], "nut tightened", poses)
    pairs = measure_pairs(section, poses, CONTACT)
    contacts = tuple(c for c in pairs if clamp.connection(c.a, c.b) != 0 or c.distance <= CONTACT)
    resolution = {"exact": CONTACT, "stepped": step, "bisection": 10.0 * RESOLUTION}[solver]
    drawn = {("P2", "P3"), ("P1", "P5"), ("P3", "P4")}  # closed by the nut, all else by the down splint
    for by_nut, by in ((False, sequence[2]), (True, sequence[3])):
        for c in contacts:
            if c.type != 1 and c.distance <= resolution and ((c.a, c.b) in drawn) == by_nut:
                log.events.append(Event(by, c.a, c.b, c.relation, c.point, travel))
    undeclared = undeclared_meetings(section, log.path, log.events)
    queries = section.queries.contact  # what the run itself asked, without the other equilibria
    proof = (final.violation, final.optimality) if isinstance(final, FinalState) else (None, None)
    motion_steps = final.motion_steps if isinstance(final, SteppedState) else 0
    return Assembly(
        clamp=clamp,
        model=model,
        solver=solver,
        status=final_status(clamp, final, resolution),
        distance=section.splint_distance(final.q),
        closing=float(final.q[D]),
        tilt=float(final.q[S]) / section.lever,
        turns=ScrewJoint(clamp.bolt.pitch).turn(travel) / (2.0 * math.pi),
        poses=poses,
        contacts=contacts,
        seats=seats(pairs, resolution),
        events=tuple(log.events),
        path=tuple(log.path),
        undeclared=undeclared,
        violation=proof[0],
        optimality=proof[1],
        work=Work(len(PARTS), len(PARTS) * (len(PARTS) - 1) // 2, queries, motion_steps, model.meshes_built),
        others=_others(section, final) if others and isinstance(final, FinalState) else None,
    )


def _others(section: Section, final: FinalState) -> tuple[Equilibrium, ...]:
    """The equilibria beside the final state."""
    return tuple(
        Equilibrium(
            distance=section.splint_distance(state.q),
            closing=float(state.q[D]),
            tilt=float(state.q[S]) / section.lever,
            status=final_status(section.clamp, state, CONTACT),
            detail=describe(state),
            rests=not slipping(state),
        )
        for state in equilibria(section)
        if not same(state, final)
    )


def _come_in(section: Section, q: Array, step: str, log: _Log) -> Array:
    """The open clamp comes in from the right until the line lies under its groove, then settles down on the line."""
    clamp = section.clamp
    beside, over, settled = q.copy(), q.copy(), q.copy()
    middle = 0.5 * (clamp.up_splint.thickness + section.down_splint(q).point(0.0, clamp.down_splint.face_depth)[1])
    for state in (beside, over):
        state[1] = middle
    beside[0] = -clamp.line.radius - _ROOM
    settled[:2] = over[:2]
    travel, touch = travel_to_contact(section, settled, "P6", -_unit(1), "P1")
    settled = settled - travel * _unit(1)
    # The jumper waits clear of the clamp's way in.
    waiting = settled.copy()
    waiting[2] = settled[0] - beside[0] + clamp.up_splint.width + clamp.jumper.radius + _ROOM
    waiting[3] = middle
    jumper = _poses(section, waiting)["P7"]
    for state, label in ((beside, "open clamp beside the line"), (over, "line between the splints")):
        log.stop(step, label, _poses(section, state) | {"P7": jumper})
    log.stop(step, "up splint rests on the line", _poses(section, waiting))
    log.events.append(_event(section, waiting, step, touch, travel))
    return waiting


def _put_in_jumper(section: Section, q: Array, step: str, log: _Log) -> Array:
    """The jumper comes in between the splints from its side and is lifted into the up splint's groove."""
    inside = q.copy()
    inside[2] = float(section.pairs["P1", "P7"].T_a_groove[0, 3])
    log.stop(step, "jumper between the splints", _poses(section, inside))
    travel, touch = travel_to_contact(section, inside, "P7", -_unit(3), "P1")
    inside = inside - travel * _unit(3)
    log.stop(step, "jumper in the up splint's groove", _poses(section, inside))
    log.events.append(_event(section, inside, step, touch, travel))
    return inside


def _first_touch(section: Section, q: Array, step: str, log: _Log, limit: float) -> None:
    """The down splint rises along the bolt until it first touches a wire, within its whole way of ``limit`` mm."""
    reach = {wire: travel_to_contact(section, q, wire, -_unit(D), "P2", limit=limit) for wire in WIRES}
    wire = min(WIRES, key=lambda w: reach[w][0])
    travel, touch = reach[wire]
    if touch is not None:
        touching = q - travel * _unit(D)
        log.stop(step, f"down splint touches {wire}", _poses(section, touching, saddle_d=float(q[D])))
        log.events.append(_event(section, touching, step, touch, travel))


def _unit(i: int) -> Array:
    return np.asarray(np.eye(6)[i])


def _poses(section: Section, q: Array, saddle_d: float | None = None) -> Poses:
    """Section poses of all parts with the line at rest; ``saddle_d`` is where the saddle stands if not under P2."""
    clamp = section.clamp
    x, y = -float(q[0]), -float(q[1])
    down = section.down_splint(q)
    saddle_y = y + (down.y - _saddle_lift(section, q) if saddle_d is None else saddle_d - clamp.back_clearance)
    bolt_y = saddle_y + clamp.saddle.radius + clamp.saddle.apex_thickness - clamp.bolt.shank_length
    bolt_x = x + section.bolt_x
    return {
        "P1": SectionPose(x, y),
        "P2": SectionPose(bolt_x, y + down.y, down.angle),
        "P3": SectionPose(bolt_x, saddle_y),
        "P4": SectionPose(bolt_x, bolt_y),
        "P5": SectionPose(bolt_x, y - clamp.nut.height),
        "P6": SectionPose(0.0, 0.0),
        "P7": SectionPose(x + float(q[2]), y + float(q[3])),
    }


def _saddle_lift(section: Section, q: Array) -> float:
    """How far the saddle's arc centre stands above P2's origin when the nut has drawn it up to the round back; mm."""
    pair = section.pairs["P3", "P2"]
    lift = 0.0
    for _ in range(100):
        back = SectionPose(0.0, lift, float(q[S]) / section.lever)
        section.queries.contact += 1
        gap = float(section.model.pieces(pair, back.T()).distance.min())
        if abs(gap) <= 1e-12 * section.clamp.saddle.radius:
            break
        lift += gap
    return lift


def _event(section: Section, q: Array, step: str, touch: tuple[PartName, PartName] | None, travel: float) -> Event:
    """The event of a motion that ended at ``touch``."""
    assert touch is not None  # every motion here ends at a groove
    contact = next(c for c in measure_pairs(section, _poses(section, q), CONTACT) if (c.a, c.b) == touch)
    return Event(step, contact.a, contact.b, contact.relation, contact.point, travel)
