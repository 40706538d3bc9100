"""The file formats that hold bodies: which function reads each of them, in the process for foreign files.

A reader takes a path and the unit, and gives what it read, and what the file announces and it could not read. It raises
InputError for what it refuses. Whatever else a library raises is made one line here.
"""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import Any, NamedTuple

from clamp3d.errors import Clamp3dError, InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.worker import OUTSIDE

UNITS_MM: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres in one unit of length."""


class Format(NamedTuple):
    """How files of a format are read.

    Attributes
    ----------
    reader : str
        Module and function of ``clamp3d.files`` that reads them.
    unit : str or None
        Unit that the format fixes ("stated": each file states it; None: neither does).
    """

    reader: str
    unit: str | None = None


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
    ".3mf": Format("threemf_file:read_3mf", "stated"),
    ".step": _STEP,
    ".stp": _STEP,
}
"""Readable formats of geometry by the ending of the file's name."""
ROBOT = ".urdf"
"""The ending of robot descriptions, whose links are drawn or name files of geometry."""


def read(path: Path, option: Any = None) -> Reading:
    """The bodies of a file, read in this process; ``option`` is one of `UNITS_MM`, or the joints of a robot."""
    kind = path.suffix.lower()
    reader = "urdf_file:read_urdf" if kind == ROBOT else FORMATS[kind].reader
    module, _, function = reader.partition(":")
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
    return read(path, option)
