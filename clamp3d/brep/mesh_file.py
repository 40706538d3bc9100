"""Files with geometry: triangle meshes and CAD, as placed bodies or as one mesh, in millimetres with Z up."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d import checks
from clamp3d.brep.apart import READERS, read_apart
from clamp3d.brep.bodies import Body, Reading
from clamp3d.brep.stl_file import read_stl
from clamp3d.core.linear import to_target
from clamp3d.core.mesh import Array, IntArray, Mesh, make_mesh
from clamp3d.core.shapes import MeshShape
from clamp3d.errors import Clamp3dError, InputError

UNITS_MM: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres in one unit of length."""

FORMATS: dict[str, str | None] = {
    ".stl": None,
    ".obj": None,
    ".ply": None,
    ".off": None,
    ".glb": "m",
    ".gltf": "m",
    ".3mf": "stated",
    ".step": "stated",
    ".stp": "stated",
}
"""Readable formats; the value is the unit that the format itself fixes (None: the file does not say)."""


def load_bodies(path: str | Path, *, unit: str | None = None, partial: bool = False) -> Reading:
    """Read all bodies of a file, with their names and places.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY or OFF (one body), GLB or GLTF (one for each node with a mesh), 3MF (one for each object of the
        build), or STEP (one for each solid of the product tree).
    unit : str, optional
        Unit of the file's lengths: mm, cm, m or in; not for STEP and 3MF, which state it. By default mm for STL, OBJ,
        PLY and OFF (which carry no unit), metres for glTF (whose Y up becomes Z up).
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
        For STEP without the extra ``step``.
    """
    file = checks.path("mesh", path)
    kind = file.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"{file}: unknown mesh format {kind or '(none)'!r}; available: {', '.join(FORMATS)}")
    own = FORMATS[kind]
    if unit is not None:
        checks.choice("unit", unit, UNITS_MM)
        if own == "stated":
            raise InputError(f"unit: {kind[1:].upper()} files state their unit themselves")
    checks.readable_file(file)
    if kind in READERS:
        found = read_apart(file)
    elif kind in (".glb", ".gltf"):
        from clamp3d.brep.gltf_file import read_gltf

        found = read_gltf(file, UNITS_MM[unit or "m"])
    else:
        found = _single(file, kind, unit)
    return found.complete(file, partial=partial)


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
    found = load_bodies(path, unit=unit)
    if len(found.bodies) == 1 and np.array_equal(found.bodies[0].T, np.eye(4)):
        return found.bodies[0].shape.mesh
    meshes = [(body.shape.mesh, body.T) for body in found.bodies]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh, _ in meshes)])
    vertices = np.concatenate([to_target(T, mesh.vertices) for mesh, T in meshes])
    faces = np.concatenate([mesh.faces + start for (mesh, _), start in zip(meshes, offsets, strict=False)])
    mesh = make_mesh(vertices, faces, name=Path(path).name)
    return replace(mesh, notes=(*found.notes, *mesh.notes))


def _single(file: Path, kind: str, unit: str | None) -> Reading:
    vertices, faces = _read(file, kind)
    mesh = make_mesh(vertices, faces, name=file.name, scale=UNITS_MM[unit or "mm"], float32=True)
    if unit is None:
        size = float(np.ptp(mesh.vertices, axis=0).max())
        doubt = f"; if they are metres, unit m makes that {1e3 * size:.6g} mm" if size < 1.0 else ""
        note = f"{kind[1:].upper()} carries no unit: taken as mm (largest extent {size:.6g} mm{doubt})"
        mesh = replace(mesh, notes=(note, *mesh.notes))
    return Reading((Body(file.stem, MeshShape(mesh, "off", file.name), np.eye(4)),), notes=mesh.notes)


def _read(file: Path, kind: str) -> tuple[Array, IntArray]:
    """Vertices (n, 3) and faces (m, 3) of a file that is one mesh."""
    plain = read_stl(file.read_bytes()) if kind == ".stl" else None
    if plain is None:
        return _read_by_trimesh(file, kind)
    if not len(plain[1]):
        raise InputError(f"{file}: no triangles in the file")
    return plain


def _read_by_trimesh(file: Path, kind: str) -> tuple[Array, IntArray]:
    import logging

    import trimesh

    # What it logs about a file goes to who has asked for logs, not on stderr.
    logger = logging.getLogger("trimesh")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    options: dict[str, Any] = {"skip_materials": True} if kind == ".obj" else {}
    try:
        with np.errstate(all="ignore"):  # numbers that are none are looked for below
            scene = trimesh.load_scene(file, file_type=kind[1:], process=False, **options)
            parts = [g for g in scene.dump() if isinstance(g, trimesh.Trimesh)]
    except Clamp3dError:
        raise
    except Exception as error:  # trimesh raises whatever its parsers meet
        reason = f" ({' '.join(str(error).split())})" if isinstance(error, trimesh.exchange.stl.HeaderError) else ""
        raise InputError(f"{file}: not a readable {kind[1:].upper()} file{reason}") from None
    if not parts or not any(len(p.faces) for p in parts):
        raise InputError(f"{file}: no triangles in the file")
    offsets = np.cumsum([0, *(len(p.vertices) for p in parts)])
    vertices = np.concatenate([np.asarray(p.vertices, dtype=np.float64) for p in parts])
    faces = np.concatenate([np.asarray(p.faces, dtype=np.int64) + o for p, o in zip(parts, offsets, strict=False)])
    _compare(file, kind, len(faces))
    return vertices, faces


def _compare(file: Path, kind: str, read: int) -> None:
    """Raise InputError if fewer triangles were ``read`` than the text of a file announces."""
    raw = file.read_bytes()
    least = 0
    if kind == ".stl" and raw.lstrip()[:5].lower() == b"solid" and b"\0" not in raw[:1000]:
        solid, endsolid, facet, endfacet, vertex = (
            len(re.findall(rb"(?im)^\s*" + word + rb"\b", raw))
            for word in (b"solid", b"endsolid", b"facet", b"endfacet", b"vertex")
        )
        if solid != endsolid or facet != endfacet or vertex != 3 * facet:
            raise InputError(f"{file}: the file is cut off: {solid} solids begin in it, {endsolid} end")
        least = facet
    elif kind == ".obj":  # a face of n corners makes n - 2 triangles
        least = sum(len(line.split()) - 3 for line in re.findall(rb"(?m)^[ \t]*f[ \t][^\r\n#]*", raw))
    elif kind == ".ply":
        found = re.search(rb"element\s+face\s+(\d+)", raw[:100_000])
        least = int(found[1]) if found else 0
    elif kind == ".off":
        found = re.search(rb"^\s*\w*OFF\s*(?:#[^\n]*\n\s*)*\d+\s+(\d+)", raw[:100_000])
        least = int(found[1]) if found else 0
    if read < least:
        raise InputError(f"{file}: the file is damaged: it announces {least} triangles or faces, {read} were read")
