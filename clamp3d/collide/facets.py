"""An exact cylinder against the facets of a mesh: the distance of its axis from the triangles, less its radius.

The axis enters FCL as a triangle of no width, whose distance from other triangles is exact to rounding. Facets of
round surfaces carry the error bound of the fit, flat ones none.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.body import ClosedForm
from clamp3d.collide.convex import Rod
from clamp3d.collide.hull import Hull
from clamp3d.collide.surface import Surface, fcl_tree
from clamp3d.core.linear import dot, norm, to_target
from clamp3d.core.pose import Array

_WIDTH = 1e-9
_TURNS = 40
"""Times that two nearest points are looked for from each other."""


@lru_cache(maxsize=1024)
def _axis(rod: Rod) -> Any:
    half, T = 0.5 * rod.length, rod.T
    ends = T[:3, 3] + np.outer([-half, half, half], T[:3, 2])
    ends[2] += _WIDTH * T[:3, 0]
    return fcl_tree(ends, np.array([[0, 1, 2]]))


def _holds(facets: Surface, points: Array) -> bool:
    """Whether something whole that does not meet the surface, and has the ``points`` (k, 3), lies inside."""
    if (points < facets.box[0]).any() or (points > facets.box[1]).any():
        return False
    return bool(facets.contains(points[:1])[0])


def rod_distance(facets: Surface, body: ClosedForm, T: Array) -> Distance:
    """Distance of the signed distance of a ``body`` with a rod around it, at ``T`` (4, 4) in the mesh's frame."""
    rod = next(piece for piece in body.outers if isinstance(piece, Rod))
    distance, low, p, a = _to_axis(facets, rod, T)
    slack = 1e-12 * (facets.scale + float(np.abs(T[:3, 3]).max()) + rod.length) + _WIDTH
    if distance <= slack:
        return _axis_inside(facets, body, T, 0.0)
    axis = dot(T[:3, :3], rod.T[:3, 2])
    if _holds(facets, to_target(T, rod.ends)):
        return _axis_inside(facets, body, T, distance)
    bounds = Distance(low - rod.radius - slack)
    n = (p - a) / distance
    q = a + rod.radius * n
    R, t = T[:3, :3], T[:3, 3]
    error = max(uncertainty for _, uncertainty in facets.groups) if low < distance else 0.0
    if distance >= rod.radius:
        # Square to the axis the nearest point is on the side, which flat ends share with round ones.
        if abs(float(dot(n, axis))) < 1e-7 and body.depth(dot(q - t, R)[None])[0] >= -slack:
            return Distance(bounds.lower - body.error, distance - rod.radius + error + slack + body.error, p, q)
        if len(body.outers) == 1 and not body.bores:
            p, q = _nearer(facets, rod, T, p)
            upper = norm(q - p) + float(facets.error_at(p[None])[0]) + slack
            return Distance(bounds.lower, max(upper, bounds.lower), p, q).widened(body.error)
        return bounds.widened(body.error)
    deep = float(body.depth(dot(p - t, R)[None])[0])
    high = slack + error - deep if deep >= -slack else np.inf
    return Distance(bounds.lower, high, p, p).widened(body.error)


def _nearer(facets: Surface, rod: Rod, T: Array, p: Array) -> tuple[Array, Array]:
    """Points (3,) of the mesh and of a cylinder with flat ends, each nearest to the other, from ``p`` on."""
    R, t = T[:3, :3], T[:3, 3]
    for _ in range(_TURNS):
        q = dot(rod.closest(dot(p - t, R)[None])[0], R.T) + t
        foot = facets.nearest(q[None])[2][0]
        if norm(foot - q) >= norm(p - q) - 1e-13:
            break
        p = foot
    return p, q


def axis_gap(facets: Surface, rod: Rod, T: Array) -> float:
    """Lower bound (mm) of the gap between the mesh and a rod at ``T`` (4, 4); minus infinity if its axis is inside."""
    distance, low, _, _ = _to_axis(facets, rod, T)
    if distance <= 1e-9 or _holds(facets, to_target(T, rod.ends)):
        return -np.inf
    return low - rod.radius - _WIDTH - 1e-12 * (facets.scale + rod.length + float(np.abs(T[:3, 3]).max()))


def hull_gap(facets: Surface, around: Hull) -> float:
    """Lower bound (mm) of the gap between the mesh and a polyhedron in its frame; minus infinity if they meet."""
    import fcl

    other = Surface(around.vertices, around.faces)
    low = np.inf
    for tree, error in facets.groups:
        request, result = fcl.DistanceRequest(), fcl.DistanceResult()
        d = float(fcl.distance(fcl.CollisionObject(tree), fcl.CollisionObject(other.bvh), request, result))
        low = min(low, d - error) if d > 0.0 else -np.inf
    inside = _holds(facets, around.vertices) or (around.depth(facets.shell_points[:, 0]) > 0.0).any()
    return -np.inf if inside else low - 1e-12 * (facets.scale + other.scale)


def _axis_inside(facets: Surface, body: ClosedForm, T: Array, distance: float) -> Distance:
    """The axis passes through the material or lies in it: points of the body on a grid say how deep at least."""
    rod = next(piece for piece in body.outers if isinstance(piece, Rod))
    turn = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    ring = np.vstack([[0.0, 0.0], 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])]) * rod.radius
    z = np.linspace(-0.48, 0.48, 9) * rod.length
    local = np.column_stack([np.tile(ring, (len(z), 1)), np.repeat(z, len(ring))])
    own = to_target(rod.T, local)
    world = to_target(T, own)
    in_body = body.depth(own)
    in_mesh = facets.certain_depth(world)
    both = np.where((in_body >= 0.0) & (in_mesh >= 0.0), np.maximum(in_body, in_mesh), -np.inf)
    k = int(np.argmax(both))
    if both[k] == -np.inf:
        return Distance()
    error = max(uncertainty for _, uncertainty in facets.groups) + body.error
    return Distance(-np.inf, error - float(both[k]), world[k], world[k])


def _to_axis(facets: Surface, rod: Rod, T: Array) -> tuple[float, float, Array, Array]:
    """Distance of the facets from the rod's axis, a lower bound of it for the true part, and the nearest points."""
    import fcl

    axis = fcl.CollisionObject(_axis(rod), fcl.Transform(T[:3, :3], T[:3, 3]))
    best, low, where = np.inf, np.inf, (np.zeros(3), np.zeros(3))
    for tree, uncertainty in facets.groups:
        answer = fcl.DistanceResult()
        d = float(
            fcl.distance(fcl.CollisionObject(tree), axis, fcl.DistanceRequest(enable_nearest_points=True), answer)
        )
        low = min(low, max(d, 0.0) - uncertainty)
        if d < best:
            best = d
            where = tuple(np.asarray(x, dtype=np.float64) for x in answer.nearest_points)  # type: ignore[assignment]
    return best, low, *where
