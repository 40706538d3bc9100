"""From a mesh to its grooves, cylinders and holes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d.brep.mesh_file import load_mesh
from clamp3d.checks import function, instance
from clamp3d.core.mesh import Mesh
from clamp3d.fit.features import CylinderFit, FittedSurface, GrooveFit, HoleFit
from clamp3d.fit.join import join
from clamp3d.fit.measure import measure
from clamp3d.fit.regions import find_regions
from clamp3d.fit.surface import Surface


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """What was found in ``mesh``: features sorted by covered area, largest first, and ``notes`` for the reader.

    ``feature_area`` and ``area`` (mm^2): area of all features and of the mesh.
    """

    mesh: Mesh
    grooves: tuple[GrooveFit, ...]
    cylinders: tuple[CylinderFit, ...]
    holes: tuple[HoleFit, ...]
    area: float
    notes: tuple[str, ...]

    @property
    def features(self) -> tuple[FittedSurface, ...]:
        """Grooves, cylinders and holes in this order."""
        return (*self.grooves, *self.cylinders, *self.holes)

    @property
    def feature_area(self) -> float:
        """Area (mm^2) of the triangles that belong to a feature."""
        return float(sum(f.covered_area for f in self.features))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists for JSON; lengths in mm."""
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        return {
            "mesh": self.mesh.name,
            "vertices": len(self.mesh.vertices),
            "triangles": len(self.mesh.faces),
            "watertight": self.mesh.watertight,
            "bounds_mm": [low.tolist(), high.tolist()],
            "area_mm2": self.area,
            "feature_area_mm2": self.feature_area,
            "grooves": [f.to_dict() for f in self.grooves],
            "cylinders": [f.to_dict() for f in self.cylinders],
            "holes": [f.to_dict() for f in self.holes],
            "notes": list(self.notes),
        }


def fit_file(
    path: str | Path, *, unit: str | None = None, progress: Callable[[str, float], None] | None = None
) -> FitResult:
    """Fit the mesh in ``path``; see ``load_mesh`` for formats, units and errors."""
    return fit_mesh(load_mesh(path, unit=unit), progress=progress)


def fit_mesh(mesh: Mesh, *, progress: Callable[[str, float], None] | None = None) -> FitResult:
    """Find the concave grooves, convex cylinders and holes of ``mesh`` (from ``load_mesh`` or ``make_mesh``).

    ``progress(stage, fraction)`` is called while it works.
    """
    instance("mesh", mesh, Mesh)
    function("progress", progress)
    surface = Surface(mesh)
    regions = join(surface, find_regions(surface, progress))
    regions.sort(key=lambda r: -float(surface.areas[r.faces].sum()))
    grooves: list[GrooveFit] = []
    cylinders: list[CylinderFit] = []
    holes: list[HoleFit] = []
    notes = list(mesh.notes)
    for region in regions:
        values = measure(surface, region)
        if values is None:
            continue
        if region.sign > 0:
            cylinders.append(CylinderFit(name=f"C{len(cylinders) + 1}", **values))
        elif values["half_angle"] < np.pi:
            grooves.append(GrooveFit(name=f"G{len(grooves) + 1}", **values))
        else:
            holes.append(HoleFit(name=f"H{len(holes) + 1}", **values, through=_open_ended(surface, values)))
    if not grooves:
        notes.append("no groove: no concave circular arc found")
    return FitResult(
        mesh=mesh,
        grooves=tuple(grooves),
        cylinders=tuple(cylinders),
        holes=tuple(holes),
        area=float(surface.areas.sum()),
        notes=tuple(notes),
    )


def _open_ended(surface: Surface, values: dict[str, Any]) -> bool:
    """True if nothing closes either end: from the middle, no face crosses the axis up to a radius past the ends."""
    T, reach = values["T_part_feature"], 0.5 * values["length"] + values["radius"]
    a, b, c = ((surface.V[surface.F[:, k]] - T[:3, 3]) @ T[:3, :3] for k in range(3))
    # A face meets the axis if the origin lies in its projection along z: all three edge functions of one sign.
    e = [p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b))]
    hit = ((e[0] >= 0) & (e[1] >= 0) & (e[2] >= 0)) | ((e[0] <= 0) & (e[1] <= 0) & (e[2] <= 0))
    total = e[0] + e[1] + e[2]
    hit &= total != 0.0
    z = (e[0] * a[:, 2] + e[1] * b[:, 2] + e[2] * c[:, 2])[hit] / total[hit]
    return not bool((np.abs(z) <= reach).any())
