"""Triangles of a solid by Open CASCADE, and how far each can be from its face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.faces import OTHER, Surfaces, height, surfaces
from clamp3d.files.open_cascade import explore, from_bytes, matrix, occ
from clamp3d.geometry.mesh import Array, IntArray
from clamp3d.geometry.triangles import closest_points

ANGLE = 0.35
"""Largest turn (rad) from facet to facet, so that a small fillet gets facets enough to be seen as round."""

SAMPLED = 2.0
"""Factor on the deviation measured at the edges' middles of splines; 4/3 is enough where the surface is quadratic."""

_FACTORS = np.array([1.0, 1.0, 2.0, 1.4, 1.4, SAMPLED])
"""The same by kind of surface. On a cylinder, as on a circle, nothing is further than such a middle; on spheres and
tori, of which a facet is a small part, it is next to quadratic. Along the edge of a cone from a circle to another one
of k times its radius it is 2 (1 + k) / (1 + sqrt k)^2 times as far.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Triangles of one solid.

    Attributes
    ----------
    vertices : ndarray (n, 3)
        Corners in mm; those that two faces share are one.
    faces : ndarray of int (m, 3)
        Corners of each triangle, wound outward.
    face : ndarray of int (m,)
        Number of the face that each triangle is on, in the explorer's order, from 0.
    errors : ndarray (m,)
        How far (mm) a triangle can be from its face, and its part of the face from the triangle.
    """

    vertices: Array
    faces: IntArray
    face: IntArray
    errors: Array


def tessellate(brep: bytes, chord: float) -> Tessellation:
    """Triangles of a solid within about ``chord`` mm of its faces; what they keep is measured afterwards.

    Raises Clamp3dError if a face gets no triangles.
    """
    solid = from_bytes(brep)
    occ.BRepTools.Clean_s(solid)
    occ.BRepMesh_IncrementalMesh(solid, 0.7 * chord, False, ANGLE, False)
    faces = [*explore(solid, "FACE")]
    form = surfaces(brep)
    corners, triples, numbers, errors = [], [], [], []
    count = 0
    for k, face in enumerate(faces):
        points, triangles, uv = triangles_of(face, k)
        if not len(triangles):
            continue
        deviation = _deviation(face, form, k, points, triangles, uv)
        corners.append(points)
        triples.append(triangles + count)
        count += len(points)
        numbers.append(np.full(len(triangles), k))
        errors.append(np.maximum(deviation, _border_sag(face, points, triangles)))
    if not corners:
        raise Clamp3dError("Open CASCADE makes no triangles of it")
    # Faces that share an edge have the same points on it, so equal coordinates are one vertex.
    vertices, index = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    F = index.reshape(-1)[np.concatenate(triples)]
    whole = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    return Tessellation(vertices, F[whole], np.concatenate(numbers)[whole], np.concatenate(errors)[whole])


def triangles_of(face: Any, number: int) -> tuple[Array, IntArray, Array]:
    """Points (n, 3), triangles (m, 3) wound outward, and the surface parameters (n, 2) of a meshed face."""
    place = occ.TopLoc_Location()
    triangulation = occ.BRep_Tool.Triangulation_s(face, place)
    if triangulation is None:
        raise Clamp3dError(f"Open CASCADE makes no triangles of face {number + 1}")
    count = range(1, triangulation.NbNodes() + 1)
    T = matrix(place)
    points = np.array([triangulation.Node(i).Coord() for i in count]) @ T[:3, :3].T + T[:3, 3]
    uv = np.array([triangulation.UVNode(i).Coord() for i in count])
    triangles = np.array([triangulation.Triangle(i).Get() for i in range(1, triangulation.NbTriangles() + 1)]) - 1
    if face.Orientation() == occ.TopAbs_Orientation.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return points, triangles.reshape(-1, 3), uv


def points_on(face: Any, uv: Array) -> Array:
    """Points (k, 3) of a face's surface at its parameters (k, 2)."""
    surface = occ.BRepAdaptor_Surface(face)
    return np.array([surface.Value(u, v).Coord() for u, v in uv.tolist()]).reshape(-1, 3)


def _deviation(face: Any, form: Surfaces, k: int, points: Array, triangles: IntArray, uv: Array) -> Array:
    """How far (m,) mm each triangle can be from its surface: measured at the edges' middles, times `_FACTORS`."""
    kind, (middles, at) = int(form.kind[k]), (_middles(x[triangles]) for x in (points, uv))
    if kind == OTHER:
        true, corner = points_on(face, at.reshape(-1, 2)), 0.0
        off = np.linalg.norm(closest_points(np.repeat(points[triangles], 3, axis=0), true) - true, axis=1)
    else:
        off, heights = (np.abs(height(kind, form.frame[k], form.size[k], x)) for x in (middles.reshape(-1, 3), points))
        corner = float(heights.max())
    return np.asarray(_FACTORS[kind] * off.reshape(-1, 3).max(axis=1) + corner)


def _middles(corners: Array) -> Array:
    return np.asarray(0.5 * (corners + np.roll(corners, -1, axis=1)))


def _border_sag(face: Any, points: Array, triangles: IntArray) -> Array:
    """How far (m,) mm the face's border can be from the edges of each triangle that stand for it."""
    triangulation = occ.BRep_Tool.Triangulation_s(face, place := occ.TopLoc_Location())
    sag_of: dict[int, float] = {}
    for edge in explore(face, "EDGE"):
        polygon, curve = occ.BRep_Tool.PolygonOnTriangulation_s(edge, triangulation, place), None
        if polygon is not None and not occ.BRep_Tool.Degenerated_s(edge):
            curve = occ.BRepAdaptor_Curve(edge)
        if curve is None or curve.GetType() == occ.GeomAbs_CurveType.GeomAbs_Line:
            continue
        count = range(1, polygon.NbNodes() + 1)
        nodes, at = np.array([polygon.Node(i) - 1 for i in count]), np.array([polygon.Parameter(i) for i in count])
        true = np.array([curve.Value(t).Coord() for t in (0.5 * (at[:-1] + at[1:])).tolist()])
        factor = 1.0 if curve.GetType() == occ.GeomAbs_CurveType.GeomAbs_Circle else SAMPLED
        sags = factor * np.linalg.norm(true - 0.5 * (points[nodes[:-1]] + points[nodes[1:]]), axis=1)
        sag_of.update(zip(_edge_keys(nodes[:-1], nodes[1:]).tolist(), sags.tolist(), strict=True))
    keys = _edge_keys(triangles, np.roll(triangles, -1, axis=1))
    errors, on_border = np.zeros(keys.shape), np.isin(keys, np.array([*sag_of], dtype=np.int64))
    errors[on_border] = [sag_of[key] for key in keys[on_border].tolist()]
    return np.asarray(errors.max(axis=1))


def _edge_keys(a: IntArray, b: IntArray) -> IntArray:
    """A number for each edge between vertices ``a`` and ``b``, the same in both directions."""
    return np.asarray((np.minimum(a, b).astype(np.int64) << 32) + np.maximum(a, b))
