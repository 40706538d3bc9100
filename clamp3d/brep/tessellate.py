"""Triangles of an Open CASCADE solid, each with a bound of its distance from the face that it stands for.

Open CASCADE takes a deflection as a wish. What the triangles really keep is computed afterwards from their parameters:
on planes, cylinders, cones, spheres and tori (and free-form surfaces that are one of these) in closed form, on others
from samples, doubled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.surfaces import (
    OTHER,
    PLANE,
    Faces,
    Size,
    bends,
    from_sides,
    height,
    parameters,
    sense_of,
    surface_of,
    unwrapped,
)
from clamp3d.core.mesh import Array, IntArray
from clamp3d.errors import Clamp3dError

ANGLE = 0.35
"""Largest turn (rad) of a facet's neighbour, so that a small fillet gets facets enough to be seen as round."""
EDGE_CHORD = 0.0005
"""Chord error (mm) of the edges: finer than that of the faces, since where two parts touch their borders decide."""
_RETRIES = 4
_SAFETY = 2.0
"""Factor on deviations that are sampled, not computed: of edges that are no lines or circles, of free-form faces."""


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Triangles of one solid: ``vertices`` (n, 3) mm, ``faces`` (m, 3) outward, equal vertices of neighbours shared.

    ``face`` (m,): number of the B-rep face of each triangle, in the order of an explorer, from 0. ``errors`` (m,) mm:
    no point of the triangle is further from its face, and no point of what it stands for further from the triangle.
    ``surfaces``: the faces themselves, with the triangles on each.
    """

    vertices: Array
    faces: IntArray
    face: IntArray
    errors: Array
    surfaces: Faces


def explore(shape: Any, kind: str, outside: str = "SHAPE") -> Iterator[Any]:
    """Sub-shapes of a ``kind`` ("SOLID", "FACE", ...), ``outside`` of those of another, in the explorer's order."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    name = kind.capitalize()
    cast = getattr(TopoDS, f"{name}_s", None) or getattr(TopoDS, name)
    kinds = (getattr(TopAbs_ShapeEnum, f"TopAbs_{k}") for k in (kind, outside))
    explorer = TopExp_Explorer(shape, *kinds)
    while explorer.More():
        yield cast(explorer.Current())
        explorer.Next()


def tessellate(solid: Any, chord: float, angle: float = ANGLE) -> Tessellation:
    """Triangles of a TopoDS_Shape within ``chord`` mm of its faces, where the mesher gets there in a few tries.

    The mesher runs in this thread: Open CASCADE's parallel one hangs in a forked process. Raises Clamp3dError if a
    face gets no triangles.
    """
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools
    from OCP.IMeshTools import IMeshTools_Parameters

    wanted = chord
    for _ in range(_RETRIES):
        BRepTools.Clean_s(solid)
        asked = IMeshTools_Parameters()
        asked.Deflection, asked.DeflectionInterior = min(EDGE_CHORD, wanted), wanted
        asked.Angle = asked.AngleInterior = angle
        BRepMesh_IncrementalMesh(solid, asked)
        made = _collected(solid)
        worst = float(made.errors.max())
        if worst <= chord:
            break
        # Below a tenth of what is asked for it is the file's own tolerance that is in the way.
        wanted, angle = max(0.7 * wanted * chord / worst, 0.1 * chord), 0.7 * angle
    return made


def _collected(solid: Any) -> Tessellation:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location

    surfaces: list[tuple[int, Array, Size, float]] = []
    rows: list[tuple[NDArray[Any], ...]] = []
    nodes: list[Array] = []
    links: list[tuple[int, int]] = []
    first_seen: dict[int, list[tuple[Any, IntArray]]] = {}
    start = 0
    for number, face in enumerate(explore(solid, "FACE")):
        place = TopLoc_Location()
        found = BRep_Tool.Triangulation_s(face, place)
        if found is None:
            raise Clamp3dError(f"Open CASCADE makes no triangles of face {number + 1}")
        n = found.NbNodes()
        P = placed(np.array([found.Node(i).Coord() for i in range(1, n + 1)]), place)
        F = np.array([found.Triangle(i).Get() for i in range(1, found.NbTriangles() + 1)], dtype=np.int64) - 1
        given = F
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            F = F[:, ::-1]
        kind, frame, size, deviation = surface_of(face)
        pieces, sags = [], []
        tolerance = BRep_Tool.Tolerance_s(face)
        for edge in explore(face, "EDGE"):
            polygon = BRep_Tool.PolygonOnTriangulation_s(edge, found, place)
            if polygon is None:
                continue
            tolerance = max(tolerance, BRep_Tool.Tolerance_s(edge))
            at = np.array([polygon.Node(i) for i in range(1, polygon.NbNodes() + 1)]) - 1
            if BRep_Tool.Degenerated_s(edge):
                links += [(start + int(at[0]), start + int(k)) for k in at[1:]]
                continue
            twins = first_seen.setdefault(hash(edge), [])
            twin = next((other for known, other in twins if known.IsSame(edge)), None)
            if twin is None:
                twins.append((edge, start + at))
            else:
                links += list(zip(twin.tolist(), (start + at).tolist(), strict=True))
            pieces.append(np.column_stack([at[:-1], at[1:]]))
            sags.append(_sags(edge, polygon, P[at], kind, frame, size))
        sag = _at_sides(F, n, pieces, sags)
        uv = unwrapped(kind, parameters(kind, frame, size, P)[F])
        if kind == OTHER:
            own = _sampled(face, found, given, P)
            deviation = float(own.max())
        else:
            deviation = max(deviation, float(np.abs(height(kind, frame, size, P)).max()))
            own = bends(kind, size, uv, P[F]) + deviation
        surfaces.append((kind, frame, size, deviation))
        nodes.append(P)
        rows.append((F + start, np.full(len(F), number), own + sag.max(axis=1) + tolerance, uv, sag, P[F]))
        start += n
    if not nodes:
        raise Clamp3dError("the solid has no faces")
    F, owner, errors, uv, sag, corners = (np.concatenate(column) for column in zip(*rows, strict=True))
    V, F, whole = _joined(np.concatenate(nodes), F, links)
    flat = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) <= 1e-14
    kept = whole & ~flat
    senses = [
        sense_of(kind, frame, size, corners[kept & (owner == number)])
        for number, (kind, frame, size, _) in enumerate(surfaces)
    ]
    faces = Faces(
        np.array([s[0] for s in surfaces], dtype=np.int64),
        np.array([s[1] for s in surfaces]),
        np.array([s[2] for s in surfaces]),
        np.array(senses),
        np.array([s[3] for s in surfaces]),
        *(np.ascontiguousarray(x[kept]) for x in (errors, corners, uv, owner, sag)),
    )
    return Tessellation(V, F, owner[whole], errors[whole], faces)


def placed(points: Array, place: Any) -> Array:
    """Points (n, 3) moved by a TopLoc_Location."""
    if place.IsIdentity():
        return points
    move = place.Transformation()
    M = np.array([[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
    return np.asarray(points @ M[:, :3].T + M[:, 3])


def _joined(V: Array, F: IntArray, links: list[tuple[int, int]]) -> tuple[Array, IntArray, NDArray[np.bool_]]:
    """Nodes that two faces share along an edge made one, without triangles that this folds; which ones are left."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if links:
        i, j = np.array(links).T
        graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(V), len(V)))
        _, label = connected_components(graph, directed=False)
        keep = np.unique(label, return_index=True)[1]
        V, F = V[keep], label[F].astype(np.int64)
    whole = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    used, rows = np.unique(F[whole], return_inverse=True)
    return V[used], rows.reshape(-1, 3), whole


def _at_sides(F: IntArray, n: int, pieces: list[IntArray], sags: list[Array]) -> Array:
    """The largest of ``sags`` among the ``pieces`` of the face's edges that are each triangle's sides (m, 3)."""
    found = np.zeros(F.shape)
    if pieces:
        pairs, sag = np.sort(np.concatenate(pieces), axis=1), np.concatenate(sags)
        keys = pairs[:, 0] * n + pairs[:, 1]
        order = np.argsort(keys)
        for k in range(3):
            side = np.sort(F[:, [k, (k + 1) % 3]], axis=1)
            wanted = side[:, 0] * n + side[:, 1]
            row = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
            found[:, k] = np.where(keys[row] == wanted, sag[row], 0.0)
    return found


def _sags(edge: Any, polygon: Any, nodes: Array, kind: int, frame: Array, size: Size) -> Array:
    """How far each piece (k,) of an edge can be from the line on the surface that is straight in its parameters, mm."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_CurveType as Kind

    curve = BRepAdaptor_Curve(edge)
    what = curve.GetType()
    if what == Kind.GeomAbs_Line:
        return np.zeros(len(nodes) - 1)
    t = np.array([polygon.Parameter(i) for i in range(1, polygon.NbNodes() + 1)])
    turn = 0.5 * np.minimum(np.abs(np.diff(t)), np.pi)
    if what == Kind.GeomAbs_Circle and kind in (PLANE, OTHER):
        return np.asarray(curve.Circle().Radius() * (1.0 - np.cos(turn)))
    if what == Kind.GeomAbs_Ellipse and kind in (PLANE, OTHER):  # a circle stretched: at most by the longer half axis
        return np.asarray(curve.Ellipse().MajorRadius() * (1.0 - np.cos(turn)))
    off = np.zeros(len(t) - 1)
    for share in (0.25, 0.5, 0.75):
        at = (1.0 - share) * t[:-1] + share * t[1:]
        true = np.array([curve.Value(float(x)).Coord() for x in at])
        off = np.maximum(off, from_sides(kind, frame, size, nodes[:-1], nodes[1:], true))
    return np.where(off > 1e-11, _SAFETY * off, 0.0)


_SAMPLES = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=np.float64)
_SAMPLES /= _SAMPLES.sum(axis=1, keepdims=True)


def _sampled(face: Any, triangulation: Any, F: IntArray, P: Array) -> Array:
    """Twice the largest distance (m,) found between points of triangles and the surface at the same parameters."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    surface = BRepAdaptor_Surface(face)
    uv = np.array([triangulation.UVNode(i).Coord() for i in range(1, len(P) + 1)])
    where = np.einsum("sk,mkd->msd", _SAMPLES, uv[F]).reshape(-1, 2)
    flat = np.einsum("sk,mkd->msd", _SAMPLES, P[F]).reshape(-1, 3)
    points = np.array([surface.Value(float(u), float(v)).Coord() for u, v in where])
    found = np.linalg.norm(points - flat, axis=1)
    return np.asarray(_SAFETY * found.reshape(len(F), -1).max(axis=1))
