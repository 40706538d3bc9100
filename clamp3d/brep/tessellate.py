"""Triangles of an Open CASCADE solid, each with a bound of its distance from the face that it stands for.

Open CASCADE takes a deflection as a wish. What the triangles really keep is computed afterwards from their parameters:
on planes, cylinders, cones, spheres and tori (and free-form surfaces that are one of these) in closed form, on splines
extruded or turned from their control points, on others from samples, doubled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.borders import BORDER, Borders, Curve
from clamp3d.brep.facets import FREE, facets
from clamp3d.brep.surfaces import (
    OTHER,
    PLANE,
    Faces,
    Size,
    bends,
    height,
    normals,
    parameters,
    sense_of,
    surface_of,
    unwrapped,
)
from clamp3d.core.linear import dot
from clamp3d.core.mesh import Array, IntArray
from clamp3d.errors import Clamp3dError

ANGLE = 0.35
"""Largest turn (rad) of a facet's neighbour, so that a small fillet gets facets enough to be seen as round."""
_RETRIES = 4
_BULGE = 10.0 * BORDER
"""Sag (mm) of a border that is not split, because its triangle is too slim, above which borders are meshed finer."""

Surface = tuple[int, Array, Size, float]
"""Kind, frame, sizes and deviation of a face's surface."""


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
    explorer, cast, kinds = _explorer(kind, outside)
    found = explorer(shape, *kinds)
    while found.More():
        yield cast(found.Current())
        found.Next()


@cache
def _explorer(kind: str, outside: str) -> tuple[Any, ...]:
    """Open CASCADE's explorer, what makes a shape one of a kind, and its words for the kinds."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    name = kind.capitalize()
    cast = getattr(TopoDS, f"{name}_s", None) or getattr(TopoDS, name)
    return TopExp_Explorer, cast, [getattr(TopAbs_ShapeEnum, f"TopAbs_{k}") for k in (kind, outside)]


def tessellate(solid: Any, chord: float, angle: float = ANGLE) -> Tessellation:
    """Triangles of a TopoDS_Shape within ``chord`` mm of its faces, where the mesher gets there in a few tries.

    Those of free-form faces are, and within `FREE`; others, whose surfaces are known, are within twice that.
    The mesher runs in this thread: Open CASCADE's parallel one hangs in a forked process. Raises Clamp3dError if a
    face gets no triangles.
    """
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    faces = list(explore(solid, "FACE"))
    surfaces = [surface_of(face) for face in faces]
    wanted, inner = 0.45 * chord, any(_is_trimmed(face, kind) for face, (kind, *_) in zip(faces, surfaces, strict=True))
    free = np.array([kind == OTHER for kind, *_ in surfaces])
    allowed, finer = min(chord, FREE), 1.0
    for _ in range(_RETRIES):
        BRepTools.Clean_s(solid)
        asked = _finest(wanted * allowed / chord, angle)
        for face, is_free in zip(faces, free.tolist(), strict=True):
            if is_free:
                BRepMesh_IncrementalMesh(face, asked)
        # Borders are split in turn, where triangles allow it.
        asked.Deflection = finer * (0.3 * wanted if inner else wanted)
        asked.DeflectionInterior = wanted
        if not inner:  # most faces need none, or are meshed in rows
            asked.InternalVerticesMode, asked.DeflectionInterior, asked.AngleInterior = False, 1e3, 3.0
        BRepMesh_IncrementalMesh(solid, asked)
        try:
            made = _collected(faces, surfaces, wanted)
        except _TornEdgeError:  # as the faces beside it were meshed one after the other
            BRepTools.Clean_s(solid)
            BRepMesh_IncrementalMesh(solid, _finest(wanted * allowed / chord, angle))
            made = _collected(faces, surfaces, wanted)
        of_free = made.surfaces.error[free[made.surfaces.face]].max(initial=0.0)
        worst = max(of_free / allowed, 0.5 * float(made.errors.max()) / chord)
        bulge = made.surfaces.sag[~free[made.surfaces.face]].max(initial=0.0)
        if bulge > _BULGE and finer == 1.0:
            finer = 0.2
        elif worst <= 1.0:
            break
        elif not inner:
            inner = True
        else:  # below a tenth of what is asked for it is the file's own tolerance that is in the way
            wanted, angle = max(0.7 * wanted / worst, 0.1 * chord), 0.7 * angle
    return made


class _TornEdgeError(Clamp3dError):
    """The mesher has split an edge in one way for one of its faces and in another for the other."""


def _finest(deflection: float, angle: float) -> Any:
    """What the mesher is asked for where a face is free-form: ``deflection`` mm, and finer borders."""
    from OCP.IMeshTools import IMeshTools_Parameters

    asked = IMeshTools_Parameters()
    asked.Angle = asked.AngleInterior = angle
    asked.DeflectionInterior = deflection
    asked.Deflection = min(BORDER, deflection)
    return asked


def _is_trimmed(face: Any, kind: int) -> bool:
    """Whether a round face has edges that are no lines or circles, so that it cannot be meshed in rows."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_CurveType, GeomAbs_SurfaceType

    if kind in (PLANE, OTHER) or BRepAdaptor_Surface(face).GetType() == GeomAbs_SurfaceType.GeomAbs_BSplineSurface:
        return False
    plain = (GeomAbs_CurveType.GeomAbs_Line, GeomAbs_CurveType.GeomAbs_Circle)
    edges = explore(face, "EDGE")
    return any(not BRep_Tool.Degenerated_s(e) and BRepAdaptor_Curve(e).GetType() not in plain for e in edges)


def _collected(faces: list[Any], surfaces: list[Surface], chord: float) -> Tessellation:
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location

    coarse: list[tuple[NDArray[Any], ...]] = []
    fine: list[tuple[NDArray[Any], ...]] = []
    nodes: list[Array] = []
    links: list[IntArray] = []
    deviations: list[float] = []
    first_seen: dict[int, list[tuple[Any, IntArray, Curve]]] = {}
    start = 0
    for number, (face, (kind, frame, size, deviation)) in enumerate(zip(faces, surfaces, strict=True)):
        place = TopLoc_Location()
        found = BRep_Tool.Triangulation_s(face, place)
        if found is None:
            raise Clamp3dError(f"Open CASCADE makes no triangles of face {number + 1}")
        P = placed(np.array([found.Node(i).Coord() for i in range(1, found.NbNodes() + 1)]), place)
        edges, border, poles = [], [], []
        tolerance = BRep_Tool.Tolerance_s(face)
        for edge in explore(face, "EDGE"):
            polygon = BRep_Tool.PolygonOnTriangulation_s(edge, found, place)
            if polygon is None:
                continue
            tolerance = max(tolerance, BRep_Tool.Tolerance_s(edge))
            count = range(1, polygon.NbNodes() + 1)
            at = np.array([polygon.Node(i) for i in count]) - 1
            border.append(at)
            if BRep_Tool.Degenerated_s(edge):
                poles.append(at)
                links.append(np.stack([np.full(len(at), start + at[0]), start + at]))
                continue
            twins = first_seen.setdefault(hash(edge), [])
            twin = next((twin for twin in twins if twin[0].IsSame(edge)), None)
            if twin is None:
                twin = edge, start + at, Curve(BRepAdaptor_Curve(edge))
                twins.append(twin)
            elif len(twin[1]) != len(at):
                raise _TornEdgeError(f"Open CASCADE splits an edge of face {number + 1} differently for its two faces")
            else:
                links.append(np.stack([twin[1], start + at]))
            edges.append(
                Borders.of(twin[2], at, np.array(list(map(polygon.Parameter, count))), P[at], kind, frame, size)
            )
        F, P, own = facets(face, found, P, kind, size, border, poles, chord)
        if kind == OTHER:
            deviation = float(own.max())
        else:
            deviation = max(deviation, float(np.abs(height(kind, frame, size, P)).max()))
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            F = F[:, ::-1]
        nodes.append(P)
        sag, table = np.zeros(F.shape), F
        if edges:
            borders = Borders.joined(edges)
            rows = borders.at_sides(F, len(P))
            sag = np.where(rows >= 0, borders.sag[rows], 0.0)
            P = np.concatenate([P, borders.points])
        at = parameters(kind, frame, size, P)

        seen = _with_errors(F, P, at, sag, own, (kind, size, deviation), tolerance)
        coarse.append((seen[0], np.full(len(F), number), F + start))
        if edges and kind != OTHER:
            table, sag, source = borders.split(F, rows, P)
            if table is not F:
                seen = _with_errors(table, P, at, sag, own[source], (kind, size, deviation), tolerance)
        fine.append((*seen, np.full(len(table), number), sag))
        deviations.append(deviation)
        start += len(nodes[-1])
    if not nodes:
        raise Clamp3dError("the solid has no faces")
    errors, owner, F = (np.concatenate(column) for column in zip(*coarse, strict=True))
    V, F, whole = _joined(np.concatenate(nodes), F, links)
    exact = [np.concatenate(column) for column in zip(*fine, strict=True)]
    kept = np.linalg.norm(normals(exact[1]), axis=1) > 1e-14
    exact = [np.ascontiguousarray(x[kept]) for x in exact]
    ends = np.searchsorted(exact[3], np.arange(len(surfaces) + 1))
    senses = [
        sense_of(kind, frame, size, exact[1][ends[number] : ends[number + 1]])
        for number, (kind, frame, size, _) in enumerate(surfaces)
    ]
    made = Faces(
        np.array([s[0] for s in surfaces], dtype=np.int64),
        np.array([s[1] for s in surfaces]),
        np.array([s[2] for s in surfaces]),
        np.array(senses),
        np.array(deviations),
        *exact,
    )
    return Tessellation(V, F, owner[whole], errors[whole], made)


def _with_errors(
    F: IntArray, P: Array, at: Array, sag: Array, own: Array, surface: tuple[int, Size, float], tolerance: float
) -> tuple[Array, Array, Array]:
    """How far triangles F (m, 3) of P, whose parameters are ``at``, can be from their face; their corners; their uv."""
    kind, size, deviation = surface
    corners, uv = P[F], unwrapped(kind, at[F])
    error = own if kind == OTHER else np.maximum(own, bends(kind, size, uv, corners) + deviation)
    return error + np.maximum(np.maximum(sag[:, 0], sag[:, 1]), sag[:, 2]) + tolerance, corners, uv


def placed(points: Array, place: Any) -> Array:
    """Points (n, 3) moved by a TopLoc_Location."""
    if place.IsIdentity():
        return points
    move = place.Transformation()
    M = np.array([[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
    return np.asarray(dot(points, M[:, :3].T) + M[:, 3])


def _joined(V: Array, F: IntArray, links: list[IntArray]) -> tuple[Array, IntArray, NDArray[np.bool_]]:
    """Nodes that two faces share along an edge made one, without triangles that this folds; which ones are left."""
    label = np.arange(len(V))
    if links:
        i, j = np.concatenate(links, axis=1)
        while (label[i] != label[j]).any():  # the least number of those that are one
            least = np.minimum(label[i], label[j])
            np.minimum.at(label, i, least)
            np.minimum.at(label, j, least)
            label = label[label]
    F = label[F]
    whole = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    used, rows = np.unique(F[whole], return_inverse=True)
    return V[used], rows.reshape(-1, 3), whole
