"""What two meshes have in common: its volume, box and corners, its deepest point, and how thick it is at most."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.surface import Surface
from clamp3d.geometry.manifolds import arrays_of
from clamp3d.geometry.pose import Array, inverse, to_source, to_target
from clamp3d.geometry.shells import volume
from clamp3d.geometry.triangles import closest_points, normals_and_areas, quarters

_INNER = 40
"""Triangles of an overlap under which a point is tried."""
_CORNERS = 400
"""Corners of an overlap that are measured."""
_NO_FURTHER = 1e-3
"""Relative to the greatest distance that was measured: a bound larger by less is sharp."""
_CLEAR = 1e-7
"""Relative to the size: so far beyond a plane nothing is on it, whatever is rounded."""
_HAIR = 1e-9
"""Relative to the size: a piece that reaches over a border by less is not cut there."""


@dataclass(eq=False)
class Common:
    """The common part of two meshes, a closed mesh in the frame of the first: ``vertices`` (n, 3), ``faces`` (m, 3)."""

    vertices: Array
    faces: NDArray[np.int64]

    @cached_property
    def volume(self) -> float:
        """Volume in mm^3."""
        return max(0.0, float(volume(self.vertices, self.faces)))

    @property
    def box(self) -> Array:
        """Lower and upper corner (2, 3), mm."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def areas(self) -> tuple[Array, Array]:
        """Outward unit normals (m, 3) of the triangles, and their areas (m,) in mm^2."""
        return normals_and_areas(self.vertices[self.faces])

    @cached_property
    def _largest(self) -> NDArray[np.int64]:
        """Its largest triangles (k,)."""
        _, area = self.areas
        rows = np.argsort(-area, kind="stable")[:_INNER]
        return np.asarray(rows[area[rows] > 0.0])

    def middles(self) -> Array:
        """The middles (k, 3) of the largest triangles: corners may lie where both bodies end."""
        return np.asarray(self.vertices[self.faces[self._largest]].mean(axis=1))

    def inner_points(self) -> Array:
        """Points (k, 3) under the middles of the largest triangles, as deep as the part is thick on average."""
        normal, area = self.areas
        depth = self.volume / max(float(area.sum()), 1e-300)
        points = self.middles() - depth * normal[self._largest]
        return np.asarray(points[Surface(self.vertices, self.faces).contains(points)])

    def directions(self, most: int = 4) -> Array:
        """Unit vectors (k, 3) square to the largest flat sides of the common part."""
        normal, area = self.areas
        chosen: list[Array] = []
        weight = area.copy()
        while len(chosen) < most and weight.max(initial=0.0) > 0.0:
            n = normal[int(np.argmax(weight))]
            chosen.append(n)
            weight[np.abs(normal @ n) > 1.0 - 1e-6] = 0.0
        return np.array(chosen).reshape(-1, 3)

    def mean_normal(self, surface: Surface) -> Array:
        """Unit vectors (0 or 1, 3): the mean outward normal of what of ``surface`` bounds the common part."""
        normal, area = self.areas
        middles = self.vertices[self.faces].mean(axis=1)
        on_surface = surface.distance(middles) <= 1e-9 * surface.scale
        mean = (normal * area[:, None])[on_surface].sum(axis=0)
        size = float(np.linalg.norm(mean))
        return np.asarray(mean[None] / size if size > 1e-3 * float(area.sum()) else np.empty((0, 3)))


def common(a: Surface, b: Surface, T: Array) -> Common | None:
    """The common part of ``a`` and of ``b`` at ``T`` (4, 4) in a's frame; None if there is none."""
    intersection = a.manifold ^ b.manifold.transform(np.ascontiguousarray(T[:3]))
    vertices, faces = arrays_of(intersection)
    return Common(vertices, faces) if len(faces) else None


def deepest(a: Surface, b: Surface, T: Array, shared: Common) -> tuple[float, Array]:
    """A depth (mm) that a point of one body certainly has inside the other, and the point (3,).

    Some corners of the common part are tried, middles of its triangles, and points in it. They lie in both meshes; a
    point of the true body is within the error of the faces near it, and the true surface of the other no nearer than
    its mesh less its error.
    Negative: nothing is certain.
    """
    corners = shared.vertices[:: max(1, len(shared.vertices) // _CORNERS)]
    points = np.vstack([corners, shared.middles(), shared.inner_points()])
    depth = np.maximum(a.distance(points), b.distance(to_source(T, points))) - a.error - b.error
    k = int(np.argmax(depth))
    return float(depth[k]), points[k]


def thickness(
    a: Surface, b: Surface, T: Array, shared: Common, end: Callable[[float, float], bool], cuts: int
) -> float:
    """Upper bound (mm) of how deep any point of one mesh's surface lies in the other.

    It is sharpened until ``end(bound, reached)``, of the bound and of a depth that a point has, or ``cuts`` are made.

    Lemma: the distance from a fixed triangle is convex, so over a triangle of the common part it is largest at a
    corner, and the distance from the whole surface is no larger than that from any one of its triangles. Another is
    that of `_moves_out`. Infinite where one body may be swallowed whole, since the surfaces then say nothing of its
    middle, and of a common part with more triangles than it may be cut into.
    """
    if len(shared.faces) > cuts or 2.0 * shared.volume >= min(float(s.manifold.volume()) for s in (a, b)):
        return np.inf
    bound = np.inf
    for pieces in cut_up(a, b, T, shared.vertices[shared.faces], cuts):
        bound = float(pieces.at_most.max(initial=0.0))
        if end(bound, float(pieces.middles.max(initial=0.0))):
            break
    return bound


class Pieces(NamedTuple):
    """Triangles (m, 3, 3): how far from either surface their middles (m,) are, and any point of them (m, 2) at most."""

    triangles: Array
    middles: Array
    at_most: Array

    @classmethod
    def of(cls, a: Surface, b: Surface, triangles: Array, T: Array) -> Pieces:
        """Measured from two surfaces, ``b`` at ``T`` (4, 4) in the frame of ``a`` and the triangles."""
        (near_a, most_a), (near_b, most_b) = _distances(a, triangles), _distances(b, to_source(T, triangles))
        return cls(triangles, np.maximum(near_a, near_b), np.stack([most_a, most_b], axis=1))

    def replaced(self, rows: NDArray[np.bool_], by: Pieces) -> Pieces:
        """With others in place of some."""
        return Pieces(*(np.concatenate([own[~rows], new]) for own, new in zip(self, by, strict=True)))


def cut_up(a: Surface, b: Surface, T: Array, triangles: Array, most: int) -> Iterator[Pieces]:
    """Triangles (m, 3, 3), and what is left when the furthest are cut, again and again, until ``most`` are added."""
    pieces = Pieces.of(a, b, triangles, T)
    while True:
        yield pieces
        # What is no further than a middle that was measured cannot be the furthest.
        bound = max(0.5 * pieces.at_most.max(initial=0.0), (1.0 + _NO_FURTHER) * pieces.middles.max(initial=0.0))
        furthest = pieces.at_most.max(axis=1) > bound
        most -= 2 * int(furthest.sum())  # three or four in place of one
        if most < 0 or not furthest.any():
            return
        from_a = pieces.at_most[:, 0] >= pieces.at_most[:, 1]
        cut = [_cut(a, np.eye(4), pieces.triangles[furthest & from_a])]
        cut.append(_cut(b, inverse(T), pieces.triangles[furthest & ~from_a]))
        pieces = pieces.replaced(furthest, Pieces.of(a, b, np.concatenate(cut), T))


def _distances(surface: Surface, triangles: Array) -> tuple[Array, Array]:
    """Distance (m,) of the middles of triangles (m, 3, 3) of the common part from a surface, and of any point at most.

    The least of two bounds: to the triangle nearest to the middle, and the length of a move that takes all of it out.
    """
    distance, face, foot = surface.nearest(triangles.mean(axis=1))
    chosen = np.repeat(surface.vertices[surface.faces[face]], 3, axis=0)
    corners = triangles.reshape(-1, 3)
    at_most = np.linalg.norm(closest_points(chosen, corners) - corners, axis=1).reshape(-1, 3).max(axis=1)
    move = _moves_out(surface, triangles, foot, surface.normals[face])
    length = np.linalg.norm(move, axis=1)
    rows = np.flatnonzero(length < at_most)
    rows = rows[surface.is_outside(triangles[rows] + move[rows, None])]
    at_most[rows] = length[rows]
    return distance, np.asarray(at_most)


def _moves_out(surface: Surface, triangles: Array, feet: Array, normals: Array) -> Array:
    """Moves (m, 3) that take triangles (m, 3, 3) beyond the planes through ``feet`` (m, 3), along their normals.

    Lemma: who leaves a body crosses its surface, so a point of the body is no further from that than it is moved to be
    outside.
    """
    height = np.einsum("mcj,mj->mc", feet[:, None] - triangles, normals).max(axis=1)
    return np.asarray((np.maximum(height, 0.0) + _CLEAR * max(1.0, surface.scale))[:, None] * normals)


def _cut(surface: Surface, T: Array, pieces: Array) -> Array:
    """Triangles (k, 3, 3) cut where they reach over a border of the surface's triangle nearest to their middle.

    Each is cut along one border, upright; those that reach over none are cut in four. ``T`` (4, 4) takes them to the
    surface's frame.
    """
    local = to_target(T, pieces)
    _, face, _ = surface.nearest(local.mean(axis=1))
    corners = surface.vertices[surface.faces[face]]
    inward = np.cross(surface.normals[face][:, None], np.roll(corners, -1, axis=1) - corners)
    inward /= np.maximum(np.linalg.norm(inward, axis=2), 1e-300)[:, :, None]
    height = np.einsum("mbj,mbcj->mbc", inward, local[:, None] - corners[:, :, None])
    reach = np.minimum(height.max(axis=2), -height.min(axis=2))
    border = reach.argmax(axis=1)
    rows = np.arange(len(pieces))
    over = reach[rows, border] > _HAIR * surface.scale
    return np.concatenate([_split(pieces[over], height[rows, border][over]), quarters(pieces[~over])])


def _split(pieces: Array, height: Array) -> Array:
    """Triangles (3 m, 3, 3): each of (m, 3, 3) cut where the height (m, 3) of its corners changes sign."""
    above = height > 0.0
    lone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)  # the corner that is alone on its side
    order = (lone[:, None] + np.arange(3)) % 3
    rows = np.arange(len(pieces))[:, None]
    (a, b, c), (h, i, j) = pieces[rows, order].transpose(1, 0, 2), height[rows, order].T
    ab = a + (h / (h - i))[:, None] * (b - a)
    ac = a + (h / (h - j))[:, None] * (c - a)
    return np.concatenate([np.stack(corners, axis=1) for corners in ((a, ab, ac), (ab, b, c), (ab, c, ac))])
