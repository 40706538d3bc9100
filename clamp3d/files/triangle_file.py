"""STL, PLY and OFF files as one body, by trimesh, whose loaders take what is left of a file that was cut off, and OBJ.

So the faces that the file announces are counted here. This runs in the process for foreign files.
"""

from __future__ import annotations

import codecs
import io
import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from clamp3d.checks import shown
from clamp3d.errors import InputError
from clamp3d.files.bodies import Body, Reading
from clamp3d.files.formats import UNITS_MM
from clamp3d.geometry.mesh import IntArray, appended, edges_of, make_mesh
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import MeshShape
from clamp3d.geometry.triangles import normals_and_areas

_FOLDED = 1e-6
"""1 less the cosine of the angle (0.08 deg) to which two faces that share an edge are one on the other."""
_MIXED = "the file is cut off, or its faces have different numbers of corners: export it as triangles"
"""What trimesh cannot tell apart in binary PLY files."""
_OBJ_WITHOUT_FACES = frozenset(
    b"vt vn vp l p g o s mg usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj ctech stech "
    b"cstype deg bmat step curv curv2 parm trim hole scrv sp end con csh".split()
)
"""Lines of OBJ files that make no faces: all of the specification but those of free-form surfaces and other files."""


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
    if kind == "obj":
        vertices, faces = _obj_arrays(raw)
        if not len(faces):
            raise InputError("no triangles in the file")
        return vertices, faces
    announced = _ANNOUNCED[kind](raw)
    with np.errstate(all="ignore"):  # numbers that are none are refused by `make_mesh`
        try:
            scene = trimesh.load_scene(io.BytesIO(raw), file_type=kind, process=False)
        except ValueError as error:
            if "PLY is unexpected length" not in str(error):
                raise
            raise InputError(_MIXED) from None
        meshes = [geometry for geometry in scene.dump() if isinstance(geometry, trimesh.Trimesh)]
    if any(_is_mixed(mesh.metadata.get("_ply_raw", {}).get("face", {}).get("data")) for mesh in meshes):
        raise InputError(_MIXED)
    read = sum(len(mesh.faces) for mesh in meshes)
    if not read:
        raise InputError("no triangles in the file")
    if read < announced:
        raise InputError(f"the file is damaged: it announces {announced} faces, {read} were read")
    vertices, faces = appended([np.asarray(mesh.vertices) for mesh in meshes], [mesh.faces for mesh in meshes])
    if read > announced:  # some faces have more than three corners
        _require_no_folds(vertices, faces)
    return vertices, faces


def _is_mixed(faces: Any) -> bool:
    """Whether binary faces of a PLY file have other lengths than the first, which trimesh takes to be that of all."""
    names = faces.dtype.names if isinstance(faces, np.ndarray) else None
    lists = [faces[name] for name in names or () if faces[name].dtype.names]
    return any((column["f0"] != column["f1"].shape[1]).any() for column in lists)


def _require_no_folds(vertices: Array, faces: IntArray) -> None:
    """Raise InputError if a face folds back onto its neighbour.

    trimesh cuts faces with many corners into fans from the first one: of a face with a notch some lie beside it.
    """
    _, pairs, _ = edges_of(faces, 2)
    with np.errstate(all="ignore"):
        normal = normals_and_areas(vertices[faces])[0][pairs]
    if ((normal[:, 0] * normal[:, 1]).sum(axis=1) < -1.0 + _FOLDED).any():
        raise InputError(
            "a face folds back onto its neighbour, as faces with notches do when they are cut into triangles: "
            "export it as triangles"
        )


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


def _obj_arrays(raw: bytes) -> tuple[Array, IntArray]:
    """Vertices (n, 3) and faces (m, 3) of an OBJ file, those with more corners as fans from the first one.

    trimesh takes numbers < 0, which count back from their line, from the end of the file, and passes over lines that it
    does not know. Raises InputError for these.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    count = 0
    text = re.sub(rb"#[^\r\n]*", b"", raw.removeprefix(codecs.BOM_UTF8))
    for line in re.sub(rb"\\(\r\n|\r|\n)", b" ", text).splitlines():
        keyword, *words = line.split() or [b"o"]
        if keyword == b"v":
            vertices.append([float(word) for word in words[:3]])
            if len(words) < 3:
                raise InputError(f"the file is damaged: a vertex has {len(words)} coordinates")
        elif keyword == b"f":
            if len(words) < 3:
                raise InputError(f"the file is damaged: a face has {len(words)} corners")
            corners = [int(word.partition(b"/")[0]) for word in words]  # numbers of texture and normals may follow
            if min(corners) < 0:
                corners = [k if k >= 0 else len(vertices) + 1 + k for k in corners]
            if min(corners) <= 0:
                raise InputError(f"the file is damaged: {shown(str(line, 'latin-1'))} names no vertex before it")
            faces += [[corners[0], *side] for side in itertools.pairwise(corners[1:])]
            count += 1
        elif keyword not in _OBJ_WITHOUT_FACES:
            word = shown(str(keyword, "latin-1"))
            raise InputError(f"a line begins with {word}, which is not read: export it as triangles")
    V, F = np.array(vertices).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3) - 1
    if len(F) > count and F.max() < len(V):
        _require_no_folds(V, F)
    return V, F


def _announced_ply(raw: bytes) -> int:
    end = raw.find(b"end_header", 0, 100_000)
    if end < 0:
        raise InputError("the file is cut off: its header has no end")
    counts = {name: int(number) for name, number in re.findall(rb"element\s+(\w+)\s+(\d+)", raw[:end])}
    if counts.get(b"tristrips"):
        raise InputError("triangle strips are not read: export it as a list of triangles")
    if b"ascii" in raw[: min(end, 100)]:
        _lines(raw[end + len(b"end_header") :], sum(counts.values()))
    return counts.get(b"face", 0)


def _announced_off(raw: bytes) -> int:
    header = re.search(rb"^\s*(\w*)OFF\s*(?:#[^\n]*\n\s*)*(\d+)[ \t]+(\d+)[^\n]*\n", raw[:100_000])
    if header is None:
        raise InputError("no OFF file: it must begin with OFF and a line with the numbers of vertices and faces")
    if b"4" in header[1] or b"n" in header[1]:
        raise InputError(f"points of {header[1].decode()}OFF files have more than three coordinates: only OFF is read")
    vertices, faces = int(header[2]), int(header[3])
    lines = _lines(raw[header.end() :], vertices + faces)
    if any(re.match(rb"\s*([5-9]|\d\d)", line) for line in lines[vertices:]):
        raise InputError("a face has more than four corners: export it as triangles")
    return faces


def _lines(data: bytes, count: int) -> list[bytes]:
    """The ``count`` lines that are neither empty nor a comment. Raises InputError if there are fewer or more."""
    lines = re.findall(rb"(?m)^[ \t]*[^\s#][^\r\n]*", data)
    if len(lines) != count:
        problem = "cut off" if len(lines) < count else "damaged"
        raise InputError(
            f"the file is {problem}: {count} lines of vertices and faces are announced, {len(lines)} follow"
        )
    return lines


_ANNOUNCED = {"stl": _announced_stl, "ply": _announced_ply, "off": _announced_off}
"""How many faces a file of each format says that it has."""
