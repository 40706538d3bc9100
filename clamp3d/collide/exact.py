"""Two solids from CAD by Open CASCADE, in its process: the last level, for pairs that the meshes leave open.

Open CASCADE states no error: `TOLERANCE` is taken for it, and the method's name says whose answer it is.
"""

from __future__ import annotations

import numpy as np

from clamp3d.brep import cad_process
from clamp3d.brep.open_cascade import TOLERANCE
from clamp3d.collide.answer import Distance
from clamp3d.collide.model import Model
from clamp3d.collide.overlap import cut_up
from clamp3d.core.pose import Array
from clamp3d.errors import SolverError

METHOD = f"Open CASCADE, tolerance {TOLERANCE:g} mm"
_TRIED = 24
"""Points of the common part's border whose depth is measured exactly: as many of those that look deepest by the meshes,
and of all that may be the deepest.
"""
_PIECES = 4000
"""Triangles that those of the common part's border are cut into beyond their number, to find these points."""
_SAMPLES = 0.02
"""Chord of the common part's border relative to its smallest extent; between the samples the depth hardly changes."""


def exact_distance(a: Model, b: Model, T: Array) -> Distance:
    """Signed distance of ``b`` at ``T`` (4, 4) in a's frame; in an overlap bounds of the interference.

    Where the solids share a volume, the depth of points on the border of their common part is measured.
    """
    assert a.exact is not None
    assert b.exact is not None
    gap, p, q = cad_process.distance(a.exact.brep, b.exact.brep, T)
    if gap > TOLERANCE:
        normal = (q - p) / np.linalg.norm(q - p)
        return Distance(gap - TOLERANCE, gap + TOLERANCE, p, q, normal, None, "exact", METHOD)
    touching = Distance(-TOLERANCE, TOLERANCE, p, q, None, None, "exact", METHOD)
    try:
        shared = cad_process.common(a.exact.brep, b.exact.brep, T, _SAMPLES)
    except SolverError:  # it takes too long: they touch or overlap, and nobody says by how much
        return Distance(-np.inf, TOLERANCE, p, q, None, None, "exact", f"{METHOD}, without a common part")
    if shared.volume <= TOLERANCE * max(1e-12, shared.area) or not len(shared.triangles):
        return touching
    depth, point = _deepest(a, b, T, shared.triangles)
    # The samples are a fraction of the overlap's thickness apart: no point between them is much deeper.
    upper_depth = depth * (1.0 + _SAMPLES) + TOLERANCE
    return Distance(-upper_depth, TOLERANCE - depth, point, point, None, None, "exact", METHOD)


def _deepest(a: Model, b: Model, T: Array, border: Array) -> tuple[float, Array]:
    """The largest depth (mm) of points of the common part's border (k, 3, 3) in either solid, and the point (3,)."""
    points = border.reshape(-1, 3)
    looks, slack = np.zeros(len(points)), np.inf
    if a.chords and b.chords:
        x, y = a.outer(a.chords[-1]), b.outer(b.chords[-1])
        *_, pieces = cut_up(x, y, T, border, _PIECES)
        points, looks = pieces.triangles.mean(axis=1), pieces.middles
        slack = 2.0 * (x.error + y.error)
    order = np.argsort(-looks, kind="stable")
    order = order[looks[order] >= looks.max() - slack]
    spread = order[np.linspace(0, len(order) - 1, min(len(order), _TRIED)).round().astype(int)]
    points = points[np.concatenate([order[:_TRIED], spread])]
    local = (points - T[:3, 3]) @ T[:3, :3]
    assert a.exact is not None
    assert b.exact is not None
    depths = np.maximum(cad_process.depths(a.exact.brep, points), cad_process.depths(b.exact.brep, local))
    k = int(np.argmax(depths))
    return float(depths[k]), points[k]
