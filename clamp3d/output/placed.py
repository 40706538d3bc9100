"""What goes into a file or a picture: each part with its name, shape, pose and colour."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import trimesh

from clamp3d.checks import items, text
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.parts import parts
from clamp3d.engine.scene import Scene, unknown_part
from clamp3d.errors import InputError
from clamp3d.files.bodies import Component, printable
from clamp3d.geometry.manifolds import arrays_of, as_manifold
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import MeshShape, Shape
from clamp3d.output.palette import PART_COLOURS, part_colours


@dataclass(frozen=True, slots=True)
class PosedMesh:
    """A mesh in its own frame, mm, at a pose ``T`` (4, 4) in the world, in a colour "#RRGGBB"."""

    mesh: trimesh.Trimesh
    T: Array
    colour: str
    label: str = ""
    component: Component | None = None

    @property
    def world(self) -> Array:
        """Its vertices (n, 3) in the world, mm."""
        return np.asarray(self.mesh.vertices) @ self.T[:3, :3].T + self.T[:3, 3]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPart:
    """A part, its pose ``T_world_part`` (4, 4) in mm (None: it stays in its own frame) and its ``colour`` "#RRGGBB".

    ``component`` is its place in the product tree of the file that it was read from.
    """

    name: str
    shape: Shape
    T_world_part: Array | None
    colour: str
    component: Component | None = None

    @property
    def label(self) -> str:
        """Name and title as files show it, e.g. ``P1 up splint``; printable."""
        title = getattr(self.shape, "title", "")
        return printable(f"{self.name} {title}" if title and self.shape.name == self.name else self.name)

    @property
    def T(self) -> Array:
        """The pose, the identity where there is none."""
        return np.eye(4) if self.T_world_part is None else self.T_world_part


def posed(parts: Iterable[PlacedPart], mesh_error: float) -> list[PosedMesh]:
    """The triangles of parts; parts of one shape share them.

    Arcs are within ``mesh_error`` mm, the facets of a mesh or of a solid from CAD are as they are. ``metadata`` of a
    mesh holds ``mesh_error`` and ``chord_error``: the largest error allowed and the largest there is, mm.
    """
    meshes: dict[Shape, trimesh.Trimesh] = {}
    for part in (parts := list(parts)):
        if part.shape not in meshes:
            meshes[part.shape] = _triangles(part.shape, mesh_error)
    return [PosedMesh(meshes[part.shape], part.T, part.colour, part.label, part.component) for part in parts]


def overlap(a: PosedMesh, b: PosedMesh) -> trimesh.Trimesh | None:
    """What two parts share, in the world, by manifold3d; None where their facets do not meet."""
    first, second = (as_manifold(item.world, item.mesh.faces) for item in (a, b))
    vertices, faces = arrays_of(first ^ second)
    return trimesh.Trimesh(vertices, faces, process=False) if len(faces) else None


def _triangles(shape: Shape, mesh_error: float) -> trimesh.Trimesh:
    if not isinstance(shape, MeshShape):
        return mesh(shape, mesh_error)
    errors = {"mesh_error": 0.0, "chord_error": shape.error}
    return trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False, metadata=errors)


def place(source: Clamp | Scene, names: Iterable[str] | None = None) -> tuple[PlacedPart, ...]:
    """The parts of a scene at their poses, or those of a clamp in their own frames; all, or those of ``names``.

    Raises InputError for an unknown part or none at all.
    """
    if isinstance(source, Clamp):
        placed = [PlacedPart(name, solid, None, PART_COLOURS[name]) for name, solid in parts(source).items()]
    else:
        colours = part_colours([part.name for part in source.parts])
        placed = [PlacedPart(p.name, p.shape, p.T_world, colours[p.name], p.component) for p in source.parts]
    available = [part.name for part in placed]
    chosen = dict.fromkeys(available if names is None else items("names", names, "part names"))
    for name in chosen:
        if text("each of names", name) not in available:
            raise InputError(unknown_part(name, available))
    if not chosen:
        raise InputError(f"names must name at least one part, available: {', '.join(available) or 'none'}")
    return tuple(part for part in placed if part.name in chosen)
