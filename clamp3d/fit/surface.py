"""A mesh prepared for region growing: normals, neighbours, planar cells, and angles about an axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from clamp3d.core.linear import atan2, dot
from clamp3d.core.mesh import Array, IntArray, Mesh
from clamp3d.fit.cylinder import Axis, perpendicular

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
        self.bend = atan2(np.linalg.norm(np.cross(n1, n2), axis=1), np.einsum("ij,ij->i", n1, n2))
        alone = trimesh.grouping.group_rows(tm.edges_sorted, require_count=1)  # type: ignore[no-untyped-call]
        self.rim, self.rim_faces = tm.edges_sorted[alone], tm.edges_face[alone]
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

    def lean(self, axis: Axis, faces: IntArray) -> Array:
        """Cosine (k,) of the angle between the normals of ``faces`` (k,) and the direction away from the axis."""
        return np.asarray(np.einsum("ij,ij->i", self.normals[faces], axis.radial(self.centres[faces])[0]))

    def labels(self, keep: BoolArray) -> IntArray:
        """Component (m,) of each face when only the neighbour pairs ``keep`` (p,) connect."""
        from trimesh.graph import connected_component_labels

        label = connected_component_labels(self.pairs[keep], len(self.F))  # type: ignore[no-untyped-call]
        return np.asarray(label, dtype=np.int64)

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
    return np.asarray(atan2(dot(p, w), dot(p, u)))


def turned(angle: Array, base: Array) -> Array:
    """Angles from ``base``, in [-pi, pi)."""
    return np.asarray((angle - base + np.pi) % (2.0 * np.pi) - np.pi)


def covered(u: Array, least: float) -> tuple[float, float]:
    """Middle and half of the arc that triangles' angles (m, 3) cover, rad; half a turn if no gap is ``least`` wide."""
    start = np.remainder(u.min(axis=1), 2.0 * np.pi)
    order = np.argsort(start, kind="stable")
    start, end = start[order], (start + np.ptp(u, axis=1))[order]
    reached = np.maximum.accumulate(end)
    gaps = np.append(start[1:], start[0] + 2.0 * np.pi) - np.maximum(reached, reached[-1] - 2.0 * np.pi)
    k = int(np.argmax(gaps))
    if gaps[k] < least:
        return 0.0, np.pi
    half = np.pi - 0.5 * float(gaps[k])
    return float(reached[k] + gaps[k]) + half, half


def facet_span(surface: Surface, axis: Axis, faces: IntArray, cells: IntArray) -> Array:
    """Angle (rad) about the axis of each planar cell that has some of ``faces``, counting those faces only."""
    angle = angles(surface, axis, faces, *perpendicular(axis.direction))
    names, first, cell = np.unique(cells[faces], return_index=True, return_inverse=True)
    about = turned(angle, angle[first, :1][cell])
    index = np.arange(len(names))
    return np.asarray(ndimage.maximum(about.max(axis=1), cell, index) - ndimage.minimum(about.min(axis=1), cell, index))
