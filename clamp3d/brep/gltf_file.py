"""glTF and GLB files as placed meshes: the nodes of the scene, their names and transforms, every kind of triangle.

A node's mesh is one body, whatever number of materials it is split into. Metres with Y up become mm with Z up.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.bodies import Reading
from clamp3d.brep.placing import Placer
from clamp3d.checks import readable_file, shown
from clamp3d.core.linear import dot, norm
from clamp3d.core.mesh import Array, IntArray
from clamp3d.core.pose import UNIT_TOLERANCE, turn_of
from clamp3d.errors import InputError

_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_TYPES = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3}
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "KHR_mesh_quantization",
    "EXT_texture_",
    "MSFT_",
)
"""Required extensions that change no body, and the one whose numbers are read here."""
_DEEPEST = 500


def read_gltf(path: Path, scale: float = 1000.0) -> Reading:
    """The meshes of a glTF or GLB file; ``scale`` mm in its unit.

    Raises InputError if the file is not glTF, or asks for an extension that is not known here.
    """
    try:
        return _File(path).reading(scale)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, struct.error, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        kind = path.suffix[1:].upper()
        raise InputError(f"{path}: not a readable {kind} file ({type(error).__name__}: {error})") from None


class _File:
    """The JSON of a file and its buffers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        readable_file(path)
        raw = path.read_bytes()
        self.binary = b""
        if raw[:4] == b"glTF":
            version, length, size, kind = struct.unpack_from("<IIII", raw, 4)
            if version != 2 or kind != 0x4E4F534A:
                raise InputError(f"{path}: not a readable GLB file (version {version})")
            if length > len(raw):
                raise InputError(f"{path}: the file is cut off: {len(raw)} of {length} bytes")
            text = raw[20 : 20 + size]
            self.binary = (
                raw[28 + size : 28 + size + struct.unpack_from("<I", raw, 20 + size)[0]] if length > 20 + size else b""
            )
        else:
            text = raw
        self.data: dict[str, Any] = json.loads(text)
        self.buffers: dict[int, bytes] = {}
        asked = [x for x in self.data.get("extensionsRequired", []) if not str(x).startswith(_HARMLESS)]
        if asked:
            raise InputError(
                f"{path}: needs {', '.join(map(str, asked))}, which is not read; export without compression"
            )

    def reading(self, scale: float) -> Reading:
        placer = Placer(scale, _Z_UP)
        meshes = self.data.get("meshes", [])
        for name, mesh, T in self._nodes(placer):
            if not 0 <= mesh < len(meshes):
                placer.missing.append(f"{name} (mesh {mesh} is not in the file)")
                continue
            name = name or meshes[mesh].get("name") or self.path.stem
            kinds = {p.get("mode", 4) for p in meshes[mesh]["primitives"]}
            if kinds <= {0, 1, 2, 3}:
                placer.notes.append(f"{name}: points or lines, left out")
                continue
            placer.place(name, mesh, partial(self._mesh, mesh), T)
        if self.data.get("skins") or any("targets" in p for m in meshes for p in m["primitives"]):
            placer.notes.append("skins and morph targets are left at rest")
        return placer.reading()

    def _nodes(self, placer: Placer) -> Iterator[tuple[str, int, Array]]:
        """Name, mesh and world transform of each node of the scene that has a mesh."""
        nodes = self.data.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        roots = [k for k in range(len(nodes)) if k not in below]
        if self.data.get("scenes"):
            roots = self.data["scenes"][self.data.get("scene", 0)].get("nodes", [])
        todo = [(k, np.eye(4), 0) for k in reversed(roots)]
        visited = set()
        while todo:
            k, above, depth = todo.pop()
            if not 0 <= k < len(nodes):
                placer.missing.append(f"node {k} (not in the file)")
                continue
            if k in visited or depth > _DEEPEST:
                raise InputError(f"{self.path}: node {k} is in the tree twice, or more than {_DEEPEST} levels deep")
            visited.add(k)
            node = nodes[k]
            T = dot(above, _transform(node))
            if "mesh" in node:
                yield node.get("name", ""), node["mesh"], T
            todo += [(child, T, depth + 1) for child in reversed(node.get("children", []))]

    def _mesh(self, mesh: int) -> tuple[Array, IntArray]:
        vertices, faces, start = [], [], 0
        for primitive in self.data["meshes"][mesh]["primitives"]:
            mode = primitive.get("mode", 4)
            if mode < 4:
                continue
            V = self._numbers(primitive["attributes"]["POSITION"]).astype(np.float64)
            every = np.arange(len(V))
            index = self._numbers(primitive["indices"]).ravel().astype(np.int64) if "indices" in primitive else every
            F = _triangles(index, mode)
            if len(F) and F.max() >= len(V):
                raise InputError(f"face index {F.max()} is out of range for {len(V)} vertices")
            vertices.append(V)
            faces.append(F + start)
            start += len(V)
        return np.concatenate(vertices), np.concatenate(faces)

    def _numbers(self, accessor: int) -> NDArray[Any]:
        """The numbers (n, width) of an accessor."""
        found = self.data["accessors"][accessor]
        width, dtype = _WIDTHS[found["type"]], np.dtype(_TYPES[found["componentType"]])
        count = found["count"]
        if "bufferView" in found:
            made = self._view(found["bufferView"], found.get("byteOffset", 0), dtype, count, width)
        else:
            self._within(count * width * dtype.itemsize)
            made = np.zeros((count, width), dtype)
        sparse = found.get("sparse")
        if sparse is not None:
            where, values = sparse["indices"], sparse["values"]
            kind = np.dtype(_TYPES[where["componentType"]])
            rows = self._view(where["bufferView"], where.get("byteOffset", 0), kind, sparse["count"], 1).ravel()
            made[rows] = self._view(values["bufferView"], values.get("byteOffset", 0), dtype, sparse["count"], width)
        if found.get("normalized"):
            return np.asarray(np.maximum(made / np.iinfo(dtype).max, -1.0))
        return made

    def _within(self, size: int) -> None:
        if size > 2**31:
            raise InputError(f"an array of {size / 2**30:.1f} GB, at most 2 GB are read")

    def _view(self, view: int, offset: int, dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        found = self.data["bufferViews"][view]
        start = found.get("byteOffset", 0) + offset
        stride = found.get("byteStride", dtype.itemsize * width)
        self._within(count * stride)
        raw = self._buffer(found["buffer"])
        if offset + (count - 1) * stride + dtype.itemsize * width > found["byteLength"] or min(start, offset) < 0:
            raise InputError(f"{count} numbers reach beyond their part of the file")
        return np.ndarray((count, width), dtype, raw, start, (stride, dtype.itemsize)).copy()

    def _buffer(self, number: int) -> bytes:
        if number not in self.buffers:
            found = self.data["buffers"][number]
            uri = found.get("uri")
            if uri is None:
                content = self.binary
            elif uri.startswith("data:"):
                try:
                    content = base64.b64decode(uri.partition(",")[2], validate=True)
                except binascii.Error:
                    raise InputError("the data of a buffer are not readable") from None
            else:
                file = self.path.parent / unquote(uri)
                readable_file(file)
                content = file.read_bytes()
            if len(content) < found["byteLength"]:
                raise InputError(f"a buffer is cut off: {len(content)} of {found['byteLength']} bytes")
            self.buffers[number] = content
        return self.buffers[number]


def _transform(node: dict[str, Any]) -> Array:
    T = np.eye(4)
    if "matrix" in node:
        T[:] = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        return T
    if "rotation" in node:
        turn = np.array(node["rotation"], dtype=np.float64)
        if turn.shape != (4,) or not abs(norm(turn) - 1.0) <= UNIT_TOLERANCE:
            raise InputError(f"the rotation of a node must be a quaternion of length 1, got {shown(turn)}")
        T[:3, :3] = turn_of(*turn)
    T[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    T[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return T


def _triangles(index: IntArray, mode: int) -> IntArray:
    """Triangles (m, 3) of a list, a strip or a fan of vertices."""
    if mode == 4:
        if len(index) % 3:
            raise InputError(f"{len(index)} corners are no triangles")
        return index.reshape(-1, 3)
    a, b = index[1:-1], index[2:]
    if mode == 6:
        return np.column_stack([np.full(len(a), index[0]), a, b]) if len(a) else np.empty((0, 3), np.int64)
    if mode != 5:
        raise InputError(f"triangles of mode {mode} are not known")
    first = index[:-2]
    odd = (np.arange(len(first)) % 2).astype(bool)[:, None]
    return np.where(odd, np.column_stack([a, first, b]), np.column_stack([first, a, b]))
