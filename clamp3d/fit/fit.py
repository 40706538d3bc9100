"""From a mesh to its grooves, cylinders and holes.

A triangle belongs to a cylinder if its vertices lie on the surface within the tolerance (or inside it by no more than
the sagitta of the region's facets: cuts end on chords, not on the arc) and its normal is radial within half a facet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from clamp3d import checks
from clamp3d.checks import function, instance
from clamp3d.files.bodies import Body, Reading
from clamp3d.files.formats import load_bodies
from clamp3d.files.solid import BrepSolid
from clamp3d.fit.cad import cad_features
from clamp3d.fit.cylinder import Axis, fit_axis
from clamp3d.fit.features import CylinderFit, FittedSurface, GrooveFit, HoleFit
from clamp3d.fit.grow import Region, Search
from clamp3d.fit.measure import arc, measure
from clamp3d.fit.seeds import patches, strips
from clamp3d.fit.surface import Surface
from clamp3d.geometry.mesh import Array, IntArray, Mesh
from clamp3d.geometry.pose import to_source
from clamp3d.geometry.profile import sagitta


@dataclass(frozen=True, slots=True, eq=False)
class FitResult:
    """What was found in a mesh.

    Attributes
    ----------
    mesh : Mesh
        The mesh that was fitted.
    grooves : tuple of GrooveFit
        Concave arcs, largest covered area first.
    cylinders : tuple of CylinderFit
        Convex cylinders and arcs, largest covered area first.
    holes : tuple of HoleFit
        Concave cylinders all the way round, largest covered area first.
    area : float
        Area of the mesh in mm^2.
    notes : tuple of str
        What was repaired, assumed, or not found.
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
            **{kind: [f.to_dict() for f in getattr(self, kind)] for kind in ("grooves", "cylinders", "holes")},
            "notes": list(self.notes),
        }


def fit_file(
    path: str | Path, *, unit: str | None = None, progress: Callable[[str, float], None] | None = None
) -> FitResult:
    """Find the grooves, cylinders and holes of the mesh in a file.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY, OFF, GLB, GLTF, 3MF or STEP file; see `load_mesh`. Of STEP the features are its cylindrical
        faces.
    unit : str, optional
        Unit of the file's lengths: mm, cm, m or in.
    progress : callable, optional
        ``progress(stage, fraction)`` is called while it works.

    Returns
    -------
    FitResult
        Surfaces with their errors; lengths in mm.

    Raises
    ------
    InputError
        If the file is missing, not readable, or holds no surface.
    MissingLibraryError
        For STEP without the extra ``step``.
    """
    file = checks.path("path", path)
    reading = load_bodies(file, unit=unit)
    if isinstance(reading.bodies[0].shape, BrepSolid):
        return _result(*cad_features(reading, file.name))
    return fit_mesh(reading.merged(file.name), progress=progress)


def fit_solid(solid: BrepSolid) -> FitResult:
    """The cylindrical faces of a solid from CAD, with its own mesh."""
    return _result(*cad_features(Reading([Body(solid.name, solid, np.eye(4))]), solid.name))


def fit_mesh(mesh: Mesh, *, progress: Callable[[str, float], None] | None = None) -> FitResult:
    """Find the concave grooves, convex cylinders and holes of a mesh.

    Parameters
    ----------
    mesh : Mesh
        From `load_mesh` or `make_mesh`; it may be open.
    progress : callable, optional
        ``progress(stage, fraction)`` is called while it works.

    Returns
    -------
    FitResult
        Surfaces with their errors; lengths in mm.

    Raises
    ------
    InputError
        If an argument has the wrong type.

    Examples
    --------
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.mesh import make_mesh
    >>> from clamp3d.geometry.meshing import mesh
    >>> wire = mesh(shapes.cylinder(6.5, 80.0))
    >>> (fitted,) = fit_mesh(make_mesh(wire.vertices, wire.faces)).cylinders
    >>> round(fitted.radius, 9), round(fitted.length, 9), fitted.full
    (6.5, 80.0, True)
    """
    instance("mesh", mesh, Mesh)
    function("progress", progress)
    surface = Surface(mesh)
    regions = join(surface, find_regions(surface, progress))
    surfaces = [(float(region.sign), values) for region in regions if (values := measure(surface, region)) is not None]
    return _result(mesh, surfaces, list(mesh.notes))


def find_regions(surface: Surface, progress: Callable[[str, float], None] | None = None) -> list[Region]:
    """All cylinders on the mesh, none overlapping; ``progress(stage, fraction)`` is called as it goes."""
    free = np.ones(len(surface.F), dtype=bool)
    regions_so_far: list[Region] = []
    coarse = 40.0 * max(surface.mesh.rounding, surface.extent * 2.0**-24)
    for floor, seeds in ((surface.floor, strips), (coarse, strips), (surface.floor, patches)):
        search = Search(surface, free, surface.cells(floor), floor, seeds is strips)
        for region in seeds(search, progress or (lambda stage, fraction: None)):
            free[region.faces] = False
            regions_so_far.append(region)
    return regions_so_far


def join(surface: Surface, regions: list[Region]) -> list[Region]:
    """Join pieces of one cylinder that a cut, a crack or a hole parts, if one fit holds for both and they are close."""
    for a, b in combinations(regions, 2):
        both = _joined(surface, a, b)
        if both is not None:
            return join(surface, [both, *(region for region in regions if region is not a and region is not b)])
    return regions


def _joined(surface: Surface, a: Region, b: Region) -> Region | None:
    if a.sign != b.sign or abs(a.axis.radius - b.axis.radius) > 0.2 * a.axis.radius:
        return None
    if abs(a.axis.direction @ b.axis.direction) < 0.97:
        return None
    V, span = surface.V, max(a.span, b.span)
    large = (a if len(a.points) >= len(b.points) else b).axis
    tolerance = max(a.tolerance, b.tolerance)
    gap, _, shorter = _along(surface, large, a.faces, b.faces)
    if -gap > 0.5 * shorter:  # side by side
        tolerance = max(tolerance, 0.3 * sagitta(large.radius, span))
    points = np.unique(np.concatenate([a.points, b.points]))
    axis = fit_axis(V[points], large)
    if axis is None or any(np.quantile(np.abs(axis.residual(V[x.points])), 0.9) > tolerance for x in (a, b)):
        return None
    # Far apart along the axis they are two features: one groove would claim material where there is none.
    gap, length, shorter = _along(surface, axis, a.faces, b.faces)
    faces = np.concatenate([a.faces, b.faces])
    half = arc(surface, axis, faces)[1]
    if gap > 0.25 * shorter or float(surface.areas[faces].sum()) < half * axis.radius * length:
        return None
    return Region(axis, a.sign, faces, points, tolerance, span, a.strips and b.strips)


def _along(surface: Surface, axis: Axis, a: IntArray, b: IntArray) -> tuple[float, float, float]:
    """Gap along the axis between two sets of faces (negative: the length they share), length of both, and the shorter.

    All in mm.
    """
    spans = [((surface.V[np.unique(surface.F[f])] - axis.point) @ axis.direction) for f in (a, b)]
    (low_a, high_a), (low_b, high_b) = ((float(z.min()), float(z.max())) for z in spans)
    length = max(high_a, high_b) - min(low_a, low_b)
    return max(low_a - high_b, low_b - high_a), length, min(high_a - low_a, high_b - low_b)


def _result(mesh: Mesh, surfaces: list[tuple[float, dict[str, Any]]], notes: list[str]) -> FitResult:
    """The features with the sense and the values of ``surfaces``, named."""
    corners = mesh.vertices[mesh.faces]
    grooves: list[GrooveFit] = []
    cylinders: list[CylinderFit] = []
    holes: list[HoleFit] = []
    for sign, values in sorted(surfaces, key=lambda x: -x[1]["covered_area"]):
        if sign > 0:
            cylinders.append(CylinderFit(name=f"C{len(cylinders) + 1}", **values))
        elif values["half_angle"] < np.pi:
            grooves.append(GrooveFit(name=f"G{len(grooves) + 1}", **values))
        else:
            holes.append(HoleFit(name=f"H{len(holes) + 1}", **values, through=_open_ended(corners, values)))
    if not grooves:
        notes = [*notes, "no groove: no concave circular arc found"]
    area = float(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).area)
    return FitResult(mesh, tuple(grooves), tuple(cylinders), tuple(holes), area, tuple(notes))


def _open_ended(corners: Array, values: dict[str, Any]) -> bool:
    """True if nothing closes either end: from the middle, no face crosses the axis up to a radius past the ends."""
    T, reach = values["T_part_feature"], 0.5 * values["length"] + values["radius"]
    x, y, z = np.moveaxis(to_source(T, corners), -1, 0)
    # A face meets the axis if the origin lies in its projection along z: all three edge functions of one sign.
    e = np.roll(x, -1, axis=1) * np.roll(y, -2, axis=1) - np.roll(y, -1, axis=1) * np.roll(x, -2, axis=1)
    total = e.sum(axis=1)
    hit = ((e >= 0).all(axis=1) | (e <= 0).all(axis=1)) & (total != 0.0)
    z = (e * z).sum(axis=1)[hit] / total[hit]
    return not bool((np.abs(z) <= reach).any())
