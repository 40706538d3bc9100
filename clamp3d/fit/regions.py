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

import numpy as np

from clamp3d.core.linear import dot, norm
from clamp3d.core.mesh import IntArray
from clamp3d.fit.cylinder import axis_along
from clamp3d.fit.grow import Region, Search, accept, grow
from clamp3d.fit.patches import patches
from clamp3d.fit.surface import MAX_FACET, Surface


def find_regions(surface: Surface, progress: Callable[[str, float], None] | None = None) -> list[Region]:
    """All cylinders on the mesh, none overlapping; ``progress(stage, fraction)`` is called as it goes."""
    free = np.ones(len(surface.F), dtype=bool)
    found: list[Region] = []
    coarse = 40.0 * max(surface.mesh.rounding, surface.extent * 2.0**-24)
    for floor, seeds in ((surface.floor, strips), (coarse, strips), (surface.floor, patches)):
        search = Search(surface, free, surface.cells(floor), floor, seeds is strips)
        for region in seeds(search, progress or (lambda stage, fraction: None)):
            free[region.faces] = False
            found.append(region)
    return found


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
        d /= norm(d)
        # Lines along the axis: the corners of the strips; what else they have (a split strip) lies on chords.
        own = np.concatenate([lines[a], lines[b]])
        own = own[np.abs(dot(vector[own], d)) > 0.9999]
        corners = np.unique(ends[own])
        axis = axis_along(d, V[corners])
        # Slack for the axis: a direction from one edge is only as good as its ends.
        loose = 3.0 * floor
        if axis is None or axis.radius > 20.0 * surface.extent or np.abs(axis.residual(V[corners])).max() > loose:
            continue
        # Two strips always lie on a circle: a third one must agree before the expensive growing starts.
        beyond = np.setdiff1d(cell[own], (a, b))
        third = np.concatenate([lines[c] for c in beyond]) if len(beyond) else np.empty(0, dtype=np.int64)
        far = ends[np.setdiff1d(third[np.abs(dot(vector[third], d)) > 0.9999], own)]
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


def _groups(values: IntArray, label: IntArray) -> dict[int, IntArray]:
    """``values`` (n,) by their ``label`` (n,)."""
    order = np.argsort(label, kind="stable")
    names, start = np.unique(label[order], return_index=True)
    return {int(k): v for k, v in zip(names, np.split(values[order], start[1:]), strict=True)}
