"""The file formats that hold bodies: which function reads each of them, in the process for foreign files."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from typing import Any, NamedTuple

from clamp3d.brep.bodies import Reading
from clamp3d.errors import MissingLibraryError

UNITS_MM: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres in one unit of length."""


class Format(NamedTuple):
    """How files of a format are read.

    Attributes
    ----------
    module, function : str
        Function of ``clamp3d.brep`` that reads them: path and unit in mm give a `Reading`.
    unit : str or None
        Unit that the format fixes ("stated": each file states it; None: neither does).
    library : str
        Optional library that it needs.
    advice : str
        What to say without the library.
    """

    module: str
    function: str
    unit: str | None = None
    library: str = ""
    advice: str = ""


_MESH = Format("triangle_file", "read_triangles")
_GLTF = Format("gltf_file", "read_gltf", "m")
_STEP = Format("step_file", "read_step", "stated", "OCP", "STEP needs Open CASCADE: pip install 'clamp3d[step]'")
FORMATS: dict[str, Format] = {
    ".stl": _MESH,
    ".obj": _MESH,
    ".ply": _MESH,
    ".off": _MESH,
    ".glb": _GLTF,
    ".gltf": _GLTF,
    ".3mf": Format("threemf_file", "read_3mf", "stated", "lib3mf", "3MF needs lib3mf: pip install 'clamp3d[3mf]'"),
    ".step": _STEP,
    ".stp": _STEP,
}
"""Readable formats by the ending of the file's name."""


def require_library(kind: str) -> None:
    """Raise MissingLibraryError if the library that reads files of this ``kind`` (".3mf") is not installed."""
    library = FORMATS[kind].library
    try:
        installed = not library or importlib.util.find_spec(library) is not None
    except ValueError:
        installed = False
    if not installed:
        raise MissingLibraryError(FORMATS[kind].advice)


def read(path: Path, unit: str | None = None) -> Reading:
    """The bodies of a file, read in this process; ``unit`` is one of `UNITS_MM`."""
    module, function, *_ = FORMATS[path.suffix.lower()]
    made: Reading = getattr(importlib.import_module(f"clamp3d.brep.{module}"), function)(path, unit)
    return made


def read_plain(path: str, unit: str | None) -> dict[str, Any]:
    """The same as dicts, lists and arrays, for the process that asked for it."""
    return read(Path(path), unit).to_plain()
