"""Triangle formats: bytes of STL, OBJ, PLY, GLB (by trimesh) and 3MF (by lib3mf), with unit, axes and names.

All but OBJ store 32-bit coordinates. GLB and 3MF therefore hold every part in its own frame, with its pose as a
transform; STL, OBJ and PLY have no transforms, so the pose is in the coordinates there.
"""

from __future__ import annotations

import ctypes
import re
import uuid
from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh

from clamp3d.errors import InputError, need
from clamp3d.files.bodies import Component
from clamp3d.files.formats import UNITS_MM
from clamp3d.geometry.pose import Array, inverse
from clamp3d.output.palette import rgb
from clamp3d.output.placed import PosedMesh

_3MF_UNITS = {"mm": "MilliMeter", "cm": "CentiMeter", "m": "Meter", "in": "Inch"}
_Z_UP_TO_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
_DIGITS = {"mm": 9, "cm": 10, "m": 12, "in": 10}  # decimals in text: 1e-9 mm hides the last bit of sin and cos


def stl(items: Sequence[PosedMesh], title: str, unit: str, _: float) -> bytes:
    """Binary STL; the 80 byte header names what it is, its unit and the axis that is up.

    Raises InputError if 32-bit numbers would move a vertex by more than the mesh error (0.1 um at least).
    """
    header = f"clamp3d {title}; unit {unit}; Z up".encode("ascii", "replace")[:80].ljust(80, b" ")
    mesh = _joined("stl", items, unit)
    mesh.vertices = mesh.vertices.astype(np.float32)  # the normals in the file are those of its own corners
    return header + bytes(trimesh.exchange.stl.export_stl(mesh))[80:]


def ply(items: Sequence[PosedMesh], title: str, unit: str, _: float) -> bytes:
    """Binary PLY with a colour per vertex, and name, unit and axes as comments.

    Raises InputError if 32-bit numbers would move a vertex by more than the mesh error (0.1 um at least).
    """
    lines = [f"comment clamp3d {title}", f"comment unit {unit}, Z up", *(f"comment part {i.label}" for i in items)]
    comments = "".join(f"{line}\n" for line in lines).encode("ascii", "replace")
    content = bytes(trimesh.exchange.ply.export_ply(_joined("ply", items, unit), vertex_normal=False))
    start, vertices, rest = content.partition(b"element vertex")
    return start + comments + vertices + rest


def obj(items: Sequence[PosedMesh], title: str, unit: str, mtl_name: str) -> tuple[bytes, bytes]:
    """Wavefront OBJ with one named object per part, and its MTL with the colours."""
    scene = trimesh.Scene()
    for item in items:
        name = re.sub(r" |\\$", "_", item.label)  # a backslash would join the next line
        while name in scene.geometry:  # of two with one name trimesh keeps one
            name += "_"
        visual: Any = trimesh.visual
        material = visual.material.SimpleMaterial(name=name, diffuse=rgb(item.colour))
        mesh = _mesh(item, unit)
        mesh.visual = visual.TextureVisuals(material=material)
        scene.add_geometry(mesh, geom_name=name, node_name=name)
    text, materials = trimesh.exchange.obj.export_obj(  # type: ignore[no-untyped-call]
        scene,
        include_normals=False,
        return_texture=True,
        digits=_DIGITS[unit],
        mtl_name=mtl_name,
        header=f"clamp3d {title}\n# unit {unit}, Z up",
    )
    return text.encode("utf-8"), materials[mtl_name]


def glb(items: Sequence[PosedMesh], title: str, unit: str, mesh_error: float) -> bytes:
    """Binary glTF 2.0: metres and Y up (the root node turns Z up to it), local coordinates, named nodes, materials.

    Parts from a file stand in its tree of assemblies. Parts of one shape and colour share a mesh.
    """
    # trimesh identifies nodes by their names, its own root among them: unique keys here, the names at the end.
    names = {"root": title}
    scene = trimesh.Scene()
    scene.graph.update(frame_to="root", frame_from=scene.graph.base_frame, matrix=_Z_UP_TO_Y_UP)  # type: ignore[no-untyped-call]
    nodes: dict[Component | None, tuple[str, Array]] = {None: ("root", np.eye(4))}
    shown: list[PosedMesh] = []  # the first item of each mesh
    meshes: dict[tuple[int, str], str] = {}

    def add(name: str, T: Array, assembly: Component | None, geometry: str | None = None) -> str:
        if assembly not in nodes:
            assert assembly is not None
            nodes[assembly] = add(assembly.instance, assembly.T, assembly.assembly), assembly.T
        parent, T_parent = nodes[assembly]
        T = inverse(T_parent) @ T
        T[:3, 3] /= UNITS_MM[unit]
        names[key := f"node {len(names)}"] = name
        scene.graph.update(frame_to=key, frame_from=parent, matrix=T, geometry=geometry)  # type: ignore[no-untyped-call]
        return key

    for item in items:
        geometry = meshes.setdefault((id(item.mesh), item.colour), f"mesh {len(meshes)}")
        if geometry not in scene.geometry:
            local = trimesh.Trimesh(item.mesh.vertices / UNITS_MM[unit] + 0.0, item.mesh.faces, process=False)
            scene.geometry[geometry] = local
            shown.append(item)
        add(item.label, item.T, item.component.assembly if item.component else None, geometry)

    def finish(tree: dict[str, Any]) -> None:
        tree["asset"] = {
            "version": "2.0",
            "generator": "clamp3d",
            "extras": {"unit": unit, "mesh_error_mm": mesh_error},
        }
        tree["materials"] = [_material(item) for item in shown]
        for i, (entry, item) in enumerate(zip(tree["meshes"], shown, strict=True)):
            entry["name"] = item.component.name if item.component else item.label
            for primitive in entry["primitives"]:
                primitive["material"] = i
        for entry in tree["nodes"]:
            entry["name"] = names[entry["name"]]

    return bytes(trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=finish))  # type: ignore[no-untyped-call]


def _material(item: PosedMesh) -> dict[str, Any]:
    """A part's glTF material; little metal: without surroundings to reflect, viewers show bare metal as black."""
    srgb = np.array(rgb(item.colour)) / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    surface = {"baseColorFactor": [*linear.round(6).tolist(), 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.6}
    return {"name": item.label, "pbrMetallicRoughness": surface}


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
    tree = model.AddComponentsObject()
    tree.SetName(title)
    identify(tree, "tree")
    for i, item in enumerate(items):
        local, pose = _in_six_digits(item, unit)
        leaf = model.AddMeshObject()
        leaf.SetName(item.label)
        identify(leaf, "part", i)
        leaf.SetGeometry(
            [lib3mf.Position(tuple(p)) for p in local.tolist()],
            [lib3mf.Triangle(tuple(t)) for t in item.mesh.faces.tolist()],
        )
        colour = materials.AddMaterial(item.label, wrapper.RGBAToColor(*rgb(item.colour), 255))
        leaf.SetObjectLevelProperty(materials.GetResourceID(), colour)
        # 3MF multiplies row vectors: the rotation is written transposed, the translation last.
        rows = [(ctypes.c_float * 3)(*row) for row in pose[:3].T.tolist()]
        identify(tree.AddComponent(leaf, lib3mf.Transform((ctypes.c_float * 3 * 4)(*rows))), "component", i)
    identify(model.AddBuildItem(tree, wrapper.GetIdentityTransform()), "item")
    model.SetBuildUUID(str(uuid.uuid5(uuid.NAMESPACE_URL, f"clamp3d/{title}")))
    writer = model.QueryWriter("3mf")
    writer.SetDecimalPrecision(9)
    return bytes(writer.WriteToBuffer())


def _in_six_digits(item: PosedMesh, unit: str) -> tuple[Array, Array]:
    """Vertices (n, 3) and pose (4, 4) in a unit: lib3mf writes six digits of a pose, the rest is put
    into the vertices."""
    T = item.T.copy()
    T[:3, 3] /= UNITS_MM[unit]
    written = np.vectorize(lambda value: float(f"{value:.6g}"))(T)
    local = np.asarray(item.mesh.vertices) / UNITS_MM[unit]
    if not np.array_equal(written, T):
        rest = np.linalg.solve(written, T)
        local = local @ rest[:3, :3].T + rest[:3, 3]
    return local + 0.0, written


def _mesh(item: PosedMesh, unit: str) -> trimesh.Trimesh:
    """A part's mesh in the world in a file's unit, without negative zeros, in its colour."""
    vertices = item.world / UNITS_MM[unit] + 0.0
    colours = np.tile(np.array([*rgb(item.colour), 255], dtype=np.uint8), (len(vertices), 1))
    return trimesh.Trimesh(vertices, item.mesh.faces, vertex_colors=colours, process=False)


def _joined(format: str, items: Sequence[PosedMesh], unit: str) -> trimesh.Trimesh:
    """All meshes as one, for a format of 32-bit numbers.

    Raises InputError if these would move a vertex by more than the mesh error (0.1 um at least).
    """
    allowed = max(1e-4, min(item.mesh.metadata["mesh_error"] for item in items))
    for item in items:
        corners = item.world / UNITS_MM[unit]
        rounding = float(np.abs(corners.astype(np.float32) - corners).max()) * UNITS_MM[unit]
        if rounding > allowed:
            raise InputError(
                f"{format} holds 32-bit numbers: the pose of {item.label} would lose {rounding:.2g} mm, allowed "
                f"{allowed:.2g} mm; bring the parts to the origin, or use glb, 3mf, step or obj"
            )
    return trimesh.util.concatenate([_mesh(item, unit) for item in items])  # type: ignore[return-value]
