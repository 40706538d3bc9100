"""What Open CASCADE says of two solids: their distance, their common part, and how deep points lie in one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.open_cascade import area_of, bounds_of, explore, from_bytes, moved, occ, parse, volume_of
from clamp3d.files.tessellation import ANGLE, points_on, triangles_of
from clamp3d.geometry.mesh import Array, IntArray

TOLERANCE = 1e-6
"""Accuracy (mm) taken for an answer by Open CASCADE, ten times its own confusion of points (1e-7)."""

_SLENDER = 400.0
"""Ratio of a common part's size to its thickness beyond which its chords go by the size: else they take seconds."""


_AT_EDGES = 9.0 / 4.0
"""How many times as far as in a triangle's middle a quadratic surface can be from it, at the middle of an edge."""
_SAMPLES = 500
"""Triangles that a face of a common part is cut into at least, to find where it is deepest."""


@dataclass(frozen=True, slots=True, eq=False)
class Border:
    """What of a common part's border lies on one solid, as triangles: ``points`` (n, 3), ``triangles`` (m, 3)."""

    points: Array
    triangles: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class CommonPart:
    """What two solids share: ``volume`` (mm^3), ``area`` (mm^2) and ``box`` (2, 3); nothing if the volume is 0.

    ``borders``, if any, are on the first and on the second solid, within ``chord`` mm of their triangles.
    """

    volume: float
    area: float
    box: Array
    borders: tuple[Border, ...] = ()
    chord: float = 0.0


def distance(a: bytes, b: bytes, T: Array) -> tuple[float, Array, Array]:
    """Distance (mm) of ``b`` at ``T`` (4, 4) in a's frame, and nearest points (3,); 0 where they touch or overlap.

    Raises Clamp3dError if Open CASCADE finds none.
    """
    search = occ.BRepExtrema_DistShapeShape(from_bytes(a), moved(from_bytes(b), T))
    if not search.IsDone() or search.NbSolution() < 1:
        raise Clamp3dError("Open CASCADE finds no distance of the two solids")
    p, q = (np.array(x.Coord()) for x in (search.PointOnShape1(1), search.PointOnShape2(1)))
    return float(search.Value()), p, q


def common(a: bytes, b: bytes, T: Array, share: float | None = None) -> CommonPart:
    """The common part of ``a`` and of ``b`` at ``T`` (4, 4).

    With ``share`` its border is meshed, with chords that are ``share`` of its thickness, volume over area, or of its
    size divided by `_SLENDER`. Raises Clamp3dError if Open CASCADE cannot make it.
    """
    shape = _common_shape(a, b, np.asarray(T).tobytes())
    if next(explore(shape, "SOLID"), None) is None:
        return CommonPart(0.0, 0.0, np.zeros((2, 3)))
    volume, area, box = abs(volume_of(shape)), area_of(shape), bounds_of(shape)
    if share is None:
        return CommonPart(volume, area, box)
    chord = max(share * volume / max(area, 1e-300), share / _SLENDER * float(np.linalg.norm(box[1] - box[0])))
    occ.BRepMesh_IncrementalMesh(shape, max(chord, TOLERANCE), False, ANGLE, False)
    solids = from_bytes(a), moved(from_bytes(b), T)
    sides: tuple[list[tuple[Array, IntArray]], ...] = ([], [])
    chord = 0.0
    for k, face in enumerate(explore(shape, "FACE")):
        points, quads = _samples(face, k)
        if not len(quads):
            continue
        chord = max(chord, _AT_EDGES * float(_heights(points[quads]).max()))
        middle = points[quads[len(quads) // 2, 3]]
        away = [_from_surface(solid, middle) for solid in solids]
        for side, distance in zip(sides, away, strict=True):
            if distance <= min(away) + TOLERANCE:  # where the two coincide the face is on both
                side.append((points, quads[:, :3]))
    return CommonPart(volume, area, box, tuple(map(_joined, sides)), chord)


def _joined(side: list[tuple[Array, IntArray]]) -> Border:
    """Samples of some faces as one."""
    starts = np.cumsum([0, *(len(points) for points, _ in side)])
    triangles = [rows + start for (_, rows), start in zip(side, starts, strict=False)]
    no_rows = np.empty((0, 3), dtype=np.int64)
    return Border(np.vstack([np.empty((0, 3)), *(points for points, _ in side)]), np.vstack([no_rows, *triangles]))


@lru_cache(maxsize=64)
def _common_shape(a: bytes, b: bytes, pose: bytes) -> Any:
    """The common part as a TopoDS_Shape, kept for who asks for its depth, its volume or finer samples."""
    # Of new copies, since it widens the tolerances of what it is given; a mesh of that is as coarse as these.
    operation = occ.BRepAlgoAPI_Common(parse(a), moved(parse(b), np.frombuffer(pose).reshape(4, 4)))
    if not operation.IsDone():
        raise Clamp3dError("Open CASCADE cannot make the common part of the two solids")
    return operation.Shape()


def _samples(face: Any, number: int) -> tuple[Array, IntArray]:
    """Points (n, 3) of a meshed face, and those (m, 4) of each triangle, at its corners and in its middle.

    Meshes of a face may have no point inside of it, so its triangles are cut in the surface's parameters.
    """
    _, triangles, uv = triangles_of(face, number)
    corners = uv[triangles]
    while 0 < len(corners) < _SAMPLES:
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        at_corners = [np.stack([corners[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
        corners = np.concatenate([middles, *at_corners])
    everything = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1).reshape(-1, 2)
    uv, place = np.unique(everything, axis=0, return_inverse=True)  # triangles share their corners
    return points_on(face, uv), place.reshape(-1, 4)


def _heights(points: Array) -> Array:
    """How far (m,) the last of four points (m, 4, 3) is from the plane of the others; of slivers from their middle."""
    a, b, c, last = points.transpose(1, 0, 2)
    normal, offset = np.cross(b - a, c - a), last - (a + b + c) / 3.0
    size, away = np.linalg.norm(normal, axis=1), np.linalg.norm(offset, axis=1)
    height = np.abs(np.einsum("ij,ij->i", normal, offset)) / np.maximum(size, 1e-300)
    return np.asarray(np.where(size > 1e-6 * away**2, height, away))


def depths(brep: bytes, points: Array) -> Array:
    """Signed depth (k,) mm of points (k, 3) in a solid: negative outside."""
    shape = from_bytes(brep)
    side = occ.BRepClass3d_SolidClassifier(shape)
    signed = np.array([_from_surface(shape, point) for point in points])
    for k, point in enumerate(points.tolist()):
        side.Perform(occ.gp_Pnt(*point), TOLERANCE)
        if side.State() == occ.TopAbs_State.TopAbs_OUT:
            signed[k] = -signed[k]
    return signed


def _from_surface(solid: Any, point: Array) -> float:
    """Distance (mm) of a point (3,) from the surface of a solid, on either side."""
    vertex = occ.BRepBuilderAPI_MakeVertex(occ.gp_Pnt(*point.tolist())).Vertex()
    return min(float(occ.BRepExtrema_DistShapeShape(shell, vertex).Value()) for shell in explore(solid, "SHELL"))
