"""One triangle mesh for everything: checked, cleaned, oriented outward, in millimetres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d import checks
from clamp3d.errors import InputError
from clamp3d.geometry.manifolds import arrays_of, as_manifold
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shells import inside_out, joined, sampled, shells, volume, winding_numbers
from clamp3d.geometry.triangles import normals_and_areas

IntArray = NDArray[np.int64]

LARGEST, SMALLEST = 1e12, 1e-9
"""Largest coordinate and least extent in mm: beyond them products of three lengths lose their digits or vanish."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A checked triangle mesh, wound outward, equal vertices merged.

    Attributes
    ----------
    name : str
        Name for messages.
    vertices : ndarray of shape (n, 3)
        Coordinates in mm.
    faces : ndarray of shape (m, 3)
        Vertices of each triangle.
    watertight : bool
        Whether every edge has two triangles, which run along it in opposite directions.
    rounding : float
        Largest error in mm of a vertex from the number format.
    notes : tuple of str
        What was repaired or assumed on the way in.
    """

    name: str
    vertices: Array = field(repr=False)
    faces: IntArray = field(repr=False)
    watertight: bool
    rounding: float
    notes: tuple[str, ...] = ()

    @property
    def slivers(self) -> NDArray[np.bool_]:
        """Triangles (m,) without a normal: no higher than the rounding of their corners."""
        return slivers_of(self.vertices, self.faces, 4.0 * self.rounding)

    def crosses_itself(self) -> bool:
        """Whether triangles reach through each other, by more than the rounding of their corners."""
        import igl.predicates

        V, F = np.ascontiguousarray(self.vertices), np.ascontiguousarray(self.faces)
        _, pairs, _ = igl.predicates.find_self_intersections(V, F, False)
        through = np.full(len(pairs), np.inf)
        for own, other in (pairs.T, pairs.T[::-1]):  # some that are listed do no more than touch
            corners = V[F[other]]
            height = np.einsum("kij,kj->ki", V[F[own]] - corners[:, :1], normals_and_areas(corners)[0])
            through = np.minimum(through, np.minimum(height.max(axis=1), -height.min(axis=1)))
        return bool((through > 4.0 * self.rounding).any())


def make_mesh(
    vertices: ArrayLike, faces: ArrayLike, *, name: str = "mesh", scale: float = 1.0, float32: bool = False
) -> Mesh:
    """Check, clean and orient a mesh.

    Equal vertices are merged, triangles with two equal corners and doubled triangles dropped, windings made
    consistent and, on a closed mesh, outward, body by body. Slivers stay where they close a surface; of an open mesh
    they are dropped.

    Parameters
    ----------
    vertices : array_like of shape (n, 3)
        Coordinates.
    faces : array_like of shape (m, 3)
        Integer indices of each triangle's vertices.
    name : str
        Name for messages.
    scale : float
        Millimetres in one unit of the coordinates.
    float32 : bool
        Whether the coordinates passed through single precision; so they have if their type says so.

    Returns
    -------
    Mesh
        The mesh in mm; its ``notes`` say what was repaired.

    Raises
    ------
    InputError
        For wrong shapes, numbers that are not finite, indices out of range, no triangle left, or a closed surface
        without a volume.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> make_mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).watertight
    True
    """
    checks.text("name of a mesh", name)
    scale, float32 = checks.positive("scale", scale), checks.flag("float32", float32)
    float32 = float32 or getattr(vertices, "dtype", None) == np.float32
    V, F = _arrays(vertices, faces, name, scale)
    rounding = float(np.abs(V).max()) * (2.0**-24 if float32 else 2.0**-50)
    notes: list[str] = []
    V, F = _merge(V, F, max(4.0 * rounding, 1e-9 * _extent(V, name)), name)
    V, F = _cleaned(V, F, rounding, name, notes)
    F = _one_winding(V, F, notes)
    watertight, fault = _closure(V, F)
    if fault:
        notes.append(fault)
    if watertight:
        F = _outward(V, F, notes)
        V, F = _united(V, F, notes, pinched=bool(fault))
        if not volume(V, F) > 0.0:
            raise InputError(f"{name}: the surface encloses no volume")
    mesh = Mesh(name, V, F, watertight, rounding, tuple(notes))
    slivers = mesh.slivers
    if slivers.all():
        raise InputError(f"{name}: no triangle with an area")
    return mesh if watertight else replace(mesh, faces=F[~slivers])


def _extent(V: Array, name: str) -> float:
    """Largest extent in mm. Raises InputError if it is too small for a mesh."""
    extent = float(np.ptp(V, axis=0).max())
    if extent <= 0.0:
        raise InputError(f"{name}: all vertices lie in one point")
    if extent < SMALLEST:
        raise InputError(f"{name}: extent must be >= {SMALLEST:g} mm, got {extent:.3g} mm; is the unit right?")
    return extent


def _used(V: Array, F: IntArray) -> tuple[Array, IntArray]:
    """The vertices that faces use, and the faces by their new numbers."""
    used, index = np.unique(F, return_inverse=True)
    return V[used], index.reshape(-1, 3).astype(np.int64)


def _cleaned(V: Array, F: IntArray, rounding: float, name: str, notes: list[str]) -> tuple[Array, IntArray]:
    """The mesh without folded and doubled triangles, and without slivers that keep it open; ``notes`` say so."""
    F = F[(np.roll(F, 1, axis=1) != F).all(axis=1)]
    single = _without_doubles(F)
    if len(single) < len(F):
        notes.append(f"{len(F) - len(single)} doubled triangles left out")
    if len(single) == 0:
        raise InputError(f"{name}: no triangle with an area")
    thin = _in_the_way(V, single, rounding)
    if thin.any():
        notes.append(f"{int(thin.sum())} triangles without an area left out")
    return _used(V, single[~thin])


def _one_winding(V: Array, F: IntArray, notes: list[str]) -> IntArray:
    """The faces with one winding on each connected surface; ``notes`` say how many were turned."""
    _, uses, balance = _edges(F)
    if not balance[uses == 2].any():
        return F
    import igl

    oriented, patch = igl.bfs_orient(F)
    turned = (oriented != F).any(axis=1)
    turned ^= (np.bincount(patch, turned) > 0.5 * np.bincount(patch))[patch]  # the fewer triangles of a surface
    notes.append(f"{int(turned.sum())} triangles turned to one winding")
    return np.where(turned[:, None], F[:, ::-1], F)


def _outward(V: Array, F: IntArray, notes: list[str]) -> IntArray:
    """The faces of a closed mesh wound outward, body by body; ``notes`` say what was turned."""
    if volume(V, F) < 0.0:
        F = np.ascontiguousarray(F[:, ::-1])
        notes.append("inside out: all triangles turned")
    for rows in inside_out(V, F):
        F[rows] = F[rows][:, ::-1]
        notes.append(f"a body of {len(rows)} triangles inside out: turned")
    return F


def _united(V: Array, F: IntArray, notes: list[str], *, pinched: bool) -> tuple[Array, IntArray]:
    """A closed mesh without the walls between bodies that overlap or touch, which are no surface of what they make.

    ``pinched``: whether bodies share edges, so that they are one connected surface; then some may still be inside out.
    """
    connected = shells(F)
    if len(connected) == 1 and not pinched:
        return V, F
    import manifold3d

    surfaces = [as_manifold(*_used(V, F[rows])) for rows in connected]
    if pinched:  # only then, since it takes long for many bodies
        surfaces = [part for surface in surfaces for part in surface.decompose()]
    surfaces.sort(key=lambda surface: float(surface.volume()))
    solids = [surface for surface in surfaces if surface.volume() > 0.0]
    if len(surfaces) < 2 or any(surface.is_empty() for surface in surfaces):
        return V, F
    bodies = [*solids]
    for corners, triangles in map(arrays_of, surfaces[: len(surfaces) - len(solids)]):
        inside = as_manifold(corners, triangles[:, ::-1])
        k = _holder(bodies[: len(solids)], sampled(corners))
        if k is None:
            bodies.append(inside)
            notes.append(f"a body of {len(triangles)} triangles inside out: turned")
        else:  # a cavity
            bodies[k] -= inside
    if len(bodies) < 2:
        return V, F
    whole = manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)
    if whole.num_tri() == len(F) and np.isclose(whole.volume(), volume(V, F), rtol=1e-9):
        return V, F
    notes.append(f"{len(bodies)} bodies in the mesh, some of which overlap or touch: taken as one")
    return arrays_of(whole)


def _holder(bodies: Sequence[Any], points: Array) -> int | None:
    """The first of some bodies in which all points (k, 3) are, else that with most of them; None where no half is."""
    shares = np.zeros(len(bodies))
    for k, body in enumerate(bodies):
        if not body.is_empty():
            shares[k] = (winding_numbers(*arrays_of(body), points) > 0.5).mean()
        if shares[k] == 1.0:
            break
    return int(shares.argmax()) if shares.max(initial=0.0) > 0.5 else None


def closed_mesh(vertices: ArrayLike, faces: ArrayLike, name: str = "mesh") -> Mesh:
    """Take a closed mesh as it is, or refuse it: what `make_mesh` would have to repair.

    CoACD and FCL end the interpreter on some of what is refused here, and give a wrong answer without a word on the
    rest. The one thing that is mended: an STL gives every triangle corners of its own, so equal vertices become one
    where a mesh is open without that.

    Parameters
    ----------
    vertices, faces, name
        As for `make_mesh`; in mm.

    Returns
    -------
    Mesh
        A watertight mesh with read-only arrays of its own.

    Raises
    ------
    InputError
        As `make_mesh`; also for a mesh that is not closed, or that it would repair.

    Examples
    --------
    >>> tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> closed_mesh(tetrahedron, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).faces.shape
    (4, 3)
    """
    mesh = make_mesh(vertices, faces, name=name)
    if mesh.notes:
        raise InputError(f"{name} must be watertight and wound outward: {'; '.join(mesh.notes)}")
    V, F = _arrays(vertices, faces, name, 1.0)
    if not is_closed(F):
        V, F = mesh.vertices, mesh.faces
    V.flags.writeable = F.flags.writeable = False
    return Mesh(name, V, F, True, mesh.rounding)


def _arrays(vertices: ArrayLike, faces: ArrayLike, name: str, scale: float) -> tuple[Array, IntArray]:
    """Vertices (n, 3) in mm, those in use only, and faces (m, 3), m > 0, as arrays of their own."""
    V = checks.array(f"{name}: vertices", vertices, (None, 3), finite=False)
    try:
        F = np.asarray(faces)
    except (TypeError, ValueError, OverflowError, RecursionError):
        raise InputError(f"{name}: faces must be an array of integers with shape (m, 3)") from None
    if F.dtype.kind not in "iu" and F.size:
        raise InputError(f"{name}: faces must be integers, got {F.dtype}")
    if F.ndim != 2 or F.shape[1:] != (3,) or len(F) == 0:
        raise InputError(f"{name}: faces must have shape (m, 3), got {F.shape}")
    outside = (F < 0) | (len(V) <= F)
    if outside.any():
        raise InputError(f"{name}: face index {F[outside][0]} is out of range for {len(V)} vertices")
    used, index = np.unique(F, return_inverse=True)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        V = V[used] * scale
    wrong = ~(np.abs(V) <= LARGEST).all(axis=1)
    if wrong.any():
        k = int(wrong.argmax())
        raise InputError(f"{name}: vertex {used[k]} is not finite, or not within {LARGEST:g} mm: {V[k].tolist()}")
    return V, index.reshape(-1, 3).astype(np.int64)


def _merge(V: Array, F: IntArray, tolerance: float, name: str) -> tuple[Array, IntArray]:
    """Merge equal vertices and, where that leaves a surface open, those closer than ``tolerance`` (mm).

    By a tree, not a grid: a grid parts equal points at its lines. Raises InputError where what is merged is no point.
    """
    unique, inverse = np.unique(V, axis=0, return_inverse=True)
    F = inverse.reshape(-1)[F].astype(np.int64)
    if (_edges(F)[1] == 2).all():  # closed, whichever way its triangles are wound
        return unique, F
    from scipy.spatial import cKDTree

    label = joined(cKDTree(unique).query_pairs(tolerance, output_type="ndarray"), len(unique))
    keep, number = np.unique(label, return_inverse=True)
    if (np.abs(unique - unique[keep][number]) > 2.0 * tolerance).any():
        raise InputError(
            f"{name}: open, and vertices are as near to each other as its numbers are rounded ({tolerance:.2g} mm): "
            "move it nearer to the origin"
        )
    return unique[keep], number[F]


def slivers_of(V: Array, F: IntArray, height: float) -> NDArray[np.bool_]:
    """Faces (m,) that are no higher than ``height`` (mm) over their longest side."""
    corners = V[F]
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 2]), axis=1)
    return np.asarray(twice_area <= height * longest)


def _in_the_way(V: Array, F: IntArray, rounding: float) -> NDArray[np.bool_]:
    """Slivers (m,) on edges of an odd number of faces, if without them there are no such edges; else none."""
    thin = slivers_of(V, F, 4.0 * rounding)
    gone = np.zeros(len(F), dtype=bool)
    while not gone.all():
        rest = np.flatnonzero(~gone)
        edge, uses, _ = _edges(F[rest])
        odd = (uses % 2 == 1)[edge].reshape(-1, 3).any(axis=1)
        if not odd.any():
            return gone
        if not (odd & thin[rest]).any():
            break
        gone[rest[odd & thin[rest]]] = True
    return np.zeros(len(F), dtype=bool)


def appended(vertices: Sequence[Array], faces: Sequence[IntArray]) -> tuple[Array, IntArray]:
    """Meshes with ``vertices`` (n, 3) and ``faces`` (m, 3) each as one, in their order.

    >>> appended([np.zeros((3, 3)), np.ones((3, 3))], [np.array([[0, 1, 2]]), np.array([[2, 1, 0]])])[1].tolist()
    [[0, 1, 2], [5, 4, 3]]
    """
    starts = np.cumsum([0, *map(len, vertices[:-1])])
    return np.concatenate(vertices), np.concatenate([own + n for own, n in zip(faces, starts, strict=True)])


def _ends(F: IntArray) -> IntArray:
    """Both ends (3m, 2) of the sides of faces (m, 3), face by face."""
    return np.stack([F, np.roll(F, -1, axis=1)], axis=-1).reshape(-1, 2)


def _edges(F: IntArray) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[Any]]:
    """The number (3m,) of each side's edge; of each edge (k,) how many faces it has, and how their directions differ.

    That is how much more often they run along it from its smaller end than from the other.
    """
    ends = _ends(F)
    key = ends.max(axis=1) * (F.max() + 1) + ends.min(axis=1)  # one number for both ends: quick to sort
    _, edge, uses = np.unique(key, return_inverse=True, return_counts=True)
    return edge, uses, np.bincount(edge, weights=np.sign(ends[:, 1] - ends[:, 0]))


def _without_doubles(F: IntArray) -> IntArray:
    """Each triangle once; of two that wind in opposite directions none, where only so every edge is closed.

    Such a pair encloses nothing: it is a fin, or the wall between two bodies that were put together.
    """
    _, first, group = np.unique(np.sort(F, axis=1), axis=0, return_index=True, return_inverse=True)
    smallest = F.argmin(axis=1)
    rows = np.arange(len(F))
    side = np.where(F[rows, (smallest + 1) % 3] < F[rows, (smallest + 2) % 3], 1, -1)
    once: IntArray = F[np.sort(first)]
    without: IntArray = F[np.sort(first[np.bincount(group.reshape(-1), weights=side) != 0])]
    if len(without) in (0, len(once)) or not (_edges(once)[1] % 2).any() or (_edges(without)[1] % 2).any():
        return once
    return without


def _closure(V: Array, F: IntArray) -> tuple[bool, str]:
    """Whether triangles enclose a volume, and what is odd about their edges."""
    _, uses, balance = _edges(F)
    rim, crossed = int((uses == 1).sum()), int((uses > 2).sum())
    if not balance.any():
        if not crossed:
            return True, ""
        import manifold3d

        if as_manifold(V, F).status() == manifold3d.Error.NoError:
            return True, f"{crossed} edges with more than two triangles: taken as bodies that touch there"
    return False, (
        f"not closed: {rim} edges with one triangle, {crossed} with more than two, "
        f"{int((balance[uses == 2] != 0).sum())} with both on one side: what is inside is not known"
    )


def is_closed(F: IntArray) -> bool:
    """Whether every edge of faces (m, 3) has two of them, which run along it in opposite directions."""
    _, uses, balance = _edges(F)
    return bool((uses == 2).all() and not balance.any())


def encloses(V: Array, F: IntArray) -> bool:
    """Whether triangles (m, 3) of vertices (n, 3) enclose a volume, which may touch itself along an edge."""
    return _closure(V, F)[0]


def edges_of(F: IntArray, uses: int) -> tuple[IntArray, IntArray, IntArray]:
    """The edges that have ``uses`` of the triangles (m, 3), in the order of their larger ends, then of the smaller.

    Ends (k, 2) of each, the smaller one first; its triangles (k, uses) in the order of ``F``, and the corners (k, uses)
    of these across from it.

    >>> [x.tolist() for x in edges_of(np.array([[0, 1, 2], [2, 1, 3]]), 2)]
    [[[1, 2]], [[0, 1]], [[0, 3]]]
    """
    edge, counts, _ = _edges(F)
    order = np.argsort(edge, kind="stable")
    sides = order[counts[edge[order]] == uses].reshape(-1, uses)
    return np.sort(_ends(F)[sides[:, 0]], axis=1), sides // 3, F[sides // 3, (sides + 2) % 3]
