"""The file formats that hold bodies, as placed bodies or as one mesh, in millimetres with Z up.

Each is read by a function of its own, in the process for foreign files.

A reader takes a path and the unit, and gives what it read, and what the file announces and it could not read. It raises
InputError for what it refuses. Whatever else a library raises is made one line here.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from clamp3d import checks
from clamp3d.errors import Clamp3dError, InputError, need
from clamp3d.files.bodies import Reading
from clamp3d.files.worker import OUTSIDE, read_in_process
from clamp3d.geometry.mesh import Mesh

UNITS_MM: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres in one unit of length."""


class Format(NamedTuple):
    """How files of a format are read.

    Attributes
    ----------
    reader : str
        Module and function of ``clamp3d.files`` that reads them.
    unit : str or None
        Unit of the format: "m" of glTF, whose Y is up; "stated" where no other may be given, since each file states it
        or the format fixes mm; None where it is mm unless the caller says otherwise.
    library : str or None
        Optional library that the reader needs and does not ask for itself.
    """

    reader: str
    unit: str | None = None
    library: str | None = None


_MESH = Format("triangle_file:read_triangles")
_GLTF = Format("gltf_file:read_gltf", "m")
_STEP = Format("step_file:read_step", "stated")
FORMATS: dict[str, Format] = {
    ".stl": _MESH,
    ".obj": _MESH,
    ".ply": _MESH,
    ".off": _MESH,
    ".glb": _GLTF,
    ".gltf": _GLTF,
    ".3mf": Format("threemf_file:read_3mf", "stated", "lib3mf"),
    ".step": _STEP,
    ".stp": _STEP,
}
"""Readable formats of geometry by the ending of the file's name."""
ROBOT = ".urdf"
"""The ending of robot descriptions, whose links are drawn or name files of geometry."""
_ROBOT = Format("urdf_file:read_urdf", "stated", "yourdfpy")


def read(path: Path, option: Any = None) -> Reading:
    """The bodies of a file, read in this process; ``option`` is one of `UNITS_MM`, or the joints of a robot."""
    checks.note_read([path])
    kind = path.suffix.lower()
    form = _ROBOT if kind == ROBOT else FORMATS[kind]
    if form.library is not None:
        need(form.library, kind[1:].upper())
    if path.is_file() and not path.stat().st_size:
        raise InputError("the file is empty")
    module, _, function = form.reader.partition(":")
    try:
        reading: Reading = getattr(importlib.import_module(f"clamp3d.files.{module}"), function)(path, option)
        return reading
    except (Clamp3dError, MemoryError):
        raise
    except OSError as error:
        raise InputError(error.strerror or str(error)) from None
    except Exception as error:  # libraries raise whatever their parsers meet
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"not a readable {kind[1:].upper()} file ({reason})") from None


def read_any(path: Path, option: Any, outside: bool) -> Reading:
    """The same for another process; ``outside``: whether the file may name others outside of its folder."""
    os.environ[OUTSIDE] = str(int(outside))  # the settings of the process that asks may change
    with checks.files_read() as files:
        reading = read(path, option)
    reading.files = files
    return reading


def load_bodies(
    path: str | Path, *, unit: str | None = None, joints: Mapping[str, float] | None = None, partial: bool = False
) -> Reading:
    """Read all bodies of a file, with their names and places.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY or OFF (one body), GLB or GLTF (one for each node with a mesh), 3MF (one for each object of the
        build), or STEP (one for each solid of the product tree); with ``joints`` URDF too (one for each shape of a
        link).
    unit : str, optional
        Unit of the file's lengths: mm, cm, m or in; not for STEP, 3MF and URDF, which state it. By default mm for STL,
        OBJ, PLY and OFF (which carry no unit), metres for glTF (whose Y up becomes Z up).
    joints : dict, optional
        Joint values of a robot by name: rad, or mm for joints that slide; 0, or the nearest limit, by default.
    partial : bool
        Go on with what was read where bodies are missing; a note says how many.

    Returns
    -------
    Reading
        Bodies in mm; ``notes`` say what was assumed and repaired.

    Raises
    ------
    InputError
        If the file is missing, damaged or empty, or, unless ``partial``, if a body in it could not be read.
    MissingLibraryError
        For STEP without the extra ``step``, 3MF without ``3mf``, URDF without ``urdf``.
    """
    file = checks.path("mesh", path)
    kind = file.suffix.lower()
    is_robot = kind == ROBOT and joints is not None
    if file.is_dir():
        raise InputError(f"{file}: a folder, not one file ({', '.join(FORMATS)})")
    if kind not in FORMATS and not is_robot:
        raise InputError(f"{file}: unknown format {kind or '(none)'!r}; available: {', '.join(FORMATS)}")
    if unit is not None:
        checks.choice("unit", unit, UNITS_MM)
        if is_robot or FORMATS[kind].unit == "stated":
            raise InputError(f"unit: {kind[1:].upper()} files state their unit themselves")
    if not isinstance(joints, Mapping | None):
        raise InputError(f"joints must be a dict from names to values, got {checks.shown(joints)}")
    values = {str(name): checks.number(f"joint {name}", value) for name, value in (joints or {}).items()}
    return read_in_process(file, values if is_robot else unit).complete(file, partial=partial)


def load_mesh(path: str | Path, *, unit: str | None = None) -> Mesh:
    """Read a file as one mesh in mm with Z up; several bodies become one mesh.

    Parameters
    ----------
    path, unit
        As for `load_bodies`.

    Returns
    -------
    Mesh
        The mesh as `make_mesh` checks and repairs it; its ``notes`` say what was assumed.

    Raises
    ------
    InputError, MissingLibraryError
        As `load_bodies`.
    """
    return load_bodies(path, unit=unit).merged(Path(path).name)
