"""A triangle mesh as FCL (distances), libigl (nearest points, inside) and manifold3d (common parts) want it.

Flat faces of a mesh are the part's own, round ones are off by their chords: every triangle has an error of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.hull import hull_error
from clamp3d.geometry.manifolds import as_manifold
from clamp3d.geometry.mesh import edges_of, is_closed
from clamp3d.geometry.pose import Array, rotation
from clamp3d.geometry.shells import shells, winding_numbers
from clamp3d.geometry.triangles import edge_middles, halves, normals_and_areas

_LEVELS = 4
"""Groups that the triangles with errors are put in at most, each four times finer than the one before."""
_FINE_LEVELS = 12
"""The same, each 1.5 times finer: the last holds errors of up to a hundredth of the largest."""
TURN = rotation((3.0, 4.0, 5.0), 1e-13)
"""By so much, which is less than is rounded, one of two meshes is turned before FCL measures their distance.

FCL 0.7 may stop at any two edges that are parallel to the last bit: their cross product is zero, and proves nothing. Of
a triangle over another whose sides are parallel to its own one distance in ten was too large, by up to their size.
"""
SMOOTH = np.radians(30.0)
"""Angle (rad) between two triangles up to which the patches that they stand for can go over into each other."""


@dataclass(eq=False)
class Surface:
    """A mesh, ``vertices`` (n, 3) mm, ``faces`` (m, 3), wound outward where it is closed.

    ``face_error`` (m,) mm: every point of the true surface is within this of a triangle, and the other way round;
    None where the mesh is the part, or holds it, or is held by it.
    ``is_simple``: whether no triangles cross each other, so that each has the part on one side.
    """

    vertices: Array
    faces: NDArray[np.int64]
    face_error: Array | None = None
    is_simple: bool = True
    has_own_errors: bool = False
    """Whether each triangle and its part of the true surface are within its error of each other, up to their borders.

    Else a true point is within the error of some triangle, and a triangle's point within that of a neighbour.
    """
    last_common: Any = None
    """The mesh and the pose of the last common part that was made with this one, and that part (`overlap.common`)."""

    def __post_init__(self) -> None:
        self.vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(self.faces, dtype=np.int64)

    @property
    def error(self) -> float:
        """Largest error of a triangle, mm."""
        return 0.0 if self.face_error is None else float(self.face_error.max(initial=0.0))

    @property
    def face_errors(self) -> Array:
        """The errors (m,) of its triangles, mm."""
        return np.zeros(len(self.faces)) if self.face_error is None else self.face_error

    @property
    def mutual_errors(self) -> Array:
        """How far (m,) mm each triangle and its part of the true surface can be from each other."""
        return self.face_errors if self.has_own_errors else np.full(len(self.faces), self.error)

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
    def groups(self) -> tuple[Group, ...]:
        """Its triangles by their errors, the exact ones first."""
        return self._by_error(self.face_errors, _LEVELS, 4.0)

    @cached_property
    def fine_groups(self) -> tuple[Group, ...]:
        """The same by their mutual errors, in groups that are more alike."""
        return self._by_error(self.mutual_errors, _FINE_LEVELS, 1.5)

    def _by_error(self, errors: Array, levels: int, ratio: float) -> tuple[Group, ...]:
        level, off = np.full(len(self.faces), levels), errors > 0.0
        steps = np.log(self.error / errors[off]) / np.log(ratio)
        level[off] = np.minimum(steps, levels - 1).astype(int)
        rows = [np.flatnonzero(level == k) for k in sorted(set(level.tolist()), reverse=True)]
        return tuple(Group(self, some, float(errors[some].max())) for some in rows)

    @cached_property
    def manifold(self) -> Any:
        """The same mesh for booleans."""
        return as_manifold(self.vertices, self.faces)

    @cached_property
    def shell_points(self) -> Array:
        """A vertex (k, 3) of each connected surface."""
        return self.vertices[[self.faces[rows[0], 0] for rows in shells(self.faces)]]

    @cached_property
    def normals(self) -> Array:
        """Unit normals (m, 3) of the triangles, 0 for slivers."""
        normal, area = normals_and_areas(self.vertices[self.faces])
        return np.asarray(np.where((2.0 * area > 1e-14 * self.scale**2)[:, None], normal, 0.0))

    @cached_property
    def is_convex(self) -> bool:
        """Whether the mesh, which is closed, is its own hull but for a millionth of its size."""
        return hull_error(self.vertices, self.faces) < np.inf

    @cached_property
    def _tree(self) -> Any:
        return _nearest_tree(self.vertices, self.faces)

    @cached_property
    def _compact(self) -> tuple[Any, Array, NDArray[np.int64]]:
        """Tree, vertices and faces of the same surface without slender triangles."""
        corners = _without_slender(self.vertices[self.faces])
        if len(corners) == len(self.faces):
            return self._tree, self.vertices, self.faces
        vertices, faces = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
        return _nearest_tree(vertices, faces), vertices, faces

    def nearest(self, points: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Distance (k,) of points (k, 3) from the surface, the triangle (k,) that is nearest, and its point (k, 3)."""
        if not len(points):
            return np.empty(0), np.empty(0, dtype=np.int64), np.empty((0, 3))
        points = np.ascontiguousarray(points, dtype=np.float64)
        square, face, foot = self._tree.squared_distance(self.vertices, self.faces, points)
        return np.sqrt(np.atleast_1d(square)), np.atleast_1d(face), np.asarray(foot).reshape(-1, 3)

    def distance(self, points: Array) -> Array:
        """Distance (k,) of points (k, 3) from the surface, never negative; that of `nearest` may be too large."""
        if not len(points):
            return np.empty(0)
        tree, *mesh = self._compact
        return np.asarray(np.sqrt(np.atleast_1d(tree.squared_distance(*mesh, np.ascontiguousarray(points))[0])))

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Which of the points (k, 3), none of them on the surface, lie inside.

        Nothing of the surface lies between a point and the triangle nearest to it, so where the nearest point is in the
        middle of a triangle its normal says the side. For other points, and of surfaces that are open or cross
        themselves, winding numbers do.
        """
        inside = ((points > self.box[0]) & (points < self.box[1])).all(axis=1)
        rows = np.flatnonzero(inside)
        if not len(rows):
            return np.asarray(inside)
        near = np.ascontiguousarray(points[rows], dtype=np.float64)
        behind, is_certain = self._behind_nearest(near)
        turns = winding_numbers(self.vertices, self.faces, near[~is_certain])
        behind[~is_certain] = np.abs(turns) > 0.5
        inside[rows] = behind
        return np.asarray(inside)

    def is_any_outside(self, points: Array) -> bool:
        """Whether some of points (k, 3) are certainly outside the true body."""
        slack = self.error + 1e-9 * (self.scale + float(np.abs(points).max(initial=0.0)))
        if ((points < self.box[0] - slack) | (points > self.box[1] + slack)).any():
            return True
        away = points[self.distance(points) > slack]
        return bool(len(away)) and not self.contains(away).all()

    def _behind_nearest(self, points: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether points (k, 3) are behind the triangle nearest to them, and nearest to its middle."""
        _, face, foot = self.nearest(points)
        away = np.einsum("ki,ki->k", points - foot, self.normals[face])
        is_certain = self.has_sides & self._is_in_middle(face, foot) & (np.abs(away) > 1e-9 * self.scale)
        return away < 0.0, np.asarray(is_certain)

    def _is_in_middle(self, face: NDArray[np.int64], points: Array) -> NDArray[np.bool_]:
        """Which of points (k, 3) on triangles ``face`` (k,) are well within these, and on no other triangle's edge."""
        return np.asarray(~self._on_sides(face, points).any(axis=1))

    def _on_sides(self, face: NDArray[np.int64], points: Array) -> NDArray[np.bool_]:
        """Which sides (k, 3) of triangles ``face`` (k,) points (k, 3) on these may lie on, rounded."""
        corners = self.vertices[self.faces[face]]
        sides = np.roll(corners, -1, axis=1) - corners
        inward = np.cross(self.normals[face][:, None], sides)
        margin = np.einsum("kij,kij->ki", points[:, None] - corners, inward)
        return np.asarray(margin <= _MIDDLE * (sides**2).sum(axis=2))

    @cached_property
    def has_sides(self) -> bool:
        """Whether each triangle has the part on one side, and what is outside on the other."""
        return self.is_simple and is_closed(self.faces)

    def is_outside(self, triangles: Array) -> NDArray[np.bool_]:
        """Which of triangles (m, 3, 3) certainly have no point in common with the closed body."""
        outside = ~self.may_meet(triangles)
        behind, is_certain = self._behind_nearest(triangles[outside].mean(axis=1))
        outside[outside] = is_certain & ~behind
        return outside

    def is_crossed(self, triangles: Array, moves: Array) -> NDArray[np.bool_]:
        """Which of triangles (m, 3, 3) certainly cross the surface with every point on their moves (m, 3).

        Lemma: the number of times that a segment crosses a surface is odd or even alike for all segments that one can
        be shifted to without an end on the surface, or the surface's border on the segment.
        """
        middles, length = triangles.mean(axis=1), np.linalg.norm(moves, axis=1)
        radius = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1, initial=0.0)
        rows = np.flatnonzero(self._from_border(middles) > radius + length)
        rows = rows[self._crosses_once(middles[rows], moves[rows])]
        for ends in (triangles, triangles + moves[:, None]):
            rows = rows[~self.may_meet(ends[rows])]
        crossed = np.zeros(len(triangles), dtype=bool)
        crossed[rows] = True
        return crossed

    def _from_border(self, points: Array) -> Array:
        """Distance (k,) of points (k, 3) from the edges that an odd number of triangles has."""
        if not (len(self._border) and len(points)):
            return np.full(len(points), np.inf)
        square, *_ = self._border_tree.squared_distance(self.vertices, self._border, np.ascontiguousarray(points))
        return np.asarray(np.sqrt(np.atleast_1d(square)))

    @cached_property
    def _border(self) -> NDArray[np.int64]:
        sides = np.sort(self.faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
        edges, count = np.unique(sides, axis=0, return_counts=True)
        return np.ascontiguousarray(edges[count % 2 == 1])

    @cached_property
    def _border_tree(self) -> Any:
        import igl

        tree = igl.AABB()
        tree.init(self.vertices, self._border)
        return tree

    def _crosses_once(self, starts: Array, moves: Array) -> NDArray[np.bool_]:
        """Which segments from points (k, 3) meet the surface within one triangle, and nowhere else."""
        length = np.linalg.norm(moves, axis=1)
        hits = []
        for start, way in ((starts, moves), (starts + moves, -moves)):
            rays = np.ascontiguousarray(start), np.ascontiguousarray(way / length[:, None])
            hits.append(self._tree.intersect_ray_first(self.vertices, self.faces, *rays))
        (first, ahead, at), (_, behind, _) = hits
        is_one = (first >= 0) & (np.abs(ahead + behind - length) <= 1e-9 * self.scale)
        at = at[is_one]  # of those without a hit there is none
        is_one[is_one] = np.column_stack([at, 1.0 - at.sum(axis=1)]).min(axis=1, initial=1.0) > _MIDDLE
        return np.asarray(is_one)

    def may_meet(self, triangles: Array) -> NDArray[np.bool_]:
        """Which of triangles (m, 3, 3) have a point in common with the surface, as far as is known."""
        import fcl

        if not len(triangles):
            return np.zeros(0, dtype=bool)
        corners = np.ascontiguousarray(triangles.reshape(-1, 3))
        loose = fcl_tree(corners, np.arange(len(corners)).reshape(-1, 3))
        most = _CONTACTS * len(triangles)
        result = fcl.CollisionResult()
        fcl.collide(*fcl_pair(loose, self.bvh, np.eye(4)), fcl.CollisionRequest(num_max_contacts=most), result)
        meet = np.full(len(triangles), len(result.contacts) >= most)  # then some may be missing
        meet[[contact.b1 for contact in result.contacts]] = True
        return meet

    def rows_near(self, box: Array, margin: float) -> NDArray[np.int64]:
        """The triangles (k,) whose true surface may be within ``margin`` mm of a box (2, 3)."""
        corners, off = self.vertices[self.faces], margin + self.face_errors[:, None]
        above = (corners.max(axis=1) + off >= box[0]).all(axis=1)
        return np.flatnonzero(above & (corners.min(axis=1) - off <= box[1]).all(axis=1))

    def error_at(self, points: Array) -> Array:
        """How far (k,) mm the true surface may be from points (k, 3) of this one."""
        if self.face_error is None:
            return np.zeros(len(points))
        away, face, foot = self.nearest(points)
        # On an edge the nearest triangle is either of two; of a flat one the true border can be that of its neighbour.
        error = self._corner_error[face]
        if self.has_own_errors:
            on_sides = self._on_sides(face, foot)
            count = on_sides.sum(axis=1)
            of_sides = np.where(on_sides, self._side_error[face], self.face_error[face, None]).max(axis=1)
            error = np.where(count <= 1, of_sides, error)
        return np.where(away <= 1e-9 * self.scale, error, self.error)

    def errors_within(self, triangles: Array, distances: Array) -> Array:
        """The largest mutual error (k,) mm of a triangle that is no further than ``distances`` (k,) from (k, 3, 3)."""
        middles = triangles.mean(axis=1)
        reach = distances + np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1, initial=0.0)
        errors, rows = np.zeros(len(triangles)), np.arange(len(triangles))
        finest, *others = self.fine_groups
        for group in reversed(others):
            near = group.distance(middles[rows]) <= reach[rows]
            errors[rows[near]] = group.error
            rows = rows[~near]
        errors[rows] = finest.error
        return errors

    @cached_property
    def _corner_error(self) -> Array:
        """The largest error (m,) of a triangle and all that share a corner with it."""
        corner = np.zeros(len(self.vertices))
        np.maximum.at(corner, self.faces.reshape(-1), np.repeat(self.face_errors, 3))
        return np.asarray(corner[self.faces].max(axis=1))

    @cached_property
    def _side_error(self) -> Array:
        """The larger error (m, 3) of both triangles at each side of one; at others than two that of its corners."""
        error = np.repeat(self._corner_error[:, None], 3, axis=1)
        _, pairs, across = edges_of(self.faces, 2)
        side = ((self.faces[pairs] == across[:, :, None]).argmax(axis=2) + 1) % 3
        error[pairs, side] = self.face_errors[pairs].max(axis=1)[:, None]
        return error


@dataclass(eq=False)
class Group:
    """Triangles ``rows`` (k,) of a surface, none of them off by more than ``error`` mm."""

    surface: Surface
    rows: NDArray[np.int64]
    error: float

    @cached_property
    def tree(self) -> Any:
        """FCL's tree of them."""
        if len(self.rows) == len(self.surface.faces):
            return self.surface.bvh
        return fcl_tree(self.surface.vertices, self.surface.faces[self.rows])

    @cached_property
    def _own_surface(self) -> Surface:
        return Surface(self.surface.vertices, self.surface.faces[self.rows])

    def distance(self, points: Array) -> Array:
        """Distance (k,) of points (k, 3) from them."""
        return self._own_surface.distance(points)


_ROUNDED, _EXACT = 1e-16, 1e-7
"""libigl's nearest point of a triangle of length L and width w is off by up to ``_ROUNDED`` L^3 / w^2, as was seen.

Of one 1000 mm long and 0.01 mm wide it is 1e-4 mm and more; triangles for which it is more than ``_EXACT`` mm are cut.
"""
_MOST_PIECES = 200_000
"""Triangles that are added for that at most."""
_CONTACTS = 100
"""Contacts of each triangle that FCL lists at most, so that its answer does not fill the memory."""
_MIDDLE = 1e-4
"""How far from a triangle's sides, relative to these, a nearest point counts as in its middle."""


def _nearest_tree(vertices: Array, faces: NDArray[np.int64]) -> Any:
    """libigl's tree of boxes of triangles (m, 3)."""
    import igl

    tree = igl.AABB()
    tree.init(vertices, faces)
    return tree


def _without_slender(corners: Array) -> Array:
    """Triangles (k, 3, 3), the slender ones of (m, 3, 3) halved.

    Those that are next to nothing stay: their neighbours are as near.
    """
    whole, left = [corners[:0]], _MOST_PIECES
    while len(corners):
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        length = sides.max(axis=1)
        width = 2.0 * normals_and_areas(corners)[1] / np.maximum(length, 1e-300)
        slender = (_ROUNDED * length**3 > _EXACT * width**2) & (width > _EXACT)
        left -= int(slender.sum())
        if left < 0:
            slender[:] = False
        whole.append(corners[~slender])
        corners, edge = corners[slender], sides[slender].argmax(axis=1)
        corners = halves(corners, edge, edge_middles(corners)[np.arange(len(edge)), edge])
    return np.concatenate(whole)


def fcl_tree(vertices: Array, faces: NDArray[np.int64]) -> Any:
    """FCL's tree of oriented boxes of triangles (m, 3)."""
    import fcl

    used, rows = np.unique(faces, return_inverse=True)  # it copies all the vertices that it gets
    tree = fcl.BVHModel()
    tree.beginModel(len(used), len(faces))
    tree.addSubModel(vertices[used], rows.reshape(faces.shape))
    tree.endModel()
    return tree


def fcl_pair(a: Any, b: Any, T: Array) -> tuple[Any, Any]:
    """FCL's objects of two trees, the second placed by ``T`` (4, 4)."""
    import fcl

    return fcl.CollisionObject(a, fcl.Transform()), fcl.CollisionObject(b, fcl.Transform(T[:3, :3], T[:3, 3]))


def rounding_of(a: Surface, b: Surface, T: Array) -> float:
    """What the distance of two meshes may be off by, mm: manifold3d merges vertices within 1e-12 of the size."""
    return 4e-12 * (a.scale + b.scale + float(np.abs(T[:3, 3]).max()))


def tree_distance(a: Any, b: Any, T: Array) -> float:
    """Distance of two trees, the second placed by ``T`` (4, 4), mm; 0 or less where they meet."""
    import fcl

    return float(fcl.distance(*fcl_pair(a, b, T @ TURN), fcl.DistanceRequest(), fcl.DistanceResult()))


def at_edges(
    vertices: Array, faces: NDArray[np.int64], error: Array, patch: NDArray[np.int64], smooth: float = 0.0
) -> Array:
    """Errors (m,) of triangles that hold for their patches' true borders too; ``error`` (m,) is square to each patch.

    ``patch`` (m,) numbers the patches; they have no border where they meet at less than ``smooth`` rad.
    Two patches that bulge by e and f meet within (e + f) / sin(w) of the edge between them, w being the angle of the
    material if that is acute; else within e + f. At a blunt or hollow edge with a flat patch the foot of every point
    lies on the mesh.
    """
    _, pairs, across = edges_of(faces, 2)
    normal, _ = normals_and_areas(vertices[faces])
    one, other = normal[pairs[:, 0]], normal[pairs[:, 1]]
    convex = np.einsum("ij,ij->i", one, vertices[across[:, 1]] - vertices[faces[pairs[:, 0], 0]]) <= 1e-8
    cosine = np.einsum("ij,ij->i", one, other)
    both = error[pairs]
    total = both.sum(axis=1)
    knife = convex & (cosine < 0.0)
    total[knife] /= np.maximum(np.sqrt(1.0 - np.minimum(1.0, cosine[knife] ** 2)), 1e-6)
    sharp = (patch[pairs[:, 0]] != patch[pairs[:, 1]]) & (cosine <= np.cos(smooth) + 1e-9)
    wider = sharp & ((knife & (total > 0.0)) | (both > 0.0).all(axis=1))
    widened = error.copy()
    off = np.where(both > 0.0, total[:, None], 0.0)[wider]
    np.maximum.at(widened, pairs[wider].reshape(-1), off.reshape(-1))
    return widened
