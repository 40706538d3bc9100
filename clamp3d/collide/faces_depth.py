"""How deep two solids from CAD overlap: a depth that a point has, and a translation after which they are apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.brep.surfaces import OTHER, height
from clamp3d.collide.answer import Distance
from clamp3d.collide.depth_cover import nearest_behind
from clamp3d.collide.faces import FaceModel, faces_distance
from clamp3d.collide.faces_search import FEW
from clamp3d.collide.verdict import RESOLUTION
from clamp3d.core.linear import dot, norm, to_target
from clamp3d.core.pose import Array, inverse
from clamp3d.core.triangles import closest_points

_ASKS = 3
"""Translations that are tried, each past one more place that touches."""
_SHARE, _LEAST = 0.005, 0.001
"""So much further, by the depth or in mm, whichever is more, b is moved, so that a gap can be seen."""
_PIECES = 4000
"""Pieces looked at for a depth, and for whether they are apart after a translation."""
_FREE = 400
"""Pieces looked at of two solids that both have free-form faces: how deep they are in each other is known coarsely."""
_COARSE = 0.1
"""Width of the bounds, by the depth, that are asked for where the first translations do not part them."""
_STEP = 1e-6


def faces_depth(a: FaceModel, b: FaceModel, T: Array, known: Distance) -> Distance:
    """What is soon found of the depth of two solids that overlap by ``-known.upper``, b at ``T`` (4, 4) in a's frame.

    No translation shorter than the depth of any one point parts them; one after which they are apart is long enough.
    Without such a one ``lower`` stays minus infinity.
    """
    free = [float(x.faces.deviation[x.faces.kind == OTHER].max(initial=0.0)) for x in (a, b)]
    most = _FREE if min(free) > 0.0 else _PIECES
    tol, inside, parted = max(_LEAST, -_SHARE * known.upper), (0.0, np.inf), known
    for pieces in (FEW, most):
        found = faces_distance(a, b, T, contact=_LEAST, tol=tol, most=pieces, brief=tol)
        inside = max(inside[0], -known.upper, -found.upper), min(inside[1], max(0.0, -found.lower))
        known = replace(known if known.upper <= found.upper else found, lower=-np.inf, interference=inside)
        margin = max(tol, _SHARE * inside[0])
        parted = _parted(a, b, T, known, found, margin, most)
        # The deepest of few points is mostly deep enough: no translation much shorter than this one parts them.
        if parted.lower > -np.inf or found.upper - found.lower <= tol:
            break
        tol = max(tol, _COARSE * inside[0], 2.0 * sum(free))
    return parted


def _parted(
    a: FaceModel,
    b: FaceModel,
    T: Array,
    known: Distance,
    found: Distance,
    margin: float,
    most: int,
) -> Distance:
    """``known`` with a translation after which they are apart, past the point of ``found`` first; as it is without."""
    inside = known.interference or (0.0, np.inf)
    planes, t, place = [], np.zeros(3), T.copy()
    at, deep = found.point_a, -found.upper
    for step in range(_ASKS):
        if (way := _way_out(a, b, place, found)) is None:
            break
        n, of_b = way
        planes.append(np.array([*n, float(dot(n, t)) - found.upper + margin]))
        before, t = t, nearest_behind(np.array(planes), t)
        size = norm(t)
        if norm(t - before) < RESOLUTION:  # it would be asked the same again
            break
        if size > 2.0 * (inside[0] + margin):  # a long way out, or nothing is behind all the planes
            break
        place[:3, 3] = T[:3, 3] + t
        found = faces_distance(a, b, place, contact=0.01 * margin, most=most, brief=margin)
        if found.lower > RESOLUTION:  # so also where the pose differs by rounding
            p, q = (None, None) if step or at is None else (at + deep * n, at) if of_b else (at, at - deep * n)
            inside = inside[0], min(inside[1], size)  # no point is deeper than a way that parts them is long
            return replace(known, lower=-size, normal=t / size, point_a=p, point_b=q, interference=inside)
    return known


def _way_out(a: FaceModel, b: FaceModel, T: Array, found: Distance) -> tuple[Array, bool] | None:
    """Unit vector (3,) along which b moves so that the deepest point found is in one solid only, and whether it is b's.

    None if there is none: the nearest face is not one of those with a formula, and no corner or edge is as near.
    """
    if not found.upper < 0.0 or found.point_a is None:
        return None
    here, best = inverse(T), (1e-3, np.zeros(3), True)
    sides = (a, found.point_a, np.eye(3)), (b, to_target(here, found.point_a), -T[:3, :3])
    for model, point, turn in sides:
        f, steps = model.faces, np.vstack([point, point + _STEP * np.eye(3), point - _STEP * np.eye(3)])
        for i in np.flatnonzero(f.kind != OTHER):
            h = f.sense[i] * height(int(f.kind[i]), f.frame[i], (float(f.size[i, 0]), float(f.size[i, 1])), steps)
            if abs(h[0] - found.upper) < best[0]:
                best = abs(float(h[0]) - found.upper), dot(turn, h[1:4] - h[4:]), model is a
    if not best[1].any():  # further in than any one surface says: in a hollow corner
        for model, point, turn in sides:
            c = model.faces.corners
            away = closest_points(c, np.broadcast_to(point, (len(c), 3))) - point
            foot = away[(away * away).sum(axis=1).argmin()]
            if abs(norm(foot) + found.upper) < best[0]:
                best = abs(norm(foot) + found.upper), dot(turn, foot), model is a
    size = norm(best[1])
    return (best[1] / size, best[2]) if size > 0.0 else None
