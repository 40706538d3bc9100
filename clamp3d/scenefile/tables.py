"""The tables of a scene file: what keys each may hold, what they mean, and the shape or motion that comes of them."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from msgspec import Meta, field

from clamp3d import checks
from clamp3d.clamp.conductors import conductor
from clamp3d.clamp.dimensions import ClampPart, Length, Offset, check_conductor
from clamp3d.clamp.loader import load_clamp
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.geometry import shapes
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import to_target
from clamp3d.geometry.primitives import SweptArc
from clamp3d.scenefile.pose_table import Angle, Number, Pose, Table, Vector
from clamp3d.scenefile.read_parts import Reader, names_like, read_parts
from clamp3d.validation import validate


class HoleTable(Table):
    """A round hole right through, along y or z, at (x, z) or (x, y)."""

    radius: Length | None = None
    diameter: Length | None = None
    at: tuple[Number, Number] = (0.0, 0.0)
    axis: Literal["y", "z"] = "z"

    def __post_init__(self) -> None:
        _one_of(self, "radius", "diameter")

    def hole(self) -> shapes.Hole:
        """The hole as a shape's argument."""
        return shapes.Hole(_half(self.radius, self.diameter), self.at, self.axis)


class GrooveTable(Table):
    """A further groove of a block, ``x`` mm beside the first one."""

    x: Offset
    radius: Length
    half_angle_deg: Annotated[float, Meta(gt=0.0, lt=180.0)]


class PartTable(Table):
    """What all parts have."""

    pose: Pose = field(default_factory=Pose)


class CylinderTable(PartTable, kw_only=True):
    """``shape = "cylinder"``: axis on z, centred; the diameter may be a conductor's."""

    length: Length
    radius: Length | None = None
    diameter: Length | None = None
    conductor: str | None = None
    bore_diameter: Length | None = None

    def __post_init__(self) -> None:
        _one_of(self, "radius", "diameter", "conductor")
        check_conductor(self.conductor)

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        diameter = conductor(self.conductor).diameter if self.conductor is not None else self.diameter
        return shapes.cylinder(_half(self.radius, diameter), self.length, bore=(self.bore_diameter or 0.0) / 2)


class BoxTable(PartTable, kw_only=True):
    """``shape = "box"``: centred, with round holes."""

    size: tuple[Length, Length, Length]
    holes: list[HoleTable] = field(default_factory=list)

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        return shapes.box(self.size, holes=[h.hole() for h in self.holes])


class SphereTable(PartTable, kw_only=True):
    """``shape = "sphere"``: about the origin."""

    radius: Length | None = None
    diameter: Length | None = None

    def __post_init__(self) -> None:
        _one_of(self, "radius", "diameter")

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        return shapes.sphere(_half(self.radius, self.diameter))


class GrooveBlockTable(PartTable, kw_only=True):
    """``shape = "groove-block"``: in the groove's frame, arc about the origin, axis on z, mouth to +y."""

    radius: Length
    half_angle_deg: Annotated[float, Meta(gt=0.0, lt=180.0)]
    length: Length
    width: Length
    height: Length
    grooves: list[GrooveTable] = field(default_factory=list)
    holes: list[HoleTable] = field(default_factory=list)

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        groove = SweptArc(self.radius, math.radians(self.half_angle_deg), self.length)
        others = [(g.x, g.radius, math.radians(g.half_angle_deg)) for g in self.grooves]
        holes = [h.hole() for h in self.holes]
        return shapes.groove_block(groove, self.width, self.height, others=others, holes=holes)


class ClampPartTable(PartTable, kw_only=True):
    """``shape = "clamp-part"``: one of the seven parts of a clamp, in its own frame."""

    part: ClampPart
    clamp: str = "reference"
    line: Any = None  # a catalogue name or a diameter, checked where the clamp is loaded
    jumper: Any = None

    def make(self, folder: Path) -> shapes.AnyShape:
        """The shape."""
        from clamp3d.clamp.parts import parts

        return parts(load_clamp(_clamp_source(self.clamp, folder), line=self.line, jumper=self.jumper))[self.part]


class FileTable(PartTable, kw_only=True):
    """A ``file`` and no ``shape``: all bodies of it, as `clamp3d.load` reads them, moved by ``pose``."""

    file: str
    unit: Literal["mm", "cm", "m", "in"] | None = None
    fit: shapes.Fit | None = None
    chord: Annotated[float, Meta(ge=0.0, lt=1e5)] | None = None
    joints: dict[str, Number] = field(default_factory=dict)
    poses: str | None = None
    partial: bool = False

    def read(self, folder: Path) -> Scene:
        """Its parts, not yet moved or renamed."""
        poses = None if self.poses is None else folder / self.poses
        keys = ("unit", "fit", "chord", "joints", "partial")
        return read_parts(folder / self.file, Reader(poses=poses, **{key: getattr(self, key) for key in keys}))


class MeshTable(FileTable, kw_only=True):
    """``shape = "mesh"``: a file of one body, in the file's frame in mm with Z up; see `MeshShape` for ``fit``."""

    def read(self, folder: Path) -> Scene:
        """The part, not yet moved or renamed."""
        scene = super().read(folder)
        if len(scene.parts) != 1:
            raise InputError(
                f"{self.file} holds {len(scene.parts)} bodies: leave out shape, and it gives as many parts"
            )
        (part,) = scene.parts
        if np.array_equal(part.T_world, np.eye(4)):
            return scene
        if type(part.shape) is not shapes.MeshShape:  # solids and spheres are not their triangles
            raise InputError(f"{self.file} places its body itself: leave out shape, and it is placed so")
        mesh = replace(part.shape.mesh, vertices=to_target(part.T_world, part.shape.mesh.vertices))
        return replace(scene, parts=(replace(part, shape=replace(part.shape, mesh=mesh), T_world=np.eye(4)),))


AnyTable: TypeAlias = CylinderTable | BoxTable | SphereTable | GrooveBlockTable | ClampPartTable | FileTable
SHAPES: dict[str, type[AnyTable]] = {
    "cylinder": CylinderTable,
    "box": BoxTable,
    "sphere": SphereTable,
    "groove-block": GrooveBlockTable,
    "clamp-part": ClampPartTable,
    "mesh": MeshTable,
}


def part_table(data: Any, origin: str, key: str) -> AnyTable:
    """The table of a part, by its ``shape`` or as a file. Raises InputError."""
    keys = data if isinstance(data, dict) else {}
    shape = keys.get("shape")
    kind: type[AnyTable] | None = SHAPES.get(shape) if isinstance(shape, str) else None
    if "file" in keys and "shape" not in keys:
        kind = FileTable
    if kind is None:
        choices = ", ".join(f'"{name}"' for name in SHAPES)
        near = difflib.get_close_matches(shape, SHAPES, n=1) if isinstance(shape, str) else []
        raise InputError(
            f"{origin}: {checks.short(key, 100)}: must have shape = one of {choices}, or a file"
            + (f", got {checks.shown(shape)}" if shape is not None else "")
            + (f"; did you mean {near[0]}?" if near else "")
        )
    table: AnyTable = validate(kind, {name: value for name, value in keys.items() if name != "shape"}, origin, key)
    return table


class ClampTable(PartTable, kw_only=True):
    """``[clamp]``: the parts P1 to P7 of a clamp as `clamp3d run` leaves them; their connections are allowed."""

    name: str = "reference"
    line: Any = None  # a catalogue name or a diameter, checked where the clamp is loaded
    jumper: Any = None

    def read(self, folder: Path) -> Scene:
        """Its parts, assembled and moved."""
        from clamp3d.clamp.assemble import assemble

        scene = assemble(_clamp_source(self.name, folder), line=self.line, jumper=self.jumper).scene
        T = self.pose.T()
        return scene.moved({part.name: T @ part.T_world for part in scene.parts})


class AllowedTable(Table):
    """``[[allowed]]``: two part names, or patterns, or a kind of fit, that may touch, and overlap by ``overlap`` mm."""

    parts: tuple[str, str] | None = None
    overlap: Annotated[float, Meta(ge=0.0)] = 0.0
    relation: Literal["running", "press", "thread", "duplicate"] | None = None

    def __post_init__(self) -> None:
        if self.parts is None and self.relation is None:
            raise ValueError("parts: give two names or patterns, or a relation")


class TurnTable(Table):
    """A turn about an axis in the world, with travel along it: mm in all, or ``pitch`` mm a turn."""

    axis: Vector
    angle_deg: Angle
    point: Vector = (0.0, 0.0, 0.0)
    travel: Number | None = None
    pitch: Number | None = None

    def __post_init__(self) -> None:
        if not any(self.axis):
            raise ValueError("axis: must not have length zero")
        if self.travel is not None and self.pitch is not None:
            raise ValueError("pitch: give travel or pitch, not both")


class MotionTable(Table):
    """``[[motions]]``, one after another: ``parts`` move together by ``translate``, ``rotate``, ``screw`` or ``to``."""

    parts: Annotated[list[str], Meta(min_length=1)]
    name: str | None = None
    translate: Vector | None = None
    rotate: TurnTable | None = None
    screw: TurnTable | None = None
    to: Pose | None = None

    def __post_init__(self) -> None:
        _one_of(self, "translate", "rotate", "screw", "to")
        if self.rotate is not None and (self.rotate.travel is not None or self.rotate.pitch is not None):
            raise ValueError("rotate: a rotation has no travel or pitch; call it screw")

    def motion(self, number: int, names: Iterable[str] = ()) -> Motion:
        """The motion of the ``names`` that its parts are patterns of; without a name it is called by its number."""
        name = self.name or f"motion {number}"
        parts = tuple(names_like(self.parts, names))
        if self.translate is not None:
            return Motion.translate(self.translate, parts=parts, name=name)
        if self.to is not None:
            return Motion.to_pose(self.to.T(), parts=parts, name=name)
        turn = self.rotate or self.screw
        assert turn is not None
        angle = math.radians(turn.angle_deg)
        travel = turn.travel if turn.travel is not None else (turn.pitch or 0.0) * turn.angle_deg / 360.0
        return Motion.screw(turn.axis, angle, point=turn.point, travel=travel, parts=parts, name=name)


class SceneTable(Table):
    """The whole file."""

    unit: Literal["mm"] = "mm"
    contact: Annotated[float, Meta(gt=0.0, lt=1e3)] = 0.01
    clearance: Annotated[float, Meta(ge=0.0, lt=1e5)] = 0.0
    clamp: ClampTable | None = None
    include: str | list[str] = field(default_factory=list)
    parts: dict[str, Any] = field(default_factory=dict)  # each a `PartTable` of its own shape
    allowed: list[AllowedTable] = field(default_factory=list)
    motions: list[MotionTable] = field(default_factory=list)


def _clamp_source(name: str, folder: Path) -> str:
    """A built-in clamp's name, or the path of a clamp file beside the scene's."""
    return str(folder / name) if name.endswith(".toml") else name


def _one_of(table: Any, *keys: str) -> None:
    present = [key for key in keys if getattr(table, key) is not None]
    if len(present) != 1:
        raise ValueError(f"{(present or keys)[0]}: give exactly one of {', '.join(keys)}")


def _half(radius: float | None, diameter: float | None) -> float:
    return radius if radius is not None else 0.5 * float(diameter or 0.0)
