"""One door for everything that a command can be given: a clamp, a scene, a mesh or a STEP file."""

from __future__ import annotations

import os
import re
from dataclasses import fields
from pathlib import Path

from clamp3d import checks
from clamp3d.brep.mesh_file import FORMATS, load_mesh
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.loader import builtin_clamps, load_clamp, parse_toml, read_text
from clamp3d.collide.scene import Scene
from clamp3d.core.shapes import MeshShape
from clamp3d.errors import InputError, escaped
from clamp3d.scenefile.file import load_scene
from clamp3d.scenefile.tables import SceneTable


def load(
    source: str | os.PathLike[str],
    *,
    line: str | float | None = None,
    jumper: str | float | None = None,
    unit: str | None = None,
) -> Clamp | Scene:
    """Load a clamp, or a scene of parts, from whatever describes it.

    Parameters
    ----------
    source
        Name of a built-in clamp (``"reference"``), or the path of a clamp file (TOML), a scene file (TOML), a mesh
        (STL, OBJ, PLY, GLB, GLTF, 3MF) or a STEP file. A mesh or STEP file becomes a scene of one part named after the
        file; all bodies of a STEP file are that one part, as triangles.
    line, jumper
        Wires that replace the clamp's own: a catalogue name or a diameter in mm. Only for a clamp.
    unit
        Unit of the numbers in a mesh file: mm, cm, m or in. Default: the file's own; mm for STL, OBJ and PLY.

    Returns
    -------
    Clamp or Scene

    Raises
    ------
    InputError
        In one line, for a source that is none of these, cannot be read, or does not go with the other arguments.
    MissingLibraryError
        For a STEP file without the extra ``step``.

    Examples
    --------
    >>> load("reference", line="LJ-500").line.conductor
    'LJ-500'
    """
    path = checks.path("source", source)
    wires = {name: wire for name, wire in (("line", line), ("jumper", jumper)) if wire is not None}
    is_mesh = path.suffix.lower() in FORMATS
    if unit is not None and not is_mesh:
        raise InputError(f"unit goes with a mesh or STEP file, not with {checks.short(path)}")
    if is_mesh:
        _refuse_wires(path, "a mesh", wires)
        return _one_part(path, unit)
    if str(path) in builtin_clamps() or _is_clamp(path):
        return load_clamp(path, line=line, jumper=jumper)
    _refuse_wires(path, "a scene", wires)
    scene = load_scene(path)
    if not scene.parts:
        raise InputError(f"{checks.short(path)}: the scene has no parts; add [parts.NAME] or [clamp]")
    return scene


def _is_clamp(path: Path) -> bool:
    """Whether the tables of a TOML file are those of a clamp; False: those of a scene."""
    named_toml = path.suffix.lower() == ".toml"
    if not named_toml and not os.path.isfile(path):
        raise InputError(f"unknown clamp or file {checks.shown(str(path))}; {_choices()}")
    try:
        given = set(parse_toml(read_text(path), str(path)))
    except InputError:
        if named_toml:
            raise
        raise InputError(f"{checks.short(path)}: unknown kind of file; {_choices()}") from None
    of_clamp, of_scene = ({f.name for f in fields(kind)} for kind in (Clamp, SceneTable))
    as_clamp, as_scene = len(given & of_clamp - of_scene), len(given & of_scene - of_clamp)
    if not as_clamp and not as_scene:
        raise InputError(
            f"{checks.short(path)}: neither a clamp ([up_splint], [line], ...) nor a scene ([parts.NAME], [clamp], ...)"
        )
    return as_clamp > as_scene


def _one_part(path: Path, unit: str | None) -> Scene:
    # Characters that a part's name must not hold: a pair is written A:B,C:D, and patterns have * and ?.
    name = escaped(re.sub(r"[\s:,*?]+", "-", path.stem)).strip("-") or "part"
    return Scene(name=name).add(name, MeshShape(load_mesh(path, unit=unit), name=escaped(path.name)))


def _refuse_wires(path: Path, kind: str, wires: dict[str, str | float]) -> None:
    for name in wires:
        raise InputError(f"{name} goes with a clamp; {checks.short(path)} is {kind}")


def _choices() -> str:
    built_in = ", ".join(builtin_clamps())
    return f"built in: {built_in}; or give a clamp or scene file (.toml), or a mesh ({', '.join(FORMATS)})"
