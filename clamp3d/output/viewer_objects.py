"""Objects for the meshcat viewer as three.js JSON: shaded solids, edges, dots, arrows, lines and labels.

The viewer takes three.js' own object format, packed as msgpack with typed arrays; each function here returns one such
object. Everything is given as vertices, so no shape depends on three.js' habit of laying cylinders along y.
"""

from __future__ import annotations

import base64
import io
import math
import uuid
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.core.pose import Array
from clamp3d.output.palette import INK

if TYPE_CHECKING:
    import trimesh

Object = dict[str, Any]

_CREASE = math.radians(25.0)
"""Faces that meet at less are shaded as one round surface; sharper edges are drawn as lines."""
_FLOAT32, _UINT32 = 0x17, 0x16  # msgpack extension types of the viewer's typed arrays
_FRONT = 10  # render order of lines that are drawn over the solids; labels come after them


def solid(mesh: trimesh.Trimesh, colour: str, *, opacity: float = 1.0) -> Object:
    """A mesh with smooth round faces and sharp edges, in mm of its part's frame."""
    import trimesh

    smooth = trimesh.graph.smooth_shade(mesh, angle=_CREASE)
    geometry = _geometry(position=smooth.vertices, normal=smooth.vertex_normals, index=smooth.faces)
    return _object("Mesh", geometry, _phong(colour, opacity))


def edges(mesh: trimesh.Trimesh, colour: str) -> Object:
    """The sharp edges of a mesh as lines."""
    sharp = mesh.face_adjacency_angles > _CREASE
    return segments(mesh.vertices[mesh.face_adjacency_edges[sharp]].reshape(-1, 3), colour)


def facets(vertices: ArrayLike, faces: ArrayLike, colour: str, *, opacity: float = 1.0, lit: bool = True) -> Object:
    """Flat facets seen from both sides; ``vertices`` (n, 3) mm, ``faces`` (m, 3). Without light the colour is as is."""
    corners = np.asarray(vertices, dtype=np.float64)[np.asarray(faces, dtype=np.int64)].reshape(-1, 3)
    triangles = corners.reshape(-1, 3, 3)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.repeat(normal / np.where(length > 0.0, length, 1.0), 3, axis=0)
    material = _phong(colour, opacity) if lit else {"type": "MeshBasicMaterial", "color": _number(colour), "side": 2}
    return _object("Mesh", _geometry(position=corners, normal=normal), material)


def segments(points: ArrayLike, colour: str, *, on_top: bool = False) -> Object:
    """Straight lines between the points (2 n, 3) two by two."""
    material: Object = {"type": "LineBasicMaterial", "color": _number(colour), "depthTest": not on_top}
    if on_top:
        material["transparent"] = True  # three.js draws what is transparent after the solids
    return _object("LineSegments", _geometry(position=points), material, order=_FRONT if on_top else 0)


def dot(radius: float, colour: str) -> Object:
    """A ball of ``radius`` mm about the origin."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    geometry = _geometry(position=ball.vertices, normal=ball.vertices / radius, index=ball.faces)
    return _object("Mesh", geometry, _phong(colour, 1.0))


def arrow(start: Array, direction: Array, length: float, colour: str) -> Object:
    """An arrow of ``length`` mm from ``start`` (3,) along the unit ``direction`` (3,)."""
    import trimesh

    head, radius = 0.3 * length, 0.035 * length
    shaft = trimesh.creation.cylinder(radius, segment=[[0.0, 0.0, 0.0], [0.0, 0.0, length - head]], sections=16)
    tip = trimesh.creation.cone(3.0 * radius, head, sections=24)
    tip.apply_translation([0.0, 0.0, length - head])
    both = joined([shaft, tip])
    return facets(both.vertices @ _upright(direction).T + start, both.faces, colour)


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Several meshes as one, their vertices apart."""
    import trimesh

    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = np.vstack([m.faces + k for m, k in zip(meshes, first[:-1], strict=True)])
    return trimesh.Trimesh(np.vstack([m.vertices for m in meshes]), faces, process=False)


def label(text: str, colour: str, at: ArrayLike, *, size: float = 1.0, ink: str = INK) -> Object:
    """A text on a rounded ground that always faces the viewer and keeps its size on the screen; ``at`` (3,) mm."""
    png, aspect = _text_image(text, colour, ink)
    image, texture = _name(), _name()
    material: Object = {
        "type": "SpriteMaterial",
        "map": texture,
        "transparent": True,
        "depthTest": False,
        "depthWrite": False,
        "sizeAttenuation": False,
    }
    # Without size attenuation a sprite of scale 1 is as high as the camera is far; 100 undoes the scene's mm.
    height = 100.0 * 0.014 * size
    matrix = np.diag([height * aspect, height, 1.0, 1.0])
    matrix[:3, 3] = at
    out = _object("Sprite", None, material, order=_FRONT + 1)
    out["object"]["matrix"] = matrix.T.ravel().tolist()
    out["images"] = [{"uuid": image, "url": "data:image/png;base64," + base64.b64encode(png).decode("ascii")}]
    out["textures"] = [{"uuid": texture, "image": image, "wrap": [1001, 1001], "repeat": [1, 1]}]
    return out


def _upright(direction: Array) -> Array:
    """A rotation (3, 3) that takes Z to the unit ``direction``."""
    side = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(side, direction)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(direction, x), direction])


@lru_cache(maxsize=256)
def _text_image(text: str, colour: str, ink: str) -> tuple[bytes, float]:
    """PNG of a text in a rounded box, and its width / height."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(36.0)
    _, top, _, bottom = font.getbbox("Xg" + text)
    height = int(bottom - top) + 20
    width = max(height, int(font.getlength(text)) + 36)
    picture = Image.new("RGBA", (width, height), (0, 0, 0, 0))
    draw = ImageDraw.Draw(picture)
    draw.rounded_rectangle((1, 1, width - 2, height - 2), height // 2 - 2, fill=colour, outline=INK, width=2)
    draw.text((width / 2, height / 2), text, fill=ink, font=font, anchor="mm")
    out = io.BytesIO()
    picture.save(out, format="PNG", optimize=True)
    return out.getvalue(), width / height


def _geometry(**arrays: ArrayLike) -> Object:
    data: dict[str, Any] = {"attributes": {}}
    for name, values in arrays.items():
        if name == "index":
            data["index"] = _typed(np.asarray(values, dtype=np.uint32), "Uint32Array", _UINT32)
        else:
            data["attributes"][name] = _typed(np.asarray(values, dtype=np.float32), "Float32Array", _FLOAT32)
    return {"uuid": _name(), "type": "BufferGeometry", "data": data}


def _typed(values: NDArray[Any], kind: str, code: int) -> dict[str, Any]:
    """Rows (n, 3) as a typed array of the viewer."""
    import umsgpack

    flat = np.ascontiguousarray(values).tobytes()
    return {"itemSize": values.shape[1], "type": kind, "array": umsgpack.Ext(code, flat), "normalized": False}


def _phong(colour: str, opacity: float) -> Object:
    return {
        "type": "MeshPhongMaterial",
        "color": _number(colour),
        "specular": 0x222222,
        "shininess": 25,
        "side": 2,  # both sides: inside of cut wires and overlays
        "transparent": opacity < 1.0,
        "opacity": opacity,
        "depthWrite": opacity == 1.0,
    }


def _object(kind: str, geometry: Object | None, material: Object, *, order: int = 0) -> Object:
    material["uuid"] = _name()
    body: Object = {"uuid": _name(), "type": kind, "material": material["uuid"]}
    if geometry is not None:
        body["geometry"] = geometry["uuid"]
    if order:
        body["renderOrder"] = order
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [] if geometry is None else [geometry],
        "materials": [material],
        "object": body,
    }


def _number(colour: str) -> int:
    return int(colour.lstrip("#"), 16)


def _name() -> str:
    return str(uuid.uuid4())
