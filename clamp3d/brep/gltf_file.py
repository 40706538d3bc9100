"""glTF and GLB files as placed meshes, by trimesh; the nodes that the file announces are counted against its answer.

A node's mesh is one body, whatever number of materials it is split into. Metres with Y up become mm with Z up. trimesh
reads a file of which everything but shapes and places is taken away, and of which nodes and meshes are called by their
numbers; what it would misread is refused here. This runs in the process for foreign files.
"""

from __future__ import annotations

import io
import json
import math
import os
import struct
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh
from trimesh.resolvers import FilePathResolver

from clamp3d.brep.bodies import Reading
from clamp3d.brep.formats import UNITS_MM
from clamp3d.brep.placing import Placer
from clamp3d.brep.worker import OUTSIDE
from clamp3d.checks import shown
from clamp3d.core.mesh import Array, IntArray
from clamp3d.core.pose import UNIT_TOLERANCE
from clamp3d.errors import InputError

_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "KHR_mesh_quantization",
    "EXT_texture_",
    "MSFT_",
)
"""Required extensions that change no body, and the one whose numbers are scaled here."""
_TRIANGLES, _STRIP = 4, 5
_NORMALIZED = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
"""What a whole number is divided by where an accessor says "normalized"."""
_DEEPEST = 500


class _Buffers(FilePathResolver):
    """Gives trimesh the binary part of a GLB as the file without a name, and files of the same folder."""

    def __init__(self, path: Path, binary: bytes) -> None:
        super().__init__(str(path), allow_anywhere=os.environ.get(OUTSIDE) == "1")
        self._binary = binary

    def get(self, name: str) -> bytes:
        if not name:
            return self._binary
        try:
            return self.absolute(unquote(name)).read_bytes()
        except ValueError:
            raise InputError(
                f"{self.file_path}: names {shown(name)}, which is outside of its folder; {OUTSIDE}=1 allows that"
            ) from None
        except OSError as error:
            raise InputError(f"{self.file_path}: names {shown(name)}: {error.strerror}") from None


def read_gltf(path: Path, unit: str | None) -> Reading:
    """The meshes of a glTF or GLB file. Raises InputError if it is damaged, or holds what cannot be read."""
    try:
        tree, binary = _parts(path)
        placer = Placer(UNITS_MM[unit or "m"], _Z_UP)
        nodes = list(_nodes(path, tree, placer))
        names = [str(n.get("name") or tree["meshes"][n["mesh"]].get("name") or path.stem) for _, n in nodes]
        divisors = _simplify(path, tree, {node["mesh"] for _, node in nodes}, placer)
        scene = trimesh.load_scene(
            io.BytesIO(json.dumps(tree).encode()),
            file_type="gltf",
            resolver=_Buffers(path, binary),
            process=False,
            skip_materials=True,
        )
        pieces = defaultdict(list)
        for key, mesh in scene.geometry.items():  # "7", "7_1", ...: the primitives of mesh 7, in their order
            pieces[int(key.partition("_")[0])].append(mesh)
        for name, (k, node) in zip(names, nodes, strict=True):
            mesh = node["mesh"]
            if len(pieces[mesh]) != len(tree["meshes"][mesh]["primitives"]):
                placer.missing.append(f"{name} (not readable)")
            elif pieces[mesh]:
                placer.place(name, mesh, partial(_arrays, pieces[mesh], divisors[mesh]), scene.graph.get(str(k))[0])
            else:
                placer.notes.append(f"{name}: points or lines, left out")
        return placer.reading()
    except (InputError, MemoryError):
        raise
    except Exception as error:  # the file's own JSON, and trimesh, raise whatever they meet
        reason = f" ({type(error).__name__}: {error})" if str(error) else ": it is cut off or damaged"
        raise InputError(f"{path}: not a readable {path.suffix[1:].upper()} file{reason}") from None


def _parts(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON of a file, and the binary part of a GLB."""
    raw = path.read_bytes()
    text, binary = raw, b""
    if raw[:4] == b"glTF":
        version, length, size, kind = struct.unpack_from("<IIII", raw, 4)
        if version != 2 or kind != 0x4E4F534A:
            raise InputError(f"{path}: not a readable GLB file (version {version})")
        if length > len(raw):
            raise InputError(f"{path}: the file is cut off: {len(raw)} of {length} bytes")
        text = raw[20 : 20 + size]
        if length > 28 + size:
            binary = raw[28 + size : 28 + size + struct.unpack_from("<I", raw, 20 + size)[0]]
    tree = json.loads(text)
    if not isinstance(tree, dict):
        raise InputError(f"{path}: not a readable {path.suffix[1:].upper()} file (no object)")
    required = [x for x in tree.get("extensionsRequired", []) if not str(x).startswith(_HARMLESS)]
    if required:
        listed = ", ".join(map(str, required))
        raise InputError(f"{path}: needs {listed}, which is not read; export without compression")
    return tree, binary


def _nodes(path: Path, tree: dict[str, Any], placer: Placer) -> Iterator[tuple[int, dict[str, Any]]]:
    """Number and content of each node of the scene that has a mesh; what is not there becomes missing, and goes."""
    nodes, meshes = tree.setdefault("nodes", []), tree.setdefault("meshes", [])
    if not tree.get("scenes"):
        below = {child for node in nodes for child in node.get("children", [])}
        tree["scenes"], tree["scene"] = [{"nodes": [k for k in range(len(nodes)) if k not in below]}], 0
    roots = tree["scenes"][tree.get("scene", 0)].setdefault("nodes", [])
    stack, visited = [(k, 0) for k in reversed(_present(roots, nodes, placer))], set()
    while stack:
        k, depth = stack.pop()
        if k in visited or depth > _DEEPEST:
            raise InputError(f"{path}: node {k} is in the tree twice, or more than {_DEEPEST} levels deep")
        visited.add(k)
        node = nodes[k]
        mesh = node.get("mesh")
        if mesh is not None and 0 <= mesh < len(meshes):
            yield k, node
        elif mesh is not None:
            placer.missing.append(f"{node.pop('name', f'node {k}')} (mesh {node.pop('mesh')} is not in the file)")
        stack += [(child, depth + 1) for child in reversed(_present(node.get("children", []), nodes, placer))]


def _present(numbers: list[int], nodes: list[Any], placer: Placer) -> list[int]:
    """The ``numbers`` without those of nodes that are not in the file, which become missing."""
    placer.missing += [f"node {k} (not in the file)" for k in numbers if not 0 <= k < len(nodes)]
    numbers[:] = [k for k in numbers if 0 <= k < len(nodes)]
    return numbers


def _simplify(path: Path, tree: dict[str, Any], used: set[int], placer: Placer) -> dict[int, list[float]]:
    """Leave trimesh nothing but what bodies are made of; the divisor of the numbers of each mesh's primitives.

    Raises InputError for what trimesh would skip, or read as zeros.
    """
    if tree.get("skins") or any("targets" in p for mesh in tree["meshes"] for p in mesh["primitives"]):
        placer.notes.append("skins and morph targets are left at rest")
    accessors = tree.setdefault("accessors", [])
    divisors = {}
    for k, mesh in enumerate(tree["meshes"]):
        kept = []
        for primitive in mesh["primitives"] if k in used else []:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP):
                if mode < _TRIANGLES:  # points and lines
                    continue
                raise InputError(f"{path}: triangles of mode {mode} are not read; export as a list of triangles")
            form = {"attributes": {"POSITION": primitive["attributes"]["POSITION"]}, "mode": mode}
            kept.append(form | {key: primitive[key] for key in ("indices",) if key in primitive})
        for number in [p["attributes"]["POSITION"] for p in kept] + [p["indices"] for p in kept if "indices" in p]:
            if "sparse" in accessors[number] or "bufferView" not in accessors[number]:
                raise InputError(f"{path}: sparse or empty numbers are not read; export without compression")
        corners = [accessors[p["attributes"]["POSITION"]] for p in kept]
        divisors[k] = [_NORMALIZED[c["componentType"]] if c.get("normalized") else 1.0 for c in corners]
        tree["meshes"][k] = {"name": str(k), "primitives": kept}
    places = ("children", "matrix", "translation", "rotation", "scale", "mesh")
    for k, node in enumerate(tree["nodes"]):
        turn = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
        if not abs(math.hypot(*turn) - 1.0) <= UNIT_TOLERANCE:
            raise InputError(f"{path}: the rotation of a node must be a quaternion of length 1, got {shown(turn)}")
        tree["nodes"][k] = {"name": str(k)} | {key: node[key] for key in places if key in node}
    for buffer in tree.setdefault("buffers", []):
        buffer.setdefault("uri", "")
    for key in tree.keys() - {"asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers"}:
        del tree[key]
    tree.setdefault("bufferViews", [])
    return divisors


def _arrays(pieces: list[trimesh.Trimesh], divisors: list[float]) -> tuple[Array, IntArray]:
    """Vertices (n, 3) and faces (m, 3) of the primitives of a mesh together."""
    for piece in pieces:
        if piece.faces.max() >= len(piece.vertices):
            raise InputError(f"face index {piece.faces.max()} is out of range for {len(piece.vertices)} vertices")
    vertices = [np.asarray(piece.vertices) / divisor for piece, divisor in zip(pieces, divisors, strict=True)]
    V, F = trimesh.util.append_faces(vertices, [piece.faces for piece in pieces])
    return np.asarray(V, dtype=np.float64), np.asarray(F, dtype=np.int64)
