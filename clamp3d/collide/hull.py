"""Convex polyhedra: their corners, edges and planes, the hull of points, and whether a mesh is convex."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.pose import Array, norm
from clamp3d.core.triangles import closest_points

MEMBER = 1e-9
"""Relative to the size of the parts: a point this far outside still counts as on the surface."""
FLAT = 1e-8
"""Sine of the angle below which a face or line counts as square to a direction."""
SMALL = 40
"""Hulls with more corners are searched only where FCL finds the nearest points."""
_SLIVER = 1e-12
"""Relative to the size: triangles narrower than this have no plane to speak of."""
_MEMORY = 2_000_000
"""Heights of points above planes that are worked out at a time."""
_EPS = 2.0**-52


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron: ``vertices`` (n, 3), ``planes`` (m, 4) with outward unit normals, normal . x + d <= 0."""

    vertices: Array
    planes: Array
    faces: NDArray[np.int64] = field(repr=False)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Corner numbers (k, 2) of the edges; those between two triangles of one flat face are left out."""
        F, V = self.faces, self.vertices
        normal = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        both = np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        order = np.lexsort((both[:, 1], both[:, 0]))
        pairs, owner = both[order].reshape(-1, 4)[:, :2], (order // 3).reshape(-1, 2)
        bent = np.linalg.norm(np.cross(normal[owner[:, 0]], normal[owner[:, 1]]), axis=1) > 1e-10
        return np.asarray(pairs[bent])

    def support(self, n: Array) -> Array:
        """The vertices (k, 3) that lie furthest along ``n`` (k, 3)."""
        return np.asarray(self.vertices[np.argmax(n @ self.vertices.T, axis=1)])

    def _highest(self, n: Array, within: float = FLAT) -> Array:
        height = self.vertices @ n
        return np.asarray(self.vertices[height >= height.max() - within * (1.0 + float(np.ptp(height)))][:24])

    def face(self, n: Array) -> Array:
        """Points (k, 3) of what lies furthest along ``n`` (3,): corners, and the middles between each two of them."""
        corners = self._highest(n)
        i, j = np.triu_indices(len(corners))
        return np.asarray(0.5 * (corners[i] + corners[j]))

    def flatness(self, n: Array, within: float = FLAT) -> tuple[int, Array | None]:
        """Dimension of what lies furthest along ``n`` (3,), and its direction if it is a line."""
        corners = self._highest(n, within)
        if len(corners) == 2:
            along = corners[1] - corners[0]
            return 1, along / norm(along)
        return (0, None) if len(corners) == 1 else (2, None)

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside, and then no further out than they are."""
        return np.asarray(-(points @ self.planes[:, :3].T + self.planes[:, 3]).max(axis=1))

    def normals(self, n: Array) -> Array:
        """The face normals (k, 3) nearest to ``n`` (k, 3)."""
        return np.asarray(self.planes[np.argmax(n @ self.planes[:, :3].T, axis=1), :3])

    def near(self, n: Array | None) -> tuple[Array, Array, Array]:
        """Corners (k, 3), edges (k, 2, 3) and triangles (k, 3, 3), of a large hull only those that face ``n`` (3,)."""
        V = self.vertices
        if n is None or len(V) <= SMALL:
            return V, V[self.edges], V[self.faces]
        height = V @ n
        high = height >= height.max() - 0.01 * float(np.ptp(height))
        return V[high], V[self.edges[high[self.edges].any(axis=1)]], V[self.faces[high[self.faces].any(axis=1)]]

    def closest(self, points: Array) -> Array:
        """The points of the surface (k, 3) that are nearest to ``points`` (k, 3), which lie outside."""
        k, m = len(points), len(self.faces)
        pairs = np.tile(self.vertices[self.faces], (k, 1, 1)), np.repeat(points, m, axis=0)
        feet = closest_points(*pairs).reshape(k, m, 3)
        nearest = np.linalg.norm(feet - points[:, None], axis=2).argmin(axis=1)
        return np.asarray(feet[np.arange(k), nearest])

    def crossed_by(self, ends: Array) -> bool:
        """Whether the segment between ``ends`` (2, 3) meets the polyhedron."""
        h, k = ends @ self.planes[:, :3].T + self.planes[:, 3]
        if ((h > 0.0) & (k > 0.0)).any():
            return False
        enters, leaves = h > 0.0, k > 0.0
        low = (h[enters] / (h - k)[enters]).max(initial=0.0)
        return bool(low <= (h[leaves] / (h - k)[leaves]).min(initial=1.0))

    def clipped(self, plane: Array) -> Hull | None:
        """What of it lies in the half-space plane[:3] . x + plane[3] >= 0; None if it has no volume."""
        V = self.vertices
        height = V @ plane[:3] + plane[3]
        slack = MEMBER * (1.0 + float(np.abs(V).max()))
        if height.min() >= -slack:
            return self
        if height.max() <= slack:
            return None
        a, b = self.edges.T
        crossed = height[a] * height[b] < 0.0
        a, b = a[crossed], b[crossed]
        share = (height[a] / (height[a] - height[b]))[:, None]
        return hull(np.vstack([V[height >= 0.0], V[a] + share * (V[b] - V[a])]))


def hull(points: Array) -> Hull:
    """Convex hull of points (n, 3). Raises ValueError if they lie in one plane."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    made, complete = _hull(points, *_by_manifold(points))
    return made if complete else _hull(points, *_by_qhull(points))[0]


def nearly_hull(points: Array) -> tuple[Hull, float]:
    """Convex hull of most of the points (n, 3), and how far (mm) the others are from it; quicker where many are level.

    Raises ValueError if they lie in one plane.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    made, complete = _hull(points, *_by_manifold(points))
    if complete:
        return made, 0.0
    return made, _reach(made.vertices, made.faces, points[_Sides.of(made.vertices, made.faces).above(points)])


def _hull(points: Array, vertices: Array, faces: NDArray[np.int64]) -> tuple[Hull, bool]:
    """The hull of its vertices and triangles, and whether all points (n, 3) lie in it, to rounding."""
    sides = _Sides.of(vertices, faces)
    top = sides.highest(points)
    # Up to the highest point: no rounding of a triangle cuts into the hull.
    rows = np.column_stack([sides.normal, -(sides.offset + top)])[sides.flat]
    planes = sorted({tuple(plane) for plane in rows.round(14).tolist()})
    return Hull(vertices, np.array(planes), faces), not (top > sides.rounding).any()


def _reach(vertices: Array, faces: NDArray[np.int64], points: Array) -> float:
    """How far (mm) points (k, 3) are at most from what the vertices of a closed mesh span.

    A point is a sum of the corners of the triangle that it lies behind, as seen from their middle. Weights below 0, and
    what they add up to beyond 1, are cut: the rest is a point between the vertices, near to it.
    """
    middle = vertices.mean(axis=0)
    corners = vertices[faces] - middle
    across = np.cross(np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1))
    volume = np.einsum("ij,ij->i", corners[:, 0], across[:, 0])
    wide = np.abs(volume) > 1e-15 * float(np.abs(corners).max()) ** 3  # beside a sliver its neighbours do as well
    corners, across = corners[wide], across[wide] / volume[wide, None, None]
    worst = 0.0
    for point in points - middle:
        weight = np.maximum(across @ point, 0.0)
        weight /= np.maximum(weight.sum(axis=1), 1.0)[:, None]
        worst = max(worst, float(np.linalg.norm(np.einsum("ij,ijk->ik", weight, corners) - point, axis=1).min()))
    return worst


def _by_manifold(points: Array) -> tuple[Array, NDArray[np.int64]]:
    """Vertices and triangles; what stands out by less than 1e-7 of the size is left out."""
    import manifold3d

    solid = manifold3d.Manifold.hull_points(points)
    made = solid.to_mesh64()
    vertices, faces = np.array(made.vert_properties)[:, :3], np.array(made.tri_verts, dtype=np.int64)
    if not len(faces) or not solid.volume() > 1e-14 * float(np.ptp(vertices, axis=0).max()) ** 3:
        raise ValueError("the points lie in one plane")
    return vertices, faces


def _by_qhull(points: Array) -> tuple[Array, NDArray[np.int64]]:
    """The same to rounding, by a library that takes longer to import than most hulls to make."""
    from scipy.spatial import ConvexHull

    made = ConvexHull(points)
    faces = made.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), made.equations[:, :3]) < 0.0
    faces[inward] = faces[inward, ::-1]
    place = np.empty(len(points), dtype=np.int64)
    place[made.vertices] = np.arange(len(made.vertices))
    return points[made.vertices], place[faces]


def hull_error(vertices: Array, faces: NDArray[np.int64]) -> float:
    """How far (mm) points of the convex hull of a closed mesh are from the mesh at most; inf if it is far from convex.

    Let a point c inside see all triangles (m, 3), wound outward, and no vertex (n, 3) be more than h above a triangle's
    plane. A ray from c that leaves the mesh at z through a plane whose normal it makes the angle t with leaves the hull
    within h / cos t of z, and cos t is the depth of c below the plane over the distance of c and z.
    """
    scale = float(np.abs(vertices).max())
    few = np.unique(np.arange(64) * 2654435761 % len(faces))  # far apart, in no step with the rings of a mesh
    if _Sides.of(vertices, faces[few]).highest(vertices).max(initial=0.0) > 1e-6 * scale:
        return np.inf
    sides = _Sides.of(vertices, faces)
    centre = vertices.mean(axis=0)
    depth = float((sides.offset - sides.normal @ centre)[sides.flat].min(initial=np.inf))
    if not 0.0 < depth < np.inf:
        return np.inf
    # A point of a sliver is this far from a neighbour's plane.
    height = float(sides.highest(vertices).max()) + (0.0 if sides.flat.all() else _SLIVER * scale)
    return max(0.0, height) * float(np.linalg.norm(vertices - centre, axis=1).max()) / depth


@dataclass(frozen=True, slots=True, eq=False)
class _Sides:
    """Unit normals (m, 3) and offsets (m,) of triangles' planes, both 0 of slivers; rounding (m,) of heights above."""

    normal: Array
    offset: Array
    rounding: Array

    @classmethod
    def of(cls, vertices: Array, faces: NDArray[np.int64]) -> _Sides:
        """The planes of triangles (m, 3)."""
        corners, scale = vertices[faces], float(np.abs(vertices).max())
        sides = np.roll(corners, -1, axis=1) - corners
        normal = np.cross(sides[:, 0], sides[:, 1])
        twice_area, longest = np.linalg.norm(normal, axis=1), np.linalg.norm(sides, axis=2).max(axis=1)
        narrow = twice_area / np.maximum(longest, 1e-300)
        normal = np.where((narrow > _SLIVER * scale)[:, None], normal / np.maximum(twice_area, 1e-300)[:, None], 0.0)
        size = float(np.ptp(vertices, axis=0).max())
        rounding = 16.0 * _EPS * scale * (1.0 + size / np.maximum(narrow, _SLIVER * scale))
        return cls(normal, np.einsum("ij,ij->i", normal, corners[:, 0]), rounding)

    @property
    def flat(self) -> NDArray[np.bool_]:
        """Which triangles (m,) are no slivers."""
        return np.asarray(self.normal.any(axis=1))

    def highest(self, points: Array) -> Array:
        """How high (m,) the highest of points (n, 3) is above each plane."""
        step = max(1, _MEMORY // len(points))
        parts = [(points @ self.normal[k : k + step].T).max(axis=0) for k in range(0, len(self.normal), step)]
        return np.concatenate(parts) - self.offset

    def above(self, points: Array) -> NDArray[np.bool_]:
        """Which of points (n, 3) are above some plane by more than rounding."""
        step, limit = max(1, _MEMORY // len(self.normal)), self.offset + self.rounding
        parts = [(points[k : k + step] @ self.normal.T > limit).any(axis=1) for k in range(0, len(points), step)]
        return np.concatenate(parts)
