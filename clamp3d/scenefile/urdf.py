"""Robot descriptions (URDF) as parts: the shapes of each link where the joints put them. Needs the extra ``urdf``.

Of each link the collision shapes are taken, or the visual ones if it has no others. Links that a joint connects may
touch.
"""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d import checks
from clamp3d.brep.bodies import part_name, unique_names
from clamp3d.brep.mesh_file import FORMATS, load_mesh
from clamp3d.collide.allowed import Allowed
from clamp3d.collide.scene import Part
from clamp3d.core import shapes
from clamp3d.core.linear import dot
from clamp3d.core.mesh import Array, make_mesh
from clamp3d.core.pose import nearest_rigid
from clamp3d.errors import InputError, need
from clamp3d.scenefile.parts import Parts, Reader

_ANY = 1e4
"""Overlap (mm) that is allowed between shapes of one link: they are one body."""
_MOST_BYTES = 2**26


def read_urdf(path: Path, reader: Reader) -> Parts:
    """The links of a robot as parts, named after them, in mm, in the frame of the root link.

    Raises InputError for a file that is no URDF, unknown joints, values out of their limits and meshes that cannot be
    read, and MissingLibraryError without yourdfpy.
    """
    robot = _robot(path)
    values = _joint_values(path, robot, reader)
    robot.update_cfg(values)
    names: list[str] = []
    made: list[tuple[shapes.AnyShape, Array, str]] = []
    notes: list[str] = []
    missing: list[str] = []
    files: dict[tuple[str, bytes], shapes.AnyShape] = {}
    for link in robot.robot.links:
        own = link.collisions or link.visuals
        T_link = robot.get_transform(link.name)
        for item in own:
            T = dot(T_link, np.eye(4) if item.origin is None else item.origin)
            try:
                shape = _shape(path, item.geometry, reader, files, notes)
            except InputError as error:
                missing.append(f"{link.name} ({error})")
                continue
            names.append(part_name(link.name))
            made.append((shape, _in_mm(T), link.name))
    count = f"{len(made)} of {len(made) + len(missing)} shapes read; missing: {'; '.join(missing[:4])}"
    if not made or (missing and not reader.partial):
        raise InputError(f"{checks.short(path)}: " + (count if missing else "no link has a shape"))
    if missing:
        notes.insert(0, count)
    if not all(link.collisions for link in robot.robot.links if link.visuals):
        notes.append("links without collision shapes are taken by their visual ones")
    parts = [
        Part(name, shapes.as_shape(shape), T) for name, (shape, T, _) in zip(unique_names(names), made, strict=True)
    ]
    return Parts(tuple(parts), tuple(notes), _allowed(robot, parts, [link for _, _, link in made]))


def _robot(path: Path) -> Any:
    checks.readable_file(path, _MOST_BYTES)
    need("yourdfpy", "URDF")
    import yourdfpy

    # What it logs about a file goes to who has asked for logs, not on stderr.
    logger = logging.getLogger("yourdfpy")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    try:
        return yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True, load_collision_meshes=False)
    except Exception as error:  # it raises whatever lxml and its own parser meet
        raise InputError(f"{path}: not a readable URDF file ({' '.join(str(error).split())})") from None


def _joint_values(path: Path, robot: Any, reader: Reader) -> dict[str, float]:
    """Value of each actuated joint: as given, else 0 or the nearest limit; m for those that slide."""
    joints = {name: robot.joint_map[name] for name in robot.actuated_joint_names}
    for name in reader.joints:
        if name not in joints:
            listed = ", ".join(list(joints)[:12]) or "none"
            raise InputError(f"{path}: unknown joint {checks.shown(name)}; available: {listed}")
    found = {}
    for name, joint in joints.items():
        slides = joint.type == "prismatic"
        low, high = -math.inf, math.inf
        if joint.type != "continuous" and joint.limit is not None:
            low = -math.inf if joint.limit.lower is None else joint.limit.lower
            high = math.inf if joint.limit.upper is None else joint.limit.upper
        value = min(max(0.0, low), high)
        if name in reader.joints:
            value = checks.number(f"joint {name}", reader.joints[name]) / (1000.0 if slides else 1.0)
            if not low - 1e-9 <= value <= high + 1e-9:
                factor, unit = (1000.0, "mm") if slides else (1.0, "rad")
                raise InputError(
                    f"joint {name} must be from {low * factor:g} to {high * factor:g} {unit}, got {value * factor:g}"
                )
        found[name] = value
    return found


def _shape(
    path: Path, geometry: Any, reader: Reader, files: dict[tuple[str, bytes], shapes.AnyShape], notes: list[str]
) -> shapes.AnyShape:
    """A link's shape in mm; the same file at the same scale is the same shape."""
    if geometry.box is not None:
        return shapes.box([1000.0 * float(x) for x in geometry.box.size])
    if geometry.cylinder is not None:
        return shapes.cylinder(1000.0 * geometry.cylinder.radius, 1000.0 * geometry.cylinder.length)
    if geometry.sphere is not None:
        return _ball(1000.0 * geometry.sphere.radius)
    if geometry.mesh is None:
        raise InputError("a shape of no known kind")
    scale = np.broadcast_to(np.asarray(1.0 if geometry.mesh.scale is None else geometry.mesh.scale, dtype=float), (3,))
    key = (geometry.mesh.filename, scale.tobytes())
    if key not in files:
        file = _mesh_file(path, geometry.mesh.filename)
        kind = file.suffix.lower()
        # ROS reads the numbers of any mesh as metres; glTF says so itself, 3MF and STEP have a unit.
        mesh = load_mesh(file, unit="m" if FORMATS.get(kind) is None else None)
        if kind in (".glb", ".gltf"):  # URDF takes its axes as they are, and not Y as up
            mesh = make_mesh(mesh.vertices[:, [0, 2, 1]] * (1, 1, -1), mesh.faces, name=file.name)
        if not np.array_equal(scale, np.ones(3)):
            faces = mesh.faces if scale.prod() > 0 else mesh.faces[:, ::-1]
            mesh = make_mesh(mesh.vertices * scale, faces, name=file.name, float32=True)
        notes += [f"{file.name}: {note}" for note in mesh.notes]
        files[key] = shapes.MeshShape(mesh, reader.fit or "off", file.name, float(reader.chord or 0.0))
    return files[key]


def _mesh_file(path: Path, name: str) -> Path:
    """A mesh beside the description, or, of a package, in a folder above it."""
    bare = name.removeprefix("file://")
    if not bare.startswith("package://"):
        return path.parent / bare
    inside = Path(bare.removeprefix("package://"))
    for folder in path.resolve().parents:
        for choice in (folder / inside, folder / Path(*inside.parts[1:])):
            if choice.is_file():
                return choice
    raise InputError(f"{name}: no such file in a folder above {path.name}")


def _ball(radius: float) -> shapes.MeshShape:
    """A sphere as facets, and how far they are from it."""
    import trimesh

    made = trimesh.creation.icosphere(4, radius)
    corners = np.asarray(made.triangles)
    least = float(np.abs(np.einsum("ij,ij->i", corners[:, 0], made.face_normals)).min())
    mesh = make_mesh(made.vertices, made.faces, name="sphere")
    return shapes.MeshShape(mesh, "off", "sphere", radius - least)


def _in_mm(T: Array) -> Array:
    pose = nearest_rigid(np.asarray(T, dtype=np.float64))
    pose[:3, 3] *= 1000.0
    return pose


def _allowed(robot: Any, parts: list[Part], links: list[str]) -> tuple[Allowed, ...]:
    """Links that a joint connects may touch; shapes of one link are one body."""
    of: dict[str, list[str]] = {}
    for part, link in zip(parts, links, strict=True):
        of.setdefault(link, []).append(part.name)
    found = [Allowed(a, b, _ANY) for own in of.values() for i, a in enumerate(own) for b in own[i + 1 :]]
    for joint in robot.robot.joints:
        found += [Allowed(a, b) for a in of.get(joint.parent, ()) for b in of.get(joint.child, ())]
    return tuple(found)
