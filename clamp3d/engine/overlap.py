"""What two meshes have in common: its volume, box and corners, its deepest point, and how thick it is at most."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.farthest import End, Pieces, farthest
from clamp3d.engine.surface import Surface
from clamp3d.geometry.manifolds import arrays_of, as_manifold
from clamp3d.geometry.pose import Array, to_source
from clamp3d.geometry.shells import volume
from clamp3d.geometry.triangles import normals_and_areas

_INNER = 40
"""Triangles of an overlap under which a point is tried."""
_CORNERS = 400
"""Corners of an overlap that are measured."""


class Common(Surface):
    """The common part of two meshes, a closed mesh in the frame of the first."""

    @cached_property
    def volume(self) -> float:
        """Volume in mm^3."""
        return max(0.0, float(volume(self.vertices, self.faces)))

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

    @cached_property
    def inner_points(self) -> Array:
        """Points (k, 3) under the middles of the largest triangles, as deep as the part is thick on average."""
        normal, area = self.areas
        depth = self.volume / max(float(area.sum()), 1e-300)
        points = self.middles() - depth * normal[self._largest]
        return np.asarray(points[self.contains(points)])

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
    placed = (b, T.tobytes())
    if a.last_common is None or a.last_common[0] != placed:  # a pair's levels ask for the same one after the other
        vertices, faces = arrays_of(a.manifold ^ b.manifold.transform(np.ascontiguousarray(T[:3])))
        a.last_common = placed, Common(vertices, faces) if len(faces) else None
    part: Common | None = a.last_common[1]
    return part


def deepest(a: Surface, b: Surface, T: Array, shared: Common) -> tuple[float, Array]:
    """A depth (mm) that a point of one body certainly has inside the other, and the point (3,).

    Some corners of the common part are tried, middles of its triangles, and points in it. They lie in both meshes; a
    point of the true body is within the error of the faces near it, and the true surface of the other no nearer than
    its mesh less its error.
    Negative: nothing is certain.
    """
    corners = shared.vertices[:: max(1, len(shared.vertices) // _CORNERS)]
    points = np.vstack([corners, shared.middles(), shared.inner_points])
    depth = np.maximum(a.distance(points), b.distance(to_source(T, points))) - a.error - b.error
    k = int(np.argmax(depth))
    return float(depth[k]), points[k]


def thickness(a: Surface, b: Surface, T: Array, shared: Common, end: End, cuts: int) -> float:
    """Upper bound (mm) of how deep what one mesh's triangles in the other stand for can lie in the true other body.

    It is sharpened until ``end``, of the bound and of what none can be less than, or ``cuts`` are made. Infinite where
    no bound can be enough for that, where one body may be swallowed whole, since the surfaces then say nothing of its
    middle, and of a common part with more triangles than it may be cut into.
    """
    if len(shared.faces) > cuts or _may_be_swallowed(a, b, T, shared):
        return np.inf
    in_a = shared.vertices[shared.faces]
    in_b = to_source(T, in_a)
    (on_a, off_a), (on_b, off_b) = _origins(a, in_a), _origins(b, in_b)
    # Those that lie on a surface alone are no way from it.
    sides = (a, in_a, on_b | ~on_a, off_b), (b, in_b, on_a | ~on_b, off_a)
    every = [Pieces.of(s, pieces[rows], errors[rows]) for s, pieces, rows, errors in sides]
    return np.inf if end(np.inf, max(pieces.reached for pieces in every)) else farthest(every, end, cuts)


def _origins(surface: Surface, pieces: Array) -> tuple[NDArray[np.bool_], Array]:
    """Which triangles (m, 3, 3) lie on a surface, and how far (m,) mm what they stand for can be from them."""
    middles = pieces.mean(axis=1)
    on = surface.distance(middles) <= 1e-9 * surface.scale
    return on, surface.error_at(middles) if surface.has_own_errors else np.full(len(middles), surface.error)


def _may_be_swallowed(a: Surface, b: Surface, T: Array, shared: Common) -> bool:
    """Whether half of a body may be in the other mesh, also of one among several of a mesh."""
    solids = a.manifold, b.manifold.transform(np.ascontiguousarray(T[:3]))
    if all(len(surface.shell_points) == 1 for surface in (a, b)):
        return 2.0 * shared.volume >= min(float(solid.volume()) for solid in solids)
    bodies = [body for solid in solids for body in solid.decompose()]
    if 2.0 * shared.volume < min(float(body.volume()) for body in bodies):
        return False
    overlaps = as_manifold(shared.vertices, shared.faces).decompose()
    return any(
        2.0 * overlap.volume() >= body.volume() and (overlap ^ body).volume() > 0.5 * overlap.volume()
        for overlap in overlaps
        for body in bodies
    )
