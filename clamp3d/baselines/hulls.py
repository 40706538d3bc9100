"""Grooved parts as the hulls CoACD makes of their meshes, each an `fcl.Convex`: what physics engines do."""

from __future__ import annotations

from collections.abc import Mapping

from clamp3d.baselines.decomposition import Decomposition, DecompositionParameters, decompose
from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.polytopes import PartOrMesh, PerPart, PolytopeModel, Polytopes, part_mesh
from clamp3d.checks import instance


class Hulls(PolytopeModel):
    """CoACD hulls of the parts' meshes, measured by FCL; any pose.

    A hull fills in what it spans, so the groove is too tight by an intrusion, which follows CoACD's
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


def _polytopes(name: str, decomposition: Decomposition) -> Polytopes:
    from trimesh.convex import convex_hull

    shapes = []
    for i, hull in enumerate(decomposition.hulls):
        # CoACD's own triangles can be dented by 1e-6 mm where they are nearly flat; Qhull's are not.
        exact = convex_hull(hull.vertices)
        shapes.append(convex(exact.vertices, exact.faces, f"{name} hull {i + 1}"))
    return Polytopes(shapes, [f"hull {i + 1}" for i in range(len(shapes))])
