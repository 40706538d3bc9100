"""Two solids from CAD by Open CASCADE, in its process, for pairs that coarse meshes leave open.

Open CASCADE states no error: `TOLERANCE` is taken for it, and the method's name says whose answer it is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.model import Model
from clamp3d.engine.near_faces import near_faces
from clamp3d.engine.overlap import common
from clamp3d.engine.surface import Surface
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.files.pairs import Border, CommonPart, halves
from clamp3d.files.tessellation import edge_middles
from clamp3d.geometry.pose import Array, to_source, to_target

METHOD = f"Open CASCADE, tolerance {TOLERANCE:g} mm"
_PROBED, _MANY = 8, 16
"""Points whose depth is measured exactly: as many of those that look deepest, and of all others."""
_SERVES = 1.005
"""Ratio of a bound of an interference to the depth of a point from which on it is not sharpened."""
_BETWEEN = (1.0 / 3.0, 1.25)
"""Factors on what a distance is above the corners' mean, for what it is more where nobody looks: above a smooth bend,
which is next to quadratic, and above anything else, such as the tip of a cone, wherever it stands.
"""
_SMOOTH = 0.9
"""Least cosine of the angle of the triangles that are nearest to one piece above a smooth sheet."""
_CUTS, _MOST_CUTS = 450.0, 30_000
"""Triangles that those of a common part's border are cut into beyond their number, times the chords' share, and at
most: two seconds.
"""
_FAINT = 1e-4
"""Overlap (mm) that Open CASCADE may leave out, where the edges of a file have tolerances of that size."""
_NARROW, _HIDING = 9e-3, 0.01
"""Overlap (mm) allowed for where Open CASCADE finds none, and chord error of meshes whose points would show it."""


def exact_distance(a: Model, b: Model, T: Array, most: float = np.inf) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame; nothing from below where they touch or it is not the least.

    Raises Clamp3dError where there are more than ``most`` pairs of edges to look at.
    """
    assert a.exact is not None
    assert b.exact is not None
    near = near_faces(a.face_meshes, b.face_meshes, T)
    nearest = cad_process.distance(a.exact.brep, b.exact.brep, T, near, most)
    gap, way = nearest.distance, nearest.q - nearest.p
    lower = gap - TOLERANCE if nearest.is_least and (gap > TOLERANCE or nearest.is_signed) else -np.inf
    normal = way / np.linalg.norm(way) if lower > 0.0 else None
    return Distance(lower, gap + TOLERANCE, nearest.p, nearest.q, normal, method=METHOD)


def exact_probe(a: Model, b: Model, T: Array, *, chord: float = np.inf, points_each: int = _PROBED) -> Distance:
    """How deep some points of the common part of meshes lie in two solids that touch or overlap.

    The corners of a mesh lie on the solid itself, so some of an overlap are as deep as it is, however coarse the mesh.
    ``chord``: chord error (mm) of the meshes, that of the coarsest by default. ``points_each``: points that look
    deepest in one solid, and in both.
    """
    nothing = Distance(method=METHOD)
    if not (a.chords and b.chords):
        return nothing
    meshes = [model.outer(min(model.chords[0], chord), thorough=True) for model in (a, b)]
    shared = common(meshes[0], meshes[1], T)
    if shared is None:
        return nothing
    points = np.vstack([shared.vertices, shared.inner_points()])
    looks = [meshes[0].distance(points), meshes[1].distance(to_source(T, points))]
    orders = [np.argsort(-look, kind="stable")[:points_each] for look in (np.minimum(*looks), np.maximum(*looks))]
    points = points[np.concatenate(orders)]
    return attested_overlap(points, depths_in(a, b, T, points))


def depths_in(a: Model, b: Model, T: Array, points: Array) -> Array:
    """Signed depths (2, k) mm of points (k, 3) of a's frame in each of two bodies, negative outside."""
    return np.stack([a.depth(points), b.depth(to_source(T, points))])


def attested_overlap(points: Array, depths: Array) -> Distance:
    """The overlap that the deepest of points (k, 3) attests; where all lie beside a solid, nothing."""
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
    a: Model, b: Model, T: Array, share: float, *, quick: bool = False, attested: float = 0.0
) -> Distance:
    """Bounds of the interference of solids that touch or overlap, from points of the border of their common part.

    ``share``: how far between the points that border may be off straight lines, of the common part's thickness.
    ``quick``: nothing is known if it takes more than a second to find.
    ``attested``: how deep (mm) a point lies: then some of a common part that is not as deep is missing.
    """
    assert a.exact is not None
    assert b.exact is not None
    unknown = Distance(method=f"{METHOD}, without a common part")
    try:
        find = cad_process.quick_common if quick else cad_process.common
        shared = find(a.exact.brep, b.exact.brep, T, share)
    except Clamp3dError:  # it takes too long, or fails
        return unknown
    if shared.volume <= TOLERANCE * max(1e-12, shared.area):
        return _without_common_part(a, b, T, attested)
    corners, middles, at_most = _deepest_places(shared, min(round(_CUTS / share), _MOST_CUTS))
    points = np.concatenate([corners, middles])
    depths = depths_in(a, b, T, points)
    # Some of what Open CASCADE calls the common part may lie beside the solids: then it is that inaccurate.
    most = at_most + max(0.0, -float(depths[:, : len(corners)].min()))
    reached = attested_overlap(points, depths)
    if most + 2.0 * TOLERANCE < max(attested, -reached.upper):  # some of it is missing
        return replace(reached, method=unknown.method)
    return replace(reached, lower=-most - TOLERANCE)


def _without_common_part(a: Model, b: Model, T: Array, attested: float) -> Distance:
    """What is known where Open CASCADE finds no common part: from below nothing, if a point lies in one.

    It misses those between round faces that are nearly tangent: of a ball and a ring one of 0.014 mm was seen. No proof
    that there is none, so `_NARROW` is allowed for: one so deep is wider than the facets of the meshes looked at.
    """
    unknown = Distance(method=f"{METHOD}, without a common part")
    if attested > _FAINT:
        return unknown
    try:
        deepest = exact_probe(a, b, T, chord=_HIDING, points_each=_MANY)
    except Clamp3dError:  # such meshes may take too long to make
        return unknown
    if -deepest.upper > _FAINT:
        return replace(deepest, method=unknown.method)
    return Distance(-_NARROW, method=METHOD)


def _deepest_places(shared: CommonPart, cuts: int) -> tuple[Array, Array, float]:
    """Corners (n, 3) and middles (k, 3) of triangles of a common part's border, and how deep (mm) any point is at most.

    They are those that look deepest, and some of all other corners. Middles need not lie on the border. Up to ``cuts``
    triangles are added to sharpen the bound.
    Lemma: what of the border lies on a solid is some of its surface, so no point is farther from all of that.
    """
    corners, middles, away, most = [], [], [], 0.0
    for own, other in (shared.borders, shared.borders[::-1]):
        corners.append(own.points)
        middles.append(own.points[own.triangles].mean(axis=1))
        points = np.concatenate([corners[-1], middles[-1]])
        is_empty = not (len(own.triangles) and len(other.triangles))
        far = np.full(len(points), np.inf) if is_empty else Surface(other.points, other.triangles).distance(points)
        away.append(np.split(far, [len(own.points)]))
        most = max(most, np.inf if is_empty else _at_most(own, other, float(far.max()), cuts))
    (order, deepest) = (np.argsort(-np.concatenate(side), kind="stable") for side in zip(*away, strict=True))
    spread = order[np.linspace(0, len(order) - 1, _PROBED).astype(int)]
    tried = np.unique(np.concatenate([order[:_PROBED], spread]))
    return np.concatenate(corners)[tried], np.concatenate(middles)[deepest[:_PROBED]], most


class _Sheet(NamedTuple):
    """Some of a border: its ``surface``, how far (m,) mm that is off, and its box (2, 3)."""

    surface: Surface
    errors: Array
    box: Array

    @classmethod
    def of(cls, border: Border, rows: Any) -> _Sheet:
        """The triangles ``rows`` of a border."""
        ends = border.points[border.triangles[rows]].reshape(-1, 3)
        box = np.array([ends.min(axis=0), ends.max(axis=0)])
        return cls(Surface(border.points, border.triangles[rows]), border.errors[rows], box)


def _at_most(own: Border, other: Border, reached: float, cuts: int) -> float:
    """How far (mm) any point of a border is from another one at most, ``reached`` mm being what some corner is.

    Triangles are cut across their longest sides until their bounds are sharp, or ``cuts`` are made.
    """
    faces, number = np.unique(other.face, return_counts=True)
    largest_first = faces[np.argsort(-number, kind="stable")]
    sheets = [*(_Sheet.of(other, other.face == face) for face in largest_first), _Sheet.of(other, slice(None))]
    pieces, errors = own.points[own.triangles], own.errors
    at_most, seen, off = _bounds(pieces, errors, sheets, _SERVES * reached)
    least, count = _SERVES * reached + float(off[seen.argmax()]), 0  # no bound of all is less
    while True:
        worst = at_most > np.maximum(least, seen + off + (_SERVES - 1.0) * reached)
        worst &= at_most >= 0.5 * (least + at_most[worst].max(initial=0.0))
        count += int(worst.sum())
        if not worst.any() or count > cuts:
            return max(reached, float(at_most.max()))
        sides = np.linalg.norm(np.roll(pieces[worst], -1, axis=1) - pieces[worst], axis=2)
        cut, twice = halves(pieces[worst], edge_middles(pieces[worst]), sides.argmax(axis=1)), np.tile(errors[worst], 2)
        old, new = (pieces, errors, at_most, seen, off), (cut, twice, *_bounds(cut, twice, sheets, _SERVES * reached))
        pieces, errors, at_most, seen, off = (np.concatenate([x[~worst], y]) for x, y in zip(old, new, strict=True))


def _bounds(pieces: Array, errors: Array, sheets: list[_Sheet], serves: float) -> tuple[Array, Array, Array]:
    """How far (m,) mm any point of triangles (m, 3, 3) is from a border at most, its middle (m,), and its error (m,).

    ``sheets`` are its faces, and last all of it. The least of three bounds: no point is farther than the middle by more
    than it is away from that; and where this is more than ``serves`` mm, what `_over_sheet` says of single faces and
    of all: the corners of a slab are at its walls, so of both together it knows nothing.
    """
    middles = pieces.mean(axis=1)
    away, nearest, _ = sheets[-1].surface.nearest(middles)
    off = sheets[-1].errors[nearest]
    at_most = away + np.linalg.norm(pieces - middles[:, None], axis=2).max(axis=1) + off
    for sheet in sheets:
        gaps = np.maximum(sheet.box[0] - middles, middles - sheet.box[1]).max(axis=1)
        rows = np.flatnonzero((at_most + errors > serves) & (gaps <= 2.0 * (serves + off)))
        at_most[rows] = np.minimum(at_most[rows], _over_sheet(pieces[rows], sheet))
    return at_most + errors, away, off + errors


def _over_sheet(pieces: Array, sheet: _Sheet) -> Array:
    """How far (m,) mm any point of triangles (m, 3, 3) is at most from a sheet.

    It is looked at in the corners, the middles of the sides and the middle. Above a plane the distance there is the
    mean of the corners'. By how much it is more above a bend, the ridge of a roof or the tip of a cone, so much more it
    can be between these places at most, times `_BETWEEN`.
    """
    places = np.concatenate([pieces, edge_middles(pieces), pieces.mean(axis=1, keepdims=True)], axis=1)
    away, nearest, _ = sheet.surface.nearest(places.reshape(-1, 3))
    away = (away + sheet.errors[nearest]).reshape(-1, 7, 1)
    means = np.concatenate([edge_middles(away[:, :3]), away[:, :3].mean(axis=1, keepdims=True)], axis=1)
    above = (away[:, 3:] - means).max(axis=(1, 2), initial=0.0)
    normals = sheet.surface.normals[nearest].reshape(-1, 7, 3)
    is_smooth = (normals @ normals[:, 6, :, None]).min(axis=(1, 2), initial=1.0) > _SMOOTH
    return np.asarray(away.max(axis=(1, 2), initial=0.0) + np.where(is_smooth, *_BETWEEN) * above)
