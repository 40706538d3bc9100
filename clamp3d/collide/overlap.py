"""What two meshes have in common: volume, box, corners, the deepest points, and moves that certainly part them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.surface import Surface
from clamp3d.core.linear import dot, norm, to_target
from clamp3d.core.pose import Array, inverse
from clamp3d.core.shells import volume

_INNER = 40
"""Triangles of an overlap under which a point is tried."""
_CORNERS = 400
"""Corners of an overlap that are measured."""
_CELLS, _CELLS_ACROSS, _CLOSE = 60_000, 24, 1.03
"""Cells of a search for the deepest point, those along an axis at first, and how near to the deepest known it goes."""
_CORNERS_OF_CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


@dataclass(eq=False)
class Common:
    """The common part of two meshes, a closed mesh in the frame of the first: ``vertices`` (n, 3), ``faces`` (m, 3)."""

    vertices: Array
    faces: NDArray[np.int64]

    @property
    def volume(self) -> float:
        """Volume in mm^3."""
        return volume(self.vertices, self.faces)

    @property
    def box(self) -> Array:
        """Lower and upper corner (2, 3), mm."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def normals(self) -> tuple[Array, Array]:
        """Outward unit normals (m, 3) of the triangles, and twice their areas (m,)."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        size = np.linalg.norm(cross, axis=1)
        return cross / np.maximum(size, 1e-300)[:, None], size

    def inner_points(self) -> Array:
        """Points (k, 3) under the middles of the largest triangles, as deep as the part is thick on average.

        Volume over area is the inner radius of a ball but for a factor of 3. Those that are outside are left out.
        """
        normal, size = self.normals
        rows = np.argsort(-size, kind="stable")[:_INNER]
        rows = rows[size[rows] > 0.0]
        depth = 2.0 * max(self.volume, 0.0) / max(float(size.sum()), 1e-300)
        points = self.vertices[self.faces[rows]].mean(axis=1) - depth * normal[rows]
        return np.asarray(points[Surface(self.vertices, self.faces).contains(points)])

    def directions(self, most: int = 4) -> Array:
        """Unit vectors (k, 3) square to the largest flat sides of the common part."""
        normal, size = self.normals
        found: list[Array] = []
        weight = size.copy()
        while len(found) < most and weight.max(initial=0.0) > 0.0:
            n = normal[int(np.argmax(weight))]
            same = np.abs(dot(normal, n)) > 1.0 - 1e-6
            found.append(n)
            weight[same] = 0.0
        return np.array(found).reshape(-1, 3)


def common(a: Surface, b: Surface, T: Array) -> Common | None:
    """The common part of ``a`` and of ``b`` at ``T`` (4, 4) in a's frame; None if there is none."""
    made = a.manifold ^ b.manifold.transform(np.ascontiguousarray(T[:3]))
    if made.is_empty():
        return None
    raw = made.to_mesh64()
    V, F = np.array(raw.vert_properties, dtype=np.float64)[:, :3], np.array(raw.tri_verts, dtype=np.int64)
    return Common(V, F) if len(F) else None


def deepest(a: Surface, b: Surface, T: Array, shared: Common) -> tuple[float, Array]:
    """A depth in mm that a point of one body has inside the other, and the point (3,); some of ``shared`` are tried.

    Corners of the common part lie in both meshes, to rounding. A point of the true body is within the error of the
    faces near it, and the true surface of the other no nearer than its faces less their errors. Negative: nothing is
    certain.
    """
    points = np.vstack([shared.vertices[:: max(1, len(shared.vertices) // _CORNERS)], shared.inner_points()])
    back = inverse(T)
    local = to_target(back, points)
    in_a = a.distance_at_least(points) - b.error_at(local)
    in_b = b.distance_at_least(local) - a.error_at(points)
    found = np.maximum(in_a, in_b)
    k = int(np.argmax(found))
    return float(found[k]), points[k]


def deepest_at_most(a: Surface, b: Surface, T: Array, shared: Common, reached: float) -> float:
    """Upper limit (mm) of how deep any point of one mesh lies in the other; ``reached`` mm is a depth that one has.

    Branch and bound over cells around the common part: a point's depth changes by no more than the way to it, so no
    point of a cell is deeper than its middle by more than its half diagonal.
    """
    piece, back = Surface(shared.vertices, shared.faces), inverse(T)
    low, high = shared.box
    half = 0.5 * (high - low) + 1e-300
    count = np.minimum(np.ceil(half / half.min()), _CELLS_ACROSS)
    steps = [np.arange(n) for n in count.astype(int)]
    cells = low + (np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3) * 2.0 + 1.0) * half / count
    half = half / count
    whole = np.zeros(len(cells), dtype=bool)  # cells that lie inside as a whole: theirs do too
    while True:
        radius = norm(half)
        depth = np.maximum(a.distance(cells), b.distance(to_target(back, cells)))
        open_ = depth + radius > _CLOSE * reached
        cells, depth, whole = cells[open_], depth[open_], whole[open_]
        away, inside = piece.distance(cells), whole
        inside[~whole] = piece.contains(cells[~whole])
        reached = max(reached, float(depth[inside].max(initial=0.0)))
        open_ = (inside | (away <= radius)) & (depth + radius > _CLOSE * reached)
        cells, whole = cells[open_], (inside & (away > radius))[open_]
        if not len(cells) or 8 * len(cells) > _CELLS or radius <= 1e-9:
            return max(float((depth[open_] + radius).max(initial=0.0)), _CLOSE * reached)
        half = 0.5 * half
        cells = (cells[:, None] + _CORNERS_OF_CUBE * half).reshape(-1, 3)
        whole = whole.repeat(8)
