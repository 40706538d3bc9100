"""What a run answers: frozen dataclasses, no behaviour beyond reading them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clamp3d.baselines.model import ContactModel
from clamp3d.checks import instance
from clamp3d.clamp.connections import Undeclared
from clamp3d.clamp.dimensions import Clamp, ConnectionType, PartName
from clamp3d.clamp.scene import clamp_scene
from clamp3d.collide.scene import Scene
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
    """Another state that closing can end in: ``distance``, ``closing`` (mm) and ``tilt`` (rad) as of `Assembly`.

    ``status`` is that of a run; ``detail`` says what holds it where that is not the grooves' arcs. ``rests``: it is an
    equilibrium; if not, a wire slips out of its groove there.
    """

    distance: float
    closing: float
    tilt: float
    status: str
    detail: str
    rests: bool


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
    status : str
        "clamped", or "not clamped: ..." with the reason.
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
        How the pairs of parts stand in the final state.
    seats : tuple of Seat
        Whether each wire lies in each of its grooves.
    events : tuple of Event
        The contacts that ended or changed a motion, in order.
    path : tuple of Waypoint
        The way from open to final.
    undeclared : tuple of Undeclared
        Pairs that met otherwise than the connection matrix declares.
    violation, optimality : float or None
        Proof of the exact answer in mm: deepest overlap, and residual of the optimality conditions.
    work : Work
        What the answer took.
    others : tuple of Equilibrium or None
        The other states that closing can end in, the one closed furthest first; None if they were not looked for.
    """

    clamp: Clamp
    model: ContactModel
    solver: Solver
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
    def method(self) -> str:
        """Name of the contact model."""
        return self.model.name

    @property
    def limits(self) -> tuple[str, ...]:
        """What the contact model cannot do, in words."""
        return self.model.limits

    @property
    def clamped(self) -> bool:
        """Whether the splints hold both wires."""
        return self.status == "clamped"

    @property
    def scene(self) -> Scene:
        """The final state as a scene: everything that works on scenes works on it."""
        return clamp_scene(self.clamp, {part: self.T_world(part) for part in self.poses})

    def scene_at(self, waypoint: Waypoint) -> Scene:
        """The parts at a waypoint of `path` as a scene."""
        instance("waypoint", waypoint, Waypoint)
        return clamp_scene(self.clamp, {part: waypoint.T_world(part) for part in waypoint.poses})

    def T_world(self, part: PartName) -> Array:
        """Pose (4, 4) of a part in the world in the final state, lengths in mm."""
        return self.poses[part].T()

    def __repr__(self) -> str:
        return f"<Assembly {self.clamp.name}: {self.status}, {self.distance:.3f} mm>"
