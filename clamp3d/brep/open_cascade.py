"""What Open CASCADE is asked about solids: bytes, triangles with errors, distances, common parts, depths of points.

All functions take and return plain data (bytes, numbers, arrays), so that they can run in another process.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.mesh import Array, IntArray
from clamp3d.errors import Clamp3dError, MissingLibraryError

KINDS = ("plane", "cylinder", "cone", "sphere", "torus", "other")
"""Kinds of a face; the index is the kind's number in `Surfaces.kind`."""
PLANE, CYLINDER, CONE, SPHERE, TORUS, OTHER = range(6)

TOLERANCE = 1e-6
"""Accuracy (mm) taken for an answer by Open CASCADE, ten times its own confusion of points (1e-7)."""

ANGLE = 0.35
"""Largest turn (rad) from facet to facet, so that a small fillet gets facets enough to be seen as round."""

_SLENDER = 400.0
"""Ratio of a common part's size to its thickness beyond which its chords go by the size: else they take seconds."""

SAMPLED = 2.0
"""Factor on the deviation measured at the edges' middles; 4/3 is enough where the surface is quadratic."""


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """The surfaces of n faces, part frame, mm.

    Attributes
    ----------
    kind : ndarray of int (n,)
        Index into `KINDS`.
    frame : ndarray (n, 4, 3)
        Origin and the axes x, y, z of each surface; z is the plane's normal or the axis.
    size : ndarray (n, 2)
        Cylinder and sphere: radius; cone: radius at the origin and semi-angle (rad); torus: major and minor radius.
    sense : ndarray (n,)
        1.0 where the material lies below the plane or inside the cylinder, sphere, ...; -1.0 for holes and hollows.
    """

    kind: NDArray[np.int64]
    frame: Array
    size: Array
    sense: Array


@dataclass(frozen=True, slots=True, eq=False)
class CommonPart:
    """What two solids share: ``volume`` (mm^3), ``area`` (mm^2) and ``box`` (2, 3); nothing if the volume is 0.

    ``points`` (n, 3) lie on its border, of which triangles between them are within ``chord`` mm; ``flat`` (m, 3, 3) are
    those of its plane faces.
    """

    volume: float
    area: float
    box: Array
    points: Array
    flat: Array
    chord: float


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


def require_open_cascade() -> None:
    """Load Open CASCADE and keep it from printing on stdout. Raises MissingLibraryError if it is not installed."""
    try:
        import OCP  # noqa: F401
    except ImportError:
        raise MissingLibraryError("STEP needs Open CASCADE: pip install 'clamp3d[step]'") from None
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    for printer in [*messenger.Printers()]:
        messenger.RemovePrinter(printer)


def to_bytes(shape: Any) -> bytes:
    """A TopoDS_Shape in Open CASCADE's binary format, without triangles."""
    from OCP.BinTools import BinTools, BinTools_FormatVersion

    stream = io.BytesIO()
    version = BinTools_FormatVersion.BinTools_FormatVersion_VERSION_4
    BinTools.Write_s(shape, stream, False, False, version)
    return stream.getvalue()


@lru_cache(maxsize=4096)
def from_bytes(brep: bytes) -> Any:
    """The TopoDS_Shape of `to_bytes`. Raises MissingLibraryError without Open CASCADE."""
    require_open_cascade()
    from OCP.BinTools import BinTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    BinTools.Read_s(shape, io.BytesIO(brep))
    return shape


def explore(shape: Any, kind: str, outside: str = "SHAPE") -> Iterator[Any]:
    """Sub-shapes of a ``kind`` ("SOLID", "FACE", ...), ``outside`` of those of another, in the explorer's order."""
    explorer, cast, kinds = _explorer(kind, outside)
    walk = explorer(shape, *kinds)
    while walk.More():
        yield cast(walk.Current())
        walk.Next()


@cache
def _explorer(kind: str, outside: str) -> tuple[Any, ...]:
    """Open CASCADE's explorer, the cast to one kind of shape, and its names of the kinds."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    name = kind.capitalize()
    cast = getattr(TopoDS, f"{name}_s", None) or getattr(TopoDS, name)
    return TopExp_Explorer, cast, [getattr(TopAbs_ShapeEnum, f"TopAbs_{k}") for k in (kind, outside)]


def bounds_of(shape: Any) -> Array:
    """Lower and upper corner (2, 3) of a box that holds a TopoDS_Shape, mm."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.array([box.CornerMin().Coord(), box.CornerMax().Coord()])


def volume_of(shape: Any) -> float:
    """Volume of a TopoDS_Shape, mm^3; negative if it is wound inward."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def area_of(shape: Any) -> float:
    """Area of the faces of a TopoDS_Shape, mm^2."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, properties)
    return float(properties.Mass())


def bounds_at(brep: bytes, T: Array) -> Array:
    """Box (2, 3) along the target's axes of a solid placed by ``T`` (4, 4), mm."""
    return bounds_of(moved(from_bytes(brep), T))


def moved(shape: Any, T: Array) -> Any:
    """A TopoDS_Shape placed by ``T`` (4, 4)."""
    from OCP.gp import gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    place = gp_Trsf()
    place.SetValues(*np.asarray(T)[:3].ravel().tolist())
    return shape.Moved(TopLoc_Location(place))


# --- faces and triangles


def surfaces(brep: bytes) -> Surfaces:
    """The surfaces of a solid's faces, in the explorer's order."""
    return _surfaces_of([*explore(from_bytes(brep), "FACE")])


def _surfaces_of(faces: list[Any]) -> Surfaces:
    from OCP.TopAbs import TopAbs_Orientation

    rows = [_surface_of(face) for face in faces]
    outward = [face.Orientation() != TopAbs_Orientation.TopAbs_REVERSED for face in faces]
    sense = [1.0 if out is direct else -1.0 for out, (*_, direct) in zip(outward, rows, strict=True)]
    return Surfaces(
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows]).reshape(-1, 4, 3),
        np.array([row[2] for row in rows]).reshape(-1, 2),
        np.array(sense),
    )


def _surface_of(face: Any) -> tuple[int, Array, tuple[float, float], bool]:
    """Kind, frame and sizes of a face's surface, and whether its own normal points away from the axis or along z."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    surface = BRepAdaptor_Surface(face)
    name = surface.GetType().name.removeprefix("GeomAbs_").lower()
    kind = KINDS.index(name) if name in KINDS else OTHER
    if kind == OTHER:
        return OTHER, np.vstack([np.zeros(3), np.eye(3)]), (0.0, 0.0), True
    form = getattr(surface, name.capitalize())()
    position = form.Position()
    axes = (position.XDirection(), position.YDirection(), position.Direction())
    frame = np.array([position.Location().Coord(), *(axis.Coord() for axis in axes)])
    if kind == PLANE:
        size = (0.0, 0.0)
    elif kind == CONE:
        size = (float(form.RefRadius()), float(form.SemiAngle()))
    elif kind == TORUS:
        size = (float(form.MajorRadius()), float(form.MinorRadius()))
    else:
        size = (float(form.Radius()), 0.0)
    return kind, frame, size, bool(position.Direct())


def height(kind: int, frame: Array, size: Array, points: Array) -> Array:
    """Signed distance (k,) of points (k, 3) from a whole surface; positive on the side of the normal or outside."""
    x, y, z = ((points - frame[0]) @ frame[1:].T).T
    across = np.hypot(x, y)
    if kind == PLANE:
        return np.asarray(z)
    if kind == CYLINDER:
        return np.asarray(across - size[0])
    if kind == CONE:
        return np.asarray((across - size[0]) * math.cos(size[1]) - z * math.sin(size[1]))
    if kind == SPHERE:
        return np.asarray(np.sqrt(across**2 + z**2) - size[0])
    return np.asarray(np.hypot(across - size[0], z) - size[1])


def tessellate(brep: bytes, chord: float) -> Tessellation:
    """Triangles of a solid within about ``chord`` mm of its faces; what they keep is measured afterwards.

    Raises Clamp3dError if a face gets no triangles.
    """
    return tessellation_of(from_bytes(brep), chord)


def tessellation_of(solid: Any, chord: float) -> Tessellation:
    """The same of a TopoDS_Shape."""
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    BRepTools.Clean_s(solid)
    BRepMesh_IncrementalMesh(solid, 0.7 * chord, False, ANGLE, False)
    faces = [*explore(solid, "FACE")]
    form = _surfaces_of(faces)
    corners, numbers, errors = [], [], []
    for k, face in enumerate(faces):
        points, triangles, uv = _triangles_of(face, k)
        if not len(triangles):
            continue
        deviation = _deviation(face, form, k, points, triangles, uv)
        corners.append(points[triangles])
        numbers.append(np.full(len(triangles), k))
        errors.append(np.maximum(deviation, _border_sag(face, points, triangles)))
    if not corners:
        raise Clamp3dError("Open CASCADE makes no triangles of it")
    # Faces that share an edge have the same points on it, so equal coordinates are one vertex.
    vertices, index = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    F = index.reshape(-1, 3)
    whole = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    return Tessellation(vertices, F[whole], np.concatenate(numbers)[whole], np.concatenate(errors)[whole])


def _triangles_of(face: Any, number: int) -> tuple[Array, IntArray, Array]:
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


# --- pairs of solids


def distance(a: bytes, b: bytes, T: Array) -> tuple[float, Array, Array]:
    """Distance (mm) of ``b`` at ``T`` (4, 4) in a's frame, and nearest points (3,); 0 where they touch or overlap.

    Raises Clamp3dError if Open CASCADE finds none.
    """
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    search = BRepExtrema_DistShapeShape(from_bytes(a), moved(from_bytes(b), T))
    if not search.IsDone() or search.NbSolution() < 1:
        raise Clamp3dError("Open CASCADE finds no distance of the two solids")
    p, q = (np.array(x.Coord()) for x in (search.PointOnShape1(1), search.PointOnShape2(1)))
    return float(search.Value()), p, q


def common(a: bytes, b: bytes, T: Array, share: float) -> CommonPart:
    """The common part of ``a`` and of ``b`` at ``T`` (4, 4).

    The chord is ``share`` of the part's thickness, volume over area, or of its size divided by `_SLENDER`.
    Raises Clamp3dError if Open CASCADE cannot make it.
    """
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    made = BRepAlgoAPI_Common(from_bytes(a), moved(from_bytes(b), T))
    if not made.IsDone():
        raise Clamp3dError("Open CASCADE cannot make the common part of the two solids")
    shape = made.Shape()
    if next(explore(shape, "SOLID"), None) is None:
        return CommonPart(0.0, 0.0, np.zeros((2, 3)), np.empty((0, 3)), np.empty((0, 3, 3)), 0.0)
    volume, area = abs(volume_of(shape)), area_of(shape)
    box = bounds_of(shape)
    chord = max(share * volume / max(area, 1e-300), share / _SLENDER * float(np.linalg.norm(box[1] - box[0])))
    BRepMesh_IncrementalMesh(shape, chord, False, ANGLE, False)
    points, flat = [np.empty((0, 3))], [np.empty((0, 3, 3))]
    for k, face in enumerate(explore(shape, "FACE")):
        P, triangles, _ = _triangles_of(face, k)
        points.append(P)
        if _surface_of(face)[0] == PLANE:
            flat.append(P[triangles])
    return CommonPart(volume, area, box, np.concatenate(points), np.concatenate(flat), chord)


def depths(brep: bytes, points: Array) -> Array:
    """Distance (k,) mm of points (k, 3) from the surface of a solid."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    shells = [*explore(from_bytes(brep), "SHELL")]
    nearest = np.full(len(points), np.inf)
    for k, point in enumerate(points.tolist()):
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
        for shell in shells:
            nearest[k] = min(nearest[k], BRepExtrema_DistShapeShape(shell, vertex).Value())
    return nearest
