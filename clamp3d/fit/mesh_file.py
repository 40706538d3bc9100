"""Triangle meshes from files: read, checked, in millimetres with Z up."""

from __future__ import annotations

import json
import logging
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d import checks
from clamp3d.contact.shells import inside_out, volume
from clamp3d.errors import Clamp3dError, InputError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

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

LARGEST, SMALLEST = 1e12, 1e-9
"""Largest coordinate and least extent in mm: beyond them products of three lengths lose their digits or vanish."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A checked triangle mesh: ``vertices`` (n, 3) in mm, ``faces`` (m, 3), outward winding, equal vertices merged.

    ``rounding`` (mm) is the largest error of a vertex from the number format; ``notes`` say what was repaired or
    assumed on the way in.
    """

    name: str
    vertices: Array
    faces: IntArray
    watertight: bool
    rounding: float
    notes: tuple[str, ...]


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
        from clamp3d.fit.step_file import read_step

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
    return Mesh(mesh.name, mesh.vertices, mesh.faces, mesh.watertight, mesh.rounding, tuple(notes))


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


def make_mesh(
    vertices: ArrayLike, faces: ArrayLike, *, name: str = "mesh", scale: float = 1.0, float32: bool = False
) -> Mesh:
    """Check, clean and orient a mesh: ``vertices`` (n, 3), ``faces`` (m, 3); lengths are multiplied by ``scale``.

    Equal vertices are merged, triangles without area and doubled triangles dropped, windings made consistent and, on a
    closed mesh, outward, body by body. ``float32``: the coordinates passed through single precision (so they have if
    their type says so). Raises InputError for wrong shapes, numbers that are not finite, indices out of range, no
    triangle left or a closed surface without a volume.
    """
    import trimesh

    checks.text("name of a mesh", name)
    scale, float32 = checks.positive("scale", scale), checks.flag("float32", float32)
    float32 = float32 or getattr(vertices, "dtype", None) == np.float32
    V = checks.array(f"{name}: vertices", vertices, (None, 3), finite=False)
    F = _indices(f"{name}: faces", faces)
    if len(V) == 0:
        raise InputError(f"{name}: vertices must not be empty")
    if F.min() < 0 or F.max() >= len(V):
        bad = int(F.max()) if F.max() >= len(V) else int(F.min())
        raise InputError(f"{name}: face index {bad} is out of range for {len(V)} vertices")
    used, F = np.unique(F, return_inverse=True)
    V, F = V[used], F.reshape(-1, 3)
    if not np.isfinite(V).all():
        bad = int(np.flatnonzero(~np.isfinite(V).all(axis=1))[0])
        raise InputError(f"{name}: vertex {used[bad]} is not finite: {V[bad].tolist()}")
    with np.errstate(over="ignore", under="ignore"):
        V = V * scale
    if not np.abs(V).max() <= LARGEST:
        bad = int(np.abs(V).max(axis=1).argmax())
        raise InputError(f"{name}: vertex {used[bad]} must be within {LARGEST:g} mm, got {V[bad].tolist()}")

    notes = []
    reach = float(np.abs(V).max())
    extent = float(np.ptp(V, axis=0).max())
    if extent <= 0.0:
        raise InputError(f"{name}: all vertices lie in one point")
    if extent < SMALLEST:
        raise InputError(f"{name}: extent must be >= {SMALLEST:g} mm, got {extent:.3g} mm; is the unit right?")
    rounding = reach * (2.0**-24 if float32 else 2.0**-50)
    V, F = _merge(V, F, max(4.0 * rounding, 1e-9 * extent))
    cornered = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    first = np.zeros(len(F), dtype=bool)
    first[np.unique(np.sort(F, axis=1), axis=0, return_index=True)[1]] = True
    doubled = int((cornered & ~first).sum())
    if doubled:
        notes.append(f"{doubled} doubled triangles left out")
    mesh = trimesh.Trimesh(V, F[cornered & first], process=False)
    if len(mesh.faces) == 0:
        raise InputError(f"{name}: no triangle with an area")
    mesh.remove_unreferenced_vertices()
    if not mesh.is_winding_consistent:
        before = mesh.faces.copy()
        trimesh.repair.fix_winding(mesh)  # type: ignore[no-untyped-call]
        turned = int(np.any(before != np.asarray(mesh.faces), axis=1).sum())
        notes.append(f"{turned} triangles turned to one winding")
    watertight = bool(mesh.is_watertight)
    if not watertight:
        notes.append("open mesh: the material's side is taken from the winding")
    V, F = np.asarray(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
    if watertight:
        enclosed = volume(V, F)
        if enclosed < 0.0:
            F = np.ascontiguousarray(F[:, ::-1])
            notes.append("inside out: all triangles turned")
        for rows in inside_out(V, F):
            F[rows] = F[rows][:, ::-1]
            notes.append(f"a body of {len(rows)} triangles inside out: turned")
        if not volume(V, F) > 0.0:
            raise InputError(f"{name}: the surface encloses no volume")
    longest = np.linalg.norm(V[F] - V[F[:, [1, 2, 0]]], axis=2).max(axis=1)
    twice_area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1)
    # Slivers go last: they close the surface, but their normals are rounding.
    F = F[twice_area > 4.0 * rounding * longest]
    if len(F) == 0:
        raise InputError(f"{name}: no triangle with an area")
    return Mesh(name, V, F, watertight, rounding, tuple(notes))


def _indices(name: str, faces: ArrayLike) -> IntArray:
    """Faces (m, 3), m > 0, of whole numbers."""
    try:
        F = np.asarray(faces)
    except (TypeError, ValueError, OverflowError, RecursionError):
        raise InputError(f"{name} must be an array of integers with shape (m, 3)") from None
    if F.dtype.kind not in "iu" and F.size:
        raise InputError(f"{name} must be integers, got {F.dtype}")
    if F.ndim != 2 or F.shape[1:] != (3,) or len(F) == 0:
        raise InputError(f"{name} must have shape (m, 3), got {F.shape}")
    if F.dtype.kind == "u" and F.max() > np.iinfo(np.int64).max:
        raise InputError(f"{name}: index {F.max()} is out of range")
    return F.astype(np.int64)


def _merge(V: Array, F: IntArray, tolerance: float) -> tuple[Array, IntArray]:
    """Merge vertices closer than ``tolerance`` (a tree, not a grid: a grid parts equal points at its lines)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    unique, inverse = np.unique(V, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    pairs = np.asarray(cKDTree(unique).query_pairs(tolerance, output_type="ndarray"))
    if len(pairs):
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(unique), len(unique)))
        _, label = connected_components(graph, directed=False)
        keep = np.unique(label, return_index=True)[1]
        return unique[keep], label[inverse][F].astype(np.int64)
    return unique, inverse[F].astype(np.int64)
