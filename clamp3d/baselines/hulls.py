"""Grooved parts as the hulls CoACD makes of their meshes, each an `fcl.Convex`: what physics engines do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clamp3d.baselines.decomposition import Decomposition, DecompositionParameters, decompose
from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.polytopes import PartOrMesh, PerPart, PolytopeModel, Polytopes, part_mesh
from clamp3d.checks import instance
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.linear import to_target
from clamp3d.core.pose import inverse


class Hulls(PolytopeModel):
    """CoACD hulls of the parts' meshes, measured by FCL; any pose.

    A hull fills in what it spans, so the groove is too tight by the intrusion (`intrusion`), which follows CoACD's
    threshold loosely and can exceed it. Hulls may also leave the part's own corners out (`Decomposition.uncovered`).
    ``decompositions[part]`` is made (or read from the cache) when a part is first measured.

    Parameters
    ----------
    parts : mapping of str to Solid or mesh
        Grooved parts by name, mm. A solid is meshed when it is first measured; a mesh must be closed.
    parameters : DecompositionParameters, optional
        CoACD's settings.
    mesh_error : float
        Chord error in mm of the meshes made of solids.
    time_limit, progress, cache
        See `decompose`.
    """

    name = "hulls"
    limits = (
        "groove filled in by the hulls",
        "corners of the part may stick out of the hulls",
        "depth of single hulls",
    )

    def __init__(
        self,
        parts: Mapping[str, PartOrMesh],
        parameters: DecompositionParameters | None = None,
        *,
        mesh_error: float = 0.05,
        time_limit: float = 300.0,
        progress: bool | None = None,
        cache: bool = True,
    ) -> None:
        instance("parts", parts, Mapping)
        self.parameters = parameters or DecompositionParameters()

        def decomposed(name: str) -> Decomposition:
            mesh = part_mesh(parts[name], mesh_error)
            settings = {"name": name, "time_limit": time_limit, "progress": progress, "cache": cache}
            return decompose(mesh.vertices, mesh.faces, self.parameters, **settings)  # type: ignore[arg-type]

        self.decompositions: PerPart[Decomposition] = PerPart([*parts], decomposed)
        super().__init__(PerPart([*parts], lambda name: _polytopes(name, self.decompositions[name])))

    @property
    def meshes_built(self) -> int:
        """How many parts had to be meshed so far."""
        return len(self.decompositions)


def intrusion(decomposition: Decomposition, pair: GroovePair) -> float:
    """How far in mm the hulls reach into the groove: its radius less that of the thickest coaxial wire that is free.

    Exact for the hulls: the distance of the groove's axis, without end, from each hull's outline seen along it.
    """
    from scipy.spatial import ConvexHull

    T = inverse(pair.T_a_groove)
    free = np.inf
    for hull in decomposition.hulls:
        seen = to_target(T, hull.vertices)[:, :2]
        outline = seen[ConvexHull(seen).vertices]
        along = np.roll(outline, -1, axis=0) - outline
        t = np.clip(-(outline * along).sum(1) / (along**2).sum(1), 0.0, 1.0)
        nearest = float(np.linalg.norm(outline + t[:, None] * along, axis=1).min())
        inside = bool((along[:, 0] * outline[:, 1] - along[:, 1] * outline[:, 0] <= 0.0).all())
        free = min(free, 0.0 if inside else nearest)
    return pair.groove.radius - free


def _polytopes(name: str, decomposition: Decomposition) -> Polytopes:
    from trimesh.convex import convex_hull

    shapes = []
    for i, hull in enumerate(decomposition.hulls):
        # CoACD's own triangles can be dented by 1e-6 mm where they are nearly flat; Qhull's are not.
        exact = convex_hull(hull.vertices)
        shapes.append(convex(exact.vertices, exact.faces, f"{name} hull {i + 1}"))
    return Polytopes(shapes, [f"hull {i + 1}" for i in range(len(shapes))])
