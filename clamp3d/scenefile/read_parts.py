"""Parts from whatever holds bodies: a geometry file, a folder of meshes with poses, a robot description."""

from __future__ import annotations

import csv
import itertools
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from clamp3d import checks
from clamp3d.engine.allowed import Allowed, is_like
from clamp3d.engine.scene import Part, Scene
from clamp3d.errors import InputError
from clamp3d.files.bodies import Component, Reading, part_name, unique_names
from clamp3d.files.formats import FORMATS, ROBOT, load_bodies
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import FARTHEST_OFF, FITS, Fit, Shape, Solid
from clamp3d.scenefile.pose_table import Pose
from clamp3d.validation import validate

COLUMNS = ("name", "x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of a table of poses: mm, and a unit quaternion."""
_ANY = 1e4
"""Overlap (mm) that is allowed between shapes of one link: they are one body."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """How files are read.

    Attributes
    ----------
    unit : str or None
        Unit of files that carry none (mm, cm, m, in), or another one for glTF.
    fit : str
        What to make of a mesh's round surfaces; see `MeshShape`.
    chord : float
        How far a mesh's true surface can be from its facets, mm.
    joints : dict
        Values of a robot's joints by name: rad, or mm for those that slide; 0, or the nearest limit, by default.
    poses : Path or None
        Table of poses for a folder of meshes.
    partial : bool
        Go on with what was read where bodies are missing.
    line, jumper : str, float or None
        Wires that replace a clamp's own.
    """

    unit: str | None = None
    fit: Fit | None = None
    chord: float | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    poses: Path | None = None
    partial: bool = False
    line: str | float | None = None
    jumper: str | float | None = None

    def __post_init__(self) -> None:
        if self.fit is not None:
            checks.choice("fit", self.fit, FITS)
        if self.chord is not None and not 0.0 <= checks.number("chord", self.chord) < FARTHEST_OFF:
            raise InputError(f"chord must be >= 0 and < {FARTHEST_OFF:g} mm, got {self.chord}")

    def refuse(self, what: str, *options: str) -> None:
        """Raise InputError if one of the ``options`` was given, which do not go with ``what``."""
        for name in options:
            if getattr(self, name) not in (None, {}, False):
                raise InputError(f"{name} goes with {_GOES_WITH[name]}, not with {what}")


_GOES_WITH = {
    "unit": "a mesh file",
    "fit": "a mesh file",
    "chord": "a mesh file",
    "joints": "a robot description (.urdf)",
    "poses": "a folder of meshes",
    "partial": "a file with geometry",
    "line": "a clamp",
    "jumper": "a clamp",
}


def prefixed(scene: Scene, name: str, T: Array) -> Scene:
    """A scene that was read, moved by ``T`` (4, 4), its parts called ``name``, or ``name/...`` if there are several.

    Several parts are below an assembly ``name`` then.
    """
    is_one = len(scene.parts) == 1
    names = {p.name: name if is_one else f"{name}/{p.name}" for p in scene.parts}
    moved: dict[Component | None, Component | None] = {None: None if is_one else Component(name, name, T)}

    def move(component: Component | None) -> Component | None:
        if component not in moved:
            assert component is not None
            moved[component] = replace(component, T=T @ component.T, assembly=move(component.assembly))
        return moved[component]

    parts = (
        replace(p, name=names[p.name], T_world=T @ p.T_world, component=move(p.component) if p.component else None)
        for p in scene.parts
    )
    allowed = (Allowed(names[x.a], names[x.b], x.overlap) for x in scene.allowed)
    return Scene(tuple(parts), allowed=tuple(allowed), notes=scene.notes)


def read_parts(path: Path, reader: Reader) -> Scene:
    """The parts of a geometry file, a robot description or a folder of meshes. Raises InputError."""
    reader.refuse(checks.short(path), "line", "jumper")
    if os.path.isdir(path):
        reader.refuse("a folder", "joints")
        return _folder(path, reader)
    is_robot = path.suffix.lower() == ROBOT
    reader.refuse(checks.short(path), "poses", *([] if is_robot else ["joints"]))
    joints = reader.joints if is_robot else None
    return to_parts(load_bodies(path, unit=reader.unit, joints=joints, partial=reader.partial), reader)


def to_parts(reading: Reading, reader: Reader) -> Scene:
    """The bodies of a reading as parts with unique names, and what a robot's joints allow."""
    shapes: dict[int, Shape] = {}
    parts = []
    links: dict[str, list[str]] = {}
    for name, body in zip(unique_names(body.name for body in reading.bodies), reading.bodies, strict=True):
        shape = shapes.setdefault(id(body.shape), _fitted(body.shape, reader))
        parts.append(Part(name, shape, body.T, body.component))
        links.setdefault(body.name, []).append(name)
    allowed = []
    if reading.joined is not None:
        allowed = [Allowed(a, b, _ANY) for names in links.values() for a, b in itertools.combinations(names, 2)]
        for parent, child in reading.joined:
            allowed += [Allowed(a, b) for a in links.get(parent, ()) for b in links.get(child, ())]
    return Scene(tuple(parts), allowed=tuple(allowed), notes=tuple(reading.notes))


def _fitted(shape: Shape, reader: Reader) -> Shape:
    """A mesh taken as the reader says; what is drawn, or knows its chord error, is taken as it is."""
    if isinstance(shape, Solid):
        return shape
    if isinstance(shape, BrepSolid):
        reader.refuse("STEP, whose faces are exact", "fit", "chord")
        return shape
    if shape.error or (reader.fit is None and not reader.chord):
        return shape
    return replace(shape, fit=reader.fit or shape.fit, error=float(reader.chord or 0.0))


def _folder(folder: Path, reader: Reader) -> Scene:
    """Every geometry file of a folder, in the order of their names, each where the table of poses puts it."""
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() in FORMATS and not f.is_dir())
    if not files:
        raise InputError(f"{checks.short(folder)}: no geometry file in the folder; choices: {', '.join(FORMATS)}")
    places = read_poses(reader.poses) if reader.poses is not None else [(f.stem, np.eye(4)) for f in files]
    named: dict[str, Path] = {}
    for file in files:
        if (other := named.setdefault(file.stem, file)) is not file:
            raise InputError(
                f"{checks.short(folder)}: {other.name} and {file.name} would both be part {checks.shown(file.stem)}; "
                "give one file, or a folder in which names differ by more than their endings"
            )
    unknown = [name for name, _ in places if name not in named]
    if unknown:
        listed = ", ".join(list(named)[:8]) + (", ..." if len(named) > 8 else "")
        raise InputError(f"{reader.poses}: no file for {checks.shown(unknown[0])} in {folder}; there are {listed}")
    left = sorted(named.keys() - {name for name, _ in places})
    if left and not reader.partial:
        raise InputError(f"{reader.poses}: no pose for {', '.join(left[:4])} ({len(left)} of {len(files)} files)")
    notes = [f"{len(left)} of {len(files)} files have no pose and are left out"] if left else []
    scenes: dict[str, Scene] = {}
    parts: list[Part] = []
    for name, T in places:
        if name not in scenes:
            scenes[name] = read_parts(named[name], replace(reader, poses=None))
            notes += [f"{name}: {note}" for note in scenes[name].notes]
        parts += prefixed(scenes[name], part_name(name), T).parts
    names = unique_names(part.name for part in parts)
    return Scene(tuple(replace(part, name=name) for name, part in zip(names, parts, strict=True)), notes=tuple(notes))


def read_poses(path: Path) -> list[tuple[str, Array]]:
    """Names and poses (4, 4) of a table with the columns of `COLUMNS`; a name may be there more than once."""
    from clamp3d.clamp.loader import read_text

    rows = csv.reader(read_text(path).splitlines())
    head = [cell.strip() for cell in next(rows, [])]
    if tuple(head) != COLUMNS:
        raise InputError(f"{path}: the first line must be {','.join(COLUMNS)}, got {checks.shown(','.join(head))}")
    poses = []
    try:
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            name, *numbers = (cell.strip() for cell in row)
            table = {"translation": numbers[:3], "quaternion": numbers[3:]}
            poses.append((name, validate(Pose, table, f"{path}: line {rows.line_num}", strict=False).T()))
    except csv.Error as error:
        raise InputError(f"{path}: line {rows.line_num}: {error}") from None
    if not poses:
        raise InputError(f"{path}: no pose in the table")
    return poses


def names_like(patterns: Iterable[str], names: Iterable[str]) -> list[str]:
    """Names that are in ``patterns``, or fit one of them; a pattern that fits none stays, and is refused as unknown."""
    available = dict.fromkeys(names)
    matching: dict[str, None] = {}
    for pattern in patterns:
        fits = [pattern] if pattern in available else [name for name in available if is_like(name, pattern)]
        matching |= dict.fromkeys(fits or [pattern])
    return list(matching)
