"""Grooved parts as triangle meshes (`fcl.BVHModel`) against an `fcl.Cylinder`: what CAD-free checkers do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from clamp3d.baselines.fcl_shapes import Shape, bvh, check_poses, distance, facets, measure
from clamp3d.baselines.model import Pieces, pose_of, poses_of
from clamp3d.baselines.polytopes import PerPart, Wires
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array

if TYPE_CHECKING:
    import trimesh


class Mesh:
    """The parts' meshes (mm, watertight) as they are, measured by FCL; any pose.

    The groove is too tight by the mesh's chord error. A mesh is a surface: depth comes from a thinner core of the wire
    and ends where that crosses the surface too; beyond, the number is the deepest triangle's own way out and only its
    sign means something. A wire inside the wall is found by the winding number (see `fcl_shapes.measure`).
    """

    name = "mesh"
    limits = ("surface only", "no depth beyond 0.4 of the wire's radius", "groove too tight by the mesh's chord error")

    def __init__(self, meshes: Mapping[str, trimesh.Trimesh]) -> None:
        self.parts: PerPart[Shape] = PerPart(
            [*meshes], lambda name: bvh(meshes[name].vertices, meshes[name].faces, name)
        )
        self._facets = PerPart([*meshes], lambda name: facets(self.parts[name]))
        self._wires = Wires()

    @property
    def meshes_built(self) -> int:
        """How many parts had to be meshed so far."""
        return self.parts.made

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every flat face of part a's mesh; see `ContactModel`. They do not see a contained wire."""
        T_a_b = pose_of(pair, T_a_b)
        wire = self._wires.of(pair)
        wire.place(check_poses((T_a_b @ pair.T_b_cylinder)[None])[0])
        found = [measure(facet, wire) for facet in self._facets[pair.a]]
        return Pieces(
            np.array([m.distance for m in found]),
            np.array([m.point_a for m in found]),
            np.array([m.normal for m in found]),
            tuple(f"facet {i + 1}" for i in range(len(found))),
        )

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Distances (n,) for poses (n, 4, 4), negative where the wire crosses the surface or lies inside it."""
        T_a_b = poses_of(pair, T_a_b)
        wire, shape = self._wires.of(pair), self.parts[pair.a]
        poses = check_poses(T_a_b @ pair.T_b_cylinder)
        out = np.empty(len(poses))
        for i, pose in enumerate(poses):
            wire.place(pose)
            out[i] = distance(shape, wire)
        return out
