"""The file formats that hold bodies: which function reads each of them, in the process for foreign files."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import NamedTuple

from clamp3d.brep.bodies import Reading
from clamp3d.brep.worker import OUTSIDE

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
    """

    module: str
    function: str
    unit: str | None = None


_MESH = Format("triangle_file", "read_triangles")
_GLTF = Format("gltf_file", "read_gltf", "m")
_STEP = Format("step_file", "read_step", "stated")
FORMATS: dict[str, Format] = {
    ".stl": _MESH,
    ".obj": _MESH,
    ".ply": _MESH,
    ".off": _MESH,
    ".glb": _GLTF,
    ".gltf": _GLTF,
    ".3mf": Format("threemf_file", "read_3mf", "stated"),
    ".step": _STEP,
    ".stp": _STEP,
}
"""Readable formats of geometry by the ending of the file's name."""
ROBOT = ".urdf"
"""The ending of robot descriptions, whose links are drawn or name files of geometry."""


def read(path: Path, unit: str | None = None) -> Reading:
    """The bodies of a file of `FORMATS`, read in this process; ``unit`` is one of `UNITS_MM`."""
    module, function, _ = FORMATS[path.suffix.lower()]
    reading: Reading = getattr(importlib.import_module(f"clamp3d.brep.{module}"), function)(path, unit)
    return reading


def read_any(path: Path, unit: str | None, joints: dict[str, float], outside: bool) -> Reading:
    """The bodies of any file, for the process that asked for them.

    ``outside``: whether the file may name others outside of its folder.
    """
    os.environ[OUTSIDE] = str(int(outside))  # this process reads for another one, whose settings may change
    if path.suffix.lower() != ROBOT:
        return read(path, unit)
    from clamp3d.brep.urdf_file import read_urdf

    return read_urdf(path, joints)
