"""Robot descriptions (URDF) as parts: the shapes of each link where the joints put them. Needs the extra ``urdf``.

Of each link the collision shapes are taken, or the visual ones if it has no others. Links that a joint connects may
touch.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d import checks
from clamp3d.brep.bodies import part_name, unique_names
from clamp3d.brep.formats import FORMATS
from clamp3d.brep.mesh_file import load_mesh
from clamp3d.brep.worker import OUTSIDE, READ_URDF, read_in_process, reading_process
from clamp3d.collide.allowed import Allowed
from clamp3d.collide.scene import Part
from clamp3d.core import shapes
from clamp3d.core.mesh import Mesh, make_mesh
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
    checks.readable_file(path, _MOST_BYTES)
    need("yourdfpy", "URDF")
    names: list[str] = []
    links: list[str] = []
    placed: list[tuple[shapes.AnyShape, Any]] = []
    missing: list[str] = []
    with reading_process():
        robot = read_in_process(READ_URDF, path, {str(name): value for name, value in reader.joints.items()})
        notes = list(robot["notes"])
        files: dict[str, shapes.AnyShape] = {}
        for item in robot["shapes"]:
            try:
                shape = _shape(path, item, reader, files, notes)
            except InputError as error:
                missing.append(f"{item['link']} ({error})")
                continue
            names.append(part_name(item["link"]))
            links.append(item["link"])
            placed.append((shape, item["T"]))
    count = f"{len(placed)} of {len(robot['shapes'])} shapes read; missing: {'; '.join(missing[:4])}"
    if not placed or (missing and not reader.partial):
        raise InputError(f"{checks.short(path)}: " + (count if missing else "no link has a shape"))
    if missing:
        notes.insert(0, count)
    parts = [
        Part(name, shapes.as_shape(shape), T) for name, (shape, T) in zip(unique_names(names), placed, strict=True)
    ]
    return Parts(tuple(parts), tuple(notes), _allowed(robot["joined"], parts, links))


def _shape(
    path: Path, item: dict[str, Any], reader: Reader, files: dict[str, shapes.AnyShape], notes: list[str]
) -> shapes.AnyShape:
    """A link's shape in mm; the same file at the same scale is the same shape."""
    if item["kind"] == "box":
        return shapes.box(item["size"])
    if item["kind"] == "cylinder":
        return shapes.cylinder(item["radius"], item["length"])
    if item["kind"] == "unreadable":
        raise InputError(item["reason"])
    if item["kind"] == "sphere":
        return shapes.MeshShape(Mesh(**item["mesh"]), "off", "sphere", item["error"])
    key = f"{item['file']} {item['scale']}"
    if key not in files:
        file = _mesh_file(path, item["file"])
        mesh = _scaled(file, item["scale"])
        notes += [f"{file.name}: {note}" for note in mesh.notes]
        files[key] = shapes.MeshShape(mesh, reader.fit or "off", file.name, float(reader.chord or 0.0))
    return files[key]


def _scaled(file: Path, scale: list[float]) -> Mesh:
    """The mesh of a file, as ROS reads it: numbers without a unit are metres, and the axes of glTF stay."""
    kind = file.suffix.lower()
    stated = FORMATS[kind].unit if kind in FORMATS else None
    mesh = load_mesh(file, unit=None if stated else "m")
    if kind in (".glb", ".gltf"):
        mesh = make_mesh(mesh.vertices[:, [0, 2, 1]] * (1, 1, -1), mesh.faces, name=file.name)
    if scale == [1.0, 1.0, 1.0]:
        return mesh
    if not np.isfinite(scale).all() or not np.all(scale):
        raise InputError(f"scale of {file.name} must be three finite numbers other than 0, got {scale}")
    faces = mesh.faces if np.prod(scale) > 0 else mesh.faces[:, ::-1]
    return make_mesh(mesh.vertices * scale, faces, name=file.name, float32=True)


def _mesh_file(path: Path, name: str) -> Path:
    """A mesh beside the description or in the folder above, or, of a package, in any folder above it."""
    bare = name.removeprefix("file://")
    if bare.startswith("package://"):
        inside = Path(bare.removeprefix("package://"))
        for folder in path.resolve().parents:
            for choice in (folder / inside, folder / Path(*inside.parts[1:])):
                if choice.is_file() and _within(choice, folder):
                    return choice
        raise InputError(f"{name}: no such file in a folder above {path.name}")
    file = path.parent / bare
    if not _within(file, path.resolve().parent.parent):
        raise InputError(f"{name}: is outside of the robot's folder and the one above; {OUTSIDE}=1 allows that")
    return file


def _within(file: Path, folder: Path) -> bool:
    return os.environ.get(OUTSIDE) == "1" or file.resolve().is_relative_to(folder.resolve())


def _allowed(joined: Iterable[tuple[str, str]], parts: list[Part], links: list[str]) -> tuple[Allowed, ...]:
    """Links that a joint connects may touch; shapes of one link are one body."""
    of: dict[str, list[str]] = {}
    for part, link in zip(parts, links, strict=True):
        of.setdefault(link, []).append(part.name)
    allowed = [Allowed(a, b, _ANY) for own in of.values() for i, a in enumerate(own) for b in own[i + 1 :]]
    for parent, child in joined:
        allowed += [Allowed(a, b) for a in of.get(parent, ()) for b in of.get(child, ())]
    return tuple(allowed)
