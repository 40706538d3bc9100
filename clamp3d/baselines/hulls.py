"""Grooved parts as the hulls CoACD makes of their meshes, each an `fcl.Convex`: what physics engines do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clamp3d.baselines.decomposition import Decomposition, check_threshold, decompose
from clamp3d.baselines.fcl_shapes import convex
from clamp3d.baselines.polytopes import PolytopeModel, Polytopes
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.shapes import Solid


class Hulls(PolytopeModel):
    """CoACD hulls of the parts' meshes, measured by FCL; any pose.

    A hull fills in what it spans, so the groove is too tight by an intrusion, which follows CoACD's
    threshold loosely and can exceed it. Hulls may also leave the part's own corners out.
    ``decompositions[part]`` is made (or read from the cache) when a part is first measured.

    Parameters
    ----------
    parts : mapping of str to Solid
        Grooved parts by name, mm. A part is meshed when it is first measured.
    threshold : float
        Concavity in mm that CoACD may leave.
    mesh_error : float
        Chord error in mm of the meshes.
    time_limit, progress
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
        parts: Mapping[str, Solid],
        threshold: float = 2.0,
        *,
        mesh_error: float = 0.05,
        time_limit: float = 300.0,
        progress: bool | None = None,
    ) -> None:
        super().__init__(parts)
        self.threshold = check_threshold(threshold)  # now, not when a part is first measured
        self.mesh_error, self.time_limit, self.progress = mesh_error, time_limit, progress
        self.decompositions: dict[str, Decomposition] = {}

    def cut(self, name: str, part: Solid) -> Polytopes:
        """See `PolytopeModel`."""
        whole = mesh(part, self.mesh_error)
        limits: dict[str, Any] = {"time_limit": self.time_limit, "progress": self.progress}
        self.decompositions[name] = decompose(whole.vertices, whole.faces, self.threshold, name=name, **limits)
        hulls = self.decompositions[name].hulls
        names = [f"hull {i + 1}" for i in range(len(hulls))]
        shapes = [convex(corners, f"{name} {n}") for corners, n in zip(hulls, names, strict=True)]
        return Polytopes(shapes, names)
