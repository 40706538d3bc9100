"""From a mesh to its grooves, cylinders and holes.

A triangle belongs to a cylinder if its vertices lie on the surface within the tolerance (or inside it by no more than
the sagitta of the region's facets: cuts end on chords, not on the arc) and its normal is radial within half a facet.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np

from clamp3d import checks
from clamp3d.checks import function, instance
from clamp3d.files.formats import load_bodies
from clamp3d.files.solid import BrepSolid
from clamp3d.fit.axis import Axis
from clamp3d.fit.cad import cad_features
from clamp3d.fit.cylinder import fit_axis
from clamp3d.fit.features import FitResult, result_of
from clamp3d.fit.grow import Region, Search
from clamp3d.fit.measure import arc, measure
from clamp3d.fit.seeds import patches, strips
from clamp3d.fit.surface import Surface
from clamp3d.geometry.mesh import IntArray, Mesh
from clamp3d.geometry.profile import sagitta


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
        return result_of(*cad_features(reading, file.name))
    return fit_mesh(reading.merged(file.name), progress=progress)


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
    return result_of(mesh, surfaces, list(mesh.notes))


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
