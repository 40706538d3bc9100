"""A mesh prepared for region growing: normals, neighbours, planar cells, and angles about an axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clamp3d.core.mesh import Mesh
from clamp3d.fit.cylinder import Axis, perpendicular

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

MAX_FACET = np.radians(46.0)
"""Widest facet of a tessellated cylinder: an octagon counts as round, a hexagon (a nut, a bolt head) does not."""


class Surface:
    """A mesh less its slivers with what region growing asks for: normals, areas, neighbours, coplanar cells.

    ``rows`` (m,): the rows of the mesh's faces that ``F`` (m, 3) holds.
    """

    def __init__(self, mesh: Mesh) -> None:
        import trimesh

        self.mesh = mesh
        # The normals of slivers are rounding.
        self.rows = np.flatnonzero(~mesh.slivers)
        self.V, self.F = mesh.vertices, mesh.faces[self.rows]
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
