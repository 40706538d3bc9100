"""What Open CASCADE says of two solids: their distance, their common part, and how deep points lie in one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.boundary import Boundary, Side
from clamp3d.files.faces import OTHER, SPHERE, distinct_points_on, form_of, height, points_on, surfaces
from clamp3d.files.open_cascade import (
    TOLERANCE,
    area_of,
    bounds_of,
    corners_of,
    explore,
    faces_of,
    from_bytes,
    moved,
    occ,
    parse,
    volume_of,
    volumes_of,
)
from clamp3d.files.tessellation import ANGLE, border_sag, covers, sag_factors, triangles_of, turn_cones
from clamp3d.geometry.mesh import IntArray, appended
from clamp3d.geometry.pose import Array, to_target
from clamp3d.geometry.triangles import distances_from_segments, edge_middles, halves, normals_and_areas

_SLENDER = 400.0
"""Ratio of a common part's size to its thickness beyond which its chords go by the size: else they take seconds."""


_BESIDE = 0.05
"""How far (mm) beside a point nearer ones are looked for first."""
_ONE_BALL = 1e-7
"""How far (mm) centres and radii of faces may differ that are one ball's."""
_COARSER = 16.0
"""How much coarser Open CASCADE meshes the inside of a common part's faces than their edges."""
_FINER_EDGES = (1.0, 0.3, 0.1)
"""Shares of a chord that a common part's edges are meshed with, until all of its faces have triangles."""
_SAMPLES = 500
"""Triangles that a face of a common part is cut into at least, to find where it is deepest."""
_MOST_SAMPLES = 100_000
"""Triangles from which on a face of a common part is cut no further."""


@dataclass(frozen=True, slots=True, eq=False)
class Border:
    """What of a common part's border lies on one solid, as triangles: ``points`` (n, 3), ``triangles`` (m, 3).

    ``errors`` (m,): how far (mm) each is from the common part's face that it is on.
    """

    points: Array
    triangles: IntArray
    errors: Array


@dataclass(frozen=True, slots=True, eq=False)
class CommonPart:
    """What two solids share: ``volume`` (mm^3), ``area`` (mm^2) and ``box`` (2, 3); nothing if the volume is 0.

    ``borders``, if any, are on the first and on the second solid; without them ``volumes`` is the volume by two
    integrations, the smaller first. Open CASCADE does not always find triangles for borders: then ``corners`` (k, 3) of
    the common part are all there is.
    """

    volume: float
    area: float
    box: Array
    borders: tuple[Border, ...] = ()
    volumes: tuple[float, float] = (0.0, 0.0)
    corners: Array = field(default_factory=lambda: np.empty((0, 3)))


class Nearest(NamedTuple):
    """Distance (mm) of two solids, 0 where they touch or overlap, and nearest points (3,) of the first and the second.

    ``is_least`` is False where one of the points is nearer to the other solid: then it is no more than a bound.
    ``is_signed``: whether the distance of an overlap is minus the greatest depth of a point of one solid in the other.
    """

    distance: float
    p: Array
    q: Array
    is_least: bool = True
    is_signed: bool = False

    def swapped(self) -> Nearest:
        """The same of the solids in the other order."""
        return self._replace(p=self.q, q=self.p)


def distance(
    a: bytes, b: bytes, T: Array, near: tuple[IntArray, IntArray] | None = None, most: float = math.inf
) -> Nearest:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame; of faces alone whose numbers are ``near``, if there are any.

    Open CASCADE does not always find the nearest points of a whole sphere (of two balls 0.04 mm in each other it said
    0.05 mm apart): a ball is as near as its centre, less its radius. Raises Clamp3dError if it finds no distance,
    and where there are more than ``most`` pairs of edges to look at.
    """
    first, second = from_bytes(a), moved(from_bytes(b), T)
    if (ball := _ball(a)) is not None and (nearest := _from_ball(*ball, second)) is not None:
        return nearest
    if (ball := _ball(b)) is not None and (nearest := _from_ball(to_target(T, ball[0]), ball[1], first)) is not None:
        return nearest.swapped()
    some, others = (first, second) if near is None else (faces_of(first, near[0]), faces_of(second, near[1]))
    if math.prod(sum(1 for _ in explore(shape, "EDGE")) for shape in (some, others)) > most:
        raise Clamp3dError("the two solids have too many edges near each other")
    nearest = _nearest(some, others)
    if nearest.distance <= TOLERANCE:
        return nearest if near is not None else _confirmed(nearest, first, second)
    own, other = Boundary(first), Boundary(second)
    nearest = _polished(_polished(nearest, own, other).swapped(), other, own).swapped()
    closer = min(other.foot(nearest.p).distance, own.foot(nearest.q).distance)
    return nearest._replace(is_least=TOLERANCE < nearest.distance <= closer + TOLERANCE)


def _polished(nearest: Nearest, own: Boundary, other: Boundary) -> Nearest:
    """Nearest points, or nearer ones beside ``p``, where that is near a pole of the first solid's faces.

    There Open CASCADE's points are up to 0.02 mm further apart than the nearest ones, though each is about as near to
    the other solid as they say.
    """
    if not own.is_near_pole(nearest.p):
        return nearest
    from scipy.optimize import minimize

    across = np.linalg.svd((nearest.q - nearest.p)[None])[2][1:]

    def beside(x: Array) -> Array:
        return own.foot(nearest.p + x @ across).point

    # Where points are within 1e-4 mm of the nearest ones, their distance is within rounding.
    how = {"initial_simplex": _BESIDE * np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]), "xatol": 1e-4, "fatol": 1e-9}
    best = minimize(lambda x: other.foot(beside(x)).distance, np.zeros(2), method="Nelder-Mead", options=how)
    p = beside(best.x)
    away, q, _ = other.foot(p)
    return Nearest(away, p, q) if away < nearest.distance else nearest


def _confirmed(nearest: Nearest, first: Any, second: Any) -> Nearest:
    """What is known of two solids that are said to touch at a point.

    Open CASCADE takes some points that lie beside a solid with free-form faces for inside. Where this is one, the
    faces' distance counts, which is the least if a point of either lies outside the other.
    """
    boundaries = Boundary(first), Boundary(second)
    if all(b.foot(nearest.p).distance <= TOLERANCE or b.side(nearest.p)[0] is Side.INSIDE for b in boundaries):
        return nearest
    apart = _nearest(faces_of(first), faces_of(second))
    points = (apart.q, apart.p)
    is_outside = all(b.side(x)[0] is Side.OUTSIDE for b, x in zip(boundaries, points, strict=True))
    return apart._replace(is_least=is_outside)


@lru_cache(maxsize=512)
def _ball(brep: bytes) -> tuple[Array, float] | None:
    """Centre (3,) and radius of a solid that is a ball; None for others."""
    form, solid = surfaces(brep), from_bytes(brep)
    centre, radius = form.frame[0, 0], float(form.size[0, 0])
    spread = max(np.ptp(form.frame[:, 0], axis=0).max(), np.ptp(form.size[:, 0]))
    if not (form.kind == SPHERE).all() or spread > _ONE_BALL:
        return None
    is_whole = area_of(solid) > 0.9 * 4.0 * np.pi * radius**2  # which is measured to 1 %
    return (centre, radius) if is_whole else None


def _from_ball(centre: Array, radius: float, solid: Any) -> Nearest | None:
    """The nearest points of a ball and a solid; None where the centre is not certainly outside.

    Lemma: where the centre is outside, at a distance d from the solid, no point of one is deeper in the other than r -
    d. A point of the solid in the ball is at least d from the centre; one of the ball is at most r - d from the ball of
    radius d about the centre, which nothing of the solid is in.
    """
    side, (away, foot, _) = Boundary(solid).side(centre)
    if side is not Side.OUTSIDE or away <= TOLERANCE:
        return None
    return Nearest(away - radius, centre + radius / away * (foot - centre), foot, is_signed=True)


def _nearest(a: Any, b: Any) -> Nearest:
    """What Open CASCADE finds for two shapes. Raises Clamp3dError if that is nothing."""
    search = occ.BRepExtrema_DistShapeShape(a, b)
    if not search.IsDone() or search.NbSolution() < 1:
        raise Clamp3dError("Open CASCADE finds no distance of the two solids")
    p, q = (np.array(x.Coord()) for x in (search.PointOnShape1(1), search.PointOnShape2(1)))
    return Nearest(float(search.Value()), p, q)


def common(a: bytes, b: bytes, T: Array, share: float | None = None) -> CommonPart:
    """The common part of ``a`` and of ``b`` at ``T`` (4, 4).

    With ``share`` its border is meshed, with chords that are ``share`` of its thickness, volume over area, or of its
    size divided by `_SLENDER`. Raises Clamp3dError if Open CASCADE cannot make it.
    """
    shape = _common_shape(a, b, np.asarray(T).tobytes())
    if next(explore(shape, "SOLID"), None) is None:
        return CommonPart(0.0, 0.0, np.zeros((2, 3)))
    volume, area, box = abs(volume_of(shape)), area_of(shape), bounds_of(shape, quick=share is not None)
    if share is None:
        return CommonPart(volume, area, box, volumes=volumes_of(shape))
    size = float(np.linalg.norm(box[1] - box[0]))
    sag = max(share * volume / max(area, 1e-300), share * size / _SLENDER, TOLERANCE)
    try:
        meshes = _border_meshes(shape, sag)
    except Clamp3dError:
        return CommonPart(volume, area, box, corners=corners_of(shape))
    boundaries = Boundary(from_bytes(a)), Boundary(moved(from_bytes(b), T))
    sides: tuple[list[Border], ...] = ([], [])
    for face, (_, coarse, at) in zip(explore(shape, "FACE"), meshes, strict=True):
        # Its border may have corners that lie beside its surface, by so much that no piece of them is ever near it.
        ends = points_on(face, at)
        uv, source, off = _samples(face, ends[coarse], at[coarse], sag)
        if not len(uv):
            continue
        points, rows = distinct_points_on(face, uv.reshape(-1, 2))
        triangles = rows.reshape(-1, 3)
        errors = np.maximum(off, border_sag(face, ends, coarse)[source])
        border = Border(points, triangles, errors)
        _, areas = normals_and_areas(points[triangles])
        # Beside its border a face may be as near to the other solid's as to its own.
        (middle,) = points_on(face, uv[areas.argmax()].mean(axis=0, keepdims=True))
        away = [boundary.foot(middle).distance for boundary in boundaries]
        for side, distance in zip(sides, away, strict=True):
            if distance <= min(away) + TOLERANCE:  # where the two coincide the face is on both
                side.append(border)
    return CommonPart(volume, area, box, tuple(map(_joined, sides)))


def _border_meshes(shape: Any, chord: float) -> list[tuple[Array, IntArray, Array]]:
    """The triangles of each face of a TopoDS_Shape, as `triangles_of` gives them.

    Their edges are within ``chord`` mm, the inside of faces is coarser: Open CASCADE takes seconds to mesh
    that of slender free-form faces finely, `_samples` does. Of slender plane faces it can leave out nearly all, and
    does not say so; finer edges help, and turned cones. Raises Clamp3dError where they do not.
    """
    how = occ.IMeshTools_Parameters()
    how.Angle = how.AngleInterior = ANGLE
    for share in _FINER_EDGES:
        how.Deflection, how.DeflectionInterior = share * chord, _COARSER * share * chord
        occ.BRepTools.Clean_s(shape)
        occ.BRepMesh_IncrementalMesh(shape, how)
        faces = [*explore(shape, "FACE")]
        meshes = [triangles_of(face, k) for k, face in enumerate(faces)]
        torn = [face for face, (_, triangles, _) in zip(faces, meshes, strict=True) if not covers(face, triangles)]
        if not torn:
            return meshes
        turn_cones(torn, curved=True)
    raise Clamp3dError("Open CASCADE leaves out some of a face of the common part of the two solids")


def _joined(side: list[Border]) -> Border:
    """The samples of some faces as one."""
    if not side:
        return Border(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), np.empty(0))
    mesh = appended([border.points for border in side], [border.triangles for border in side])
    return Border(*mesh, np.concatenate([border.errors for border in side]))


@lru_cache(maxsize=512)
def _common_shape(a: bytes, b: bytes, pose: bytes) -> Any:
    """The common part as a TopoDS_Shape, kept for who asks for its depth, its volume or finer samples."""
    # Of new copies, since it widens the tolerances of what it is given; a mesh of that is as coarse as these.
    operation = occ.BRepAlgoAPI_Common(parse(a), moved(parse(b), np.frombuffer(pose).reshape(4, 4)))
    if not operation.IsDone():
        raise Clamp3dError("Open CASCADE cannot make the common part of the two solids")
    shape = operation.Shape()
    turn_cones(explore(shape, "FACE"))
    return shape


def _samples(face: Any, ends: Array, corners: Array, sag: float) -> tuple[Array, IntArray, Array]:
    """Triangles (k, 3, 2) of a face in its surface's parameters, which of its mesh (k,) each is of, and how far off.

    Those of its mesh have their ``ends`` (m, 3, 3) on the surface, at the parameters ``corners`` (m, 3, 2). They are
    cut in two at the middle of an edge until no edge's middle is farther than ``sag`` mm from the surface, or there are
    too many.
    """
    kind, frame, size = form_of(occ.BRepAdaptor_Surface(face))
    count = len(corners)
    source = np.arange(count)
    finished = [(corners[:0], source[:0], np.empty(0))]
    while len(corners):
        middles = edge_middles(corners)
        true = points_on(face, middles.reshape(-1, 2)).reshape(-1, 3, 3)
        if kind == OTHER:
            off = distances_from_segments(true, ends, np.roll(ends, -1, axis=1))
        else:
            off = np.abs(height(kind, frame, size, edge_middles(ends).reshape(-1, 3))).reshape(-1, 3)
        wide, length = off.max(axis=1) > sag, off
        if count < _SAMPLES and not wide.any():
            wide[:], length = True, np.linalg.norm(np.roll(ends, -1, axis=1) - ends, axis=2)
        if count > _MOST_SAMPLES:
            wide[:] = False
        most = sag_factors(kind, frame, ends[~wide]) * off[~wide].max(axis=1)
        finished.append((corners[~wide], source[~wide], most))
        count += int(wide.sum())
        rows, edge = np.flatnonzero(wide), length[wide].argmax(axis=1)
        corners, ends = halves(corners[wide], edge, middles[rows, edge]), halves(ends[wide], edge, true[rows, edge])
        source = np.tile(source[wide], 2)
    uvs, sources, errors = map(np.concatenate, zip(*finished, strict=True))
    return uvs, sources, errors


def depths(brep: bytes, points: Array) -> Array:
    """Signed depth (k,) mm of points (k, 3) in a solid: negative outside, or where nobody knows the side."""
    boundary = Boundary(from_bytes(brep))
    every = [boundary.side(point) for point in points]
    return np.array([foot.distance if side is Side.INSIDE else -foot.distance for side, foot in every])
