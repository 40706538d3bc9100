"""Meshes that are not closed or cross themselves: distance of the surfaces, and whether those of two parts cross.

Where an edge of one mesh pierces a triangle of the other, it still does after a move that is short beside what is left
of both around the place. So a crossing has a depth that is certain, without an inside.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.mesh_distance import nearest_points, one_in_other, one_inside, surfaces_meet
from clamp3d.engine.model import Model
from clamp3d.engine.surface import Surface, fcl_pair, rounding_of
from clamp3d.geometry.pose import Array, inverse, to_target
from clamp3d.geometry.triangles import normals_and_areas

_PAIRS = 4000
"""Pairs of crossing triangles that are looked at."""
OPEN_ERROR = 0.016
"""Chord error (mm) of the meshes of a drawn part that an open mesh is measured against."""


def open_distance(a: Model, b: Model, T: Array) -> Distance:
    """Distance of ``b`` at ``T`` (4, 4) in a's frame where the mesh of one, or of both, is not closed or not simple.

    Without a crossing the surfaces are as far apart as said. If an open mesh seems to wind round the other part,
    nothing says that they are apart: ``lower`` is minus infinity. What a closed mesh winds round is inside it.
    """
    names = " and ".join(model.name for model in (a, b) if not model.closed)
    notes = [f"inside of {names} unknown"] if names else []
    notes += [f"{model.name} crosses itself" for model in (a, b) if model.closed and not model.is_simple]
    return replace(_surface_distance(a, b, T), method=", ".join(["surfaces (FCL)", *notes]))


def _surface_distance(a: Model, b: Model, T: Array) -> Distance:
    outer_a, outer_b = a.outer(OPEN_ERROR), b.outer(OPEN_ERROR)
    is_apart = not (surfaces_meet(outer_a, outer_b, T) or one_in_other(outer_a, outer_b, T))
    lower = nearest_points(outer_a, outer_b, T)[0] if is_apart else -np.inf
    inner_a, inner_b = a.inner(OPEN_ERROR), b.inner(OPEN_ERROR)
    if inner_a is None or inner_b is None:
        return Distance(lower if lower > 0.0 else -np.inf)
    rounding = rounding_of(inner_a, inner_b, T)
    error = inner_a.error + inner_b.error
    meet = surfaces_meet(inner_a, inner_b, T)
    upper, p, q = (0.0, None, None) if meet else nearest_points(inner_a, inner_b, T)[1:]
    if upper <= rounding:
        depth, point = _crossing(inner_a, inner_b, T)
        return Distance(-np.inf, error + rounding - depth, point, point)
    for outer, inner, place, closed in ((inner_a, inner_b, T, a.closed), (inner_b, inner_a, inverse(T), b.closed)):
        if one_inside(outer, inner, place):
            # In a closed part the other's surface is an overlap; an open one may or may not hold the other part.
            return Distance(-np.inf, (error - upper if closed else upper + error) + rounding)
    return Distance(lower - rounding, upper + error + rounding, p, q)


def _crossing(a: Surface, b: Surface, T: Array) -> tuple[float, Array | None]:
    """A depth (mm) that the crossing of two surfaces certainly has, and where; 0.0 if they only touch."""
    import fcl

    answer = fcl.CollisionResult()
    request = fcl.CollisionRequest(num_max_contacts=_PAIRS, enable_contact=True)
    fcl.collide(*fcl_pair(a.bvh, b.bvh, T), request, answer)
    if not answer.contacts:
        return 0.0, None
    rows = np.array([(contact.b1, contact.b2) for contact in answer.contacts])
    P = a.vertices[a.faces[rows[:, 0]]]
    Q = to_target(T, b.vertices[b.faces[rows[:, 1]]])
    best, where = 0.0, None
    for edges, triangles in ((P, Q), (Q, P)):
        for k in range(3):
            margin, points = _pierced(edges[:, k], edges[:, (k + 1) % 3], triangles)
            row = int(np.argmax(margin))
            if margin[row] > best:
                best, where = float(margin[row]), points[row]
    return best, where


def _pierced(start: Array, end: Array, triangles: Array) -> tuple[Array, Array]:
    """How far (k,) mm segments may be moved at least without leaving the triangles (k, 3, 3) they pierce, and where.

    A move by t shifts the point of piercing by t (1 + 1 / c) at most, and by t / c along the segment, c being the
    cosine between the segment and the triangle's normal.
    """
    way = end - start
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    along = way / length[:, None]
    sides = np.roll(triangles, -1, axis=1) - triangles
    normal, _ = normals_and_areas(triangles)
    cosine = np.einsum("ij,ij->i", along, normal)
    slope = np.abs(cosine)
    steep = slope > 1e-9
    reach = np.einsum("ij,ij->i", triangles[:, 0] - start, normal) / np.where(steep, cosine, 1.0)
    points = start + reach[:, None] * along
    inward = np.cross(normal[:, None], sides)
    inward /= np.maximum(np.linalg.norm(inward, axis=2), 1e-300)[:, :, None]
    to_border = np.einsum("ijk,ijk->ij", points[:, None] - triangles, inward).min(axis=1)
    margin = np.minimum(to_border * slope / (1.0 + slope), np.minimum(reach, length - reach) * slope)
    return np.where(steep, np.maximum(margin, 0.0), 0.0), points
