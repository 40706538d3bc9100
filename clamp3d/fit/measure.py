"""From the triangles of a cylinder to its frame, extent and errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from clamp3d.fit.cylinder import CONFIDENCE, Axis, covariance, patches_of, perpendicular, surface_error
from clamp3d.fit.grow import Region
from clamp3d.fit.surface import Surface, sagitta

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

FULL_TURN_GAP = np.radians(30.0)
"""A surface whose largest uncovered angle is below this goes all the way round."""


def arc(surface: Surface, axis: Axis, u: Array, w: Array, faces: IntArray) -> tuple[float, float]:
    """Middle (rad, from u towards w) and half angle of the arc that ``faces`` cover; half angle pi for a full turn."""
    p = surface.V[surface.F[faces]] - axis.point
    a = np.arctan2(p @ w, p @ u)
    base = a[:, :1]
    turned = base + (a - base + np.pi) % (2.0 * np.pi) - np.pi
    low, high = turned.min(axis=1), turned.max(axis=1)
    order = np.argsort(low)
    low, high = low[order], high[order]
    # Two turns of the sorted intervals make the circle a line.
    low = np.concatenate([low, low + 2.0 * np.pi])
    high = np.maximum.accumulate(np.concatenate([high, high + 2.0 * np.pi]))
    gaps = low[1:] - high[:-1]
    k = int(np.argmax(gaps))
    if gaps[k] < FULL_TURN_GAP:
        return 0.0, float(np.pi)
    start, end = low[k + 1], high[k] + 2.0 * np.pi
    return float(0.5 * (start + end)), float(0.5 * (end - start))


@dataclass(frozen=True, slots=True)
class _End:
    """One side of a region: where it ends (rad or mm), how far its border strays, and whether that is the true end.

    ``sharp``: the mesh ends there too, or a crease leads to much larger triangles, as in a CAD mesh. Otherwise the
    triangles across the border may straddle the edge.
    """

    at: float
    stray: float
    sharp: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Border:
    """Border edges of a region: ends (k, 2, 3) and lengths (k,).

    ``bend`` (k,) in rad to the triangle outside and ``growth`` (k,), its area in terms of the region's triangles, are
    infinite on the mesh's rim. ``inner_bend``: median bend within the region.
    """

    ends: Array
    length: Array
    bend: Array
    growth: Array
    inner_bend: float

    def end(self, values: Array, side: NDArray[np.bool_]) -> _End | None:
        """Length-weighted median of ``values`` (k,) on ``side`` (k,); None without a border there."""
        if not side.any():
            return None
        v, w = values[side], self.length[side]
        order = np.argsort(v)
        total = np.cumsum(w[order])
        at = float(v[order][np.searchsorted(total, 0.5 * total[-1])])
        crease = np.median(self.bend[side]) > 2.0 * self.inner_bend
        sharp = bool(crease and np.median(self.growth[side]) > 4.0)
        # A few border edges belong to a corner or a pock mark: nine tenths of the border say how far it strays.
        far = np.abs(v - at)
        by_size = np.argsort(far)
        stray = float(far[by_size][np.searchsorted(np.cumsum(w[by_size]), 0.9 * total[-1])])
        return _End(at, stray, sharp)


def _border(surface: Surface, faces: IntArray) -> _Border:
    inside = np.zeros(len(surface.F), dtype=bool)
    inside[faces] = True
    first, second = inside[surface.pairs].T
    crossing = first != second
    F = surface.F[faces]
    n = len(surface.V)
    edges = np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    key, count = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    key = key[count == 1]
    shared = np.sort(surface.edges[crossing], axis=1)
    shared_key = shared[:, 0] * n + shared[:, 1]
    known = np.isin(shared_key, key)
    at = np.searchsorted(key, shared_key[known])
    bend, growth = np.full(len(key), np.inf), np.full(len(key), np.inf)
    bend[at] = surface.bend[crossing][known]
    outside = np.where(first, surface.pairs[:, 1], surface.pairs[:, 0])[crossing][known]
    growth[at] = surface.areas[outside] / np.median(surface.areas[faces])
    ends = surface.V[np.stack([key // n, key % n], axis=1)]
    both = surface.bend[first & second]
    inner = float(np.median(both[both > 1e-4])) if (both > 1e-4).any() else 0.0
    return _Border(ends, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), bend, growth, inner)


def measure(surface: Surface, region: Region) -> dict[str, Any] | None:
    """Frame, extent, residuals and errors of ``region``; None if the points leave the cylinder open."""
    d = region.axis.direction
    d = d if d[int(np.argmax(np.abs(d)))] > 0.0 else -d
    axis = Axis(region.axis.point, d, region.axis.radius)
    u, w = perpendicular(d)
    middle, half = arc(surface, axis, u, w, region.faces)
    deepest = np.cos(middle) * u + np.sin(middle) * w
    R = np.stack([np.cross(-deepest, d), -deepest, d], axis=1)

    corners = (surface.V[np.unique(surface.F[region.faces])] - axis.point) @ R
    z0, z1 = float(corners[:, 2].min()), float(corners[:, 2].max())
    border = _border(surface, region.faces)
    local = (border.ends - axis.point) @ R
    along = np.abs(local[:, 1, 2] - local[:, 0, 2]) > 0.5 * border.length
    z, angle = local[:, :, 2].mean(axis=1), np.arctan2(local[:, :, 0], -local[:, :, 1]).mean(axis=1)
    # Off the corners, where the two kinds of border mix.
    v, t = (2.0 * z - z0 - z1) / (z1 - z0), angle / half
    low, high = (border.end(z, ~along & (k * v > 0.8) & (np.abs(t) < 0.85)) for k in (-1, 1))
    length_error = arc_error = 0.0
    if low and high:
        step = 0.0 if region.strips else float(np.median(np.ptp((surface.V[surface.F[region.faces]] @ d), axis=1)))
        z0, z1, length_error = _ends(low, high, step, z1 - z0)
    left, right = (border.end(angle, along & (k * t > 0.8) & (np.abs(v) < 0.85)) for k in (-1, 1))
    if half < np.pi and left and right:
        a, b, arc_error = _ends(left, right, 0.0 if region.strips else _facet(surface, axis, region.faces), 2.0 * half)
        half = 0.5 * (b - a)
        c, s = np.cos(0.5 * (a + b)), np.sin(0.5 * (a + b))
        R = R @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    length = z1 - z0
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = axis.point + 0.5 * (z0 + z1) * d

    points = (surface.V[region.points] - T[:3, 3]) @ R
    residual = np.hypot(points[:, 0], points[:, 1]) - axis.radius
    freedom = max(len(points) - 5, 1)
    rms = float(np.sqrt(residual @ residual / freedom))
    noise = float(np.hypot(rms, surface.mesh.rounding))
    C = covariance(points, axis.radius, noise * _inflation(surface, region, residual))
    if C is None or length <= 0.0 or half <= 0.0:
        return None
    area = float(surface.areas[region.faces].sum())
    return {
        "radius": axis.radius,
        "half_angle": half,
        "length": length,
        "T_part_feature": T,
        "residual_rms": rms,
        "residual_max": float(np.abs(residual).max()),
        "points": len(points),
        "covered_area": area,
        "coverage": min(1.0, area / (2.0 * half * axis.radius * length)),
        # Few points know their own scatter badly: three standard errors shall mean 99.73 % all the same.
        "covariance": C * (float(stats.t.isf(0.5 * (1.0 - CONFIDENCE), freedom)) / 3.0) ** 2,
        "covariance_error": surface_error(C, half, length, freedom),
        "form_error": _form_error(points, residual, rms) + 2.0 * surface.mesh.rounding,
        "chord_error": sagitta(axis.radius, region.span),
        "arc_error": arc_error,
        "length_error": length_error,
        "faces": surface.rows[region.faces],
    }


def _ends(first: _End, last: _End, step: float, extent: float) -> tuple[float, float, float]:
    """Ends of a region and their error, from its borders.

    On a dense mesh (facets of ``step`` well below ``extent``) the triangles across the border belong to neither side,
    so the end lies about half a facet further, half a facet uncertain.
    """
    shift, error = [0.0, 0.0], 0.0
    for k, end in enumerate((first, last)):
        doubt = 0.0
        if not end.sharp and step < 0.1 * extent:
            shift[k] = doubt = 0.5 * step
        elif not end.sharp and step < 0.5 * extent:
            doubt = step
        error = max(error, end.stray + doubt)
    return first.at - shift[0], last.at + shift[1], error


def _facet(surface: Surface, axis: Axis, faces: IntArray) -> float:
    """Median angle (rad) that a triangle covers."""
    u = axis.radial(surface.V[surface.F[faces].reshape(-1)])[0].reshape(-1, 3, 3)
    chord = np.linalg.norm(u - u[:, [1, 2, 0]], axis=2).max(axis=1)
    return float(np.median(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))))


def _inflation(surface: Surface, region: Region, residual: Array) -> float:
    """Factor on the standard errors for residuals that neighbours share (a scanner's or a smoother's traces).

    With correlation c between neighbours (first order autoregression along both directions of the surface) n points
    are worth n ((1 - c) / (1 + c))^2 independent ones.
    """
    number = np.full(len(surface.V), -1)
    number[region.points] = np.arange(len(region.points))
    F = surface.F[region.faces]
    edges = np.unique(np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1), axis=0)
    i, j = number[edges[:, 0]], number[edges[:, 1]]
    both = (i >= 0) & (j >= 0)
    power = float(residual @ residual) / len(residual)
    if both.sum() < 30 or power <= 0.0:
        return 1.0
    shared = float(np.mean(residual[i[both]] * residual[j[both]])) / power
    if shared < 3.0 / np.sqrt(both.sum()):
        return 1.0
    shared = min(shared, 0.95)
    return (1.0 + shared) / (1.0 - shared)


def _form_error(points: Array, residual: Array, rms: float) -> float:
    """Largest mean residual of a patch, with three standard errors of a mean; few points: the largest of all.

    Scatter averages out over a patch, a surface that is not round does not.
    """
    worst = float(np.abs(residual).max())
    patches = patches_of(points)
    if len(patches) < 2:
        return worst
    return min(worst, max(abs(float(residual[i].mean())) + 3.0 * rms / float(np.sqrt(len(i))) for i in patches))
