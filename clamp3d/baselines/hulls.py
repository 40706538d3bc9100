"""Grooved parts as the hulls CoACD makes of their meshes, each an `fcl.Convex`: what physics engines do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from clamp3d.baselines.decomposition import Decomposition, DecompositionParameters, decompose
from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.model import Pieces, pose_of, poses_of
from clamp3d.baselines.polytopes import PerPart, Polytopes, Wires
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array, inverse

if TYPE_CHECKING:
    import trimesh


class Hulls:
    """CoACD hulls of the parts' meshes (mm, watertight), measured by FCL; any pose.

    A hull fills in what it spans, so the groove is too tight by the intrusion (`intrusion`), which follows CoACD's
    threshold loosely and can exceed it. Hulls may also leave the part's own corners out (`Decomposition.uncovered`).
    ``decompositions[part]`` is made (or read from the cache) when a part is first measured.
    """

    name = "hulls"
    limits = (
        "groove filled in by the hulls",
        "corners of the part may stick out of the hulls",
        "depth of single hulls",
    )

    def __init__(
        self,
        meshes: Mapping[str, trimesh.Trimesh],
        parameters: DecompositionParameters | None = None,
        *,
        time_limit: float = 300.0,
        progress: bool | None = None,
        cache: bool = True,
    ) -> None:
        self.parameters = parameters or DecompositionParameters()

        def decomposed(name: str) -> Decomposition:
            m = meshes[name]
            return decompose(
                m.vertices, m.faces, self.parameters, name=name, time_limit=time_limit, progress=progress, cache=cache
            )

        self.decompositions: PerPart[Decomposition] = PerPart([*meshes], decomposed)
        self.parts = PerPart([*meshes], lambda name: _polytopes(name, self.decompositions[name]))
        self._wires = Wires()

    @property
    def meshes_built(self) -> int:
        """How many parts had to be meshed so far."""
        return self.decompositions.made

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every hull of part a; see `ContactModel`."""
        T_a_b = pose_of(pair, T_a_b)
        return self.parts[pair.a].pieces(self._wires.of(pair), T_a_b @ pair.T_b_cylinder)

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) for poses (n, 4, 4); see `ContactModel`."""
        T_a_b = poses_of(pair, T_a_b)
        return self.parts[pair.a].distances(self._wires.of(pair), T_a_b @ pair.T_b_cylinder)


def intrusion(decomposition: Decomposition, pair: GroovePair) -> float:
    """How far in mm the hulls reach into the groove: its radius less that of the thickest coaxial wire that is free.

    Exact for the hulls: the distance of the groove's axis, without end, from each hull's outline seen along it.
    """
    from scipy.spatial import ConvexHull

    T = inverse(pair.T_a_groove)
    free = np.inf
    for hull in decomposition.hulls:
        seen = (hull.vertices @ T[:3, :3].T + T[:3, 3])[:, :2]
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
