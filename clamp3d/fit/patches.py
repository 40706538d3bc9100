"""Seeds on dense and scanned meshes: patches whose curvature stands out of the noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from clamp3d.core.mesh import IntArray
from clamp3d.core.pose import Array
from clamp3d.core.profile import sagitta
from clamp3d.fit.cylinder import Axis, circle, fit_axis, perpendicular
from clamp3d.fit.grow import Region, accept, grow
from clamp3d.fit.surface import BoolArray, Surface

_PATCH_SIZES = (24, 96, 384, 1536)
_GATES = tuple(np.radians(a) for a in (12.0, 25.0, 46.0))
_MAX_SEEDS = 250


def patches(surface: Surface, free: BoolArray, cells: IntArray, tell: Callable[[str, float], None]) -> Iterator[Region]:
    """Cylinders among the ``free`` faces (m,), seeded all over; the caller takes what is found off ``free``."""
    if not free.any():
        return
    size = np.bincount(cells)[cells]
    todo = free & (size <= 4)
    gates = [surface.labels(surface.bend < g) for g in _GATES]
    tree = cKDTree(surface.centres)
    rng = np.random.default_rng(0)
    order = rng.permutation(np.flatnonzero(todo))
    noise = _noise(surface, tree, rng.permutation(len(surface.F))[:150])
    # First what fits as well as the mesh allows, then the rest: else a lip takes part of its groove.
    for stage, factor in enumerate((1.25, 2.0)):
        limit = factor * noise
        open_ = todo & free
        tried = 0
        for n, start in enumerate(order):
            if not (open_[start] and free[start]):
                continue
            tried += 1
            if tried > _MAX_SEEDS:
                break
            tell("patches", 0.5 * (stage + n / len(order)))
            nearest = np.atleast_1d(tree.query(surface.centres[start], k=min(_PATCH_SIZES[-1], len(surface.F)))[1])
            facing = free[nearest] & (surface.normals[nearest] @ surface.normals[start] > 0.5)
            region = _from_patches(surface, free, cells, start, nearest[facing], gates, limit, open_)
            if region is None:
                open_[nearest[: _PATCH_SIZES[0] // 2]] = False
                continue
            yield region


def _from_patches(
    surface: Surface,
    free: BoolArray,
    cells: IntArray,
    start: int,
    nearest: IntArray,
    gates: list[IntArray],
    limit: float,
    seeds: BoolArray,
) -> Region | None:
    sames = [nearest[label[nearest] == label[start]] for label in gates]
    for k, same in enumerate(sames):
        if k and len(same) == len(sames[k - 1]):
            continue
        last = 0
        for size in _PATCH_SIZES:
            patch = same[:size]
            if len(patch) < 8 or len(patch) == last:
                break
            last = len(patch)
            guess = _quadric(surface, patch)
            if guess is None:
                continue
            axis0, sign, scatter = guess
            if scatter > limit:  # an edge is in it: so it is in every larger patch
                break
            points = surface.V[np.unique(surface.F[patch])]
            axis = fit_axis(points, axis0, robust_scale=max(scatter, surface.floor))
            if axis is None:
                continue
            noise = 1.4826 * float(np.median(np.abs(axis.residual(points))))
            if noise > 1.6 * scatter + surface.floor:
                continue
            tolerance = max(surface.floor, 4.0 * noise)
            if tolerance > 0.1 * axis.radius:
                continue
            region = grow(surface, free, cells, axis, sign, patch, tolerance, surface.floor, strips=False)
            if region is None or len(region.faces) < 0.7 * len(patch):
                continue
            if not accept(surface, cells, region):  # every seed within would grow the same again
                seeds[region.faces] = False
                continue
            if np.sqrt(np.mean(region.axis.residual(surface.V[region.points]) ** 2)) <= limit:
                return region
    return None


def _noise(surface: Surface, tree: cKDTree, sample: IntArray) -> float:
    """Scatter (mm) of this mesh's vertices: the median over small patches at the faces ``sample``.

    Without it the rounded edges of a scan pass as badly fitting cylinders.
    """
    scatters = []
    for start in sample:
        patch = np.atleast_1d(tree.query(surface.centres[start], k=min(_PATCH_SIZES[0], len(surface.F)))[1])
        scatter = _quadric_fit(surface, patch[surface.normals[patch] @ surface.normals[start] > 0.5])
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
    sol, _, rank, _ = np.linalg.lstsq(A, z, rcond=0.01)
    if rank < 6:
        return None
    res = z - A @ sol
    scatter = float(np.sqrt(res @ res / (len(points) - 6)))
    return sol, np.linalg.inv(A.T @ A) * scatter**2, scatter, s, np.stack([u, w, normal, m])


def _quadric(surface: Surface, patch: IntArray) -> tuple[Axis, int, float] | None:
    """Cylinder from the principal curvatures of a patch, and the scatter about the quadric; None if it looks flat."""
    got = _quadric_fit(surface, patch)
    if got is None:  # long strips: all points in two rings leave the curvature along the axis open
        return _from_normals(surface, patch)
    sol, C, scatter, s, (u, w, normal, m) = got
    values, vectors = np.linalg.eigh(np.array([[2.0 * sol[3], sol[4]], [sol[4], 2.0 * sol[5]]]) / s**2)
    big = int(np.argmax(np.abs(values)))
    doubt = 2.0 * float(np.sqrt(C[3:, 3:].diagonal().max())) / s**2
    if abs(values[big]) < 6.0 * doubt or abs(values[big]) * surface.extent < 0.05:
        return None
    if abs(values[1 - big]) > 0.15 * abs(values[big]) + 4.0 * doubt:  # curved both ways
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
    vectors = np.linalg.eigh((N * surface.areas[patch][:, None]).T @ N)[1]
    d = vectors[:, 0]
    u, w = perpendicular(d)
    points = surface.V[np.unique(surface.F[patch])]
    flat = np.column_stack([points @ u, points @ w])
    got = circle(flat)
    if got is None:
        return None
    centre, radius = got
    axis = Axis(centre[0] * u + centre[1] * w, d, radius)
    lean = np.einsum("ij,ij->i", N, axis.radial(surface.centres[patch])[0]) @ surface.areas[patch]
    scatter = float(np.sqrt(np.mean((np.hypot(*(flat - centre).T) - radius) ** 2)))
    reach = min(float(np.ptp((flat - flat.mean(axis=0)) @ _tangent(flat, centre))) / radius, np.pi)
    if sagitta(radius, reach) < 6.0 * scatter:
        return None
    return axis, 1 if lean > 0.0 else -1, scatter


def _tangent(flat: Array, centre: Array) -> Array:
    """Unit vector (2,) along the arc at the middle of the points ``flat`` (n, 2) about ``centre``."""
    out = flat.mean(axis=0) - centre
    size = float(np.linalg.norm(out))
    return np.array([-out[1], out[0]]) / size if size > 0.0 else np.array([1.0, 0.0])
