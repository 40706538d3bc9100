"""Objects of the viewer, by meshcat's own classes: shaded solids, edges, dots, arrows, lines and labels."""

from __future__ import annotations

import io
import math
from functools import lru_cache
from typing import Any

import meshcat.geometry as g
import numpy as np
import trimesh
from numpy.typing import ArrayLike

from clamp3d.geometry.pose import Array
from clamp3d.output.palette import INK
from clamp3d.output.serving import FRONT

_CREASE = math.radians(25.0)
"""Faces that meet at less are shaded as one round surface; sharper edges are drawn as lines."""
_SHADES = 32
"""Colours of a label's picture: its two, and what is between them at their edges."""


class _Packed(g.Geometry):  # type: ignore[misc]
    """A geometry for any number of objects: its data are computed once."""

    def __init__(self, geometry: g.Geometry) -> None:
        self.uuid, self._data = geometry.uuid, geometry.lower({})

    def lower(self, _: object) -> dict[str, Any]:
        data: dict[str, Any] = self._data
        return data


def smooth_faces(mesh: trimesh.Trimesh) -> g.Geometry:
    """The faces of a mesh, round ones smooth; for all parts of one shape."""
    smooth = trimesh.graph.smooth_shade(mesh, angle=_CREASE)
    return _Packed(g.TriangularMeshGeometry(smooth.vertices, smooth.faces))


def sharp_edges(mesh: trimesh.Trimesh) -> g.Geometry:
    """The sharp edges of a mesh as pairs of points; for all parts of one shape."""
    sharp = mesh.face_adjacency_angles > _CREASE
    return _Packed(points(mesh.vertices[mesh.face_adjacency_edges[sharp]].reshape(-1, 3)))


def points(at: ArrayLike) -> g.Geometry:
    """Points (n, 3)."""
    return g.PointsGeometry(np.asarray(at, dtype=np.float32).T)


def solid(faces: g.Geometry, colour: str) -> g.Object:
    """Shaded faces in a colour."""
    return g.Mesh(faces, _phong(colour))


def lines(ends: g.Geometry, colour: str, *, on_top: bool = False) -> g.Object:
    """Straight lines between points two by two."""
    # three.js draws what is transparent after the solids
    return g.LineSegments(ends, g.LineBasicMaterial(color=_number(colour), depthTest=not on_top, transparent=on_top))


def facets(mesh: trimesh.Trimesh, colour: str, *, opacity: float = 1.0, on_top: bool = False) -> g.Object:
    """Flat facets seen from both sides."""
    geometry = g.TriangularMeshGeometry(mesh.vertices, mesh.faces)
    seen = {"depthTest": False, "transparent": True} if on_top else {}
    return g.Mesh(geometry, _phong(colour, flatShading=True, opacity=opacity, depthWrite=opacity == 1.0, **seen))


def box(low: Array, high: Array, colour: str) -> g.Object:
    """The twelve edges of a box from corner to corner, drawn over the solids."""
    return lines(sharp_edges(trimesh.creation.box(bounds=[low, high])), colour, on_top=True)


def dot(radius: float, colour: str) -> g.Object:
    """A ball of ``radius`` mm about the origin, drawn over the solids."""
    return g.Mesh(g.Sphere(radius), _phong(colour, depthTest=False, transparent=True))


def arrow(start: Array, direction: Array, length: float, thickness: float, colour: str, *, on_top: bool) -> g.Object:
    """An arrow of ``length`` mm from ``start`` (3,) along the unit ``direction`` (3,), its shaft so many mm thick."""
    radius = 0.5 * thickness
    head = min(8.5 * radius, 0.8 * length)
    outline = [[0.0, 0.0], [radius, 0.0], [radius, length - head], [3.0 * radius, length - head], [0.0, length]]
    mesh = trimesh.creation.revolve(np.array(outline), sections=24)
    turn: Array = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], direction)  # type: ignore[no-untyped-call]
    mesh.apply_transform(turn)
    mesh.apply_translation(start)
    return facets(mesh, colour, on_top=on_top)


def label(text: str, colour: str, at: ArrayLike, *, size: float = 1.0) -> g.Object:
    """A text on a rounded ground that always faces the viewer and keeps its size on the screen; ``at`` (3,) mm."""

    class Sprite(g.Object):  # type: ignore[misc]
        _type = "Sprite"

        def lower(self) -> dict[str, Any]:
            data: dict[str, Any] = super().lower()
            data["geometries"].clear()
            del data["object"]["geometry"]
            data["object"] |= {"matrix": matrix.T.ravel().tolist(), "renderOrder": FRONT + 1}
            return data

    class SpriteMaterial(g.GenericMaterial):  # type: ignore[misc]
        _type = "SpriteMaterial"

    png, aspect = _text_image(text, colour)
    # Without size attenuation a sprite of scale 1 is as high as the camera is far; 100 undoes the scene's mm.
    height = 100.0 * 0.014 * size
    matrix = np.diag([height * aspect, height, 1.0, 1.0])
    matrix[:3, 3] = at
    picture = g.ImageTexture(g.PngImage(png))
    return Sprite(
        g.Sphere(1.0),  # not sent
        SpriteMaterial(map=picture, transparent=True, depthTest=False, depthWrite=False, sizeAttenuation=False),
    )


@lru_cache(maxsize=256)
def _text_image(text: str, colour: str) -> tuple[bytes, float]:
    """PNG of a text in a rounded box, and its width / height."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(36.0)
    _, top, _, bottom = font.getbbox("Xg" + text)
    height = int(bottom - top) + 20
    width = max(height, int(font.getlength(text)) + 36)
    picture = Image.new("RGBA", (width, height), (0, 0, 0, 0))
    draw = ImageDraw.Draw(picture)
    draw.rounded_rectangle((1, 1, width - 2, height - 2), height // 2 - 2, fill=colour, outline=INK, width=2)
    draw.text((width / 2, height / 2), text, fill=INK, font=font, anchor="mm")
    out = io.BytesIO()
    # A third of the bytes that a picture with all colours has: labels are most of a page of thousands of parts.
    picture.quantize(_SHADES, Image.Quantize.FASTOCTREE).save(out, format="PNG")
    return out.getvalue(), width / height


def _phong(colour: str, **properties: Any) -> g.Material:
    # Seen from both sides (meshcat's default): the inside of cut tubes and of overlays.
    return g.MeshPhongMaterial(color=_number(colour), specular=0x222222, shininess=25, **properties)


def _number(colour: str) -> int:
    return int(colour.lstrip("#"), 16)
