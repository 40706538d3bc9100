"""A mesh prepared for region growing: normals, neighbours, planar cells, and angles about an axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clamp3d.fit.axis import Axis
from clamp3d.geometry.mesh import IntArray, Mesh, edges_of
from clamp3d.geometry.pose import Array
from clamp3d.geometry.triangles import normals_and_areas

BoolArray = NDArray[np.bool_]

MAX_FACET = np.radians(46.0)
"""Widest facet of a tessellated cylinder: an octagon counts as round, a hexagon (a nut, a bolt head) does not."""


class Surface:
    """A mesh less its slivers with what region growing asks for: normals, areas, neighbours, coplanar cells.

    ``rows`` (m,): the rows of the mesh's faces that ``F`` (m, 3) holds.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        # The normals of slivers are rounding.
        self.rows = np.flatnonzero(~mesh.slivers)
        self.V, self.F = mesh.vertices, mesh.faces[self.rows]
        corners = self.V[self.F]
        (self.normals, self.areas), self.centres = normals_and_areas(corners), corners.mean(axis=1)
        self.edges, self.pairs, opposite = edges_of(self.F, 2)
        self.rim, rim_faces, _ = edges_of(self.F, 1)
        self.rim_faces = rim_faces[:, 0]
        n1, n2 = self.normals[self.pairs[:, 0]], self.normals[self.pairs[:, 1]]
        self.bend = np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), np.einsum("ij,ij->i", n1, n2))
        # Off-plane distance of each far corner: unlike an angle it does not blow up on slivers.
        on_edge = self.V[self.edges[:, 0]]
        self.step = np.maximum(
            np.abs(np.einsum("ij,ij->i", self.V[opposite[:, 1]] - on_edge, n1)),
            np.abs(np.einsum("ij,ij->i", self.V[opposite[:, 0]] - on_edge, n2)),
        )
        self.valence = np.bincount(self.F.reshape(-1), minlength=len(self.V))
        self.extent = float(np.ptp(self.V[np.unique(self.F)], axis=0).max())
        self.floor = max(4.0 * mesh.rounding, 1e-9 * self.extent)

    def lean(self, axis: Axis, faces: IntArray) -> Array:
        """Cosine (k,) of the angle between the normals of ``faces`` (k,) and the direction away from the axis."""
        return np.asarray(np.einsum("ij,ij->i", self.normals[faces], axis.radial(self.centres[faces])[0]))

    def labels(self, keep: BoolArray) -> IntArray:
        """Number of the component (m,) of each face, when only the neighbour pairs ``keep`` (p,) connect."""
        i, j = self.pairs[keep].T
        n = len(self.F)
        return np.asarray(connected_components(coo_array((np.ones(len(i), bool), (i, j)), (n, n)), directed=False)[1])

    def cells(self, tolerance: float) -> IntArray:
        """Label (m,) of the planar cell of each face; neighbours within ``tolerance`` of one plane share a cell."""
        return self.labels((self.step <= tolerance) & (self.bend < MAX_FACET))


def border(surface: Surface, faces: IntArray) -> tuple[BoolArray, IntArray, BoolArray]:
    """Which neighbour pairs (p,) part ``faces`` from the rest, the faces outside (k,), and which pairs lie within."""
    inside = np.isin(np.arange(len(surface.F)), faces)
    first, second = inside[surface.pairs].T
    crossing = first != second
    return crossing, np.where(first, surface.pairs[:, 1], surface.pairs[:, 0])[crossing], first & second


def angles(surface: Surface, axis: Axis, faces: IntArray, u: Array, w: Array) -> Array:
    """Angles (k, 3) of the corners of ``faces`` (k,) about the axis, rad from u towards w."""
    p = surface.V[surface.F[faces]] - axis.point
    return np.asarray(np.arctan2(p @ w, p @ u))
