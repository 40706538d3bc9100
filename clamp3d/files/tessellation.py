"""Triangles of a solid by Open CASCADE, and how far each can be from its face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.faces import OTHER, PLANE, Surfaces, height, surfaces_of
from clamp3d.files.open_cascade import explore, from_bytes
from clamp3d.geometry.mesh import Array, IntArray

ANGLE = 0.35
"""Largest turn (rad) from facet to facet, so that a small fillet gets facets enough to be seen as round."""

SAMPLED = 2.0
"""Factor on the deviation measured at the edges' middles; 4/3 is enough where the surface is quadratic."""


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
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    solid = from_bytes(brep)
    BRepTools.Clean_s(solid)
    BRepMesh_IncrementalMesh(solid, 0.7 * chord, False, ANGLE, False)
    faces = [*explore(solid, "FACE")]
    form = surfaces_of(faces)
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
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location

    place = TopLoc_Location()
    triangulation = BRep_Tool.Triangulation_s(face, place)
    if triangulation is None:
        raise Clamp3dError(f"Open CASCADE makes no triangles of face {number + 1}")
    count = range(1, triangulation.NbNodes() + 1)
    points = np.array([triangulation.Node(i).Coord() for i in count])
    uv = np.array([triangulation.UVNode(i).Coord() for i in count])
    triangles = np.array([triangulation.Triangle(i).Get() for i in range(1, triangulation.NbTriangles() + 1)]) - 1
    if not place.IsIdentity():
        move = place.Transformation()
        M = np.array([[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
        points = points @ M[:, :3].T + M[:, 3]
    if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return points, triangles.reshape(-1, 3), uv


def _deviation(face: Any, form: Surfaces, k: int, points: Array, triangles: IntArray, uv: Array) -> Array:
    """How far (m,) mm each triangle can be from its surface: measured at the edges' middles, times `SAMPLED`."""
    kind = int(form.kind[k])
    P = points[triangles]
    middles = 0.5 * (P + np.roll(P, -1, axis=1))
    if kind == OTHER:
        from OCP.BRepAdaptor import BRepAdaptor_Surface

        surface = BRepAdaptor_Surface(face)
        at = uv[triangles]
        at = 0.5 * (at + np.roll(at, -1, axis=1))
        true = np.array([surface.Value(u, v).Coord() for u, v in at.reshape(-1, 2).tolist()]).reshape(-1, 3, 3)
        return np.asarray(SAMPLED * np.linalg.norm(true - middles, axis=2).max(axis=1))
    off = np.abs(height(kind, form.frame[k], form.size[k], middles.reshape(-1, 3))).reshape(-1, 3).max(axis=1)
    corner = float(np.abs(height(kind, form.frame[k], form.size[k], points)).max())
    return np.asarray(off + corner if kind == PLANE else SAMPLED * off + corner)


def _border_sag(face: Any, points: Array, triangles: IntArray) -> Array:
    """How far (m,) mm the face's border can be from the edges of each triangle that stand for it."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_CurveType
    from OCP.TopLoc import TopLoc_Location

    place = TopLoc_Location()
    triangulation = BRep_Tool.Triangulation_s(face, place)
    n = len(points)
    keys, sags = [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for edge in explore(face, "EDGE"):
        polygon = BRep_Tool.PolygonOnTriangulation_s(edge, triangulation, place)
        if polygon is None or BRep_Tool.Degenerated_s(edge):
            continue
        curve = BRepAdaptor_Curve(edge)
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_Line:
            continue
        at = np.array([polygon.Node(i) for i in range(1, polygon.NbNodes() + 1)]) - 1
        t = np.array([polygon.Parameter(i) for i in range(1, polygon.NbNodes() + 1)])
        true = np.array([curve.Value(s).Coord() for s in (0.5 * (t[1:] + t[:-1])).tolist()]).reshape(-1, 3)
        sags.append(SAMPLED * np.linalg.norm(true - 0.5 * (points[at[1:]] + points[at[:-1]]), axis=1))
        keys.append(np.minimum(at[1:], at[:-1]) * n + np.maximum(at[1:], at[:-1]))
    key, sag = np.concatenate(keys), np.concatenate(sags)
    if not len(key):
        return np.zeros(len(triangles))
    order = np.argsort(key)
    key, sag = key[order], sag[order]
    ends = np.roll(triangles, -1, axis=1)
    sides = np.minimum(triangles, ends) * n + np.maximum(triangles, ends)
    row = np.minimum(np.searchsorted(key, sides), len(key) - 1)
    return np.asarray(np.where(key[row] == sides, sag[row], 0.0).max(axis=1))
