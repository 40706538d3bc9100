"""STL, OBJ, PLY and OFF files as one body, by trimesh, whose loaders take what is left of a file that was cut off.

So the triangles that the file announces are counted here. This runs in the process for foreign files.
"""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from clamp3d.errors import InputError
from clamp3d.files.bodies import Body, Reading
from clamp3d.files.formats import UNITS_MM
from clamp3d.geometry.mesh import Array, IntArray, make_mesh
from clamp3d.geometry.shapes import MeshShape


def read_triangles(path: Path, unit: str | None) -> Reading:
    """The one body of a file. Raises InputError if the file is damaged, or holds fewer triangles than it announces."""
    vertices, faces = _arrays(path)
    mesh = make_mesh(vertices, faces, name=path.name, scale=UNITS_MM[unit or "mm"], float32=True)
    if unit is None:
        size = float(np.ptp(mesh.vertices, axis=0).max())
        metres = f"; if they are metres, unit m makes that {1e3 * size:.6g} mm" if size < 1.0 else ""
        kind = path.suffix[1:].upper()
        note = f"{kind} carries no unit: taken as mm (largest extent {size:.6g} mm{metres})"
        mesh = replace(mesh, notes=(note, *mesh.notes))
    return Reading([Body(path.stem, MeshShape(mesh, "off", path.name), np.eye(4))], notes=[*mesh.notes])


def _arrays(path: Path) -> tuple[Array, IntArray]:
    """Vertices (n, 3) and faces (m, 3), in the file's unit."""
    raw, kind = path.read_bytes(), path.suffix[1:].lower()
    announced = _ANNOUNCED[kind](raw)
    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    with np.errstate(all="ignore"):  # numbers that are none are refused by `make_mesh`
        scene = trimesh.load_scene(io.BytesIO(raw), file_type=kind, process=False, **options)
        meshes = [geometry for geometry in scene.dump() if isinstance(geometry, trimesh.Trimesh)]
    read = sum(len(mesh.faces) for mesh in meshes)
    if not read:
        raise InputError("no triangles in the file")
    if read < announced:
        raise InputError(f"the file is damaged: it announces {announced} triangles or faces, {read} were read")
    vertices, faces = trimesh.util.append_faces([mesh.vertices for mesh in meshes], [mesh.faces for mesh in meshes])
    return np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)


def _announced_stl(raw: bytes) -> int:
    """How many triangles an STL file announces. Raises InputError if it ends before them."""
    if raw.lstrip()[:5].lower() == b"solid" and b"\0" not in raw[:1000]:
        solid, endsolid, facet, endfacet, vertex = (
            len(re.findall(rb"(?im)^\s*" + word + rb"\b", raw))
            for word in (b"solid", b"endsolid", b"facet", b"endfacet", b"vertex")
        )
        if solid != endsolid or facet != endfacet or vertex != 3 * facet:
            raise InputError(f"the file is cut off: {solid} solids begin in it, {endsolid} end")
        return facet
    if not raw:
        return 0
    announced = int.from_bytes(raw[80:84], "little")
    if len(raw) != 84 + 50 * announced:
        raise InputError(
            f"the file is cut off or damaged: its {announced} triangles take {84 + 50 * announced} bytes, "
            f"it has {len(raw)}"
        )
    return announced


def _announced_obj(raw: bytes) -> int:
    # A line with too few corners counts too: trimesh leaves it out.
    return sum(max(1, len(line.split()) - 3) for line in re.findall(rb"(?m)^[ \t]*f[ \t][^\r\n#]*", raw))


def _announced_ply(raw: bytes) -> int:
    number = re.search(rb"element\s+face\s+(\d+)", raw[:100_000])
    return int(number[1]) if number else 0


def _announced_off(raw: bytes) -> int:
    number = re.search(rb"^\s*\w*OFF\s*(?:#[^\n]*\n\s*)*\d+\s+(\d+)", raw[:100_000])
    return int(number[1]) if number else 0


_ANNOUNCED = {"stl": _announced_stl, "obj": _announced_obj, "ply": _announced_ply, "off": _announced_off}
"""How many triangles at least a file of each format says that it has."""
