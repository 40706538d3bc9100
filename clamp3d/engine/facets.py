"""An exact cylinder or ball against the facets of a mesh: the distance of its axis from the triangles, less its radius.

The axis, of a ball its centre, enters FCL as a triangle of no width, whose distance from other triangles is exact to
rounding.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, reduce

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.closed_form import ClosedForm
from clamp3d.engine.convex import Ball, Rod
from clamp3d.engine.mesh_distance import nearest_points
from clamp3d.engine.surface import Surface
from clamp3d.geometry.pose import Array, norm, to_source, to_target

_WIDTH = 1e-9
"""Width (mm) of the triangle that stands for an axis."""
_SQUARE = 1e-7
"""Sine of the angle up to which the nearest points count as square to the axis."""


def rods_distance(mesh: Surface, bodies: tuple[ClosedForm, ...], T: Array) -> Distance:
    """Distance of bodies that a cylinder or ball holds each, at ``T`` (4, 4) in the mesh's frame."""
    distance = reduce(Distance.union, (_rod_distance(mesh, body, T) for body in bodies))
    return replace(distance, method="cylinder on facets (FCL)")


def rod_of(body: ClosedForm) -> Rod | Ball | None:
    """The cylinder or ball that holds a body; None if none does."""
    return next((piece for piece in body.outers if isinstance(piece, (Rod, Ball))), None)


def _rod_distance(mesh: Surface, body: ClosedForm, T: Array) -> Distance:
    rod = rod_of(body)
    assert rod is not None
    lower, axis_gap, p, on_axis = nearest_points(mesh, _axis(rod), T)
    slack = 1e-12 * (mesh.scale + float(np.abs(T[:3, 3]).max()) + norm(rod.ends[1] - rod.ends[0])) + _WIDTH
    if axis_gap <= slack or mesh.contains(to_target(T, rod.ends[:1])).any():
        return Distance()  # the axis meets the part: the meshes say how deep
    lower -= rod.radius + slack
    off = slack + (mesh.error if lower + rod.radius < axis_gap else 0.0)
    if axis_gap < rod.radius:
        depth = float(body.depth(to_source(T, p)[None])[0])
        upper = off - depth if depth >= -slack else np.inf
        return Distance(lower, max(lower, upper), p, p).widened(body.error)
    n = (p - on_axis) / axis_gap
    q = on_axis + rod.radius * n
    # Square to the axis the nearest point is on the side, which flat ends share with round ones.
    is_on_side = isinstance(rod, Ball) or abs(float(n @ T[:3, :3] @ rod.T[:3, 2])) < _SQUARE
    if is_on_side and body.depth(to_source(T, q)[None])[0] >= -slack:
        return Distance(lower, axis_gap - rod.radius + off, p, q).widened(body.error)
    return Distance(lower).widened(body.error)


@lru_cache(maxsize=1024)
def _axis(rod: Rod | Ball) -> Surface:
    """The axis as a triangle of no width."""
    return Surface(np.vstack([rod.ends, rod.ends[1:] + _WIDTH * rod.T[:3, 0]]), np.array([[0, 1, 2]]))
