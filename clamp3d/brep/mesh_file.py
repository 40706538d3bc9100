"""Triangle meshes from files: read, checked, in millimetres with Z up."""

from __future__ import annotations

import json
import logging
import os
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d import checks
from clamp3d.core.mesh import Array, IntArray, Mesh, make_mesh
from clamp3d.errors import Clamp3dError, InputError

UNITS_MM: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres in one unit of length."""

FORMATS: dict[str, str | None] = {
    ".stl": None,
    ".obj": None,
    ".ply": None,
    ".glb": "m",
    ".gltf": "m",
    ".3mf": "mm",
    ".step": "mm",
    ".stp": "mm",
}
"""Readable formats; the value is the unit that the format itself fixes (None: the file does not say)."""

_STEP = (".step", ".stp")
_UNITS_3MF = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "meter": 1000.0, "inch": 25.4, "foot": 304.8}
_SILENT = logging.NullHandler()


def load_mesh(path: str | Path, *, unit: str | None = None) -> Mesh:
    """Read a file as one mesh in mm with Z up; several bodies become one mesh.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY, GLB, GLTF, 3MF or STEP file.
    unit : str, optional
        Unit of the file's lengths: mm, cm, m or in. By default mm for STL, OBJ and PLY (which carry no unit), the
        unit in the file for 3MF and STEP, metres for glTF (whose Y up becomes Z up).

    Returns
    -------
    Mesh
        The mesh as `make_mesh` checks and repairs it; its ``notes`` say what was assumed.

    Raises
    ------
    InputError
        If the file is missing, not readable or empty, or has a number that is not finite.
    MissingLibraryError
        For STEP without the extra ``step``.
    """
    file = checks.path("mesh", path)
    kind = file.suffix.lower()
    if unit is not None:
        checks.choice("unit", unit, UNITS_MM)
    if kind not in FORMATS:
        raise InputError(f"{file}: unknown mesh format {kind or '(none)'!r}; available: {', '.join(FORMATS)}")
    if not os.path.isfile(file):
        raise InputError(f"{checks.short(file)}: no such file")
    if kind in _STEP:
        from clamp3d.brep.step_file import read_step

        vertices, faces = read_step(file)
        own: float | None = 1.0
    else:
        vertices, faces, own = _read(file, kind)
    if kind in (".glb", ".gltf"):
        vertices = np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]])
    scale = UNITS_MM[unit] if unit else own or 1.0
    mesh = make_mesh(vertices, faces, name=file.name, scale=scale, float32=kind not in _STEP)
    if unit or own:
        return mesh
    size = float(np.ptp(mesh.vertices, axis=0).max())
    note = f"{kind[1:].upper()} carries no unit: taken as mm (largest extent {size:.6g} mm)"
    return replace(mesh, notes=(note, *mesh.notes))


def _read(file: Path, kind: str) -> tuple[Array, IntArray, float | None]:
    """Vertices (n, 3) and faces (m, 3) of all bodies, and millimetres in the file's unit if it says one."""
    import trimesh

    # What it logs about a file goes to who has asked for logs, not on stderr.
    logging.getLogger("trimesh").addHandler(_SILENT)

    try:
        options: dict[str, Any] = {"process": False}
        if kind == ".obj":
            options["skip_materials"] = True
        with np.errstate(all="ignore"):  # numbers that are none are looked for below
            scene = trimesh.load_scene(file, file_type=kind[1:], **options)
            parts = [g for g in scene.dump() if isinstance(g, trimesh.Trimesh)]
    except Clamp3dError:
        raise
    except Exception as error:  # trimesh raises whatever its parsers meet
        told = isinstance(error, (trimesh.exchange.stl.HeaderError, zipfile.BadZipFile, json.JSONDecodeError))
        reason = f" ({' '.join(str(error).split())})" if told else ""
        raise InputError(f"{file}: not a readable {kind[1:].upper()} file{reason}") from None
    if not parts or not any(len(p.faces) for p in parts):
        raise InputError(f"{file}: no triangles in the file")
    offsets = np.cumsum([0, *(len(p.vertices) for p in parts)])
    vertices = np.concatenate([np.asarray(p.vertices, dtype=np.float64) for p in parts])
    faces = np.concatenate([np.asarray(p.faces, dtype=np.int64) + o for p, o in zip(parts, offsets, strict=False)])
    own = UNITS_MM.get(FORMATS[kind] or "")
    if kind == ".3mf":
        own = _UNITS_3MF.get(str(scene.units).removesuffix("s"))  # where the file says none it is "millimeters"
        if own is None:
            raise InputError(f"{file}: unit must be one of {', '.join(_UNITS_3MF)}, got {scene.units!r}")
    return vertices, faces, own
