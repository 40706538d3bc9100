"""Two solids from CAD by Open CASCADE, in its process, for pairs that coarse meshes leave open.

Open CASCADE states no error: `TOLERANCE` is taken for it, and the method's name says whose answer it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.farthest import Pieces, farthest
from clamp3d.engine.model import CAD_CHORDS, CadModel, Model
from clamp3d.engine.near_faces import faces_nearby, near_faces
from clamp3d.engine.overlap import common
from clamp3d.engine.surface import Surface
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.files.pairs import Border, CommonPart
from clamp3d.geometry.pose import Array, to_source, to_target

End = Callable[[Distance, Distance], bool]
"""Whether bounds of an interference are sharp enough, or none can be, since none are closer than the second ones."""

METHOD = f"Open CASCADE, tolerance {TOLERANCE:g} mm"
_UNKNOWN = Distance(method=f"{METHOD}, without a common part")
"""What is said where Open CASCADE gives no common part."""
_PROBED, _MANY = 8, 16
"""Points whose depth is measured exactly: as many of those that look deepest, and of all others."""
_SPREAD = 64
"""Corners of triangles that do not close, or of a common part without any, whose depth is measured, wherever they are.

Each takes one to four milliseconds.
"""
SHARES = (0.04, 0.015, 0.004)
"""Chords of the border of a common part, of its thickness: the first is quick, the last takes up to seconds."""
_CUTS = 200_000
"""Triangles that are added to each side of a common part's border at most to bound its depth: they take seconds."""
_FAINT = 1e-4
"""Overlap (mm) that Open CASCADE may leave out, where the edges of a file have tolerances of that size."""
_NARROW, _HIDING = 9e-3, 0.01
"""Overlap (mm) allowed for where Open CASCADE finds none, and chord error of meshes whose points would show it."""


def exact_distance(a: CadModel, b: CadModel, T: Array, most: float = np.inf) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame; nothing from below where they touch or it is not the least.

    Raises Clamp3dError where there are more than ``most`` pairs of edges to look at.
    """
    near = near_faces(a.face_meshes, b.face_meshes, T) if a.chords and b.chords else None
    nearest = cad_process.distance(a.shape.brep, b.shape.brep, T, near, most)
    gap, way = nearest.distance, nearest.q - nearest.p
    lower = gap - TOLERANCE if nearest.is_least and (gap > TOLERANCE or nearest.is_signed) else -np.inf
    normal = way / np.linalg.norm(way) if lower > 0.0 else None
    return Distance(lower, gap + TOLERANCE, nearest.p, nearest.q, normal, method=METHOD)


def exact_probe(
    a: CadModel, b: CadModel, T: Array, *, chord: float | None = None, points_each: int = _PROBED
) -> Distance:
    """How deep some points of the common part of meshes lie in two solids that touch or overlap.

    The corners of a mesh lie on the solid itself, so some of an overlap are as deep as it is, however coarse the mesh.
    Of triangles that do not close some corners are tried.
    ``chord``: chord error (mm) of the meshes where the solids are near each other; by default they are coarse.
    ``points_each``: points that look deepest in one solid, and in both.
    """
    nothing = Distance(method=METHOD)
    if not (a.chords and b.chords):
        points = _corners_in_both_boxes(a, b, T, chord or CAD_CHORDS[0])
        return attested_overlap(points, depths_in(a, b, T, points))
    if chord is None:
        meshes = [model.outer(CAD_CHORDS[0]) for model in (a, b)]
    else:
        on_a, on_b = faces_nearby(a.face_meshes, b.face_meshes, T)
        meshes = [a.outer_near(on_a, chord), b.outer_near(on_b, chord)]
    shared = common(meshes[0], meshes[1], T)
    if shared is None:
        return nothing
    points = np.vstack([shared.vertices, shared.inner_points])
    looks = [meshes[0].distance(points), meshes[1].distance(to_source(T, points))]
    orders = [np.argsort(-look, kind="stable")[:points_each] for look in (np.minimum(*looks), np.maximum(*looks))]
    points = points[np.concatenate(orders)]
    return attested_overlap(points, depths_in(a, b, T, points))


def _corners_in_both_boxes(a: CadModel, b: CadModel, T: Array, chord: float) -> Array:
    """Some corners (k, 3) of triangles of two solids, which need not close, that lie in the box of the other one."""
    try:
        on_a, on_b = (solid.tessellated(chord).vertices for solid in (a.shape, b.shape))
    except Clamp3dError:  # a face gets none
        return np.empty((0, 3))
    corners = np.vstack([on_a, to_target(T, on_b)])
    inside = [
        ((x >= model.bounds[0]) & (x <= model.bounds[1])).all(axis=1)
        for model, x in ((a, corners), (b, to_source(T, corners)))
    ]
    return _some_of(corners[inside[0] & inside[1]])


def _some_of(points: Array) -> Array:
    """Points (k, 3) of (n, 3), spread over them, but no more than are measured quickly."""
    rows = np.linspace(0, len(points) - 1, min(len(points), _SPREAD)).astype(int)
    return np.asarray(points[rows])


def depths_in(a: Model, b: Model, T: Array, points: Array) -> Array:
    """Signed depths (2, k) mm of points (k, 3) of a's frame in each of two bodies, negative outside."""
    return np.stack([a.depth(points), b.depth(to_source(T, points))])


def attested_overlap(points: Array, depths: Array) -> Distance:
    """The overlap that the deepest of points (k, 3) attests; where there are none, or all beside a solid, nothing."""
    if not len(points):
        return Distance(method=METHOD)
    beside = np.minimum(depths.min(axis=0), 0.0)  # by so much it is moved into both solids, and less deep
    overlaps = np.where(beside >= -2.0 * TOLERANCE, depths.max(axis=0) + beside, -np.inf)
    k = int(np.argmax(overlaps))
    return Distance(-np.inf, TOLERANCE - float(overlaps[k]), points[k], points[k], method=METHOD)


def exact_height(inner: Surface, outer: Surface, solid: Model, T: Array) -> float:
    """How far (mm) corners of a mesh, which lie on its solid, stand out of another ``solid`` that it may lie in.

    ``outer`` is a mesh of that: what stands out most of it is measured, with ``inner`` placed by ``T`` (4, 4).
    """
    points = to_target(T, inner.vertices)
    away = outer.distance(points)
    order = np.argsort(np.where(outer.contains(points), away, -away), kind="stable")
    return -float(solid.depth(points[order[:_MANY]]).min())


def exact_overlap(
    a: CadModel,
    b: CadModel,
    T: Array,
    share: float,
    *,
    end: End = lambda *_: False,
    quick: bool = False,
    attested: float = 0.0,
) -> Distance:
    """Bounds of the interference of solids that touch or overlap, from points of the border of their common part.

    ``share``: how far between the points that border may be off straight lines, of the common part's thickness.
    ``end``: where these are not sharpened further, though they could be.
    ``quick``: nothing is known if it takes more than a second to find.
    ``attested``: how deep (mm) a point lies: then some of a common part that is not as deep is missing.
    """
    try:
        find = cad_process.quick_common if quick else cad_process.common
        shared = find(a.shape.brep, b.shape.brep, T, share)
    except Clamp3dError:  # it takes too long, or fails
        return _UNKNOWN
    if shared.volume <= TOLERANCE * max(1e-12, shared.area):
        return _without_common_part(a, b, T, attested)
    if not (shared.borders and all(len(border.triangles) for border in shared.borders)):
        corners = _some_of(np.unique(shared.corners, axis=0))
        by_corners = attested_overlap(corners, depths_in(a, b, T, corners))
        return replace(by_corners, method=_UNKNOWN.method)
    on_a, on_b = shared.borders
    # Lemma: what of the border lies on a solid is some of its surface, so no point is farther from all of that.
    sides = [_measured(on_a, on_b), _measured(on_b, on_a)]
    corners, middles = _deepest_places(shared, sides)
    points = np.concatenate([corners, middles])
    depths = depths_in(a, b, T, points)
    reached = attested_overlap(points, depths)
    # Some of what Open CASCADE calls the common part may lie beside the solids: then it is that inaccurate.
    beside = max(0.0, -float(depths[:, : len(corners)].min()))

    def bounded(at_most: float) -> Distance:
        return replace(reached, lower=-at_most - beside - TOLERANCE)

    def is_end(at_most: float, least: float) -> bool:
        return end(bounded(at_most), bounded(max(least, -reached.upper)))

    at_most = farthest(sides, is_end, _CUTS)
    if at_most + beside + 2.0 * TOLERANCE < max(attested, -reached.upper):  # some of it is missing
        return replace(reached, method=_UNKNOWN.method)
    return bounded(at_most)


def _without_common_part(a: CadModel, b: CadModel, T: Array, attested: float) -> Distance:
    """What is known where Open CASCADE finds no common part: from below nothing, if a point lies in one.

    It misses those between round faces that are nearly tangent: of a ball and a ring one of 0.014 mm was seen. No proof
    that there is none, so `_NARROW` is allowed for: one so deep is wider than the facets of the meshes looked at.
    """
    if attested > _FAINT:
        return _UNKNOWN
    try:
        deepest = exact_probe(a, b, T, chord=_HIDING, points_each=_MANY)
    except Clamp3dError:  # such meshes may take too long to make
        return _UNKNOWN
    if -deepest.upper > _FAINT:
        return replace(deepest, method=_UNKNOWN.method)
    return Distance(-_NARROW, method=METHOD)


def _measured(own: Border, other: Border) -> Pieces:
    """How far one side of a border is from the other."""
    surface = Surface(other.points, other.triangles, other.errors, has_own_errors=True)
    return Pieces.of(surface, own.points[own.triangles], own.errors)


def _deepest_places(shared: CommonPart, sides: list[Pieces]) -> tuple[Array, Array]:
    """Corners (n, 3) and middles (k, 3) of triangles of a common part's border that look deepest.

    With some of all other corners; middles need not lie on the border.
    """
    corners = np.concatenate([border.points for border in shared.borders])
    away = [side.surface.distance(border.points) for side, border in zip(sides, shared.borders, strict=True)]
    order = np.argsort(-np.concatenate(away), kind="stable")
    spread = order[np.linspace(0, len(order) - 1, _PROBED).astype(int)]
    tried = np.unique(np.concatenate([order[:_PROBED], spread]))
    middles = np.concatenate([side.triangles.mean(axis=1) for side in sides])
    deepest = np.argsort(-np.concatenate([side.middles for side in sides]), kind="stable")[:_PROBED]
    return corners[tried], middles[deepest]
