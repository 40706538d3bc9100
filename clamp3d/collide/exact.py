"""Two solids from CAD by Open CASCADE, in its process: the last level, for pairs that the meshes leave open.

Open CASCADE states no error: `TOLERANCE` is taken for it, and the method's name says whose answer it is.
"""

from __future__ import annotations

import numpy as np

from clamp3d.brep import cad_process
from clamp3d.brep.open_cascade import TOLERANCE
from clamp3d.collide.answer import Distance
from clamp3d.collide.model import Model
from clamp3d.core.pose import Array
from clamp3d.errors import SolverError

METHOD = f"Open CASCADE, tolerance {TOLERANCE:g} mm"
_TRIED = 12
"""Points of the common part's border that look deepest from the meshes, whose depth is then measured exactly."""
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
    if shared.volume <= TOLERANCE * max(1e-12, shared.area) or not len(shared.points):
        return touching
    depth, point = _deepest(a, b, T, shared.points)
    # The samples are a fraction of the overlap's thickness apart: no point between them is much deeper.
    upper_depth = depth * (1.0 + _SAMPLES) + TOLERANCE
    return Distance(-upper_depth, TOLERANCE - depth, point, point, None, None, "exact", METHOD)


def _deepest(a: Model, b: Model, T: Array, points: Array) -> tuple[float, Array]:
    """The largest depth (mm) of points (k, 3) of the common part in either solid, and the point (3,)."""
    local = (points - T[:3, 3]) @ T[:3, :3]
    best, where = 0.0, points[0]
    for model, own in ((a, points), (b, local)):
        assert model.exact is not None
        meshed = np.zeros(len(own)) if not model.chords else model.outer(model.chords[-1]).distance(own)
        chosen = np.argsort(-meshed, kind="stable")[:_TRIED]
        depths = cad_process.depths(model.exact.brep, own[chosen])
        k = int(np.argmax(depths))
        if depths[k] > best:
            best, where = float(depths[k]), points[chosen[k]]
    return best, where
