"""One door for everything that a command can be given: a clamp, a scene, or any file that holds bodies."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clamp3d import checks
from clamp3d.brep.bodies import part_name
from clamp3d.collide.scene import Scene
from clamp3d.core.shapes import Fit
from clamp3d.errors import InputError
from clamp3d.scenefile.parts import Parts, Reader, has_bodies, read_parts, refuse_wires, to_parts

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
        Name of a built-in clamp (``"reference"``), or a path:

        - a clamp file or a scene file (TOML);
        - STEP: a part for each solid of the product tree; GLB and GLTF: for each node with a mesh; 3MF: for each
          object;
        - STL, OBJ, PLY, OFF: one part;
        - URDF: a part for each shape of each link;
        - a folder of such files.

        Parts are called as the file calls them; names that occur more than once are numbered.

        Or an object: an assembly, a shape or a Workplane of CadQuery, a shape of build123d, a TopoDS_Shape of Open
        CASCADE, a `trimesh.Scene` or `trimesh.Trimesh`.
    line, jumper
        Wires that replace the clamp's own: a catalogue name or a diameter in mm. Only for a clamp.
    unit
        Unit of the numbers in a mesh file: mm, cm, m or in. Default: mm for STL, OBJ, PLY and OFF, m for glTF. STEP
        and 3MF state their own.
    fit
        What to make of the round surfaces of meshes: "off" (default) takes the facets as the part; see `MeshShape`.
    chord
        How far the true surface of a mesh can be from its facets, mm; it widens every bound. 0 by default.
    joints
        Joint values of a URDF by name: rad, or mm for joints that slide.
    poses
        CSV table of poses for a folder of meshes; its first line is ``name,x,y,z,qx,qy,qz,qw`` (mm, unit quaternion).
    partial
        Go on where some bodies of a file cannot be read; a note of the scene says how many of how many were.

    Returns
    -------
    Clamp or Scene

    Raises
    ------
    InputError
        In one line, for a source that is none of these, cannot be read completely, or does not go with the other
        arguments.
    MissingLibraryError
        For STEP without the extra ``step``, URDF without ``urdf``.

    Examples
    --------
    >>> load("reference", line="LJ-500").line.conductor
    'LJ-500'
    """
    wires = {name: wire for name, wire in (("line", line), ("jumper", jumper)) if wire is not None}
    reader = Reader(
        unit=unit,
        fit=fit,
        chord=chord,
        joints={} if joints is None else joints,
        poses=None if poses is None else checks.path("poses", poses),
        partial=checks.flag("partial", partial),
    )
    if isinstance(source, (str, os.PathLike)):
        if not os.fspath(source):  # else it would be the folder that one is in
            raise InputError("source must not be empty")
        return _from_path(checks.path("source", source), reader, wires)
    refuse_wires(type(source).__name__, "an object", wires)
    return _from_object(source, reader)


def _from_object(source: Any, reader: Reader) -> Scene:
    from clamp3d.brep.objects import read_object

    reader.refuse("an object", "joints", "poses", "unit")
    reading, name = read_object(source)
    return _scene(to_parts(reading.complete(name, partial=reader.partial), reader), name)


def _from_path(path: Path, reader: Reader, wires: dict[str, str | float]) -> Clamp | Scene:
    if has_bodies(path) and not (path.is_dir() and _is_builtin(str(path))):
        refuse_wires(path, "a file of bodies", wires)
        return _scene(read_parts(path, reader), path.resolve().name if path.is_dir() else path.stem)
    from clamp3d.scenefile.file import load_described

    reader.refuse(checks.short(path), "unit", "fit", "chord", "joints", "poses", "partial")
    return load_described(path, wires)


def _scene(parts: Parts, name: str) -> Scene:
    return Scene(parts.parts, allowed=parts.allowed, name=part_name(name), notes=parts.notes)


def _is_builtin(name: str) -> bool:
    from clamp3d.clamp.loader import builtin_clamps

    return name in builtin_clamps()
