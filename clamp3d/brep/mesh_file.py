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
_SILENT = logging.NullHandler()


def load_mesh(path: str | Path, *, unit: str | None = None) -> Mesh:
    """Read ``path`` (STL, OBJ, PLY, GLB, GLTF, 3MF or STEP) as one mesh in mm, Z up.

    ``unit`` is one of ``UNITS_MM``; the default is mm for STL, OBJ and PLY (which carry no unit), the unit in the file
    for 3MF and STEP, metres for glTF (whose Y up becomes Z up). Several bodies become one mesh.
    Raises InputError if the file is missing, unreadable, empty, or has a number that is not finite;
    MissingLibraryError for STEP without the extra ``step``.
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

        file_unit: str | None = "mm"
        vertices, faces = read_step(file)
    else:
        vertices, faces, file_unit = _read(file, kind)
    if kind in (".glb", ".gltf"):
        vertices = np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]])
    scale = UNITS_MM[unit or file_unit or "mm"]
    mesh = make_mesh(vertices, faces, name=file.name, scale=scale, float32=kind not in _STEP)
    notes = list(mesh.notes)
    if unit is None and file_unit is None:
        size = float(np.ptp(mesh.vertices, axis=0).max())
        notes.insert(0, f"{kind[1:].upper()} carries no unit: taken as mm (largest extent {size:.6g} mm)")
    return replace(mesh, notes=tuple(notes))


def _read(file: Path, kind: str) -> tuple[Array, IntArray, str | None]:
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
        file_unit = scene.units
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
    names = {"millimeter": "mm", "millimeters": "mm", "centimeter": "cm", "meter": "m", "meters": "m", "inch": "in"}
    if kind in (".glb", ".gltf"):
        return vertices, faces, "m"
    if kind != ".3mf":
        return vertices, faces, None
    file_unit = names.get(str(file_unit), str(file_unit)) if file_unit else "mm"
    if file_unit not in UNITS_MM:
        raise InputError(f"{file}: unknown unit {file_unit!r} in the file; give one: {', '.join(UNITS_MM)}")
    return vertices, faces, file_unit
