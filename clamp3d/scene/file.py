"""Scene files: TOML in, a validated `Scene` out; every fault is one line with file, key, value and rule.

Lengths in mm, angles in degrees (keys that end in ``_deg``). See the package's documentation for every key.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic.dataclasses import dataclass

from clamp3d import checks
from clamp3d.clamp.conductors import conductor
from clamp3d.clamp.dimensions import Length, Offset, PartName
from clamp3d.clamp.loader import load_clamp, parse_toml, read_text
from clamp3d.clamp.validation import validate
from clamp3d.errors import Clamp3dError, InputError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import SweptArc
from clamp3d.scene import shapes
from clamp3d.scene.motion import Motion
from clamp3d.scene.scene import Allowed, Scene, ScenePart

_FROZEN = ConfigDict(extra="forbid")
_SNAP = 1e-4
Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Vector = tuple[Number, Number, Number]
Angle = Annotated[float, Field(gt=-1e5, lt=1e5, allow_inf_nan=False, strict=True)]


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class Pose:
    """A pose in the world: ``matrix`` (4 rows of 4, or 3 of 4), or ``translation`` with one kind of turn.

    ``rpy_deg``: roll, pitch, yaw about the fixed axes X, Y, Z in this order (URDF). ``axis`` with ``angle_deg``.
    ``quaternion``: x, y, z, w.
    """

    translation: Vector = (0.0, 0.0, 0.0)
    rpy_deg: Vector | None = None
    axis: Vector | None = None
    angle_deg: Angle | None = None
    quaternion: tuple[Number, Number, Number, Number] | None = None
    matrix: list[tuple[Number, Number, Number, Number]] | None = None

    @model_validator(mode="after")
    def _one_turn(self) -> Pose:
        turns = [k for k in ("rpy_deg", "axis", "quaternion", "matrix") if getattr(self, k) is not None]
        if len(turns) > 1:
            raise ValueError(
                f"{turns[1]}: give one of rpy_deg, axis with angle_deg, quaternion, matrix, not {turns[0]} too"
            )
        if (self.axis is None) != (self.angle_deg is None):
            raise ValueError("axis: give axis and angle_deg together")
        if self.axis is not None and not any(self.axis):
            raise ValueError("axis: must not have length zero")
        if self.quaternion is not None and not any(self.quaternion):
            raise ValueError("quaternion: must not have length zero")
        if self.matrix is not None:
            if any(self.translation):
                raise ValueError("matrix: holds the translation already")
            rows = [list(row) for row in self.matrix]
            if len(rows) not in (3, 4) or (len(rows) == 4 and rows[3] != [0.0, 0.0, 0.0, 1.0]):
                raise ValueError("matrix: must have 3 rows of 4 numbers, or a fourth row 0, 0, 0, 1")
            R = np.array(rows)[:3, :3]
            with np.errstate(over="ignore", invalid="ignore"):
                off = float(np.abs(R @ R.T - np.eye(3)).max())
            if not off <= _SNAP or np.linalg.det(R) < 0.0:
                raise ValueError(f"matrix: must be rigid (a rotation and a translation): deviates by {off:.3g}")
        return self

    def T(self) -> Array:
        """The pose (4, 4). A typed matrix is brought to the nearest rotation: its printed digits are not exact."""
        from scipy.spatial.transform import Rotation

        T = np.eye(4)
        T[:3, 3] = self.translation
        if self.rpy_deg is not None:
            T[:3, :3] = _quarter_turns(self.rpy_deg)
        elif self.axis is not None and self.angle_deg is not None:
            axis = np.array(self.axis) / np.linalg.norm(self.axis)
            T[:3, :3] = _tidy(Rotation.from_rotvec(math.radians(self.angle_deg) * axis).as_matrix())
        elif self.quaternion is not None:
            T[:3, :3] = _tidy(Rotation.from_quat(self.quaternion).as_matrix())
        elif self.matrix is not None:
            rows = np.array(self.matrix[:3])
            u, _, vt = np.linalg.svd(rows[:, :3])
            nearest = u @ vt
            # Exact input stays exact: a product of SVD factors is not.
            T[:3, :3] = rows[:, :3] if np.abs(nearest - rows[:, :3]).max() < 1e-14 else nearest
            T[:3, 3] = rows[:, 3]
        return T


def _quarter_turns(rpy_deg: tuple[float, float, float]) -> Array:
    """Rotation (3, 3) of roll, pitch, yaw in degrees; multiples of 90 exactly."""
    R = np.eye(3)
    for k, angle in enumerate(rpy_deg):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        if angle % 90.0 == 0.0:
            c, s = round(c), round(s)
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = np.eye(3)
        turn[[i, i, j, j], [i, j, i, j]] = (c, -s, s, c)
        R = turn @ R
    return R


def _tidy(R: Array) -> Array:
    """A rotation with the rounding of its zeros and ones taken away."""
    return np.where(np.abs(R - R.round()) < 4e-16, R.round(), R)


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class HoleTable:
    """A round hole right through, along y or z, at (x, z) or (x, y)."""

    radius: Length | None = None
    diameter: Length | None = None
    at: tuple[Number, Number] = (0.0, 0.0)
    axis: Literal["y", "z"] = "z"

    @model_validator(mode="after")
    def _one(self) -> HoleTable:
        _one_of(self, "radius", "diameter")
        return self

    def hole(self) -> shapes.Hole:
        """The hole as a shape's argument."""
        return shapes.Hole(_half(self.radius, self.diameter), self.at, self.axis)


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class GrooveTable:
    """A further groove of a block, ``x`` mm beside the first one."""

    x: Offset
    radius: Length
    half_angle_deg: Annotated[float, Field(gt=0.0, lt=180.0, strict=True)]


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class _Placed:
    pose: Pose = Field(default_factory=Pose)


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class CylinderTable(_Placed):
    """``shape = "cylinder"``: axis on z, centred; the diameter may be a conductor's."""

    TAG: ClassVar[str] = "cylinder"
    shape: Literal["cylinder"]
    length: Length
    radius: Length | None = None
    diameter: Length | None = None
    conductor: str | None = None
    bore_diameter: Length | None = None

    @model_validator(mode="after")
    def _one(self) -> CylinderTable:
        _one_of(self, "radius", "diameter", "conductor")
        if self.conductor is not None:
            try:
                conductor(self.conductor)
            except InputError as error:
                raise ValueError(f"conductor: {error}") from None
        return self

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        diameter = conductor(self.conductor).diameter if self.conductor is not None else self.diameter
        return shapes.cylinder(_half(self.radius, diameter), self.length, bore=(self.bore_diameter or 0.0) / 2)


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class BoxTable(_Placed):
    """``shape = "box"``: centred, with round holes."""

    TAG: ClassVar[str] = "box"
    shape: Literal["box"]
    size: tuple[Length, Length, Length]
    holes: list[HoleTable] = Field(default_factory=list)

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        return shapes.box(self.size, holes=[h.hole() for h in self.holes])


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class GrooveBlockTable(_Placed):
    """``shape = "groove-block"``: in the groove's frame, arc about the origin, axis on z, mouth to +y."""

    TAG: ClassVar[str] = "groove-block"
    shape: Literal["groove-block"]
    radius: Length
    half_angle_deg: Annotated[float, Field(gt=0.0, lt=180.0, strict=True)]
    length: Length
    width: Length
    height: Length
    grooves: list[GrooveTable] = Field(default_factory=list)
    holes: list[HoleTable] = Field(default_factory=list)

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        groove = SweptArc(self.radius, math.radians(self.half_angle_deg), self.length)
        others = [(g.x, g.radius, math.radians(g.half_angle_deg)) for g in self.grooves]
        holes = [h.hole() for h in self.holes]
        return shapes.groove_block(groove, self.width, self.height, others=others, holes=holes)


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class ClampPartTable(_Placed):
    """``shape = "clamp-part"``: one of the seven parts of a clamp, in its own frame."""

    TAG: ClassVar[str] = "clamp-part"
    shape: Literal["clamp-part"]
    part: PartName
    clamp: str = "reference"
    line: str | None = None
    jumper: str | None = None

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        from clamp3d.clamp.parts import parts

        return parts(load_clamp(_clamp_source(self.clamp, folder), line=self.line, jumper=self.jumper))[self.part]


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class MeshTable(_Placed):
    """``shape = "mesh"``: a closed mesh from a file beside the scene; see `MeshShape` for ``fit``."""

    TAG: ClassVar[str] = "mesh"
    shape: Literal["mesh"]
    file: str
    unit: Literal["mm", "cm", "m", "in"] | None = None
    fit: shapes.Fit = "bound"

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        from clamp3d.fit.mesh_file import load_mesh

        return shapes.MeshShape(load_mesh(folder / self.file, unit=self.unit), self.fit, name=self.file)


_TABLES = (CylinderTable, BoxTable, GrooveBlockTable, ClampPartTable, MeshTable)
_TAGS = {f"shape {table.TAG}": table for table in _TABLES}


def _tag(data: Any) -> str | None:
    tag = f"shape {data.get('shape')}" if isinstance(data, dict) else None
    return tag if tag in _TAGS else None


PartTable = Annotated[
    Annotated[CylinderTable, Tag("shape cylinder")]
    | Annotated[BoxTable, Tag("shape box")]
    | Annotated[GrooveBlockTable, Tag("shape groove-block")]
    | Annotated[ClampPartTable, Tag("shape clamp-part")]
    | Annotated[MeshTable, Tag("shape mesh")],
    Discriminator(
        _tag,
        custom_error_type="shape",
        custom_error_message="must have shape = one of " + ", ".join(f'"{table.TAG}"' for table in _TABLES),
    ),
]


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class ClampTable(_Placed):
    """``[clamp]``: the parts P1 to P7 of a clamp as `clamp3d run` leaves them; their connections are allowed."""

    name: str = "reference"
    line: str | None = None
    jumper: str | None = None


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class AllowedTable:
    """``[[allowed]]``: two part names, or patterns, that may touch, and overlap by ``overlap`` mm."""

    parts: tuple[str, str]
    overlap: Annotated[float, Field(ge=0.0, strict=True)] = 0.0


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class TurnTable:
    """A turn about an axis in the world, with travel along it: mm in all, or ``pitch`` mm a turn."""

    axis: Vector
    angle_deg: Angle
    point: Vector = (0.0, 0.0, 0.0)
    travel: Number | None = None
    pitch: Number | None = None

    @model_validator(mode="after")
    def _is_turn(self) -> TurnTable:
        if not any(self.axis):
            raise ValueError("axis: must not have length zero")
        if self.travel is not None and self.pitch is not None:
            raise ValueError("pitch: give travel or pitch, not both")
        return self


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class MotionTable:
    """``[[motions]]``, one after another: ``parts`` move together by ``translate``, ``rotate``, ``screw`` or ``to``."""

    parts: Annotated[list[str], Field(min_length=1)]
    name: str | None = None
    translate: Vector | None = None
    rotate: TurnTable | None = None
    screw: TurnTable | None = None
    to: Pose | None = None

    @model_validator(mode="after")
    def _one(self) -> MotionTable:
        _one_of(self, "translate", "rotate", "screw", "to")
        if self.rotate is not None and (self.rotate.travel is not None or self.rotate.pitch is not None):
            raise ValueError("rotate: a rotation has no travel or pitch; call it screw")
        return self

    def motion(self, number: int) -> Motion:
        """The motion; without a name it is called by its number."""
        name = self.name or f"motion {number}"
        parts = tuple(self.parts)
        if self.translate is not None:
            return Motion.translate(parts, self.translate, name=name)
        if self.to is not None:
            return Motion.to_pose(parts, self.to.T(), name=name)
        turn = self.rotate or self.screw
        assert turn is not None
        angle = math.radians(turn.angle_deg)
        travel = turn.travel if turn.travel is not None else (turn.pitch or 0.0) * turn.angle_deg / 360.0
        return Motion.screw(parts, turn.axis, angle, point=turn.point, travel=travel, name=name)


@dataclass(frozen=True, config=_FROZEN, kw_only=True)
class SceneTable:
    """The whole file."""

    unit: Literal["mm"] = "mm"
    contact: Annotated[float, Field(gt=0.0, lt=1e3, strict=True)] = 0.01
    clearance: Annotated[float, Field(ge=0.0, lt=1e5, strict=True)] = 0.0
    clamp: ClampTable | None = None
    parts: dict[str, PartTable] = Field(default_factory=dict)
    allowed: list[AllowedTable] = Field(default_factory=list)
    motions: list[MotionTable] = Field(default_factory=list)


def load_scene(path: str | Path) -> Scene:
    """Read a scene file. Raises InputError for anything that is not a scene, naming file, key, value and rule."""
    path = checks.path("scene", path)
    return parse_scene(read_text(path), origin=str(path), folder=path.parent, name=path.stem)


def parse_scene(text: str, *, origin: str = "scene", folder: Path = Path(), name: str = "scene") -> Scene:
    """A scene from the text of a scene file; files it names are looked for in ``folder``.

    >>> scene = parse_scene('''
    ... [parts.pin]
    ... shape = "cylinder"
    ... diameter = 10
    ... length = 40
    ... pose = { translation = [0, 0, 5], rpy_deg = [90, 0, 0] }
    ... ''')
    >>> scene.parts[0].T_world[:3, 3].tolist()
    [0.0, 0.0, 5.0]
    """
    table: SceneTable = validate(SceneTable, parse_toml(text, origin), origin, _TAGS)
    made: list[ScenePart] = []
    allowed: list[Allowed] = []
    files: dict[tuple[str, str | None, str], shapes.AnyShape] = {}
    try:
        if table.clamp is not None:
            made, allowed = _clamp_parts(table.clamp, folder)
        for part_name, part in table.parts.items():
            where = f"parts.{part_name}"
            if isinstance(part, MeshTable):  # one file is one shape, however often it is used
                key = (part.file, part.unit, part.fit)
                files[key] = shape = files.get(key) or part.make(folder)
            else:
                shape = part.make(folder)
            made.extend(Scene().add(part_name, shape, part.pose.T()).parts)
        where = "allowed"
        allowed += [Allowed(*item.parts, item.overlap) for item in table.allowed]
        where = "motions"
        motions = tuple(m.motion(i) for i, m in enumerate(table.motions, 1))
        where = ""
        return Scene(tuple(made), table.contact, table.clearance, tuple(allowed), motions, name)
    except Clamp3dError as error:
        place = f"{where}: " if "where" in locals() and where else ""
        raise InputError(f"{origin}: {place}{error}") from None


def _clamp_parts(table: ClampTable, folder: Path) -> tuple[list[ScenePart], list[Allowed]]:
    from clamp3d.assembly.run import assemble
    from clamp3d.clamp.parts import parts
    from clamp3d.contact.cas import Cas

    clamp = load_clamp(_clamp_source(table.name, folder), line=table.line, jumper=table.jumper)
    run = assemble(clamp, Cas())
    T = table.pose.T()
    made = [ScenePart(n, shapes.as_shape(part), T @ run.T_world(n)) for n, part in parts(clamp).items()]
    return made, [Allowed(a, b) for a, row in clamp.connections.items() for b, kind in row.items() if kind]


def _clamp_source(name: str, folder: Path) -> str:
    return str(folder / name) if name.endswith(".toml") else name


def _one_of(table: Any, *keys: str) -> None:
    given = [key for key in keys if getattr(table, key) is not None]
    if len(given) != 1:
        raise ValueError(f"{(given or keys)[0]}: give exactly one of {', '.join(keys)}")


def _half(radius: float | None, diameter: float | None) -> float:
    return radius if radius is not None else 0.5 * float(diameter or 0.0)
