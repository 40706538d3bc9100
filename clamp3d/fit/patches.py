"""Seeds on dense and scanned meshes: patches whose curvature stands out of the noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from clamp3d.core.mesh import IntArray
from clamp3d.core.pose import Array
from clamp3d.core.profile import sagitta
from clamp3d.fit.cylinder import Axis, axis_along, fit_axis, perpendicular
from clamp3d.fit.grow import Region, Search, accept, grow
from clamp3d.fit.surface import BoolArray, Surface

_PATCH_SIZES = (24, 96, 384, 1536)
_GATES = tuple(np.radians(a) for a in (12.0, 25.0, 46.0))
_LEAST = 8
"""Fewest triangles of a patch: flat sides and what was found before leave fewer of a CAD mesh."""
_MAX_SEEDS = 250


def patches(search: Search, tell: Callable[[str, float], None]) -> Iterator[Region]:
    """Cylinders among the free faces, seeded all over; the caller takes what is found off them."""
    surface, free, cells = search.surface, search.free, search.cells
    if not free.any():
        return
    todo = free & (np.bincount(cells)[cells] <= 4)
    gates = [surface.labels(surface.bend < g) for g in _GATES]
    widest = gates[-1]
    if not (todo & (np.bincount(widest[free], minlength=len(todo))[widest] >= _LEAST)).any():
        return
    tree = cKDTree(surface.centres)
    rng = np.random.default_rng(0)
    order = rng.permutation(np.flatnonzero(todo))
    noise = _noise(surface, tree, rng.permutation(len(surface.F))[:150])
    # First what fits as well as the mesh allows, then the rest: else a lip takes part of its groove.
    for stage, factor in enumerate((1.25, 2.0)):
        seeds = todo & free
        tried = 0
        for n, start in enumerate(order):
            if not (seeds[start] and free[start]):
                continue
            tried += 1
            if tried > _MAX_SEEDS:
                break
            tell("patches", 0.5 * (stage + n / len(order)))
            nearest = _nearest(surface, tree, start, _PATCH_SIZES[-1])
            facing = nearest[free[nearest] & ((surface.normals[nearest] @ surface.normals[start]) > 0.5)]
            same = [facing[label[facing] == label[start]] for label in gates]
            region = _from_patches(search, same, factor * noise, seeds)
            if region is None:
                seeds[nearest[: _PATCH_SIZES[0] // 2]] = False
                continue
            yield region


def _nearest(surface: Surface, tree: cKDTree, start: int, count: int) -> IntArray:
    return np.atleast_1d(tree.query(surface.centres[start], k=min(count, len(surface.F)))[1])


def _from_patches(search: Search, same: list[IntArray], limit: float, seeds: BoolArray) -> Region | None:
    """Region grown from the least patch that is round; ``same``: a seed's neighbours, nearest first, by each gate."""
    surface = search.surface
    for k, near in enumerate(same):
        if k and len(near) == len(same[k - 1]):
            continue
        for size in sorted({min(size, len(near)) for size in _PATCH_SIZES}):
            patch = near[:size]
            guess = _quadric(surface, patch) if size >= _LEAST else None
            if guess is None:
                continue
            start, sign, scatter = guess
            if scatter > limit:  # an edge is in it: so it is in every larger patch
                break
            points = surface.V[np.unique(surface.F[patch])]
            axis = fit_axis(points, start, robust_scale=max(scatter, search.floor))
            if axis is None:
                continue
            noise = 1.4826 * np.median(np.abs(axis.residual(points)))
            tolerance = max(search.floor, 4.0 * noise)
            if noise > 1.6 * scatter + search.floor or tolerance > 0.1 * axis.radius:
                continue
            region = grow(search, axis, sign, patch, tolerance)
            if region is None or len(region.faces) < 0.7 * len(patch):
                continue
            if not accept(search, region):  # every seed within would grow the same again
                seeds[region.faces] = False
            elif np.sqrt(np.mean(region.axis.residual(surface.V[region.points]) ** 2)) <= limit:
                return region
    return None


def _noise(surface: Surface, tree: cKDTree, sample: IntArray) -> float:
    """Scatter (mm) of this mesh's vertices: the median over small patches at the faces ``sample``.

    Without it the rounded edges of a scan pass as badly fitting cylinders.
    """
    scatters = []
    for start in sample:
        patch = _nearest(surface, tree, start, _PATCH_SIZES[0])
        scatter = _quadric_fit(surface, patch[(surface.normals[patch] @ surface.normals[start]) > 0.5])
        if scatter is not None:
            scatters.append(scatter[2])
    if len(scatters) < 20:
        return np.inf
    side = float(np.sqrt(np.median(surface.areas[sample])))
    return float(np.median(scatters)) + 0.003 * side


def _quadric_fit(surface: Surface, patch: IntArray) -> tuple[Array, Array, float, float, Array] | None:
    """Height over the patch's mean plane as a quadric.

    Returns coefficients (6,) and covariance (6, 6) in units of the size, scatter (mm), size (mm) and frame (4, 3): the
    rows u, w, normal and the middle. None if fewer than 9 vertices or all on two lines.
    """
    normal = surface.areas[patch] @ surface.normals[patch]
    length = np.linalg.norm(normal)
    points = surface.V[np.unique(surface.F[patch])]
    if length <= 0.0 or len(points) < 9:
        return None
    normal = normal / length
    u, w = perpendicular(normal)
    m = points.mean(axis=0)
    x, y, z = (points - m) @ u, (points - m) @ w, (points - m) @ normal
    s = max(float(np.abs(x).max()), float(np.abs(y).max()))
    x, y = x / s, y / s
    A = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    left, sizes, right = np.linalg.svd(A, full_matrices=False)
    if sizes[-1] <= 0.01 * sizes[0]:
        return None
    sol = ((z @ left) / sizes) @ right
    res = z - (A @ sol)
    scatter = float(np.sqrt((res @ res) / (len(points) - 6)))
    return sol, ((right.T / sizes**2) @ right) * scatter**2, scatter, s, np.stack([u, w, normal, m])


def _quadric(surface: Surface, patch: IntArray) -> tuple[Axis, int, float] | None:
    """Cylinder from the principal curvatures of a patch, and the scatter about the quadric; None if it looks flat."""
    quadric = _quadric_fit(surface, patch)
    if quadric is None:  # long strips: all points in two rings leave the curvature along the axis open
        return _from_normals(surface, patch)
    sol, C, scatter, s, (u, w, normal, m) = quadric
    values, vectors = np.linalg.eigh(np.array([[2.0 * sol[3], sol[4]], [sol[4], 2.0 * sol[5]]]) / s**2)
    big = int(np.argmax(np.abs(values)))
    uncertainty = 2.0 * float(np.sqrt(C[3:, 3:].diagonal().max())) / s**2
    if abs(values[big]) < 6.0 * uncertainty or abs(values[big]) * surface.extent < 0.05:
        return None
    if abs(values[1 - big]) > 0.15 * abs(values[big]) + 4.0 * uncertainty:  # curved both ways
        return None
    radius = 1.0 / abs(values[big])
    # Height over the outward normal: a valley (positive curvature) is a groove.
    sign = -1 if values[big] > 0.0 else 1
    d = vectors[0, 1 - big] * u + vectors[1, 1 - big] * w
    top = m + sol[0] * normal
    return Axis(top - sign * radius * normal, d, radius), sign, scatter


def _from_normals(surface: Surface, patch: IntArray) -> tuple[Axis, int, float] | None:
    """Cylinder whose axis is the direction that the patch's normals avoid most, and the scatter about it."""
    N = surface.normals[patch]
    d = np.linalg.eigh(((N * surface.areas[patch][:, None]).T) @ N)[1][:, 0]
    points = surface.V[np.unique(surface.F[patch])]
    axis = axis_along(d, points)
    if axis is None:
        return None
    sign = 1 if (surface.lean(axis, patch) @ surface.areas[patch]) > 0.0 else -1
    scatter = float(np.sqrt(np.mean(axis.residual(points) ** 2)))
    # Along the arc at the middle of the points; round a full turn any direction serves.
    across = np.cross(d, points.mean(axis=0) - axis.point)
    size = np.linalg.norm(across)
    across = across / size if size > 0.0 else perpendicular(d)[0]
    reach = min(float(np.ptp(points @ across)) / axis.radius, np.pi)
    return None if sagitta(axis.radius, reach) < 6.0 * scatter else (axis, sign, scatter)
