"""Grooved parts as their triangle meshes in FCL."""

from __future__ import annotations

from collections.abc import Mapping

from clamp3d.baselines.fcl_shapes import bvh, facets
from clamp3d.baselines.polytopes import PartOrMesh, PerPart, PolytopeModel, Polytopes, part_mesh
from clamp3d.checks import instance


class Meshes(PolytopeModel):
    """The parts' meshes as they are, measured by FCL; any pose.

    The groove is too tight by the mesh's chord error. A mesh is a surface: depth comes from a thinner core of the wire
    and ends where that crosses the surface too; beyond, the number is the deepest triangle's own way out and only its
    sign means something. A wire inside the wall is found by the winding number (see `fcl_shapes.measure`), but not by
    ``pieces``, the gaps to every flat face.

    Parameters
    ----------
    parts : mapping of str to Solid or mesh
        Grooved parts by name, mm. A solid is meshed when it is first measured; a mesh must be closed.
    mesh_error : float
        Chord error in mm of the meshes made of solids.
    """

    name = "mesh"
    limits = ("surface only", "no depth beyond 0.4 of the wire's radius", "groove too tight by the mesh's chord error")

    def __init__(self, parts: Mapping[str, PartOrMesh], mesh_error: float = 0.05) -> None:
        instance("parts", parts, Mapping)

        def surface(name: str) -> Polytopes:
            mesh = part_mesh(parts[name], mesh_error)
            return Polytopes([bvh(mesh.vertices, mesh.faces, name)], ["surface"])

        def faces(name: str) -> Polytopes:
            shapes = facets(self.parts[name].shapes[0])
            return Polytopes(shapes, [f"facet {i + 1}" for i in range(len(shapes))])

        super().__init__(PerPart([*parts], surface), PerPart([*parts], faces))

    @property
    def meshes_built(self) -> int:
        """How many parts had to be meshed so far."""
        return len(self.parts)
