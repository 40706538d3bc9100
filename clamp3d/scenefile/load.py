"""One door for everything that a command can be given: a clamp, a scene, or any file that holds bodies."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from clamp3d import checks
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.files.bodies import part_name
from clamp3d.files.formats import FORMATS, ROBOT
from clamp3d.geometry.shapes import Fit
from clamp3d.scenefile.parts import Reader, read_parts, to_parts

if TYPE_CHECKING:
    from clamp3d.clamp.dimensions import Clamp


def load(
    source: str | os.PathLike[str] | Any,
    *,
    line: str | float | None = None,
    jumper: str | float | None = None,
    unit: str | None = None,
    fit: Fit | None = None,
    chord: float | None = None,
    joints: Mapping[str, float] | None = None,
    poses: str | os.PathLike[str] | None = None,
    partial: bool = False,
) -> Clamp | Scene:
    """Load a clamp, or a scene of parts, from whatever describes it.

    Parameters
    ----------
    source
        Name of a built-in clamp (``"reference"``); a path: a clamp or scene file (TOML), STEP, GLB, GLTF, 3MF, STL,
        OBJ, PLY, OFF, URDF, or a folder of such files; or an object of CadQuery, build123d, Open CASCADE or trimesh.
        Each solid, node, object or link's shape becomes a part of that name; names that occur again are numbered.
    line, jumper
        Wires that replace the clamp's own: a catalogue name or a diameter in mm.
    unit
        Unit of a mesh file: mm, cm, m or in. Default: m for glTF, mm for STL, OBJ, PLY, OFF. Others state their own.
    fit
        What to make of the round surfaces of meshes: "off" (default) takes the facets as the part; see `MeshShape`.
    chord
        How far the true surface of a mesh can be from its facets, mm; it widens every bound. 0 by default.
    joints
        Joint values of a URDF by name: rad, or mm for joints that slide.
    poses
        CSV table of poses for a folder of meshes, headed ``name,x,y,z,qx,qy,qz,qw`` (mm, unit quaternion).
    partial
        Go on where some bodies of a file cannot be read; a note of the scene says how many of how many were.

    Returns
    -------
    Clamp or Scene

    Raises
    ------
    InputError
        In one line, for what cannot be read completely, or does not go with the other arguments.
    MissingLibraryError
        For STEP without the extra ``step``, 3MF without ``3mf``, URDF without ``urdf``.

    Examples
    --------
    >>> load("reference", line="LJ-500").line.conductor
    'LJ-500'
    """
    reader = Reader(
        unit=unit,
        fit=fit,
        chord=chord,
        joints={} if joints is None else joints,
        poses=None if poses is None else checks.path("poses", poses),
        partial=checks.flag("partial", partial),
        line=line,
        jumper=jumper,
    )
    return _load_path(source, reader) if isinstance(source, (str, os.PathLike)) else _load_object(source, reader)


def _load_path(source: str | os.PathLike[str], reader: Reader) -> Clamp | Scene:
    from clamp3d.clamp.loader import builtin_clamps
    from clamp3d.scenefile.file import load_described

    path = checks.path("source", source)
    if not os.fspath(source):  # else it would be the folder that one is in
        raise InputError("source must not be empty")
    if os.path.isdir(path) and str(path) not in builtin_clamps():
        return _named(read_parts(path, reader), path.resolve().name)
    if path.suffix.lower() in (*FORMATS, ROBOT):
        return _named(read_parts(path, reader), path.stem)
    return load_described(path, reader)


def _load_object(source: Any, reader: Reader) -> Scene:
    from clamp3d.files.objects import read_object

    reader.refuse("an object", "joints", "poses", "unit", "line", "jumper")
    reading, name = read_object(source)
    return _named(to_parts(reading.complete(name, partial=reader.partial), reader), name)


def _named(scene: Scene, name: str) -> Scene:
    return replace(scene, name=part_name(name))
