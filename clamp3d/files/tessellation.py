"""Triangles of a solid by Open CASCADE, and how far each can be from its face."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.faces import CONE, OTHER, Surfaces, distinct_points_on, height, points_on, surfaces
from clamp3d.files.open_cascade import area_of, explore, faces_of, matrix, occ, parse, require_open_cascade
from clamp3d.geometry.mesh import IntArray, appended, encloses
from clamp3d.geometry.pose import Array, to_target
from clamp3d.geometry.triangles import closest_points, distances_from_segments, edge_middles

COARSE = 0.1
"""Chord error (mm) of faces that nobody needs finely: of all where meshes are asked first, of those far from others."""
ANGLE = 0.35
"""Largest turn (rad) from facet to facet, so that a small fillet gets facets enough to be seen as round."""

SAMPLED = 2.0
"""Factor on the deviation measured at places of splines; 4/3 is enough at the edges' middles of a quadratic surface."""
_SHARES = np.array([0.25, 0.5, 0.75])
"""Where a border is looked at between two points: a curve that is odd about the chord's middle passes through it."""
_PLACES = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i) if 4 not in (i, j, 4 - i - j)]) / 4.0
"""Barycentric coordinates (12, 3) of the places where a spline's triangle is looked at: on its edges and between.

A crowned face with straight borders is four times as far from a triangle between its edges as at their middles.
"""

_FACTORS = np.array([1.0, 1.0, 2.0, 1.4, 1.4, SAMPLED])
"""How much farther from a face of each kind a triangle can be than at its edges' middles (`sag_factors`)."""

_FINER = (1.0, 4.0, 16.0)
"""How much finer meshes are asked for, one after the other, where the one before overlooks some of a spline."""
_MANY = 20_000
"""Triangles from which on finer meshes take tens of seconds, and mostly overlook the same."""
_PLACES_EACH = 5
"""Places between two knots of a surface that tells no degree."""
_MOST_PLACES = 20_000
"""About how many places of a spline are looked at besides those of each triangle."""
_FEW_CURVES = 20
"""Curved edges up to which a cone is meshed as it is: with 61 of them one took 20 s."""
_NO_AREA = 1e-9
"""Area (mm^2) up to which a face may have no triangles: even a ball of so little is smaller than a contact."""
_DIGITS = 9
"""Decimals (mm) to which points are one vertex."""
_EDGE = 1e-9
"""How far beside a triangle, relative to the parameters, a place is still in it: none falls between two."""


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


def tessellate(brep: bytes, chord: float, near: tuple[int, ...] | None = None) -> Tessellation:
    """Triangles of a solid within about ``chord`` mm of its faces; what they keep is measured afterwards.

    ``near``: numbers of the faces that are meshed so; all others are within `COARSE`, if the triangles close then.
    Raises Clamp3dError if a face gets no triangles.
    """
    form = surfaces(brep)
    # A copy: of a solid with triangles Open CASCADE measures distances by their boxes, and leaves out what of a round
    # flat face is beyond them.
    solid = parse(brep)
    faces = [*explore(solid, "FACE")]
    turn_cones(faces)
    meshes, overlooked = _meshes(solid, faces, form, chord, near)
    cones = ((face, triangles) for face, (_, triangles, _) in zip(faces, meshes, strict=True) if _is_cone(face))
    if torn := [cone for cone, triangles in cones if len(triangles) and not covers(cone, triangles)]:
        turn_cones(torn, curved=True)
        meshes, overlooked = _meshes(solid, faces, form, chord, near)
    corners, triples, numbers, errors = [], [], [], []
    for k, (face, (points, triangles, uv)) in enumerate(zip(faces, meshes, strict=True)):
        if not len(triangles):
            continue
        deviation = np.maximum(_deviation(face, form, k, points, triangles, uv), SAMPLED * overlooked[k])
        corners.append(points)
        triples.append(triangles)
        numbers.append(np.full(len(triangles), k))
        errors.append(np.maximum(deviation, border_sag(face, points, triangles)))
    if not corners:
        raise Clamp3dError("Open CASCADE makes no triangles of it")
    # Faces that share an edge have the same points on it, but for rounding where each has a place of its own.
    points, triangles = appended(corners, triples)
    _, first, index = np.unique(points.round(_DIGITS), axis=0, return_index=True, return_inverse=True)
    vertices, F = points[first], index.reshape(-1)[triangles]
    whole = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    # Faces that are one, in two places, get other points each.
    if near is not None and not encloses(vertices, F[whole]):
        return tessellate(brep, chord)
    return Tessellation(vertices, F[whole], np.concatenate(numbers)[whole], np.concatenate(errors)[whole])


def turn_cones(faces: Iterable[Any], *, curved: bool = False) -> None:
    """Make the cones among the faces of a new TopoDS_Shape turned lines, which have the same parameters.

    Of some cones between circles Open CASCADE makes no triangles (OCCT issue 572), of others five times as many as it
    needs; cones with long curved borders can take it half a minute. Those with a few curved edges are turned only if
    ``curved``: they get ten times as many triangles then.
    """
    for face in faces:
        if not _is_cone(face):
            continue
        curves = sum(not _is_plain(edge) for edge in explore(face, "EDGE"))
        if curved or not 0 < curves <= _FEW_CURVES:
            _turn(face)


def _is_cone(face: Any) -> bool:
    return bool(occ.BRepAdaptor_Surface(face).GetType() == occ.GeomAbs_SurfaceType.GeomAbs_Cone)


def _turn(cone: Any) -> None:
    """Give a face the surface of its cone as a turned line, and its edges their curves on that."""
    builder, ways = occ.BRep_Builder(), occ.TopAbs_Orientation
    surface = occ.BRep_Tool.Surface_s(cone, place := occ.TopLoc_Location())
    axis = occ.GeomAdaptor_Surface(surface).Cone().Position()
    turned = occ.Geom_SurfaceOfRevolution(surface.UIso(0.0), axis.Axis() if axis.Direct() else axis.Axis().Reversed())
    for edge in explore(cone, "EDGE"):
        is_seam, span, curves = occ.BRep_Tool.IsClosed_s(edge, cone), occ.BRepAdaptor_Curve2d(edge, cone), []
        for way in (ways.TopAbs_REVERSED, ways.TopAbs_FORWARD):  # a seam has a curve for each
            edge.Orientation(way)
            curves.append(occ.BRep_Tool.CurveOnSurface_s(edge, surface, place, 0.0, 0.0))
        back, forth = curves
        builder.UpdateEdge(edge, forth, *[back] * is_seam, turned, place, occ.BRep_Tool.Tolerance_s(edge))
        builder.Range(edge, turned, place, span.FirstParameter(), span.LastParameter())
    builder.UpdateFace(cone, turned, place, occ.BRep_Tool.Tolerance_s(cone))


def _is_plain(edge: Any) -> bool:
    """Whether an edge is straight, a circle or a point."""
    curve = _curve(edge)
    return curve is None or bool(curve.GetType() == occ.GeomAbs_CurveType.GeomAbs_Circle)


def _meshes(
    solid: Any, faces: list[Any], form: Surfaces, chord: float, near: tuple[int, ...] | None
) -> tuple[list[tuple[Array, IntArray, Array]], list[Array]]:
    """The triangles of each face, as `triangles_of` gives them, and how far (m,) mm a spline is from them elsewhere."""
    steps: list[tuple[Any, Collection[int], float]] = [(solid, range(len(faces)), chord)]
    if near is not None:
        # Open CASCADE keeps triangles that are there, and takes their edges' points for the faces beside them.
        others = sorted({*range(len(faces))} - {*near})
        steps = [(faces_of(solid, np.array(near, dtype=np.int64)), near, chord), (solid, others, COARSE)]
    for finer in _FINER:
        occ.BRepTools.Clean_s(solid)
        for shape, numbers, most in steps:
            if numbers:
                _mesh(shape, {k: faces[k] for k in numbers}, form, most / finer)
        meshes = [_triangles(face, k) for k, face in enumerate(faces)]
        overlooked = [_overlooked(face, kind, *mesh) for face, kind, mesh in zip(faces, form.kind, meshes, strict=True)]
        is_seen = all(overlooked[k].max(initial=0.0) <= most for _, numbers, most in steps for k in numbers)
        if is_seen or sum(len(triangles) for _, triangles, _ in meshes) > _MANY:
            break
    return meshes, overlooked


def _mesh(shape: Any, faces: dict[int, Any], form: Surfaces, chord: float) -> None:
    """Have a shape's ``faces``, by their numbers, meshed within about ``chord`` mm; others keep what they have.

    Open CASCADE looks whether triangles of splines are near enough, and puts points where they are not: in a cylinder
    with a long border a hundred times as many as it needs. So for planes, cylinders and cones it does so only where
    triangles without these points are too far off.
    """
    how = occ.IMeshTools_Parameters()
    how.Deflection, how.Angle = 0.7 * chord, ANGLE
    straight = [k for k, face in faces.items() if form.kind[k] <= CONE and _is_general(face)]
    how.ControlSurfaceDeflection = not straight
    occ.BRepMesh_IncrementalMesh(shape, how)
    if not straight:
        return
    near = {k for k in straight if _deviation(faces[k], form, k, *_triangles(faces[k], k)).max(initial=0.0) <= chord}
    for k, face in faces.items():
        if k not in near and (form.kind[k] == OTHER or _is_general(face)):
            occ.BRepTools.Clean_s(face)
    how.ControlSurfaceDeflection = True
    occ.BRepMesh_IncrementalMesh(shape, how)  # of the faces without triangles


def _is_general(face: Any) -> bool:
    """Whether a face is a B-spline, which may be a plain surface, or a turned line."""
    kinds = occ.GeomAbs_SurfaceType
    general = (kinds.GeomAbs_BSplineSurface, kinds.GeomAbs_SurfaceOfRevolution)
    return occ.BRepAdaptor_Surface(face).GetType() in general


def triangles_of(face: Any, number: int) -> tuple[Array, IntArray, Array]:
    """Points (n, 3), triangles (m, 3) wound outward, and the surface parameters (n, 2) of a meshed face."""
    place = occ.TopLoc_Location()
    triangulation = occ.BRep_Tool.Triangulation_s(face, place)
    if triangulation is None:
        raise Clamp3dError(f"Open CASCADE makes no triangles of face {number + 1}")
    count = range(1, triangulation.NbNodes() + 1)
    points = to_target(matrix(place), np.array([triangulation.Node(i).Coord() for i in count]))
    uv = np.array([triangulation.UVNode(i).Coord() for i in count])
    triangles = np.array([triangulation.Triangle(i).Get() for i in range(1, triangulation.NbTriangles() + 1)]) - 1
    if face.Orientation() == occ.TopAbs_Orientation.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return points, triangles.reshape(-1, 3), uv


def _triangles(face: Any, number: int) -> tuple[Array, IntArray, Array]:
    """The same; none of a face without an area, between two edges in one place, of which Open CASCADE makes none."""
    try:
        return triangles_of(face, number)
    except Clamp3dError:
        if area_of(face) > _NO_AREA:
            raise
    return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), np.empty((0, 2))


def sag_factors(kind: int, frame: Array, triangles: Array) -> Array:
    """How much farther (m,) triangles (m, 3, 3) can be from their surface than at the middles of their edges.

    On a cylinder, as on a circle, nothing is further than such a middle; on spheres and tori, of which a facet is a
    small part, it is next to quadratic. Along the edge of a cone from a circle to another one of k times its radius it
    is 2 (1 + k) / (1 + sqrt k)^2 times as far.
    """
    factors = np.full(len(triangles), _FACTORS[kind])
    if kind == CONE:
        radii = np.hypot(*np.moveaxis((triangles - frame[0]) @ frame[1:3].T, 2, 0))
        k = radii.min(axis=1) / np.maximum(radii.max(axis=1), 1e-300)
        factors = 2.0 * (1.0 + k) / (1.0 + np.sqrt(k)) ** 2
    return factors


def _deviation(face: Any, form: Surfaces, k: int, points: Array, triangles: IntArray, uv: Array) -> Array:
    """How far (m,) mm each triangle can be from its surface: measured at the edges' middles, times `sag_factors`.

    Splines are looked at in more places, on the edges and between.
    """
    kind = int(form.kind[k])
    if not len(triangles):
        return np.zeros(0)
    if kind == OTHER:
        at = _PLACES @ uv[triangles]
        places, row = distinct_points_on(face, at.reshape(-1, 2))
        true, corner = places[row], 0.0
        off = np.linalg.norm(closest_points(np.repeat(points[triangles], len(_PLACES), axis=0), true) - true, axis=1)
    else:
        middles = edge_middles(points[triangles])
        off, heights = (np.abs(height(kind, form.frame[k], form.size[k], x)) for x in (middles.reshape(-1, 3), points))
        corner = float(heights.max())
    factors = sag_factors(kind, form.frame[k], points[triangles])
    return np.asarray(factors * off.reshape(len(triangles), -1).max(axis=1) + corner)


def _overlooked(face: Any, kind: int, points: Array, triangles: IntArray, uv: Array) -> Array:
    """How far (m,) mm a spline is from each of its triangles between the knots, where no edge's middle is near.

    It is looked at in as many places as its degrees ask for: Open CASCADE can overlook a bump of a face that is flat
    besides.
    """
    off = np.zeros(len(triangles))
    if kind != OTHER or not len(triangles):
        return off
    surface = occ.BRepAdaptor_Surface(face)
    grids = [_grid(surface, along) for along in "UV"]
    seen = np.concatenate([uv, edge_middles(uv[triangles]).reshape(-1, 2)])
    cells = [np.clip(np.searchsorted(grid, x) - 1, 0, len(grid) - 2) for grid, x in zip(grids, seen.T, strict=True)]
    empty = np.ones([len(grid) - 1 for grid in grids], dtype=bool)
    empty[tuple(cells)] = False
    middles = [0.5 * (grid[1:] + grid[:-1])[rows] for grid, rows in zip(grids, np.nonzero(empty), strict=True)]
    at = np.column_stack(middles)[:: 1 + int(empty.sum()) // _MOST_PLACES]
    place, row = _inside(at, uv[triangles])
    true = points_on(face, at)[place]
    np.maximum.at(off, row, np.linalg.norm(closest_points(points[triangles[row]], true) - true, axis=1))
    return off


def _inside(places: Array, triangles: Array) -> tuple[IntArray, IntArray]:
    """Numbers (k,) of places (n, 2) of the plane, and of the triangles (m, 3, 2) that each of them is in."""
    import shapely

    tree, beside = shapely.STRtree(shapely.polygons(triangles)), _EDGE * float(np.abs(triangles).max())
    place, row = tree.query(shapely.points(places), "dwithin", beside)
    return place, row


def _grid(surface: Any, along: str) -> Array:
    """Parameters (n,) of a BRepAdaptor_Surface along "U" or "V": as many between knots as its degree asks for."""
    every = occ.GeomAbs_Shape.GeomAbs_CN
    knots = _array_of_numbers()(1, getattr(surface, f"Nb{along}Intervals")(every) + 1)
    getattr(surface, f"{along}Intervals")(knots, every)
    kinds = occ.GeomAbs_SurfaceType
    has_degree = surface.GetType() in (kinds.GeomAbs_BSplineSurface, kinds.GeomAbs_BezierSurface)
    each = max(2, getattr(surface, f"{along}Degree")()) if has_degree else _PLACES_EACH
    starts = np.array([*knots])
    inner = starts[:-1, None] + np.diff(starts)[:, None] * (np.arange(each) / each)
    return np.append(inner.reshape(-1), starts[-1])


@cache
def _array_of_numbers() -> Any:
    """Open CASCADE's class for arrays of numbers, by the name that it has in this version or had before."""
    OCP = require_open_cascade()
    made = getattr(OCP.collections, "Array1_double", None) if hasattr(OCP, "collections") else None
    return made or occ.TColStd_Array1OfReal


def border_sag(face: Any, points: Array, triangles: IntArray) -> Array:
    """How far (m,) mm the face's border can be from the edges of each triangle that stand for it."""
    ends, places, factors = [], [], []
    for edge, polygon in _border(face):
        if (curve := _curve(edge)) is None:
            continue
        factor, shares = (1.0, _SHARES[1:2]) if _is_plain(edge) else (SAMPLED, _SHARES)
        nodes, at = _nodes(polygon), np.array([polygon.Parameter(i) for i in range(1, polygon.NbNodes() + 1)])
        times = at[:-1, None] + np.diff(at)[:, None] * shares
        places += [curve.Value(t).Coord() for t in times.reshape(-1).tolist()]
        ends.append(np.repeat(np.column_stack([nodes[:-1], nodes[1:]]), len(shares), axis=0))
        factors.append(np.full(times.size, factor))
    if not ends:
        return np.zeros(len(triangles))
    starts, stops = np.concatenate(ends).T
    off = np.concatenate(factors) * distances_from_segments(np.array(places), points[starts], points[stops])
    border, row = np.unique(_edge_keys(starts, stops), return_inverse=True)
    sag = np.zeros(len(border))
    np.maximum.at(sag, row.reshape(-1), off)
    keys = _edge_keys(triangles, np.roll(triangles, -1, axis=1))
    nearest = np.minimum(np.searchsorted(border, keys), len(border) - 1)
    return np.asarray(np.where(border[nearest] == keys, sag[nearest], 0.0).max(axis=1))


def covers(face: Any, triangles: IntArray) -> bool:
    """Whether the triangles (m, 3) of a meshed face end at its border alone: Open CASCADE can leave some out."""
    border = [_edge_keys(nodes[:-1], nodes[1:]) for nodes in (_nodes(polygon) for _, polygon in _border(face))]
    keys, count = np.unique(_edge_keys(triangles, np.roll(triangles, -1, axis=1)), return_counts=True)
    return bool(np.isin(keys[count == 1], np.concatenate(border)).all())


def _border(face: Any) -> Iterator[tuple[Any, Any]]:
    """The edges of a meshed face, each with its polygon (Poly_PolygonOnTriangulation) in the triangulation."""
    triangulation = occ.BRep_Tool.Triangulation_s(face, place := occ.TopLoc_Location())
    for edge in explore(face, "EDGE"):
        polygon = occ.BRep_Tool.PolygonOnTriangulation_s(edge, triangulation, place)
        if polygon is not None:
            yield edge, polygon


def _nodes(polygon: Any) -> IntArray:
    """The numbers (k,) of a polygon's points, from 0."""
    return np.array([polygon.Node(i) - 1 for i in range(1, polygon.NbNodes() + 1)])


def _curve(edge: Any) -> Any:
    """The curve of an edge that triangles may be off; None of straight edges, and of those that are a point."""
    if occ.BRep_Tool.Degenerated_s(edge):
        return None
    curve = occ.BRepAdaptor_Curve(edge)
    return None if curve.GetType() == occ.GeomAbs_CurveType.GeomAbs_Line else curve


def _edge_keys(a: IntArray, b: IntArray) -> IntArray:
    """A number for each edge between vertices ``a`` and ``b``, the same in both directions."""
    return np.asarray((np.minimum(a, b).astype(np.int64) << 32) + np.maximum(a, b))
