"""One door for everything that a command can be given: a clamp, a scene, or any file that holds bodies."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from clamp3d import checks
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.loader import builtin_clamps, load_clamp, parse_toml, read_text
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.files.bodies import part_name
from clamp3d.files.formats import FORMATS, ROBOT
from clamp3d.files.objects import read_object
from clamp3d.geometry.shapes import Fit
from clamp3d.scenefile.file import load_scene
from clamp3d.scenefile.read_parts import Reader, read_parts, to_parts
from clamp3d.scenefile.tables import SceneTable


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
    if isinstance(source, (str, os.PathLike)):
        path = checks.path("source", source)
        if not os.fspath(source):  # else it would be the folder that one is in
            raise InputError("source must not be empty")
        is_folder = os.path.isdir(path) and str(path) not in builtin_clamps()
        if not is_folder and path.suffix.lower() not in (*FORMATS, ROBOT):
            return _described(path, reader)
        scene, name = read_parts(path, reader), path.resolve().name if is_folder else path.stem
    else:
        reader.refuse("an object", "joints", "poses", "unit", "line", "jumper")
        reading, name = read_object(source)
        scene = to_parts(reading.complete(name, partial=reader.partial), reader)
    return replace(scene, name=part_name(name))


def _described(path: Path, reader: Reader) -> Clamp | Scene:
    """A clamp by the name or the file ``path``, with the ``reader``'s wires, or the scene in a file."""
    reader.refuse(checks.short(path), "unit", "fit", "chord", "joints", "poses", "partial")
    if str(path) in builtin_clamps() or _is_clamp(path):
        return load_clamp(path, line=reader.line, jumper=reader.jumper)
    reader.refuse(checks.short(path), "line", "jumper")
    scene = load_scene(path)
    if not scene.parts:
        raise InputError(f"{checks.short(path)}: the scene has no parts; add [parts.NAME], include or [clamp]")
    return scene


def _is_clamp(path: Path) -> bool:
    """Whether the tables of a TOML file are those of a clamp; False: those of a scene."""
    named_toml = path.suffix.lower() == ".toml"
    if not named_toml and not os.path.isfile(path):
        raise InputError(f"unknown clamp or file {checks.shown(str(path))}; {_choices(path)}")
    try:
        keys = set(parse_toml(read_text(path), str(path)))
    except InputError:
        if named_toml:
            raise
        raise InputError(f"{checks.short(path)}: unknown kind of file; {_choices(path)}") from None
    of_clamp, of_scene = {f.name for f in fields(Clamp)}, {*SceneTable.__struct_fields__}
    as_clamp, as_scene = len(keys & of_clamp - of_scene), len(keys & of_scene - of_clamp)
    if not as_clamp and not as_scene:
        raise InputError(
            f"{checks.short(path)}: neither a clamp ([up_splint], [line], ...) nor a scene ([parts.NAME], [clamp], ...)"
            + _hint(path)
        )
    return as_clamp > as_scene


def _choices(path: Path) -> str:
    built_in = ", ".join(builtin_clamps())
    files = ", ".join((*FORMATS, ROBOT))
    return f"built in: {built_in}; or give a clamp or scene file (.toml), a folder, or a file ({files}){_hint(path)}"


def _hint(path: Path) -> str:
    """The ending that a misspelt one is like."""
    endings = (".toml", *FORMATS, ROBOT)
    near = difflib.get_close_matches(path.suffix.lower(), endings, n=1, cutoff=0.75)
    return f"; did you mean {near[0]}?" if near and near[0] != path.suffix.lower() else ""
