"""Triangle formats: bytes of STL, OBJ, PLY, GLB and 3MF, each with the units, axes and names its users expect.

STL, GLB and 3MF store 32-bit coordinates. GLB and 3MF therefore hold every part in its own frame, with its pose as a
transform; STL, OBJ and PLY have no transforms, so the pose is in the coordinates there (OBJ and PLY in 64 bit).
trimesh writes STL and GLB and lib3mf 3MF; trimesh's OBJ (one material for all parts of a colour) and PLY (32 bit, no
comments) would lose names, places and the unit.
"""

from __future__ import annotations

import ctypes
import uuid
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.pose import Array
from clamp3d.errors import InputError, need
from clamp3d.output.palette import rgb
from clamp3d.output.placed import PosedMesh

MILLIMETRES: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of the files that can be chosen, in mm."""

_3MF_UNITS = {"mm": "MilliMeter", "cm": "CentiMeter", "m": "Meter", "in": "Inch"}
_Z_UP_TO_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
_DIGITS = {"mm": 9, "cm": 10, "m": 12, "in": 10}  # decimals in text: 1e-9 mm hides the last bit of sin and cos


def stl(items: Sequence[PosedMesh], title: str, unit: str) -> bytes:
    """Binary STL; the 80 byte header names what it is, its unit and the axis that is up.

    Raises InputError if 32-bit numbers would move a vertex by more than the mesh error (0.1 um at least).
    """
    import trimesh

    allowed = max(1e-4, min(item.mesh.metadata["mesh_error"] for item in items))
    for item in items:
        corners = _corners(item, unit)
        rounding = float(np.abs(corners.astype(np.float32) - corners).max()) * MILLIMETRES[unit]
        if rounding > allowed:
            raise InputError(
                f"stl holds 32-bit numbers: the pose of {item.label} would lose {rounding:.2g} mm, allowed "
                f"{allowed:.2g} mm; bring the parts to the origin, or use glb, 3mf, step, obj or ply"
            )
    vertices, faces = _joined(items, unit)
    rounded = trimesh.Trimesh(vertices.astype(np.float32), faces, process=False)
    header = f"clamp3d {title}; unit {unit}; Z up".encode("ascii", "replace")[:80].ljust(80, b" ")
    return header + bytes(trimesh.exchange.stl.export_stl(rounded))[80:]


def ply(items: Sequence[PosedMesh], title: str, unit: str) -> bytes:
    """Binary PLY with double coordinates, a colour per vertex, and name, unit and axes as comments."""
    points, corners = _joined(items, unit)
    vertices = np.zeros(len(points), dtype=[("position", "<f8", 3), ("colour", "u1", 3)])
    vertices["position"] = points
    vertices["colour"] = np.repeat([rgb(i.colour) for i in items], [len(i.mesh.vertices) for i in items], axis=0)
    faces = np.zeros(len(corners), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, corners
    parts = "".join(f"comment part {item.label}\n" for item in items)
    header = f"""ply
format binary_little_endian 1.0
comment clamp3d {title}
comment unit {unit}, Z up
{parts}element vertex {len(vertices)}
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
element face {len(faces)}
property list uchar int vertex_indices
end_header
"""
    return header.encode("ascii", "replace") + vertices.tobytes() + faces.tobytes()


def _corners(item: PosedMesh, unit: str) -> Array:
    """Vertices (n, 3) in the world in a file's unit, without negative zeros."""
    return item.world / MILLIMETRES[unit] + 0.0


def _joined(items: Sequence[PosedMesh], unit: str) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of all meshes as one."""
    starts = np.cumsum([0, *(len(item.mesh.vertices) for item in items)])
    faces = [item.mesh.faces + start for item, start in zip(items, starts[:-1], strict=True)]
    return np.concatenate([_corners(item, unit) for item in items]), np.concatenate(faces)


def obj(items: Sequence[PosedMesh], title: str, unit: str, mtl_name: str) -> tuple[bytes, bytes]:
    """Wavefront OBJ with one named object per part, and its MTL with the colours."""
    lines = [f"# clamp3d {title}", f"# unit {unit}, Z up", f"mtllib {mtl_name}"]
    materials: list[str] = [f"# clamp3d {title}"]
    offset = 1
    for item in items:
        name = item.label.replace(" ", "_")
        lines.append(f"o {name}")
        lines += [f"v {x} {y} {z}" for x, y, z in (np.round(_corners(item, unit), _DIGITS[unit]) + 0.0).tolist()]
        lines.append(f"usemtl {name}")
        lines += [f"f {a} {b} {c}" for a, b, c in (item.mesh.faces + offset).tolist()]
        offset += len(item.mesh.vertices)
        colour = " ".join(f"{c / 255:.4f}" for c in rgb(item.colour))
        materials += [f"newmtl {name}", f"Kd {colour}", "Ka 0 0 0", "Ks 0.2 0.2 0.2", "Ns 40", "d 1", "illum 2"]
    model, material = ("\n".join([*text, ""]).encode("utf-8") for text in (lines, materials))
    return model, material


def glb(items: Sequence[PosedMesh], title: str, mesh_error: float) -> bytes:
    """Binary glTF 2.0: metres and Y up (the root node turns Z up to it), local coordinates, named nodes, materials."""
    import trimesh

    # trimesh tells nodes apart by their names, its own root among them: keys here, the names are put in at the end.
    names = {"root": title} | {f"part {i}": item.label for i, item in enumerate(items)}
    scene = trimesh.Scene()
    scene.graph.update(frame_to="root", frame_from=scene.graph.base_frame, matrix=_Z_UP_TO_Y_UP)  # type: ignore[no-untyped-call]
    for i, item in enumerate(items):
        T = item.T.copy()
        T[:3, 3] /= MILLIMETRES["m"]
        vertices = np.asarray(item.mesh.vertices) / MILLIMETRES["m"] + 0.0
        scene.add_geometry(
            trimesh.Trimesh(vertices, item.mesh.faces, process=False),
            node_name=f"part {i}",
            geom_name=f"part {i}",
            parent_node_name="root",
            transform=T,
        )

    def finish(tree: dict[str, Any]) -> None:
        tree["asset"] = {"version": "2.0", "generator": "clamp3d", "extras": {"unit": "m", "mesh_error_mm": mesh_error}}
        tree["materials"] = []
        for item, entry in zip(items, tree["meshes"], strict=True):
            colour = [*(round(_linear(c), 6) for c in rgb(item.colour)), 1.0]
            # Little metal: without surroundings to reflect, viewers show bare metal as black.
            surface = {"baseColorFactor": colour, "metallicFactor": 0.1, "roughnessFactor": 0.6}
            tree["materials"].append({"name": item.label, "pbrMetallicRoughness": surface})
            for primitive in entry["primitives"]:
                primitive["material"] = len(tree["materials"]) - 1
        for entry in (*tree["nodes"], *tree["meshes"]):
            entry["name"] = names[entry["name"]]

    data = trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=finish)  # type: ignore[no-untyped-call]
    return bytes(data)


def three_mf(items: Sequence[PosedMesh], title: str, unit: str, mesh_error: float) -> bytes:
    """3MF core: the unit declared, one named and coloured object per part, joined as components of one build item.

    Same input, same bytes: the identifiers that lib3mf draws are replaced by ones of the names. Raises
    MissingLibraryError if lib3mf, which has no wheel for some platforms, is not installed.
    """
    need("lib3mf", "3MF")
    import lib3mf

    def identify(thing: Any, *names: object) -> None:
        thing.SetUUID(str(uuid.uuid5(uuid.NAMESPACE_URL, "/".join(["clamp3d", title, *map(str, names)]))))

    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(getattr(lib3mf.ModelUnit, _3MF_UNITS[unit]))
    described = f"chord error {mesh_error:g} mm at most"
    for key, text in (("Title", title), ("Application", "clamp3d"), ("Description", described)):
        model.GetMetaDataGroup().AddMetaData("", key, text, "xs:string", True)
    materials = model.AddBaseMaterialGroup()
    leaves = []
    for i, item in enumerate(items):
        leaf = model.AddMeshObject()
        leaf.SetName(item.label)
        identify(leaf, "part", i)
        T = item.T.copy()
        T[:3, 3] /= MILLIMETRES[unit]
        # lib3mf writes six digits of a transform: what they leave out goes into the coordinates.
        written = np.vectorize(lambda value: float(f"{value:.6g}"))(T)
        local = np.asarray(item.mesh.vertices) / MILLIMETRES[unit]
        if not np.array_equal(written, T):
            rest = np.linalg.solve(written, T)
            local = local @ rest[:3, :3].T + rest[:3, 3]
        leaf.SetGeometry(
            [lib3mf.Position(tuple(p)) for p in (local + 0.0).tolist()],
            [lib3mf.Triangle(tuple(t)) for t in item.mesh.faces.tolist()],
        )
        leaf.SetObjectLevelProperty(
            materials.GetResourceID(),
            materials.AddMaterial(item.label, wrapper.RGBAToColor(*rgb(item.colour), 255)),
        )
        # 3MF multiplies row vectors: the rotation is written transposed, the translation last.
        rows = [(ctypes.c_float * 3)(*row) for row in written[:3].T.tolist()]
        leaves.append((leaf, lib3mf.Transform((ctypes.c_float * 3 * 4)(*rows))))
    tree = model.AddComponentsObject()
    tree.SetName(title)
    identify(tree, "tree")
    for i, (leaf, transform) in enumerate(leaves):
        identify(tree.AddComponent(leaf, transform), "component", i)
    identify(model.AddBuildItem(tree, wrapper.GetIdentityTransform()), "item")
    model.SetBuildUUID(str(uuid.uuid5(uuid.NAMESPACE_URL, f"clamp3d/{title}")))
    writer = model.QueryWriter("3mf")
    writer.SetDecimalPrecision(9)
    return bytes(writer.WriteToBuffer())


def _linear(channel: int) -> float:
    """SRGB byte to linear light (IEC 61966-2-1), as glTF wants colours."""
    c = channel / 255
    return float(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4)
