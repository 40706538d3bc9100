"""What a run answers: frozen dataclasses, no behaviour beyond reading them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clamp3d.clamp.connections import Undeclared
from clamp3d.clamp.dimensions import Clamp, ConnectionType, PartName
from clamp3d.core.pose import Array, SectionPose

Solver = Literal["exact", "stepped", "bisection"]


@dataclass(frozen=True, slots=True)
class Contact:
    """How a declared pair stands: ``distance`` mm (positive apart), ``point`` (3,) and ``normal`` (3,) in the world.

    ``relation`` is a column of Table 3 (type 3), a row of Table 2 or 'seat' (type 2), or 'screw joint' (type 1);
    ``feature`` names the piece of the groove. ``point`` lies on part a, ``normal`` is unit from a to b.
    """

    a: PartName
    b: PartName
    type: ConnectionType
    relation: str
    distance: float
    point: Array
    normal: Array
    feature: str


@dataclass(frozen=True, slots=True)
class Seat:
    """A wire in a groove: ``seated`` if it touches the groove's arc; ``gap`` in mm; ``detail`` in words."""

    splint: PartName
    wire: PartName
    seated: bool
    gap: float
    detail: str


@dataclass(frozen=True, slots=True)
class Event:
    """A contact that ended or changed a motion: in ``step`` of the sequence, after ``travel`` mm of it."""

    step: str
    a: PartName
    b: PartName
    relation: str
    point: Array
    travel: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Section poses of all parts at a moment of the run; between two waypoints every part moves straight and even."""

    step: str
    label: str
    poses: dict[PartName, SectionPose]


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
    """Another state that closing the clamp can end in: ``distance``, ``closing`` (mm) and ``tilt`` (rad) as of `Run`.

    ``status`` is that of a run; ``detail`` says what holds it where that is not the grooves' arcs. ``rests``: it is an
    equilibrium; if not, a wire slips out of its groove there.
    """

    distance: float
    closing: float
    tilt: float
    status: str
    detail: str
    rests: bool


@dataclass(frozen=True, slots=True)
class Run:
    """A clamp assembled: where every part ends up, what touches, and how it came there.

    ``distance`` is the height between the splints' inner edges on the line side (Table 4) in mm, ``closing`` that of
    their origins along the bolt. ``status`` is 'clamped' or 'not clamped: ...'. ``violation`` and ``optimality`` in mm
    prove the exact answer (None for the other solvers). ``turns`` of the nut tighten the clamp from open.
    ``others`` are the other states that closing can end in, the one closed furthest first (None: not looked for).
    """

    clamp: Clamp
    method: str
    solver: Solver
    limits: tuple[str, ...]
    status: str
    distance: float
    closing: float
    tilt: float
    turns: float
    poses: dict[PartName, SectionPose]
    contacts: tuple[Contact, ...]
    seats: tuple[Seat, ...]
    events: tuple[Event, ...]
    path: tuple[Waypoint, ...]
    undeclared: tuple[Undeclared, ...]
    violation: float | None
    optimality: float | None
    work: Work
    others: tuple[Equilibrium, ...] | None = None

    @property
    def clamped(self) -> bool:
        """Whether the splints hold both wires."""
        return self.status == "clamped"

    def T_world(self, part: PartName) -> Array:
        """Pose (4, 4) of a part in the world, lengths in mm."""
        return self.poses[part].T()
