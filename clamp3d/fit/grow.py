"""One cylinder's triangles: growing from a seed, refitting, and judging the outcome."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum, minimum
from scipy.special import stdtrit

from clamp3d.fit.axis import Axis, perpendicular, turned
from clamp3d.fit.cylinder import fit_axis
from clamp3d.fit.surface import MAX_FACET, BoolArray, Surface, angles, border
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import sagitta

MIN_LINES = 4
"""Fewest lines on a surface: three always lie on some circle (a trapezoid or V groove is not an arc)."""


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """Triangles of one cylinder: ``sign`` +1 convex, -1 concave; ``points`` index the vertices that the fit uses.

    ``tolerance`` (mm): farthest that a vertex may lie off; ``span`` (rad): the widest facet. ``strips``: found as an
    exact tessellation, whose border is the surface's own; otherwise the triangles across the border are missing.
    """

    axis: Axis
    sign: int
    faces: IntArray
    points: IntArray
    tolerance: float
    span: float
    strips: bool


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """One pass over a surface: the faces (m,) still ``free``, planar ``cells`` (m,), least tolerance ``floor`` in mm.

    ``strips``: the seeds are strips of an exact tessellation.
    """

    surface: Surface
    free: BoolArray
    cells: IntArray
    floor: float
    strips: bool

    def span(self, axis: Axis, faces: IntArray) -> Array:
        """Angle (rad) about the axis of each planar cell that has some of ``faces``, counting those faces only."""
        angle = angles(self.surface, axis, faces, *perpendicular(axis.direction))
        names, first, cell = np.unique(self.cells[faces], return_index=True, return_inverse=True)
        about = turned(angle, angle[first, :1][cell])
        index = np.arange(len(names))
        return np.asarray(maximum(about.max(axis=1), cell, index) - minimum(about.min(axis=1), cell, index))


def grow(search: Search, axis: Axis, sign: int, seed: IntArray, tolerance: float) -> Region | None:
    """Grow from ``seed`` faces, refit, and repeat until the faces no longer change."""
    # Voxel and remeshed surfaces put their vertices off by a good part of the facets' sagitta.
    share = 0.0 if search.strips else 0.3
    surface, floor = search.surface, search.floor
    V, F, faces = surface.V, surface.F, seed
    span = float(search.span(axis, faces).max())
    for _ in range(12):
        if not 0.0 < axis.radius < 20.0 * surface.extent or span > MAX_FACET:
            return None
        off = axis.residual(V)
        depth = sagitta(axis.radius, span)
        tolerance = max(tolerance, share * depth)
        near = (off <= tolerance) & (off >= -1.02 * depth - tolerance)
        slack = math.acos(np.quantile(np.clip(sign * surface.lean(axis, faces), -1.0, 1.0), 0.1))
        limit = np.cos(min(max(0.6 * span, 2.5 * slack, 0.02), 0.7))
        mask: BoolArray = search.free & np.asarray(near[F].all(axis=1))
        index = np.flatnonzero(mask)
        mask[index] = sign * surface.lean(axis, index) >= limit
        if not mask[faces].any():
            return None
        label = surface.labels(np.asarray(mask[surface.pairs].all(axis=1)))
        inside = faces[mask[faces]]
        names, where = np.unique(label[inside], return_inverse=True)
        main = names[np.argmax(np.bincount(where, weights=surface.areas[inside]))]
        grown = np.flatnonzero(mask & (label == main))
        settled, faces = np.array_equal(grown, faces), grown
        points = _support(surface, faces, np.abs(off) <= tolerance)
        if len(points) < 6:
            return None
        better = fit_axis(V[points], axis)
        if better is None:
            return None
        axis = better
        tolerance = max(floor, _tolerance(axis.residual(V[points])))
        span = float(search.span(axis, faces).max())
        if settled:
            break
    return Region(axis, sign, faces, points, tolerance, span, search.strips)


def _tolerance(residual: Array) -> float:
    """Distance that a vertex with the scatter of ``residual`` (n,) exceeds as rarely as four normal deviations.

    The scatter is the median one, so a few strays do not widen it; five fitted parameters and few points do.
    """
    n = len(residual)
    freedom = max(n - 5, 1)
    scatter = 1.4826 * np.median(np.abs(residual))
    if n < 60:  # the median of few is too rough
        scatter = max(scatter, float(np.sqrt(np.mean(residual**2))))
    scatter *= np.sqrt(n / freedom)
    return float(-scatter * stdtrit(min(freedom, 1000), 3.2e-5))


def _support(surface: Surface, faces: IntArray, on: BoolArray) -> IntArray:
    """Vertices (k,) of ``faces`` that the fit may use: those ``on`` the surface, which leaves out points on chords.

    On a dense mesh only those with all their faces in the region: the border is chosen by the fit itself.
    """
    inside = np.bincount(surface.F[faces].reshape(-1), minlength=len(surface.V))
    keep = np.flatnonzero((inside > 0) & on)
    inner = keep[inside[keep] == surface.valence[keep]]
    return np.asarray(inner if len(inner) >= max(50, 0.6 * len(keep)) else keep)


def accept(search: Search, region: Region) -> bool:
    """True if the region is long, round and distinct enough to be a cylinder rather than an accident."""
    V, axis = search.surface.V, region.axis
    p = (V[region.points] - axis.point) @ np.stack([*perpendicular(axis.direction), axis.direction], axis=1)
    angle = np.sort(np.arctan2(p[:, 1], p[:, 0]))
    gaps = np.diff(angle, append=angle[0] + 2.0 * np.pi)
    arc = 2.0 * np.pi - float(gaps.max())
    noise = max(region.tolerance / 4.0, 1e-12)
    lines = int((gaps > 1e-3 * max(arc, 1e-9)).sum())
    spans = search.span(axis, region.faces)
    if lines < MIN_LINES:
        return False
    # Every trapezoid with equal flanks lies on a circle: with three facets ask for three equal ones.
    if lines == MIN_LINES and (spans.max() > 1.02 * spans.min() or spans.max() > np.radians(30.0)):
        return False
    if sagitta(axis.radius, arc) < 6.0 * noise or arc < 2.0 * np.median(spans):
        return False
    length = float(np.ptp((V[np.unique(search.surface.F[region.faces])]) @ axis.direction))
    return len(region.points) >= 8 and length > 0.0 and not _runs_on(search.surface, region, length)


def _runs_on(surface: Surface, region: Region, length: float) -> bool:
    """True if the surface goes on smoothly past both round ends with bands as long: a ring of a sphere or torus."""
    crossing, outside, _ = border(surface, region.faces)
    ends = surface.V[surface.edges[crossing]]
    along = ends @ region.axis.direction
    across = np.abs(along[:, 1] - along[:, 0]) < 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    z = along.mean(axis=1)
    z = z - 0.5 * (z.min() + z.max()) if len(z) else z
    smooth = surface.bend[crossing] < 1.5 * region.span
    band = np.ptp((surface.V[surface.F[outside]]) @ region.axis.direction, axis=1)
    both = [across & (z > 0.0), across & (z < 0.0)]
    return all(bool(e.any() and smooth[e].mean() > 0.7 and np.median(band[e]) > 0.3 * length) for e in both)
