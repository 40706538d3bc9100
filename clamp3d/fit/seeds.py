"""Where cylinders are looked for on a mesh: at the strips of an exact tessellation, and at patches of any other.

*Strips*: a tessellated cylinder consists of planar strips whose vertices lie on the surface; two neighbouring strips
give the axis (their common edge) and the circle exactly, however coarse. *Patches*: on dense or scanned meshes the
direction that the normals of a patch avoid most and the circle through its points seen along it give a first cylinder,
which least squares refine; patches grow until the curvature stands out of the noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial import cKDTree

from clamp3d.fit.axis import Axis, perpendicular
from clamp3d.fit.cylinder import axis_along, fit_axis
from clamp3d.fit.grow import Region, Search, accept, grow
from clamp3d.fit.surface import MAX_FACET, BoolArray, Surface
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.profile import sagitta

_PATCH_SIZES = (24, 96, 384, 1536)  # fourfold: twice as wide, so an arc is four times as high over its chord
_GATES = tuple(np.radians(a) for a in (12.0, 25.0, 46.0))
"""Bends (rad) within a patch: fine meshes first, then up to `MAX_FACET`."""
_LEAST = 8
"""Fewest triangles of a patch: flat sides and what was found before leave fewer of a CAD mesh."""
_MAX_SEEDS = 250  # chosen, against minutes on free forms


def strips(search: Search, progress: Callable[[str, float], None]) -> Iterator[Region]:
    """Cylinders of an exact tessellation among the free faces; the caller takes what is found off them."""
    surface, cells, floor = search.surface, search.cells, search.floor
    V = surface.V
    split = cells[surface.pairs[:, 0]] != cells[surface.pairs[:, 1]]
    ridge = split & (surface.step > floor) & (surface.bend > 1e-5) & (surface.bend < MAX_FACET)
    # A whole strip has four corners, so two triangles at least: this spares dense meshes the search.
    ridge &= (np.bincount(cells)[cells[surface.pairs]] >= 2).all(axis=1)
    order = np.flatnonzero(ridge)
    if len(order) == 0:
        return
    # Lines: edges of planar cells, creases and the mesh's rim included, for they bound the last strips.
    ends = np.concatenate([surface.edges[split], surface.rim])
    cell = np.concatenate([cells[surface.pairs[split]], cells[surface.rim_faces][:, None].repeat(2, axis=1)])
    vector = V[ends[:, 1]] - V[ends[:, 0]]
    vector /= np.maximum(np.linalg.norm(vector, axis=1), 1e-300)[:, None]
    members = _groups(np.arange(len(cells)), cells)
    lines = _groups(np.tile(np.arange(len(ends)), 2), cell.T.reshape(-1))
    fails = np.zeros(cells.max() + 1, dtype=np.int64)
    for n, k in enumerate(order):
        if n % 50 == 0:
            progress("strips", n / len(order))
        i, j = surface.pairs[k]
        a, b = cells[i], cells[j]
        if not (search.free[i] and search.free[j]) or fails[a] > 2 or fails[b] > 2:
            continue
        fails[[a, b]] += 1
        d = V[surface.edges[k, 1]] - V[surface.edges[k, 0]]
        d /= np.linalg.norm(d)
        # Lines along the axis: the corners of the strips; what else they have (a split strip) lies on chords.
        own = np.concatenate([lines[a], lines[b]])
        corners = np.unique(ends[own[np.abs(vector[own] @ d) > 0.9999]])
        axis = axis_along(d, V[corners])
        # Slack for the axis: a direction from one edge is only as good as its ends.
        loose = 3.0 * floor
        if axis is None or axis.radius > 20.0 * surface.extent or np.abs(axis.residual(V[corners])).max() > loose:
            continue
        sign = 1 if surface.lean(axis, np.array([i]))[0] > 0.0 else -1
        region = grow(search, axis, sign, np.concatenate([members[a], members[b]]), loose)
        if region is None or region.tolerance > 4.0 * floor:
            continue
        if accept(search, region):
            yield region
        else:  # its other strips would only grow the same again
            fails[np.unique(cells[region.faces])] += 3


def _groups(values: IntArray, label: IntArray) -> dict[int, IntArray]:
    """``values`` (n,) by their ``label`` (n,)."""
    order = np.argsort(label, kind="stable")
    names, start = np.unique(label[order], return_index=True)
    return {int(k): v for k, v in zip(names, np.split(values[order], start[1:]), strict=True)}


def patches(search: Search, progress: Callable[[str, float], None]) -> Iterator[Region]:
    """Cylinders among the free faces, seeded all over; the caller takes what is found off them."""
    surface, free, cells = search.surface, search.free, search.cells
    seeds = free & (np.bincount(cells)[cells] <= 4)
    gates = [surface.labels(surface.bend < g) for g in _GATES]
    widest = gates[-1]
    if not (seeds & (np.bincount(widest[free], minlength=len(seeds))[widest] >= _LEAST)).any():
        return
    tree = cKDTree(surface.centres)
    rng = np.random.default_rng(0)
    order = rng.permutation(np.flatnonzero(seeds))
    limit = 2.0 * _noise(surface, tree, rng.permutation(len(surface.F))[:150])
    tried = 0
    for n, start in enumerate(order):
        if not (seeds[start] and free[start]):
            continue
        tried += 1
        if tried > _MAX_SEEDS:
            return
        progress("patches", n / len(order))
        nearest = _nearest(surface, tree, start, _PATCH_SIZES[-1])
        facing = nearest[free[nearest] & ((surface.normals[nearest] @ surface.normals[start]) > 0.5)]
        region = _from_patches(search, [facing[label[facing] == label[start]] for label in gates], limit, seeds)
        if region is None:
            seeds[nearest[: _PATCH_SIZES[0] // 2]] = False
        else:
            yield region


def _nearest(surface: Surface, tree: cKDTree, start: int, count: int) -> IntArray:
    return np.atleast_1d(tree.query(surface.centres[start], k=min(count, len(surface.F)))[1])


def _from_patches(search: Search, same: list[IntArray], limit: float, seeds: BoolArray) -> Region | None:
    """Region grown from the least patch that is round; ``same``: a seed's neighbours, nearest first, by each gate."""
    surface = search.surface
    for k, near in enumerate(same):
        if len(near) < _LEAST or (k and len(near) == len(same[k - 1])):
            continue
        for size in sorted({min(size, len(near)) for size in _PATCH_SIZES}):
            patch = near[:size]
            guess = _from_normals(surface, patch)
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
    """Scatter (mm) of this mesh's vertices about quadrics: the median over small patches at the faces ``sample``.

    Without it the rounded edges of a scan pass as badly fitting cylinders.
    """
    scatters = []
    for start in sample:
        patch = _nearest(surface, tree, start, _PATCH_SIZES[0])
        patch = patch[(surface.normals[patch] @ surface.normals[start]) > 0.5]
        points = surface.V[np.unique(surface.F[patch])] - surface.centres[start]
        if len(points) < 9:
            continue
        normal = surface.normals[start]
        x, y = (points @ np.stack(perpendicular(normal), axis=1)).T / np.abs(points).max()
        A = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        left = points @ normal - A @ np.linalg.lstsq(A, points @ normal, rcond=0.01)[0]
        scatters.append(float(np.sqrt((left @ left) / (len(points) - 6))))
    if len(scatters) < 20:
        return np.inf
    return float(np.median(scatters)) + 0.003 * float(np.sqrt(np.median(surface.areas[sample])))


def _from_normals(surface: Surface, patch: IntArray) -> tuple[Axis, int, float] | None:
    """Cylinder whose axis is the direction that a patch's normals avoid most, its sense, and the scatter about it.

    None where the patch looks flat.
    """
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
