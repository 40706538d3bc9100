"""glTF and GLB files as placed meshes, by trimesh; the nodes that the file announces are counted against its answer.

A node's mesh is one body, whatever number of materials it is split into. Metres with Y up become mm with Z up. trimesh
reads a file of which everything but shapes and places is taken away, and of which nodes and meshes are called by their
numbers; what it would misread is refused here. This runs in the process for foreign files.
"""

from __future__ import annotations

import base64
import io
import json
import math
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh

from clamp3d.checks import choice, shown
from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.formats import UNITS_MM
from clamp3d.files.placing import Placer
from clamp3d.files.worker import named_file
from clamp3d.geometry.mesh import IntArray, appended
from clamp3d.geometry.pose import UNIT_TOLERANCE, Array

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
_INSTANCES = "EXT_mesh_gpu_instancing"
"""The extension that places a node's mesh many times, which files may use without requiring it."""
_KEYS = {
    "nodes": "camera children skin matrix mesh rotation scale translation weights name extensions extras",
    "accessors": "bufferView byteOffset componentType normalized count type max min sparse name extensions extras",
    "bufferViews": "buffer byteOffset byteLength byteStride target name extensions extras",
    "primitives": "attributes indices material mode targets name extensions extras",
}
"""What glTF 2.0 allows in those: a misspelt place is none to trimesh."""
_TRIANGLES, _STRIP = 4, 5
_NORMALIZED = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
"""What a whole number is divided by where an accessor says "normalized"."""


def read_gltf(path: Path, unit: str | None) -> Reading:
    """The meshes of a glTF or GLB file. Raises InputError if it is damaged, or holds what cannot be read."""
    tree, binary = _parts(path)
    placer = Placer(UNITS_MM[unit or "m"], _Z_UP)
    if tree.get("skins") or any("targets" in p for mesh in tree.get("meshes", []) for p in mesh["primitives"]):
        placer.notes.append("skins and morph targets are left at rest")
    _check_keys(tree)
    nodes = _nodes(tree)
    names = [node.get("name") or tree["meshes"][node.get("mesh", 0)].get("name") for node in tree["nodes"]]
    meshes = {k: _Mesh(tree, k) for k in {tree["nodes"][n]["mesh"] for n in nodes}}
    _simplify(tree, meshes)
    for buffer in tree.get("buffers", []):
        uri = buffer.get("uri", "")
        if not uri.startswith("data:"):
            raw = _beside(path, unquote(uri)) if uri else binary
            buffer["uri"] = f"data:;base64,{base64.b64encode(raw).decode()}"
    text = io.BytesIO(json.dumps(tree).encode())
    scene = trimesh.load_scene(text, file_type="gltf", process=False, skip_materials=True)
    for key, piece in scene.geometry.items():  # "7", "7_1", ...: the primitives of mesh 7, in their order
        meshes[int(key.partition("_")[0])].pieces.append(piece)
    for n in nodes:
        k = tree["nodes"][n]["mesh"]
        name = str(names[n] or path.stem)
        if _INSTANCES in tree["nodes"][n].get("extensions", {}):
            placer.add(name, f"its instances ({_INSTANCES}) are not read", np.eye(4))
        elif len(meshes[k].pieces) != len(meshes[k].primitives):
            placer.add(name, "not readable", np.eye(4))
        elif meshes[k].pieces:
            placer.place(name, k, meshes[k].arrays, scene.graph.get(str(n))[0])
        else:
            placer.notes.append(f"{name}: points or lines, left out")
    read = set(nodes)
    for n, node in enumerate(tree["nodes"]):
        if "mesh" in node and n not in read:
            placer.add(str(names[n] or path.stem), f"node {n} is not in the scene that is read", np.eye(4))
    return placer


def _parts(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON of a file, and the binary part of a GLB."""
    raw = path.read_bytes()
    text, binary = raw, b""
    if raw[:4] == b"glTF":
        version, length, size, kind = struct.unpack_from("<IIII", raw, 4)
        if version != 2 or kind != 0x4E4F534A:
            raise InputError(f"not a readable GLB file (version {version})")
        if length > len(raw):
            raise InputError(f"the file is cut off: {len(raw)} of {length} bytes")
        text = raw[20 : 20 + size]
        if length > 28 + size:
            binary = raw[28 + size : 28 + size + struct.unpack_from("<I", raw, 20 + size)[0]]
    tree = json.loads(text)
    if not isinstance(tree, dict):
        raise InputError("not a readable glTF file (no object)")
    required = [x for x in tree.get("extensionsRequired", []) if not str(x).startswith(_HARMLESS)]
    if required:
        listed = ", ".join(map(str, required))
        raise InputError(f"needs {listed}, which is not read; export without compression")
    return tree, binary


def _beside(path: Path, name: str) -> bytes:
    """What is in a file that the file at ``path`` names. Raises InputError."""
    try:
        return named_file(path, name).read_bytes()
    except OSError as error:
        raise InputError(f"names {shown(name)}: {error.strerror}") from None


def _check_keys(tree: dict[str, Any]) -> None:
    """Raise InputError for keys that trimesh would pass over."""
    primitives = [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]
    for kind, keys in _KEYS.items():
        items = primitives if kind == "primitives" else tree.get(kind, [])
        for key in dict.fromkeys(key for item in items for key in item):
            choice(f"a key of {kind}", key, keys.split())


def _nodes(tree: dict[str, Any]) -> list[int]:
    """Numbers of the scene's nodes that have a mesh. Raises InputError for one that is not there, or there twice."""
    nodes = tree.get("nodes", [])
    takes_all = not tree.get("scenes")
    if takes_all:
        below = {child for node in nodes for child in node.get("children", [])}
        tree["scenes"], tree["scene"] = [{"nodes": [k for k in range(len(nodes)) if k not in below]}], 0
    stack = list(reversed(tree["scenes"][tree.get("scene", 0)].get("nodes", [])))
    visited: dict[int, None] = {}
    while stack:
        k = stack.pop()
        if not 0 <= k < len(nodes) or not 0 <= nodes[k].get("mesh", 0) < max(1, len(tree.get("meshes", []))):
            raise InputError(f"node {k}, or its mesh, is not in the file")
        if k in visited:
            raise InputError(f"node {k} is in the tree twice")
        visited[k] = None
        turn = nodes[k].get("rotation", (0.0, 0.0, 0.0, 1.0))
        if not abs(math.hypot(*turn) - 1.0) <= UNIT_TOLERANCE:
            raise InputError(f"the rotation of a node must be a quaternion of length 1, got {shown(turn)}")
        stack += reversed(nodes[k].get("children", []))
    if takes_all and len(visited) < len(nodes):
        raise InputError(f"node {next(k for k in range(len(nodes)) if k not in visited)} is below itself")
    return [k for k in visited if "mesh" in nodes[k]]


class _Mesh:
    """What is read of a mesh: ``primitives`` of triangles, which trimesh makes ``pieces`` of."""

    def __init__(self, tree: dict[str, Any], number: int) -> None:
        self.primitives: list[dict[str, Any]] = []
        self.pieces: list[trimesh.Trimesh] = []
        self._divisors: list[float] = []
        for primitive in tree["meshes"][number]["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode < _TRIANGLES:  # points and lines
                continue
            if mode not in (_TRIANGLES, _STRIP):
                raise InputError(f"triangles of mode {mode} are not read; export as a list of triangles")
            corners = primitive["attributes"]["POSITION"]
            indices = {"indices": primitive["indices"]} if "indices" in primitive else {}
            for accessor in (tree["accessors"][k] for k in (corners, *indices.values())):
                if "sparse" in accessor or "bufferView" not in accessor:
                    raise InputError("sparse or empty numbers are not read; export without compression")
            corner = tree["accessors"][corners]
            self._divisors.append(_NORMALIZED[corner["componentType"]] if corner.get("normalized") else 1.0)
            self.primitives.append({"attributes": {"POSITION": corners}, "mode": mode} | indices)

    def arrays(self) -> tuple[Array, IntArray]:
        """Vertices (n, 3) and faces (m, 3) of all pieces together."""
        for piece in self.pieces:
            if piece.faces.max() >= len(piece.vertices):
                raise InputError(f"face index {piece.faces.max()} is out of range for {len(piece.vertices)} vertices")
        vertices = [np.asarray(piece.vertices) / n for piece, n in zip(self.pieces, self._divisors, strict=True)]
        return appended(vertices, [np.asarray(piece.faces, dtype=np.int64) for piece in self.pieces])


def _simplify(tree: dict[str, Any], meshes: dict[int, _Mesh]) -> None:
    """Leave nothing in the file but what bodies are made of, and call nodes and meshes by their numbers."""
    for n, node in enumerate(tree["nodes"]):
        node["name"] = str(n)
        node.pop("camera", None)  # trimesh would leave out what is below
    tree["meshes"] = [
        {"name": str(k), "primitives": meshes[k].primitives if k in meshes else []}
        for k in range(len(tree.get("meshes", [])))
    ]
