"""An exact cylinder against the facets of a mesh: the distance of its axis from the triangles, less its radius.

The axis enters FCL as a triangle of no width, whose distance from other triangles is exact to rounding.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.closed_form import ClosedForm
from clamp3d.engine.convex import Rod
from clamp3d.engine.surface import Surface, fcl_tree
from clamp3d.geometry.pose import Array

_WIDTH = 1e-9
"""Width (mm) of the triangle that stands for an axis."""
_SQUARE = 1e-7
"""Sine of the angle up to which the nearest points count as square to the axis."""


def rods_distance(mesh: Surface, bodies: tuple[ClosedForm, ...], T: Array) -> Distance:
    """Distance of bodies that a cylinder holds each, at ``T`` (4, 4) in the mesh's frame."""
    nearest = Distance(np.inf, np.inf)
    for body in bodies:
        nearest = nearest.union(_rod_distance(mesh, body, T))
    return nearest


def rod_of(body: ClosedForm) -> Rod | None:
    """The cylinder that holds a body; None if none does."""
    return next((piece for piece in body.outers if isinstance(piece, Rod)), None)


def _rod_distance(mesh: Surface, body: ClosedForm, T: Array) -> Distance:
    rod = rod_of(body)
    assert rod is not None
    R, t = T[:3, :3], T[:3, 3]
    axis_gap, lower, p, on_axis = _to_axis(mesh, rod, T)
    slack = 1e-12 * (mesh.scale + float(np.abs(t).max()) + rod.length) + _WIDTH
    ends = rod.ends @ R.T + t
    if axis_gap <= slack or mesh.contains(ends[:1]).any():
        return Distance()  # the axis meets the part: the meshes say how deep
    lower -= rod.radius + slack
    n = (p - on_axis) / axis_gap
    q = on_axis + rod.radius * n
    off = mesh.error if lower + rod.radius < axis_gap else 0.0
    if axis_gap < rod.radius:
        deep = float(body.depth(((p - t) @ R)[None])[0])
        upper = slack + off - deep if deep >= -slack else np.inf
        return Distance(lower, max(lower, upper), p, p).widened(body.error)
    # Square to the axis the nearest point is on the side, which flat ends share with round ones.
    on_side = abs(float(n @ R @ rod.T[:3, 2])) < _SQUARE and body.depth(((q - t) @ R)[None])[0] >= -slack
    upper = axis_gap - rod.radius + off + slack if on_side else np.inf
    return Distance(lower, upper, p if on_side else None, q if on_side else None).widened(body.error)


def _to_axis(mesh: Surface, rod: Rod, T: Array) -> tuple[float, float, Array, Array]:
    """Distance of the facets from the rod's axis, a lower bound of it for the true part, and the nearest points."""
    import fcl

    axis = fcl.CollisionObject(_axis(rod), fcl.Transform(T[:3, :3], T[:3, 3]))
    best, lower, points = np.inf, np.inf, (np.zeros(3), np.zeros(3))
    for tree, error in mesh.groups:
        answer = fcl.DistanceResult()
        request = fcl.DistanceRequest(enable_nearest_points=True)
        d = float(fcl.distance(fcl.CollisionObject(tree), axis, request, answer))
        lower = min(lower, max(d, 0.0) - error)
        if d < best:
            p, q = answer.nearest_points
            best, points = d, (np.array(p, dtype=np.float64), np.array(q, dtype=np.float64))
    return best, lower, *points


@lru_cache(maxsize=1024)
def _axis(rod: Rod) -> Any:
    """FCL's tree of the axis."""
    corners = np.vstack([rod.ends, rod.ends[1:] + _WIDTH * rod.T[:3, 0]])
    return fcl_tree(corners, np.array([[0, 1, 2]]))
