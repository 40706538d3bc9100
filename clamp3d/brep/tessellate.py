"""Triangles of an Open CASCADE solid, each with a bound of its distance from the face that it stands for.

Open CASCADE takes a deflection as a wish. What the triangles really keep is computed afterwards from their parameters:
on planes, cylinders, cones, spheres and tori in closed form, on other surfaces from samples, doubled.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.core.mesh import Array, IntArray
from clamp3d.errors import Clamp3dError

ANGLE = 0.35
"""Largest turn (rad) of a facet's neighbour, so that a small fillet gets facets enough to be seen as round."""
_RETRIES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Triangles of one solid: ``vertices`` (n, 3) mm, ``faces`` (m, 3) outward, equal vertices of neighbours shared.

    ``face`` (m,): number of the B-rep face of each triangle, in the order of an explorer, from 0. ``errors`` (m,) mm:
    no point of the triangle is further from its face, and no point of what it stands for further from the triangle.
    """

    vertices: Array
    faces: IntArray
    face: IntArray
    errors: Array


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

    wanted = chord
    for _ in range(_RETRIES):
        BRepTools.Clean_s(solid)
        BRepMesh_IncrementalMesh(solid, wanted, False, angle, False)
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

    nodes: list[Array] = []
    triangles: list[IntArray] = []
    owner: list[IntArray] = []
    errors: list[Array] = []
    links: list[tuple[int, int]] = []
    first_seen: dict[int, list[tuple[Any, IntArray]]] = {}
    start = 0
    for number, face in enumerate(explore(solid, "FACE")):
        place = TopLoc_Location()
        found = BRep_Tool.Triangulation_s(face, place)
        if found is None:
            raise Clamp3dError(f"Open CASCADE makes no triangles of face {number + 1}")
        move = place.Transformation()
        n = found.NbNodes()
        points = [found.Node(i).Transformed(move) for i in range(1, n + 1)]
        P = np.array([(p.X(), p.Y(), p.Z()) for p in points])
        F = np.array([found.Triangle(i).Get() for i in range(1, found.NbTriangles() + 1)], dtype=np.int64) - 1
        uv = np.array([(q.X(), q.Y()) for q in map(found.UVNode, range(1, n + 1))])
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
            sags.append(_sagitta(edge, polygon))
        errors.append(_bound(face)(uv[F], P[F]) + _at_edges(F, n, pieces, sags) + tolerance)
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            F = F[:, ::-1]
        nodes.append(P)
        triangles.append(F + start)
        owner.append(np.full(len(F), number))
        start += n
    if not nodes:
        raise Clamp3dError("the solid has no faces")
    return _joined(
        np.concatenate(nodes), np.concatenate(triangles), np.concatenate(owner), np.concatenate(errors), links
    )


def _joined(V: Array, F: IntArray, owner: IntArray, errors: Array, links: list[tuple[int, int]]) -> Tessellation:
    """Nodes that two faces share along an edge made one; triangles that this folds left out."""
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
    return Tessellation(V[used], rows.reshape(-1, 3), owner[whole], errors[whole])


def _at_edges(F: IntArray, n: int, pieces: list[IntArray], sags: list[Array]) -> Array:
    """The largest of ``sags`` among the ``pieces`` of the face's edges that are sides of each triangle (m,)."""
    found = np.zeros(len(F))
    if pieces:
        pairs, sag = np.sort(np.concatenate(pieces), axis=1), np.concatenate(sags)
        keys = pairs[:, 0] * n + pairs[:, 1]
        order = np.argsort(keys)
        for k in range(3):
            side = np.sort(F[:, [k, (k + 1) % 3]], axis=1)
            wanted = side[:, 0] * n + side[:, 1]
            row = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
            found = np.maximum(found, np.where(keys[row] == wanted, sag[row], 0.0))
    return found


def _sagitta(edge: Any, polygon: Any) -> Array:
    """How far each piece (k,) of an edge can be from its chord, mm."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_CurveType as Kind

    curve = BRepAdaptor_Curve(edge)
    kind = curve.GetType()
    t = np.array([polygon.Parameter(i) for i in range(1, polygon.NbNodes() + 1)])
    if kind == Kind.GeomAbs_Line:
        return np.zeros(len(t) - 1)
    turn = 0.5 * np.minimum(np.abs(np.diff(t)), np.pi)
    if kind == Kind.GeomAbs_Circle:
        return np.asarray(curve.Circle().Radius() * (1.0 - np.cos(turn)))
    if kind == Kind.GeomAbs_Ellipse:  # a circle stretched: so is its sagitta, at most by the longer half axis
        return np.asarray(curve.Ellipse().MajorRadius() * (1.0 - np.cos(turn)))
    found = []
    for a, b in itertools.pairwise(t):
        p = np.array(
            [(q.X(), q.Y(), q.Z()) for q in (curve.Value(a + s * (b - a)) for s in (0.0, 0.25, 0.5, 0.75, 1.0))]
        )
        along = p[-1] - p[0]
        size = float(np.linalg.norm(along))
        away = np.linalg.norm(np.cross(p - p[0], along), axis=1) / size if size else np.linalg.norm(p - p[0], axis=1)
        found.append(2.0 * float(away.max()))
    return np.array(found)


def _bound(face: Any) -> Callable[[Array, Array], Array]:
    """Distance (m,) mm of triangles from a face at most, by their parameters (m, 3, 2) and corners (m, 3, 3)."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType as Kind

    surface = BRepAdaptor_Surface(face)
    kind = surface.GetType()

    def turn(uv: Array, k: int) -> Array:
        return np.asarray(1.0 - np.cos(0.5 * np.minimum(np.ptp(uv[:, :, k], axis=1), np.pi)))

    if kind == Kind.GeomAbs_Plane:
        return lambda uv, P: np.zeros(len(P))
    if kind == Kind.GeomAbs_Cylinder:
        radius = surface.Cylinder().Radius()
        return lambda uv, P: radius * turn(uv, 0)
    if kind == Kind.GeomAbs_Cone:
        cone = surface.Cone()
        wide, slope = cone.RefRadius(), np.sin(cone.SemiAngle())

        def cone_bound(uv: Array, P: Array) -> Array:
            # A weighted mean of points on a circle of at most this radius lies no deeper than the sagitta.
            r = np.abs(wide + slope * uv[:, :, 1])
            widest = r.max(axis=1)
            # The apex has no angle: it takes that of the widest corner.
            at = np.take_along_axis(uv[:, :, 0], r.argmax(axis=1)[:, None], axis=1)
            u = np.where(r > 1e-9 * widest[:, None], uv[:, :, 0], at)
            return np.asarray(widest * turn(u[:, :, None], 0))

        return cone_bound
    if kind == Kind.GeomAbs_Sphere:
        ball = surface.Sphere().Radius()
        return lambda uv, P: ball - np.sqrt(np.maximum(ball**2 - _enclosing(P) ** 2, 0.0))
    if kind == Kind.GeomAbs_Torus:
        torus = surface.Torus()
        large, small = torus.MajorRadius(), torus.MinorRadius()
        return lambda uv, P: (large + small) * turn(uv, 0) + small * turn(uv, 1)
    return lambda uv, P: _sampled(surface, uv, P)


def _enclosing(P: Array) -> Array:
    """Radius (m,) of the smallest ball around each of triangles (m, 3, 3)."""
    side = np.linalg.norm(np.roll(P, -1, axis=1) - P, axis=2)
    long = side.max(axis=1)
    twice_area = np.linalg.norm(np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]), axis=1)
    around = side.prod(axis=1) / np.maximum(2.0 * twice_area, 1e-300)
    obtuse = 2.0 * long**2 >= (side**2).sum(axis=1)
    return np.asarray(np.where(obtuse, 0.5 * long, np.minimum(around, long)))


_SAMPLES = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=np.float64)
_SAMPLES /= _SAMPLES.sum(axis=1, keepdims=True)


def _sampled(surface: Any, uv: Array, P: Array) -> Array:
    """Twice the largest distance (m,) found between points of triangles and the surface at the same parameters."""
    where = np.einsum("sk,mkd->msd", _SAMPLES, uv).reshape(-1, 2)
    flat = np.einsum("sk,mkd->msd", _SAMPLES, P).reshape(-1, 3)
    points = [surface.Value(float(u), float(v)) for u, v in where]
    found = np.linalg.norm(np.array([(p.X(), p.Y(), p.Z()) for p in points]) - flat, axis=1)
    return np.asarray(2.0 * found.reshape(len(P), -1).max(axis=1))
