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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from clamp3d.fit.cylinder import Axis, circle, fit_axis, perpendicular
from clamp3d.fit.mesh_file import Mesh

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

MAX_FACET = np.radians(46.0)
"""Widest facet of a tessellated cylinder: an octagon counts as round, a hexagon (a nut, a bolt head) does not."""
MIN_LINES = 4
"""Fewest lines on a surface: three always lie on some circle (a trapezoid or V groove is not an arc)."""
_PATCH_SIZES = (24, 96, 384, 1536)
_GATES = tuple(np.radians(a) for a in (12.0, 25.0, 46.0))
_MAX_SEEDS = 250


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


class Surface:
    """A mesh with what region growing asks for: normals, areas, neighbours, coplanar cells."""

    def __init__(self, mesh: Mesh) -> None:
        import trimesh

        self.mesh = mesh
        self.V, self.F = mesh.vertices, mesh.faces
        tm = trimesh.Trimesh(self.V, self.F, process=False)
        self.normals = np.asarray(tm.face_normals)
        self.areas = np.asarray(tm.area_faces)
        self.centres = np.asarray(tm.triangles_center)
        self.pairs = np.asarray(tm.face_adjacency, dtype=np.int64).reshape(-1, 2)
        self.edges = np.asarray(tm.face_adjacency_edges, dtype=np.int64).reshape(-1, 2)
        n1, n2 = self.normals[self.pairs[:, 0]], self.normals[self.pairs[:, 1]]
        self.bend = np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), np.einsum("ij,ij->i", n1, n2))
        sides = np.sort(self.F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, first, count = np.unique(sides[:, 0] * len(self.V) + sides[:, 1], return_index=True, return_counts=True)
        self.rim, self.rim_faces = sides[first[count == 1]], first[count == 1] // 3
        opposite = np.asarray(tm.face_adjacency_unshared, dtype=np.int64).reshape(-1, 2)
        # Off-plane distance of each far corner: unlike an angle it does not blow up on slivers.
        on_edge = self.V[self.edges[:, 0]]
        self.step = np.maximum(
            np.abs(np.einsum("ij,ij->i", self.V[opposite[:, 1]] - on_edge, n1)),
            np.abs(np.einsum("ij,ij->i", self.V[opposite[:, 0]] - on_edge, n2)),
        )
        self.valence = np.bincount(self.F.reshape(-1), minlength=len(self.V))
        self.extent = float(np.ptp(self.V[np.unique(self.F)], axis=0).max())
        self.floor = max(4.0 * mesh.rounding, 1e-9 * self.extent)

    def labels(self, keep: BoolArray) -> IntArray:
        """Component (m,) of each face when only the neighbour pairs ``keep`` (p,) connect."""
        p = self.pairs[keep]
        graph = coo_array((np.ones(len(p), dtype=np.int8), (p[:, 0], p[:, 1])), shape=(len(self.F),) * 2)
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    def cells(self, tolerance: float) -> IntArray:
        """Label (m,) of the planar cell of each face; neighbours within ``tolerance`` of one plane share a cell."""
        return self.labels((self.step <= tolerance) & (self.bend < MAX_FACET))


def facet_span(surface: Surface, axis: Axis, faces: IntArray, cells: IntArray) -> Array:
    """Angle (rad) about the axis of each planar cell that has some of ``faces``, counting those faces only."""
    u, w = perpendicular(axis.direction)
    p = surface.V[surface.F[faces]] - axis.point
    angle = np.arctan2(p @ w, p @ u)
    _, first, cell = np.unique(cells[faces], return_index=True, return_inverse=True)
    base = angle[first, 0][cell][:, None]
    turned = (angle - base + np.pi) % (2.0 * np.pi) - np.pi
    low, high = np.zeros(len(first)), np.zeros(len(first))
    np.minimum.at(low, cell, turned.min(axis=1))
    np.maximum.at(high, cell, turned.max(axis=1))
    return np.asarray(high - low)


def sagitta(radius: float, span: float) -> float:
    """Distance between an arc of ``span`` rad and its chord."""
    return float(2.0 * radius * np.sin(0.25 * span) ** 2)


def _grow(
    surface: Surface,
    free: BoolArray,
    cells: IntArray,
    axis: Axis,
    sign: int,
    seed: IntArray,
    tolerance: float,
    floor: float,
    *,
    strips: bool,
) -> Region | None:
    """Grow from ``seed`` faces, refit, and repeat until the faces no longer change."""
    # Voxel and remeshed surfaces put their vertices off by a good part of the facets' sagitta.
    share = 0.0 if strips else 0.3
    V, F = surface.V, surface.F
    faces = seed
    points = np.unique(F[seed])
    span = float(facet_span(surface, axis, seed, cells).max())
    for _ in range(12):
        if not 0.0 < axis.radius < 20.0 * surface.extent or span > MAX_FACET:
            return None
        off = axis.residual(V)
        depth = sagitta(axis.radius, span)
        tolerance = max(tolerance, share * depth)
        near = (off <= tolerance) & (off >= -1.02 * depth - tolerance)
        lean = np.einsum("ij,ij->i", surface.normals[faces], axis.radial(surface.centres[faces])[0])
        slack = float(np.quantile(np.arccos(np.clip(sign * lean, -1.0, 1.0)), 0.9))
        limit = np.cos(min(max(0.6 * span, 2.5 * slack, 0.02), 0.7))
        mask: BoolArray = free & np.asarray(near[F].all(axis=1))
        index = np.flatnonzero(mask)
        radial = axis.radial(surface.centres[index])[0]
        mask[index] = sign * np.einsum("ij,ij->i", surface.normals[index], radial) >= limit
        if not mask[faces].any():
            return None
        label = surface.labels(np.asarray(mask[surface.pairs].all(axis=1)))
        inside = faces[mask[faces]]
        names, where = np.unique(label[inside], return_inverse=True)
        main = names[np.argmax(np.bincount(where, weights=surface.areas[inside]))]
        grown = np.flatnonzero(mask & (label == main))
        settled = len(grown) == len(faces) and bool((grown == faces).all())
        faces = grown
        points = _support(surface, faces, np.abs(off) <= tolerance)
        if len(points) < 6:
            return None
        better = fit_axis(V[points], axis)
        if better is None:
            return None
        axis = better
        tolerance = max(floor, _tolerance(axis.residual(V[points])))
        span = float(facet_span(surface, axis, faces, cells).max())
        if settled:
            break
    corners = np.unique(F[faces])
    if len(points) < len(corners) <= min(60, 1.25 * len(points)):
        # Scatter can look like points on chords: if all points make one consistent surface, none was.
        whole = fit_axis(V[corners], axis)
        if whole is not None:
            res = whole.residual(V[corners])
            wider = max(floor, _tolerance(res))
            if wider <= 3.0 * tolerance and float(np.abs(res).max()) <= wider:
                axis, points, tolerance = whole, corners, wider
    return Region(axis, sign, faces, points, tolerance, span, strips)


def _tolerance(residual: Array) -> float:
    """Distance that a vertex with the scatter of ``residual`` (n,) exceeds as rarely as four normal deviations.

    The scatter is the median one, so a few strays do not widen it; five fitted parameters and few points do.
    """
    n = len(residual)
    freedom = max(n - 5, 1)
    scatter = 1.4826 * float(np.median(np.abs(residual)))
    if n < 60:  # the median of few is too rough
        scatter = max(scatter, float(np.sqrt(np.mean(residual**2))))
    scatter *= np.sqrt(n / freedom)
    return float(scatter * stats.t.isf(3.2e-5, min(freedom, 1000)))


def _support(surface: Surface, faces: IntArray, on: BoolArray) -> IntArray:
    """Vertices (k,) of ``faces`` that the fit may use: those ``on`` the surface, which leaves out points on chords.

    On a dense mesh only those with all their faces in the region: the border is chosen by the fit itself.
    """
    inside = np.bincount(surface.F[faces].reshape(-1), minlength=len(surface.V))
    keep = np.flatnonzero((inside > 0) & on)
    inner = keep[inside[keep] == surface.valence[keep]]
    return np.asarray(inner if len(inner) >= max(50, 0.6 * len(keep)) else keep)


def find_regions(surface: Surface, progress: Callable[[str, float], None] | None = None) -> list[Region]:
    """All cylinders on the mesh, none overlapping; ``progress(stage, fraction)`` is called as it goes."""
    free = np.ones(len(surface.F), dtype=bool)
    found: list[Region] = []
    tell = progress or (lambda stage, fraction: None)
    for floor in (surface.floor, 40.0 * max(surface.mesh.rounding, surface.extent * 2.0**-24)):
        cells = surface.cells(floor)
        for region in _strips(surface, free, cells, floor, tell):
            free[region.faces] = False
            found.append(region)
    cells = surface.cells(surface.floor)
    for region in _patches(surface, free, cells, tell):
        free[region.faces] = False
        found.append(region)
    return found


def _strips(
    surface: Surface, free: BoolArray, cells: IntArray, floor: float, tell: Callable[[str, float], None]
) -> Iterator[Region]:
    V, F = surface.V, surface.F
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
    members = _groups(np.arange(len(F)), cells)
    lines = _groups(np.tile(np.arange(len(ends)), 2), cell.T.reshape(-1))
    fails = np.zeros(cells.max() + 1, dtype=np.int64)
    for n, k in enumerate(order):
        if n % 50 == 0:
            tell("strips", n / len(order))
        i, j = surface.pairs[k]
        a, b = cells[i], cells[j]
        if not (free[i] and free[j]) or fails[a] > 2 or fails[b] > 2:
            continue
        fails[[a, b]] += 1
        d = V[surface.edges[k, 1]] - V[surface.edges[k, 0]]
        d /= np.linalg.norm(d)
        # Lines along the axis: the corners of the strips; what else they have (a split strip) lies on chords.
        own = np.concatenate([lines[a], lines[b]])
        own = own[np.abs(vector[own] @ d) > 0.9999]
        corners = np.unique(ends[own])
        u, w = perpendicular(d)
        flat = np.column_stack([V[corners] @ u, V[corners] @ w])
        got = circle(flat)
        if got is None:
            continue
        centre, radius = got
        # Slack for the axis: a direction from one edge is only as good as its ends.
        loose = 3.0 * floor
        if radius > 20.0 * surface.extent or np.abs(np.hypot(*(flat - centre).T) - radius).max() > loose:
            continue
        axis = Axis(centre[0] * u + centre[1] * w, d, radius)
        # Two strips always lie on a circle: a third one must agree before the dear growing starts.
        beyond = np.setdiff1d(cell[own], (a, b))
        third = np.concatenate([lines[c] for c in beyond]) if len(beyond) else np.empty(0, dtype=np.int64)
        far = ends[np.setdiff1d(third[np.abs(vector[third] @ d) > 0.9999], own)]
        if not (np.abs(axis.residual(V[far.reshape(-1)])).reshape(-1, 2) <= 4.0 * loose).all(axis=1).any():
            continue
        seed = np.concatenate([members[a], members[b]])
        sign = 1 if surface.normals[i] @ axis.radial(surface.centres[i : i + 1])[0][0] > 0.0 else -1
        region = _grow(surface, free, cells, axis, sign, seed, loose, floor, strips=True)
        if region is None or region.tolerance > 4.0 * floor:
            continue
        if _accept(surface, cells, region):
            yield region
        else:  # its other strips would only grow the same again
            fails[np.unique(cells[region.faces])] += 3


def _groups(values: IntArray, label: IntArray) -> dict[int, IntArray]:
    """``values`` (n,) by their ``label`` (n,)."""
    order = np.argsort(label, kind="stable")
    names, start = np.unique(label[order], return_index=True)
    return {int(k): v for k, v in zip(names, np.split(values[order], start[1:]), strict=True)}


def _patches(
    surface: Surface, free: BoolArray, cells: IntArray, tell: Callable[[str, float], None]
) -> Iterator[Region]:
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
            region = _grow(surface, free, cells, axis, sign, patch, tolerance, surface.floor, strips=False)
            if region is None or len(region.faces) < 0.7 * len(patch):
                continue
            if not _accept(surface, cells, region):  # every seed within would grow the same again
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


def _accept(surface: Surface, cells: IntArray, region: Region) -> bool:
    """True if the region is long, round and distinct enough to be a cylinder rather than an accident."""
    V, F = surface.V, surface.F
    axis = region.axis
    u, w = perpendicular(axis.direction)
    p = V[region.points] - axis.point
    angle = np.sort(np.arctan2(p @ w, p @ u))
    gaps = np.diff(angle, append=angle[0] + 2.0 * np.pi)
    arc = 2.0 * np.pi - float(gaps.max())
    noise = max(region.tolerance / 4.0, 1e-12)
    lines = int((gaps > 1e-3 * max(arc, 1e-9)).sum())
    spans = facet_span(surface, axis, region.faces, cells)
    if lines < MIN_LINES:
        return False
    # Every trapezoid with equal flanks lies on a circle: with three facets ask for three equal ones.
    if lines == MIN_LINES and (spans.max() > 1.02 * spans.min() or spans.max() > np.radians(30.0)):
        return False
    if 2.0 * axis.radius * np.sin(0.25 * arc) ** 2 < 6.0 * noise or arc < 2.0 * float(np.median(spans)):
        return False
    z = (V[np.unique(F[region.faces])] - axis.point) @ axis.direction
    length = float(np.ptp(z))
    if _runs_on(surface, region, length):
        return False
    p = p @ np.stack([u, w, axis.direction], axis=1)
    if _bent(p, axis.residual(V[region.points]), axis.radius):
        return False
    return len(region.points) >= 8 and length > 0.0


def _bent(local: Array, residual: Array, radius: float) -> bool:
    """True if a loose fit (over 1 % of the radius) is loose because the shape is bent, oval or a barrel.

    Points ``local`` (n, 3) in the cylinder's own frame. Scatter leaves nothing for a smooth second-order correction to
    explain; another shape lets it explain more than half.
    """
    power = float(residual @ residual)
    if np.sqrt(power / len(residual)) <= 0.01 * radius or len(residual) < 12:
        return False
    r = np.hypot(local[:, 0], local[:, 1])
    x, y, z = local[:, 0] / r, local[:, 1] / r, local[:, 2] - local[:, 2].mean()
    A = np.column_stack([np.ones_like(x), x, y, z, z * x, z * y, z * z, z * z * x, z * z * y, x * y, x * x])
    left = residual - A @ np.linalg.lstsq(A, residual, rcond=1e-9)[0]
    return float(left @ left) / power < 0.5 - 5.0 / len(residual)


def _runs_on(surface: Surface, region: Region, length: float) -> bool:
    """True if the surface goes on smoothly past both round ends with bands as long: a ring of a sphere or torus."""
    inside = np.zeros(len(surface.F), dtype=bool)
    inside[region.faces] = True
    first, second = inside[surface.pairs].T
    border = first != second
    ends = surface.V[surface.edges[border]] @ region.axis.direction
    run = np.linalg.norm(np.diff(surface.V[surface.edges[border]], axis=1)[:, 0], axis=1)
    across = np.abs(ends[:, 1] - ends[:, 0]) < 0.5 * run
    z = ends.mean(axis=1)
    z = z - 0.5 * (z.min() + z.max()) if len(z) else z
    smooth = surface.bend[border] < 1.5 * region.span
    outside = np.where(first, surface.pairs[:, 1], surface.pairs[:, 0])[border]
    band = np.ptp(surface.V[surface.F[outside]] @ region.axis.direction, axis=1)
    both = [across & (z > 0.0), across & (z < 0.0)]
    return all(bool(e.any() and smooth[e].mean() > 0.7 and np.median(band[e]) > 0.3 * length) for e in both)
