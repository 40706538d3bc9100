"""Two solids from CAD by Open CASCADE, in its process: the last level, for pairs that the meshes leave open.

Open CASCADE states no error: `TOLERANCE` is taken for it, and the method's name says whose answer it is.
"""

from __future__ import annotations

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.model import Model
from clamp3d.engine.overlap import common
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process
from clamp3d.files.pairs import TOLERANCE, CommonPart
from clamp3d.geometry.pose import Array, to_source

METHOD = f"Open CASCADE, tolerance {TOLERANCE:g} mm"
_FAINT = 1e-4
"""Overlap (mm) that Open CASCADE may leave out, where the edges of a file have tolerances of that size."""
_PROBED = 8
"""Points of the coarse common part, those that look deepest, by which it is told whether it was left out."""
_TRIED = 24
"""Points of the common part's border whose depth is measured exactly: as many of those that look deepest by the meshes,
and of all that may be the deepest.
"""


def exact_distance(a: Model, b: Model, T: Array) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame; where the solids touch or overlap nothing from below."""
    assert a.exact is not None
    assert b.exact is not None
    gap, p, q = cad_process.distance(a.exact.brep, b.exact.brep, T)
    if gap <= TOLERANCE:
        return Distance(-np.inf, TOLERANCE, p, q, None, None, "exact", METHOD)
    return Distance(gap - TOLERANCE, gap + TOLERANCE, p, q, (q - p) / np.linalg.norm(q - p), None, "exact", METHOD)


def exact_overlap(a: Model, b: Model, T: Array, share: float, *, quick: bool = False) -> Distance:
    """Bounds of the interference of solids that touch or overlap, from points of the border of their common part.

    ``share``: how far between the points that border may be off straight lines, of the common part's thickness.
    ``quick``: nothing is known if it takes more than a second to find.
    """
    assert a.exact is not None
    assert b.exact is not None
    unknown = Distance(level="exact", method=f"{METHOD}, without a common part")
    try:
        find = cad_process.quick_common if quick else cad_process.common
        shared = find(a.exact.brep, b.exact.brep, T, share)
    except Clamp3dError:  # it takes too long, or fails
        return unknown
    if shared.volume <= TOLERANCE * max(1e-12, shared.area) or not len(shared.points):
        missed = _missed(a, b, T)
        return unknown if missed > _FAINT else Distance(-TOLERANCE - missed, level="exact", method=METHOD)
    points = _deep_points(a, b, T, shared)
    if points is None:
        return unknown
    in_a = cad_process.depths(a.exact.brep, points)
    in_b = cad_process.depths(b.exact.brep, to_source(T, points))
    # Between the points both surfaces are within a chord of straight lines, so nothing is much deeper.
    most = float(np.maximum(np.abs(in_a), np.abs(in_b)).max()) + 2.0 * shared.chord
    # A point near the border, which is only that well known, may lie beside the part and attests nothing.
    attested = np.where(np.minimum(in_a, in_b) >= -2.0 * TOLERANCE, np.maximum(in_a, in_b), 0.0)
    k = int(np.argmax(attested))
    upper = TOLERANCE - float(attested[k])
    return Distance(-most - TOLERANCE, upper, points[k], points[k], None, None, "exact", METHOD)


def _missed(a: Model, b: Model, T: Array) -> float:
    """How deep (mm) points of the common part of coarse meshes lie in both of two solids that seem only to touch."""
    assert a.exact is not None
    assert b.exact is not None
    if not (a.chords and b.chords):
        return 0.0
    coarse = [model.outer(model.chords[0]) for model in (a, b)]
    shared = common(coarse[0], coarse[1], T)
    if shared is None:
        return 0.0
    points = np.vstack([shared.vertices, shared.inner_points()])
    looks = np.minimum(coarse[0].distance(points), coarse[1].distance(to_source(T, points)))
    points = points[np.argsort(-looks, kind="stable")[:_PROBED]]
    in_a = cad_process.depths(a.exact.brep, points)
    in_b = cad_process.depths(b.exact.brep, to_source(T, points))
    return float(np.minimum(in_a, in_b).max(initial=0.0))


def _deep_points(a: Model, b: Model, T: Array, shared: CommonPart) -> Array | None:
    """Points (k, 3) of the common part's border that may be the deepest.

    None where some of the border does not lie in both by their meshes: Open CASCADE was wrong.
    """
    points = shared.points
    local = to_source(T, points)
    looks, slack = np.zeros(len(points)), np.inf
    if a.chords and b.chords:
        sides = ((a.outer(a.chords[-1]), points), (b.outer(b.chords[-1]), local))
        away = [surface.distance(seen) for surface, seen in sides]
        for (surface, seen), far in zip(sides, away, strict=True):
            outside = far > surface.error + shared.chord + 2.0 * TOLERANCE
            if not surface.contains(seen[outside]).all():
                return None
        looks, slack = np.maximum(*away), 2.0 * sum(surface.error for surface, _ in sides)
    order = np.argsort(-looks, kind="stable")
    order = order[looks[order] >= looks.max() - slack]
    spread = order[np.linspace(0, len(order) - 1, min(len(order), _TRIED)).round().astype(int)]
    return np.asarray(points[np.concatenate([order[:_TRIED], spread])])
