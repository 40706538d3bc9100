"""What an assembly answers: frozen dataclasses, no behaviour beyond reading them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from clamp3d import __version__
from clamp3d.baselines.model import ContactModel
from clamp3d.checks import instance
from clamp3d.clamp.contact import Contact, measure_contacts, overlap
from clamp3d.clamp.dimensions import TITLES, TYPES, Clamp, ConnectionType, Pair, PartName
from clamp3d.clamp.parts import clamp_scene
from clamp3d.clamp.plain import plain
from clamp3d.clamp.status import ClosingStatus, Seat
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError, need
from clamp3d.geometry.pose import Array, SectionPose

Solver = Literal["exact", "stepped", "bisection"]
HELD_ON_AXIS = "held on the bolt's axis"
"""What carries the sideways force that frictionless contacts leave, where the joints are said to have no play."""


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """A contact force: part a pushes part b.

    Attributes
    ----------
    a, b : str
        The two parts.
    feature : str
        What touches, as the section names it; `HELD_ON_AXIS` is no contact but an assumption.
    force : float
        Newton per newton of bolt force.
    point : ndarray (3,)
        Where it acts, in the world, mm.
    direction : ndarray (3,)
        Unit vector in which b is pushed, in the world.
    """

    a: PartName
    b: PartName
    feature: str
    force: float
    point: Array
    direction: Array


def millimetres(gap: float) -> str:
    """A gap in mm for people: three digits, more where it is smaller than they show, and 0 for rounding.

    >>> [millimetres(gap) for gap in (1.0, 0.0012, -9.876e-4, 6e-10, 4e-10)]
    ['1.000', '0.001', '-0.000988', '6e-10', '0']
    """
    return "0" if abs(gap) < 5e-10 else f"{gap:.3g}" if abs(gap) < 1e-3 else f"{gap:.3f}"


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """A pair whose measured contact is not the declared one.

    Attributes
    ----------
    a, b : str
        The two parts.
    declared, measured : int
        Types of the connection matrix; 0 is no contact.
    gap : float or None
        Signed distance of the two in the final state, mm; None for a meeting on the way.
    place : ndarray (3,) or None
        Where it is measured, on part a in the world, mm.
    where : str
        When it was seen: "the final state", or a step of the sequence.
    """

    a: PartName
    b: PartName
    declared: ConnectionType
    measured: ConnectionType
    gap: float | None
    place: Array | None
    where: str = "the final state"

    def __str__(self) -> str:
        pair = f"{self.a}-{self.b} ({TITLES[self.a]}, {TITLES[self.b]})"
        declared = f"declared {self.declared} ({TYPES[self.declared]})"
        if self.gap is not None and self.measured == 0:
            return f"{pair} {declared} but does not touch: {millimetres(self.gap)} mm apart in {self.where}"
        return f"{pair} {declared} but met as {self.measured} ({TYPES[self.measured]}) in {self.where}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return plain(self, gap="gap_mm", place="point") | {"text": str(self)}


@dataclass(frozen=True, slots=True)
class Event:
    """A contact that ended or changed a motion: in ``step`` of the sequence, after ``travel`` mm of it."""

    step: str
    a: PartName
    b: PartName
    relation: str
    point: Array | None
    travel: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where all parts are at a moment of the assembly; between two waypoints every part moves straight and even.

    Attributes
    ----------
    step, label : str
        The step of the sequence, and what has been reached in words.
    poses : dict of SectionPose
        Each part in the section frame.
    """

    step: str
    label: str
    poses: dict[PartName, SectionPose]

    def T_world(self, part: PartName) -> Array:
        """Pose (4, 4) of a part in the world, lengths in mm."""
        return self.poses[part].T()

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: x, y, angle in degrees, and the way along the wires where there is one."""
        parts = {
            name: {"x": p.x, "y": p.y, "angle_deg": math.degrees(p.angle)} | ({"along": p.along} if p.along else {})
            for name, p in self.poses.items()
        }
        return {"step": self.step, "label": self.label, "parts": parts}


@dataclass(frozen=True, slots=True)
class Start:
    """Where closing begins: splint origins' distance (mm), tilt (rad), wire centres seen from P1 (mm)."""

    closing: float
    tilt: float
    line: tuple[float, float]
    jumper: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Work:
    """What the answer took: questions to the contact model are C of Table 5, positions tried are M."""

    parts: int
    pairs: int
    contact_queries: int
    motion_steps: int
    meshes_built: int


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Another state that closing the clamp can end in.

    Attributes
    ----------
    distance, closing, tilt : float
        As of `Assembly`; mm, mm, rad.
    status : str
        As of `Assembly`.
    detail : str
        What holds the state where that is not the grooves' arcs.
    is_equilibrium : bool
        If it is not one, a wire slips out of its groove there.
    """

    distance: float
    closing: float
    tilt: float
    status: str
    detail: str
    is_equilibrium: bool

    def __str__(self) -> str:
        where = f"{self.distance:.3f} mm, tilt {math.degrees(self.tilt):z.2f} deg"
        if self.is_equilibrium:
            return f"another equilibrium: {where}" + (f": {self.detail}" if self.detail else "")
        return f"also ends at {where} (no equilibrium: {self.detail})"


@dataclass(frozen=True, slots=True)
class Play:
    """Where the clamp closes to when ``joints`` have play: the distance in mm if it holds then, and its status."""

    joints: tuple[str, ...]
    status: str
    distance: float | None


Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Something a reviewer has to know: ``text`` in words, how grave it is, and its two parts if it has two."""

    severity: Severity
    text: str
    a: PartName | None = None
    b: PartName | None = None

    def __str__(self) -> str:
        return f"{self.severity}: {self.text}"


@dataclass(frozen=True, slots=True, repr=False)
class Assembly:
    """A clamp assembled: where every part ends up, what touches, and how it came there.

    Attributes
    ----------
    clamp : Clamp
        What was assembled.
    model : ContactModel
        How its grooves were measured.
    solver : str
        How the closed position was found: "exact", "stepped" or "bisection".
    closing_status : ClosingStatus
        Whether it holds both wires, and where they lie in its grooves.
    distance : float
        Height between the splints' inner edges on the line side, along the bolt (Table 4); mm.
    closing : float
        Distance of the splints' origins along the bolt; mm.
    tilt : float
        Tilt of the down splint; rad.
    turns : float
        Turns of the nut from open to tight.
    poses : dict of SectionPose
        Each part in the section frame, in the final state.
    contacts : tuple of Contact
        How all 21 pairs of parts stand in the final state, in the order of the connection matrix.
    events : tuple of Event
        The contacts that ended or changed a motion, in order.
    path : tuple of Waypoint
        The way from open to final.
    undeclared : tuple of Difference
        Pairs that met, on the way or in the end, though the connection matrix declares no connection.
    resolution : float
        Gaps up to this count as closed: the solver cannot close further; mm.
    violation, optimality : float or None
        Proof of the exact answer in mm: deepest overlap, and residual of the optimality conditions.
    work : Work
        What the answer took.
    start : Start
        Where closing began.
    forces : tuple of Force
        The contact forces per newton of bolt force (exact solver).
    others : tuple of Equilibrium or None
        The other states that closing can end in, the one closed furthest first; None if they were not looked for.
    with_play : tuple of Play or None
        What the joints' play changes; None if not looked for.
    """

    clamp: Clamp
    model: ContactModel
    solver: Solver
    closing_status: ClosingStatus
    distance: float
    closing: float
    tilt: float
    turns: float
    poses: dict[PartName, SectionPose]
    contacts: tuple[Contact, ...]
    events: tuple[Event, ...]
    path: tuple[Waypoint, ...]
    undeclared: tuple[Difference, ...]
    resolution: float
    violation: float | None
    optimality: float | None
    work: Work
    start: Start
    forces: tuple[Force, ...] = ()
    with_play: tuple[Play, ...] | None = None
    others: tuple[Equilibrium, ...] | None = None

    @property
    def method(self) -> str:
        """Name of the contact model."""
        return self.model.name

    @property
    def limits(self) -> tuple[str, ...]:
        """What the contact model cannot do, in words."""
        return self.model.limits

    @property
    def status(self) -> str:
        """ "clamped", "clamped, but P6 on a lip of ...", or "not clamped: ..." with the reason."""
        return self.closing_status.text

    @property
    def clamped(self) -> bool:
        """Whether the grooves of both splints hold both wires."""
        return self.closing_status.clamped

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong: no finding is an error. Else every command ends with exit code 1."""
        return not any(finding.severity == "error" for finding in self.findings)

    @property
    def seats(self) -> tuple[Seat, ...]:
        """Where each wire lies in each of its grooves."""
        return self.closing_status.seats

    @property
    def scene(self) -> Scene:
        """The final state as a scene: everything that works on scenes works on it."""
        return clamp_scene(self.clamp, {part: self.T_world(part) for part in self.poses})

    def waypoint(self, state: str) -> Waypoint:
        """The waypoint of a state: ``open`` is where the run begins, a step is where it ends, ``final`` the run's end.

        A step is named as in the sequence or by its number. Raises InputError for any other name, with the choices.
        """
        ends = {waypoint.step: waypoint for waypoint in self.path}
        numbered = {str(i): end for i, end in enumerate(ends.values(), 1)}
        states = {"open": self.path[0]} | ends | numbered | {"final": self.path[-1]}
        if state not in states:
            steps = ", ".join(f"{step} (or {i})" for i, step in enumerate(ends, 1))
            raise InputError(f"unknown state {state!r}; available: open, {steps}, final")
        return states[state]

    def scene_at(self, waypoint: Waypoint) -> Scene:
        """The parts at a waypoint of `path` as a scene."""
        instance("waypoint", waypoint, Waypoint)
        return clamp_scene(self.clamp, {part: waypoint.T_world(part) for part in waypoint.poses})

    def contacts_at(self, waypoint: Waypoint) -> tuple[Contact, ...]:
        """How all 21 pairs stand at a waypoint of `path`."""
        instance("waypoint", waypoint, Waypoint)
        return measure_contacts(self.clamp, waypoint.poses, self.model)

    @property
    def matrix(self) -> dict[Pair, Contact]:
        """The connection matrix as measured: the pairs that touch in the final state, with type and place."""
        return {(c.a, c.b): c for c in self.contacts if c.type}

    @property
    def matrix_differences(self) -> tuple[Difference, ...]:
        """Where `matrix` differs from the declared one, in both directions; gaps up to `resolution` may touch."""
        return tuple(
            Difference(c.a, c.b, c.declared, c.type, c.gap, c.point)
            for c in self.contacts
            if c.type != c.declared and not (c.type == 0 and c.gap <= self.resolution)
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What a reviewer has to know, the worst first; every report prints this list."""
        overlaps = {text: c for c in self.contacts if (text := overlap(c))}
        why = next((c for text, c in overlaps.items() if self.status.endswith(text)), None)
        findings = [] if self.clamped else [Finding("error", self.status, *((why.a, why.b) if why else ()))]
        findings += [Finding("error", text, c.a, c.b) for text, c in overlaps.items() if c is not why]
        findings += [Finding("error", str(d), d.a, d.b) for d in self.undeclared]
        findings += [Finding("warning", text) for text in self.closing_status.warnings]
        for d in self.matrix_differences:
            if d.declared != 0:
                findings.append(Finding("warning" if d.declared == 3 or d.measured else "note", str(d), d.a, d.b))
        findings += [Finding("note", str(e)) for e in self.others or ()]
        return tuple(sorted(findings, key=lambda finding: get_args(Severity).index(finding.severity)))

    def T_world(self, part: PartName) -> Array:
        """Pose (4, 4) of a part in the world in the final state, lengths in mm."""
        return self.poses[part].T()

    def __repr__(self) -> str:
        return f"<Assembly {self.clamp.name}: {self.status}, {self.distance:.3f} mm>"

    def _repr_html_(self) -> str:
        from html import escape

        rows = "".join(
            f"<tr><td>{c.a}-{c.b}</td><td>{c.declared}</td><td>{c.type}</td><td>{c.relation}</td>"
            f"<td style='text-align:right'>{c.gap:.6f}</td></tr>"
            for c in self.contacts
        )
        head = "".join(f"<th>{name}</th>" for name in ("pair", "declared", "measured", "relation", "gap (mm)"))
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{rows}</table>"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, as ``clamp3d run --json`` writes it; lengths in mm, angles in degrees."""
        keys = {"distance": "distance_mm", "closing": "closing_mm", "tilt": "tilt_deg", "is_equilibrium": "rests"}
        return {
            "clamp3d": __version__,
            "clamp": self.clamp.name,
            "line": self.clamp.line.label,
            "jumper": self.clamp.jumper.label,
            "method": self.method,
            "solver": self.solver,
            "limits": list(self.limits),
            "sequence": self.clamp.sequence,
            "status": self.status,
            "distance_mm": self.distance,
            "closing_mm": self.closing,
            "tilt_deg": math.degrees(self.tilt),
            "nut_turns": self.turns,
            "parts": {
                name: {
                    "title": TITLES[name],
                    "T_world": self.T_world(name).tolist(),
                    "section": {"x": pose.x, "y": pose.y, "angle_deg": math.degrees(pose.angle)},
                }
                for name, pose in self.poses.items()
            },
            "contacts": [c.to_dict() for c in self.contacts],
            "seats": [plain(seat, gap="gap_mm") for seat in self.seats],
            "events": [plain(event, travel="travel_mm") for event in self.events],
            "path": [waypoint.to_dict() for waypoint in self.path],
            "undeclared": [str(d) for d in self.undeclared],
            "matrix_differences": [d.to_dict() for d in self.matrix_differences],
            "findings": [plain(finding) for finding in self.findings],
            "residuals": {"largest_violated_gap_mm": self.violation, "optimality_mm": self.optimality},
            "other_ends": None if self.others is None else [plain(e, **keys) for e in self.others],
            "start": plain(self.start, **keys),
            "forces": [plain(force) for force in self.forces],
            "with_play_mm": None
            if self.with_play is None
            else {", ".join(p.joints): p.distance for p in self.with_play},
            "work": plain(self.work),
        }

    def frame(self) -> Any:
        """The contacts as a pandas DataFrame, a row for each pair. Raises MissingLibraryError without pandas."""
        need("pandas", "frame(), but not contacts,")
        import pandas  # type: ignore[import-untyped,unused-ignore]

        return pandas.DataFrame([c.to_dict() for c in self.contacts])
