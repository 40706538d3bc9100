"""Region growing: which triangles belong to one circular cylinder.

Two kinds of seed feed one growing rule. *Strips*: a tessellated cylinder consists of planar strips whose vertices lie
on the surface; two neighbouring strips give the axis (cross product of their normals) and the circle exactly, however
coarse. *Patches*: on dense or scanned meshes a quadric through a patch gives the principal curvatures, which a
least-squares cylinder refines; patches grow until the curvature stands out of the noise.

A triangle belongs to a cylinder if its vertices lie on the surface within the tolerance (or inside it by no more than
the sagitta of the region's facets: cuts end on chords, not on the arc) and its normal is radial within half a facet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np

from clamp3d.core.mesh import IntArray
from clamp3d.core.profile import sagitta
from clamp3d.fit.cylinder import Axis, axis_along, fit_axis, perpendicular
from clamp3d.fit.grow import Region, Search, accept, grow
from clamp3d.fit.measure import arc
from clamp3d.fit.patches import patches
from clamp3d.fit.surface import MAX_FACET, Surface


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


def strips(search: Search, tell: Callable[[str, float], None]) -> Iterator[Region]:
    """Cylinders of an exact tessellation among the free faces; the caller takes what is found off them."""
    surface, cells, floor = search.surface, search.cells, search.floor
    V = surface.V
    ridge = (surface.step > floor) & (surface.bend > 1e-5) & (surface.bend < MAX_FACET)
    ridge &= cells[surface.pairs[:, 0]] != cells[surface.pairs[:, 1]]
    # A whole strip has four corners, so two triangles at least: this spares dense meshes the search.
    ridge &= (np.bincount(cells)[cells[surface.pairs]] >= 2).all(axis=1)
    order = np.flatnonzero(ridge)
    if len(order) == 0:
        return
    # Lines: edges of planar cells, creases and the mesh's rim included, for they bound the last strips.
    split = cells[surface.pairs[:, 0]] != cells[surface.pairs[:, 1]]
    ends = np.concatenate([surface.edges[split], surface.rim])
    cell = np.concatenate([cells[surface.pairs[split]], cells[surface.rim_faces][:, None].repeat(2, axis=1)])
    vector = V[ends[:, 1]] - V[ends[:, 0]]
    vector /= np.maximum(np.linalg.norm(vector, axis=1), 1e-300)[:, None]
    members = _groups(np.arange(len(cells)), cells)
    lines = _groups(np.tile(np.arange(len(ends)), 2), cell.T.reshape(-1))
    fails = np.zeros(cells.max() + 1, dtype=np.int64)
    for n, k in enumerate(order):
        if n % 50 == 0:
            tell("strips", n / len(order))
        i, j = surface.pairs[k]
        a, b = cells[i], cells[j]
        if not (search.free[i] and search.free[j]) or fails[a] > 2 or fails[b] > 2:
            continue
        fails[[a, b]] += 1
        d = V[surface.edges[k, 1]] - V[surface.edges[k, 0]]
        d /= np.linalg.norm(d)
        # Lines along the axis: the corners of the strips; what else they have (a split strip) lies on chords.
        own = np.concatenate([lines[a], lines[b]])
        own = own[np.abs(vector[own] @ d) > 0.9999]
        corners = np.unique(ends[own])
        axis = axis_along(d, V[corners])
        # Slack for the axis: a direction from one edge is only as good as its ends.
        loose = 3.0 * floor
        if axis is None or axis.radius > 20.0 * surface.extent or np.abs(axis.residual(V[corners])).max() > loose:
            continue
        # Two strips always lie on a circle: a third one must agree before the expensive growing starts.
        beyond = _others(cell[own], np.array([a, b]))
        third = np.concatenate([lines[c] for c in beyond]) if len(beyond) else np.empty(0, dtype=np.int64)
        far = ends[_others(third[np.abs(vector[third] @ d) > 0.9999], own)]
        if not (np.abs(axis.residual(V[far.reshape(-1)])).reshape(-1, 2) <= 4.0 * loose).all(axis=1).any():
            continue
        seed = np.concatenate([members[a], members[b]])
        sign = 1 if surface.lean(axis, np.array([i]))[0] > 0.0 else -1
        region = grow(search, axis, sign, seed, loose)
        if region is None or region.tolerance > 4.0 * floor:
            continue
        if accept(search, region):
            yield region
        else:  # its other strips would only grow the same again
            fails[np.unique(cells[region.faces])] += 3


def _others(values: IntArray, excluded: IntArray) -> IntArray:
    """What is in ``values`` (n,) and not ``excluded`` (k,), once each and sorted."""
    regions_so_far = np.unique(values)
    return regions_so_far[~np.isin(regions_so_far, excluded)]


def _groups(values: IntArray, label: IntArray) -> dict[int, IntArray]:
    """``values`` (n,) by their ``label`` (n,)."""
    order = np.argsort(label, kind="stable")
    names, start = np.unique(label[order], return_index=True)
    return {int(k): v for k, v in zip(names, np.split(values[order], start[1:]), strict=True)}


def join(surface: Surface, regions: list[Region]) -> list[Region]:
    """Join pieces of one cylinder that a cut, a crack or a hole parts, if one fit holds for both and they are close."""
    regions = list(regions)
    while True:
        for i, j in combinations(range(len(regions)), 2):
            both = _joined(surface, regions[i], regions[j])
            if both is not None:
                regions[i] = both
                del regions[j]
                break
        else:
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
    if axis is None:
        return None
    if any(np.quantile(np.abs(axis.residual(V[region.points])), 0.9) > tolerance for region in (a, b)):
        return None
    # Far apart along the axis they are two features: one groove would claim material where there is none.
    gap, length, shorter = _along(surface, axis, a.faces, b.faces)
    if gap > 0.25 * shorter:
        return None
    faces = np.concatenate([a.faces, b.faces])
    half = arc(surface, axis, *perpendicular(axis.direction), faces)[1]
    if float(surface.areas[faces].sum()) < 0.5 * 2.0 * half * axis.radius * length:
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
