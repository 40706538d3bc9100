"""Convex polyhedra: their corners, edges and planes, the hull of points, and whether a mesh is convex."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from clamp3d.geometry.mesh import edges_of, slivers_of
from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import turns
from clamp3d.geometry.triangles import normals_and_areas

MEMBER = 1e-9
"""Relative to the size of the parts: a point this far outside still counts as on the surface."""
FLAT = 1e-8
"""Sine of the angle below which a face or line counts as square to a direction."""
STRAIGHT = 1e-9
"""Sine of the turn of an outline below which it goes straight on."""
_FACES = 200
"""Faces of a polyhedron whose normals a search begins with."""
_SLIVER = 1e-12
"""Relative to the size: triangles narrower than this have no plane to speak of."""
_MEMORY = 2_000_000
"""Heights of points above planes that are worked out at a time."""


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron: ``vertices`` (n, 3), ``planes`` (m, 4) with outward unit normals, normal . x + d <= 0."""

    vertices: Array
    planes: Array
    faces: NDArray[np.int64] = field(repr=False)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Corner numbers (k, 2) of the edges; those between two triangles of one flat face are left out."""
        pairs, owner, _ = edges_of(self.faces, 2)
        normal = normals_and_areas(self.vertices[self.faces])[0][owner]
        bent = np.linalg.norm(np.cross(normal[:, 0], normal[:, 1]), axis=1) > 1e-10
        return np.asarray(pairs[bent])

    def support(self, n: Array) -> Array:
        """The vertices (k, 3) that lie furthest along ``n`` (k, 3)."""
        return np.asarray(self.vertices[np.argmax(n @ self.vertices.T, axis=1)])

    def face(self, n: Array, within: float = FLAT) -> Array:
        """Points (k, 3) of what lies furthest along ``n`` (3,): corners, and the middles between each two of them."""
        height = self.vertices @ n
        corners = self.vertices[height >= height.max() - within * (1.0 + float(np.ptp(height)))][:24]
        i, j = np.triu_indices(len(corners))
        return np.asarray(0.5 * (corners[i] + corners[j]))

    def depth(self, points: Array) -> Array:
        """How deep points (k, 3) lie inside; negative outside, and then no further out than they are."""
        return np.asarray(-(points @ self.planes[:, :3].T + self.planes[:, 3]).max(axis=1))

    @property
    def flat_normals(self) -> Array:
        """Unit normals (k, 3) of the faces, of a body that is nearly round only some."""
        return self.planes[:_FACES, :3]

    def normals(self, n: Array) -> Array:
        """The face normals (k, 3) nearest to ``n`` (k, 3)."""
        return np.asarray(self.planes[np.argmax(n @ self.planes[:, :3].T, axis=1), :3])

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
    from scipy.spatial import ConvexHull, QhullError  # takes longer to import than most hulls to make

    points = np.ascontiguousarray(points, dtype=np.float64)
    try:
        qhull = ConvexHull(points)
    except QhullError as error:
        raise ValueError("the points lie in one plane") from error
    faces = qhull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), qhull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward, ::-1]
    number = np.empty(len(points), dtype=np.int64)
    number[qhull.vertices] = np.arange(len(qhull.vertices))
    normals = qhull.equations[np.unique(qhull.equations.round(12), axis=0, return_index=True)[1], :3]
    return Hull(points[qhull.vertices], _planes(normals, points), number[faces])


def prism(corners: Array, start: float, end: float, frame: Array) -> Hull:
    """A convex outline (k, 2), anticlockwise, drawn from ``start`` to ``end`` mm along z of ``frame`` (3, 3)."""
    corners = corners[turns(corners) > STRAIGHT]
    n = len(corners)
    ends = [np.column_stack([corners, np.full(n, z)]) for z in (start, end)]
    vertices = np.vstack(ends) @ frame.T
    fan = np.column_stack([np.zeros(n - 2, dtype=np.int64), np.arange(1, n - 1), np.arange(2, n)])
    here, following = np.arange(n), np.roll(np.arange(n), -1)
    sides = [np.column_stack([here, following, following + n]), np.column_stack([here, following + n, here + n])]
    faces = np.vstack([fan[:, ::-1], fan + n, *sides])
    along = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([along[:, 1], -along[:, 0], np.zeros(n)]) / np.linalg.norm(along, axis=1)[:, None]
    normals = np.vstack([outward, [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)]]) @ frame.T
    return Hull(vertices, _planes(normals, vertices), faces if np.linalg.det(frame) > 0.0 else faces[:, ::-1])


def _planes(normals: Array, points: Array) -> Array:
    """Planes (m, 4) square to unit normals (m, 3), up to the highest of the points (n, 3): none is cut off."""
    step = max(1, _MEMORY // len(points))
    top = [(normals[k : k + step] @ points.T).max(axis=1) for k in range(0, len(normals), step)]
    return np.column_stack([normals, -np.concatenate(top)])


def hull_error(vertices: Array, faces: NDArray[np.int64]) -> float:
    """How far (mm) points of the convex hull of a closed mesh are from the mesh at most; inf if it is far from convex.

    Let a point c inside see all triangles (m, 3), wound outward, and no vertex (n, 3) be more than h above a triangle's
    plane. A ray from c that leaves the mesh at z through a plane whose normal it makes the angle t with leaves the hull
    within h / cos t of z, and cos t is the depth of c below the plane over the distance of c and z.
    """
    scale = float(np.abs(vertices).max())
    flat = ~slivers_of(vertices, faces, _SLIVER * scale)  # others have no plane to speak of
    corners = vertices[faces[flat]]
    normal, corner = normals_and_areas(corners)[0], corners[:, 0]
    few = np.unique(np.arange(64) * 2654435761 % max(1, len(normal)))  # far apart, in no step with the rings of a mesh
    offset = np.einsum("ij,ij->i", normal, corner)
    for rows in (few, slice(None)):
        height = float((-_planes(normal[rows], vertices)[:, 3] - offset[rows]).max(initial=0.0))
        if height > 1e-6 * scale:
            return np.inf
    centre = vertices.mean(axis=0)
    depth = float((offset - normal @ centre).min(initial=np.inf))
    if not 0.0 < depth < np.inf:
        return np.inf
    # A point of a sliver is this far from a neighbour's plane.
    height += 0.0 if flat.all() else _SLIVER * scale
    return height * float(np.linalg.norm(vertices - centre, axis=1).max()) / depth
