"""A triangle mesh, mostly a closed one, as FCL, manifold3d and the compiled searches want it, each form when needed.

Flat faces of a mesh are the part's own, round ones are off by their chords: every triangle has an error of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.linear import dot
from clamp3d.core.mesh import edges_of
from clamp3d.core.pose import Array, rotation
from clamp3d.core.shells import corners_of, shells, winding_number
from clamp3d.core.triangles import distinct, side_keys

_LEVELS = 4
"""Groups that the triangles with errors are put in at most, each four times finer than the one before."""
_TURN = rotation([0.3, 0.5, 0.8], 0.7)[:3, :3]
"""Edges of parts mostly run along the axes: seen along another direction few points that are asked lie below one."""
_SHARP = np.cos(np.radians(30.0))
"""Cosine of the angle between the normals of two triangles beyond which their edge is one of the part's."""


@dataclass(eq=False)
class Surface:
    """A mesh, ``vertices`` (n, 3) mm, ``faces`` (m, 3), wound outward where it is closed.

    ``face_error`` (m,) mm: every point of the true surface is within this of a triangle, and the other way round;
    None where the mesh is the part, or holds it, or is held by it. ``point_error`` (m,) mm: how far points of a
    triangle are from the true body, the same if not given; chords of a convex face lie inside.
    """

    vertices: Array
    faces: NDArray[np.int64]
    face_error: Array | None = None
    point_error: Array | None = None

    @property
    def error(self) -> float:
        """Largest error of a triangle, mm."""
        return 0.0 if self.face_error is None else float(self.face_error.max(initial=0.0))

    @cached_property
    def scale(self) -> float:
        """Largest coordinate, mm: what rounding is relative to."""
        return float(np.abs(self.vertices).max())

    @cached_property
    def box(self) -> Array:
        """Lower and upper corner (2, 3), mm."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def bvh(self) -> Any:
        """FCL's tree of oriented boxes."""
        return fcl_tree(self.vertices, self.faces)

    @cached_property
    def levels(self) -> list[tuple[NDArray[np.bool_], float]]:
        """Triangles (m,) by their error, and its largest in mm; the exact ones first."""
        if self.face_error is None:
            return [(np.ones(len(self.faces), dtype=bool), 0.0)]
        level = np.full(len(self.faces), _LEVELS)
        off = self.face_error > 0.0
        level[off] = np.minimum(np.log2(self.error / self.face_error[off]) // 2.0, _LEVELS - 1).astype(int)
        return [(level == k, float(self.face_error[level == k].max())) for k in sorted(set(level.tolist()))[::-1]]

    @cached_property
    def groups(self) -> tuple[tuple[Any, float], ...]:
        """Triangles by their error: (FCL's tree, error mm), the exact ones first."""
        if len(self.levels) == 1:
            return ((self.bvh, self.error),)
        return tuple((fcl_tree(self.vertices, self.faces[rows]), error) for rows, error in self.levels)

    @cached_property
    def _parts(self) -> dict[float, Surface]:
        own = self.point_error
        return {
            error: Surface(self.vertices, self.faces[rows], None, None if own is None else own[rows])
            for rows, error in self.levels
        }

    @cached_property
    def manifold(self) -> Any:
        """The same mesh for booleans."""
        import manifold3d

        return manifold3d.Manifold(
            manifold3d.Mesh64(
                vert_properties=np.array(self.vertices, dtype=np.float64, order="C"),
                tri_verts=np.array(self.faces, dtype=np.uint64, order="C"),
            )
        )

    @cached_property
    def shells(self) -> list[NDArray[np.intp]]:
        """Rows of ``faces`` of each connected surface."""
        return shells(self.faces, len(self.vertices))

    @cached_property
    def shell_points(self) -> Array:
        """Six vertices (k, 6, 3) of each connected surface: those furthest out along the axes."""
        found = []
        for rows in self.shells:
            own = self.vertices[distinct(self.faces[rows])]
            found.append(own[np.concatenate([own.argmin(axis=0), own.argmax(axis=0)])])
        return np.array(found)

    @cached_property
    def planes(self) -> tuple[Array, Array]:
        """Unit normals (m, 3) of the triangles, and offsets (m,) of their planes, minus infinity of slivers."""
        a, b, c = corners_of(self.vertices, self.faces)
        N = np.cross(b - a, c - a)
        size = np.linalg.norm(N, axis=1)
        N = N / np.maximum(size, 1e-300)[:, None]
        return N, np.where(size > 1e-14 * self.scale**2, np.einsum("ij,ij->i", N, a), -np.inf)

    @cached_property
    def _wide(self) -> NDArray[np.intp]:
        """Rows (n,) of the triangles that have an area."""
        return np.flatnonzero(self.planes[0].any(axis=1))

    @cached_property
    def _tree(self) -> tuple[NDArray[np.generic], ...]:
        """Corners (n, 3, 3) of these triangles, no errors (n,), and their tree's arrays."""
        from clamp3d.collide.faces_tree import tree_of

        corners = np.ascontiguousarray(self.vertices[self.faces[self._wide]], dtype=np.float64)
        exact = np.zeros(len(corners))
        box, link, order, _ = tree_of(corners, exact, np.array([0, len(corners)]))
        return corners, exact, box, link, order

    def nearest(self, points: Array) -> tuple[Array, NDArray[np.intp], Array]:
        """Distance (k,) of points (k, 3) from the surface, the triangle (k,) that is nearest, and its point (k, 3)."""
        from clamp3d.collide.faces_tree import DEEP
        from clamp3d.collide.surface_kernel import nearest

        n = len(points)
        away, face, foot = np.full(n, np.inf), np.zeros(n, dtype=np.int64), np.zeros((n, 3))
        if not len(self._wide):  # of slivers alone, as a group of triangles with like errors may be
            return away, face, foot
        stack = np.empty(DEEP, dtype=np.int64)
        nearest(*self._tree, np.ascontiguousarray(points, dtype=np.float64), stack, away, face, foot)
        return away, self._wide[face], foot

    def distance(self, points: Array) -> Array:
        """Distance (k,) of points (k, 3) from the surface, never negative."""
        return self.nearest(points)[0]

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Which of the points (k, 3), none of them on the surface, lie inside: winding numbers of those in the box.

        Of a surface with an edge: which it hides from more than half of all directions, whichever side it shows them.
        """
        found = ((points > self.box[0]) & (points < self.box[1])).all(axis=1)
        if found.any() and self.rimless:
            found[found] = self.winding_numbers(points[found]) > 0.5
        elif found.any():
            corners = corners_of(self.vertices, self.faces)
            found[found] = [abs(winding_number(corners, point)) > 0.5 for point in points[found]]
        return np.asarray(found)

    @cached_property
    def _ends(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The edges of all triangles in order: those run along from their smaller end, and the others."""
        ends = np.roll(self.faces, -1, axis=1)
        key = side_keys(self.faces, ends, len(self.vertices))
        forward = ends > self.faces
        return np.sort(key[forward]), np.sort(key[~forward])

    @property
    def rimless(self) -> bool:
        """Whether each edge is run along as often one way as the other: else a line may miss it that starts inside."""
        return np.array_equal(*self._ends)

    @cached_property
    def rim(self) -> tuple[Array, Array]:
        """Starts (k, 3) of the edges that are not, and the ways (k, 3) to their ends, as often as left over."""
        keys, number = np.unique(np.concatenate(self._ends), return_inverse=True)
        one_way = np.bincount(number[: len(self._ends[0])], minlength=len(keys))
        left = np.abs(2 * one_way - np.bincount(number, minlength=len(keys)))
        low, high = np.divmod(np.repeat(keys, left), len(self.vertices))
        return self.vertices[low], self.vertices[high] - self.vertices[low]

    def winding_numbers(self, points: Array) -> Array:
        """How often the surface winds round points (k, 3) that are not on it."""
        from clamp3d.core.kernel_winding import crossings

        corners, low, widest = self._turned
        found = np.empty(len(points))
        scale = max(self.scale, float(np.abs(points).max(initial=0.0)))
        crossings(corners, low, widest, np.ascontiguousarray(dot(points, _TURN.T)), scale, found)
        for k in np.flatnonzero(np.isnan(found)):  # straight below an edge: the sum of solid angles
            found[k] = winding_number(corners_of(self.vertices, self.faces), points[k])
        return found

    @cached_property
    def _turned(self) -> tuple[Array, Array, float]:
        """The triangles (m, 9), turned, by their least x (m,), and the width in x of the widest."""
        corners = dot(self.vertices, _TURN.T)[self.faces]
        low, high = corners[:, :, 0].min(axis=1), corners[:, :, 0].max(axis=1)
        order = np.argsort(low, kind="stable")
        made = np.ascontiguousarray(corners[order].reshape(-1, 9)), np.ascontiguousarray(low[order])
        return (*made, float((high - low).max()) * (1.0 + 1e-12))

    def certain_depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside, where the nearest triangle alone says so; minus infinity elsewhere.

        Before the inside of a triangle that is nearest nothing else of the surface can lie, so its normal tells the
        side. What it calls inside is inside one of the shells at least.
        """
        d, face, foot = self.nearest(points)
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        n = np.cross(b - a, c - a)
        nn = np.maximum(np.einsum("ij,ij->i", n, n), 1e-300)
        behind = np.einsum("ij,ij->i", points - foot, n) < 0.0
        for start, end in ((a, b), (b, c), (c, a)):
            behind &= np.einsum("ij,ij->i", np.cross(end - start, foot - start), n) > 1e-6 * nn
        return np.where(behind, d, -np.inf)

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside."""
        d = self.distance(points)
        return np.where(self.contains(points), d, -d)

    def distance_at_least(self, points: Array) -> Array:
        """How far (k,) mm the true surface is at least from points (k, 3): negative where it may be on either side."""
        found = np.full(len(points), np.inf)
        for rows, error in self.levels:
            part = self if rows.all() else self._parts[error]
            found = np.minimum(found, part.distance(points) - error)
        return found

    def error_at(self, points: Array) -> Array:
        """How far (k,) mm the true surface may be from points (k, 3) of this one: the largest error of what is near."""
        found = np.zeros(len(points))
        for error, part in self._parts.items() if self.error > 0.0 else ():
            away, face, _ = part.nearest(points)
            own = error if part.point_error is None else part.point_error[face]
            found = np.where(away <= error * (1.0 + 1e-9), np.maximum(found, own), found)
        return found


def fcl_tree(vertices: Array, faces: NDArray[np.int64]) -> Any:
    """FCL's tree of oriented boxes of triangles (m, 3)."""
    import fcl

    tree = fcl.BVHModel()
    tree.beginModel(len(vertices), len(faces))
    tree.addSubModel(vertices, faces)
    tree.endModel()
    return tree


def at_edges(vertices: Array, faces: NDArray[np.int64], error: Array, patch: NDArray[np.int64] | None = None) -> Array:
    """Errors (m,) of triangles that hold for their patches' true borders too; ``error`` (m,) is square to each patch.

    ``patch`` (m,) numbers the patches; else triangles that meet at more than 30 degrees are of two.
    Two patches that bulge by e and f meet within (e + f) / sin(w) of the edge between them, w being the angle of the
    material if that is acute; else within e + f. At a blunt or hollow edge with a flat patch the foot of every point
    lies on the mesh.
    """
    _, pairs, across = edges_of(faces, 2)
    a, b, c = corners_of(vertices, faces)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    one, other = normal[pairs[:, 0]], normal[pairs[:, 1]]
    convex = np.einsum("ij,ij->i", one, vertices[across[:, 1]] - a[pairs[:, 0]]) <= 1e-8
    cosine = np.einsum("ij,ij->i", one, other)
    both = error[pairs]
    total = both.sum(axis=1)
    knife = convex & (cosine < 0.0)
    total[knife] /= np.maximum(np.sqrt(1.0 - np.minimum(1.0, cosine[knife] ** 2)), 1e-6)
    sharp = cosine < _SHARP if patch is None else patch[pairs[:, 0]] != patch[pairs[:, 1]]
    wider = sharp & ((knife & (total > 0.0)) | (both > 0.0).all(axis=1))
    found = error.copy()
    for side in (0, 1):
        np.maximum.at(found, pairs[wider, side], np.where(both[wider, side] > 0.0, total[wider], 0.0))
    return found
