"""Triangle formats: bytes of STL, OBJ, PLY, GLB and 3MF, each with the units, axes and names its users expect.

STL and GLB store 32-bit numbers. GLB and 3MF therefore hold every part in its own frame, with its pose as a transform
in full precision; STL, OBJ and PLY have no transforms, so the pose is in the coordinates there (OBJ and PLY in 64 bit).
"""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from clamp3d.core.meshing import mesh
from clamp3d.core.pose import Array
from clamp3d.errors import InputError
from clamp3d.output.placed import PlacedPart

if TYPE_CHECKING:
    import trimesh

MILLIMETRES: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of the files that can be chosen, in mm."""

_3MF_UNITS = {"mm": "millimeter", "cm": "centimeter", "m": "meter", "in": "inch"}
_Z_UP_TO_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
_DIGITS = {"mm": 9, "cm": 10, "m": 12, "in": 10}  # decimals in text: 1e-9 mm hides the last bit of sin and cos


@dataclass(frozen=True, slots=True)
class Placement:
    """One file's meshes: ``vertices`` (n, 3) float64 in the file's unit and axes, as a reader will see them."""

    placed: PlacedPart
    local: trimesh.Trimesh
    vertices: Array

    @property
    def faces(self) -> Array:
        """Vertex indices (m, 3)."""
        return np.asarray(self.local.faces)


def placements(placed: Sequence[PlacedPart], mesh_error: float, unit: str) -> list[Placement]:
    """Mesh each part and put it into the world, in ``unit``."""
    out = []
    for item in placed:
        local = mesh(item.part, mesh_error)
        world = np.asarray(local.vertices) @ item.T[:3, :3].T + item.T[:3, 3]
        out.append(Placement(item, local, world / MILLIMETRES[unit] + 0.0))
    return out


def stl(items: Sequence[Placement], title: str, unit: str) -> bytes:
    """Binary STL; the 80 byte header names what it is, its unit and the axis that is up.

    Raises InputError if 32-bit numbers would move a vertex by more than the mesh error (0.1 um at least).
    """
    allowed = max(1e-4, min(item.local.metadata["mesh_error"] for item in items))
    for item in items:
        rounding = float(np.abs(item.vertices.astype(np.float32) - item.vertices).max()) * MILLIMETRES[unit]
        if rounding > allowed:
            raise InputError(
                f"stl holds 32-bit numbers: the pose of {item.placed.part.name} would lose {rounding:.2g} mm, allowed "
                f"{allowed:.2g} mm; bring the clamp to the origin, or use glb, 3mf, step, obj or ply"
            )
    corners = np.concatenate([item.vertices[item.faces] for item in items]).astype("<f4")
    exact = corners.astype(np.float64)
    normals = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    triangles = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    triangles["corners"] = corners
    header = f"clamp3d {title}; unit {unit}; Z up".encode("ascii", "replace")[:80].ljust(80, b" ")
    return header + struct.pack("<I", len(triangles)) + triangles.tobytes()


def ply(items: Sequence[Placement], title: str, unit: str) -> bytes:
    """Binary PLY with double coordinates, a colour per vertex, and name, unit and axes as comments."""
    count = sum(len(item.vertices) for item in items)
    vertices = np.zeros(count, dtype=[("position", "<f8", 3), ("colour", "u1", 3)])
    faces = np.zeros(sum(len(item.faces) for item in items), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    faces["n"] = 3
    v = f = 0
    for item in items:
        n, m = len(item.vertices), len(item.faces)
        vertices["position"][v : v + n] = item.vertices
        vertices["colour"][v : v + n] = item.placed.colour
        faces["corners"][f : f + m] = item.faces + v
        v, f = v + n, f + m
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            f"comment clamp3d {title}",
            f"comment unit {unit}, Z up",
            *(f"comment part {item.placed.label}" for item in items),
            f"element vertex {count}",
            *(f"property double {axis}" for axis in "xyz"),
            *(f"property uchar {colour}" for colour in ("red", "green", "blue")),
            f"element face {len(faces)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
    )
    return header.encode("ascii", "replace") + vertices.tobytes() + faces.tobytes()


def obj(items: Sequence[Placement], title: str, unit: str, mtl_name: str) -> tuple[bytes, bytes]:
    """Wavefront OBJ with one named object per part, and its MTL with the colours."""
    lines = [f"# clamp3d {title}", f"# unit {unit}, Z up", f"mtllib {mtl_name}"]
    materials: list[str] = [f"# clamp3d {title}"]
    offset = 1
    for item in items:
        name = item.placed.label.replace(" ", "_")
        lines.append(f"o {name}")
        lines += [f"v {x} {y} {z}" for x, y, z in _text(item.vertices, unit)]
        lines.append(f"usemtl {name}")
        lines += [f"f {a} {b} {c}" for a, b, c in (item.faces + offset).tolist()]
        offset += len(item.vertices)
        colour = " ".join(f"{c / 255:.4f}" for c in item.placed.colour)
        materials += [f"newmtl {name}", f"Kd {colour}", "Ka 0 0 0", "Ks 0.2 0.2 0.2", "Ns 40", "d 1", "illum 2"]
    return _join(lines), _join(materials)


def glb(items: Sequence[Placement], title: str, extras: dict[str, Any]) -> bytes:
    """Binary glTF 2.0: metres and Y up (the root node turns Z up to it), local coordinates, named nodes, materials."""
    import trimesh

    scene = trimesh.Scene()
    scene.graph.update(frame_to=title, frame_from=scene.graph.base_frame, matrix=_Z_UP_TO_Y_UP)  # type: ignore[no-untyped-call]
    for item in items:
        T = item.placed.T.copy()
        T[:3, 3] /= MILLIMETRES["m"]
        vertices = np.asarray(item.local.vertices) / MILLIMETRES["m"] + 0.0
        scene.add_geometry(
            trimesh.Trimesh(vertices, item.local.faces, process=False),
            node_name=item.placed.label,
            geom_name=item.placed.label,
            parent_node_name=title,
            transform=T,
        )

    def finish(tree: dict[str, Any]) -> None:
        tree["asset"] = {"version": "2.0", "generator": "clamp3d", "extras": extras}
        tree["materials"] = []
        by_name = {item.placed.label: item for item in items}
        for entry in tree["meshes"]:
            colour = [*(round(_linear(c), 6) for c in by_name[entry["name"]].placed.colour), 1.0]
            # Little metal: without surroundings to reflect, viewers show bare metal as black.
            surface = {"baseColorFactor": colour, "metallicFactor": 0.1, "roughnessFactor": 0.6}
            tree["materials"].append({"name": entry["name"], "pbrMetallicRoughness": surface})
            for primitive in entry["primitives"]:
                primitive["material"] = len(tree["materials"]) - 1

    data = trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=finish)  # type: ignore[no-untyped-call]
    return bytes(data)


def three_mf(items: Sequence[Placement], title: str, unit: str, description: str) -> bytes:
    """3MF core: the unit declared, one named and coloured object per part, joined as components of one build item."""
    scale = 1.0 / MILLIMETRES[unit]
    xml = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<model unit="{_3MF_UNITS[unit]}" xml:lang="en-US" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">',
        f'<metadata name="Title">{_escape(title)}</metadata>',
        '<metadata name="Application">clamp3d</metadata>',
        f'<metadata name="Description">{_escape(description)}</metadata>',
        "<resources>",
        '<basematerials id="1">',
    ]
    for item in items:
        name, colour = quoteattr(item.placed.label), "#{:02X}{:02X}{:02X}".format(*item.placed.colour)
        xml.append(f'<base name={name} displaycolor="{colour}"/>')
    xml.append("</basematerials>")
    components = []
    for i, item in enumerate(items):
        name = quoteattr(item.placed.label)
        xml.append(f'<object id="{i + 2}" type="model" name={name} pid="1" pindex="{i}"><mesh><vertices>')
        local = np.asarray(item.local.vertices) * scale + 0.0
        xml += [f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in _text(local, unit)]
        xml.append("</vertices><triangles>")
        xml += [f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in item.faces.tolist()]
        xml.append("</triangles></mesh></object>")
        # 3MF multiplies row vectors: the rotation is written transposed, the translation last.
        T = item.placed.T.copy()
        T[:3, 3] *= scale
        numbers = " ".join(f"{value:.17g}" for value in (T[:3, :4].T + 0.0).flatten())
        components.append(f'<component objectid="{i + 2}" transform="{numbers}"/>')
    root = len(items) + 2
    xml += [f'<object id="{root}" type="model" name={quoteattr(title)}><components>', *components]
    xml += ["</components></object>", "</resources>", f'<build><item objectid="{root}"/></build>', "</model>"]
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as package:
        for path, content in (
            ("[Content_Types].xml", _CONTENT_TYPES),
            ("_rels/.rels", _RELATIONSHIPS),
            ("3D/3dmodel.model", _join(xml)),
        ):
            entry = zipfile.ZipInfo(path, date_time=(1980, 1, 1, 0, 0, 0))  # a fixed date: same input, same bytes
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            package.writestr(entry, content)
    return archive.getvalue()


_CONTENT_TYPES = b"""<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""

_RELATIONSHIPS = b"""<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/3dmodel.model"/>
</Relationships>
"""


def _text(vertices: Array, unit: str) -> list[list[float]]:
    return (np.round(vertices, _DIGITS[unit]) + 0.0).tolist()  # type: ignore[no-any-return]


def _join(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode("utf-8")


def _escape(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _linear(channel: int) -> float:
    """SRGB byte to linear light (IEC 61966-2-1), as glTF wants colours."""
    c = channel / 255
    return float(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4)
