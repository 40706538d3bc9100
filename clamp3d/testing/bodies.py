"""Bodies by their definition: functions of points, written from what the shapes are said to be."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import Capsule, Cylinder, SweptArc
from clamp3d.geometry.profile import Arc, Profile
from clamp3d.geometry.shapes import MeshShape, Solid, Sphere

Field = Callable[[Array], Array]
"""Of points (n, 3): <= 0 on the body, > 0 elsewhere, and nowhere steeper than 1. So a point with the value g > 0 is at
least g mm from the body, and one with g < 0 is the centre of a ball of radius -g mm in it."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A body by its definition: a `Field`, and the corners (2, 3) of a ``box`` around it, infinite if it has no end."""

    field: Field
    box: Array

    def at(self, T: Array) -> Body:
        """The body placed by ``T`` (4, 4)."""
        box = self.box
        if np.isfinite(box).all():
            middle, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
            centre, reach = T[:3, :3] @ middle + T[:3, 3], np.abs(T[:3, :3]) @ half
            box = np.array([centre - reach, centre + reach])
        return Body(lambda x: self.field((x - T[:3, 3]) @ T[:3, :3]), box)


AnyBody = Body | Solid | MeshShape | Cylinder | Capsule | SweptArc


def body(shape: AnyBody) -> Body:
    """The definition of a shape. Raises InputError for what is neither a shape nor a `Body`."""
    if isinstance(shape, Body):
        return shape
    if isinstance(shape, Solid):
        return Body(_solid(shape), shape.bounds)
    if isinstance(shape, Sphere):
        r = shape.radius
        return Body(lambda x: np.linalg.norm(x, axis=1) - r, np.outer([-r, r], np.ones(3)))
    if isinstance(shape, MeshShape):
        V = shape.mesh.vertices
        return Body(_mesh(V, shape.mesh.faces), np.array([V.min(axis=0), V.max(axis=0)]))
    if isinstance(shape, Cylinder):
        r, half = shape.radius, 0.5 * shape.length
        corner = np.array([r, r, half])
        return Body(
            lambda x: _prism(np.hypot(x[:, 0], x[:, 1]) - r, np.abs(x[:, 2]) - half), np.array([-corner, corner])
        )
    if isinstance(shape, Capsule):
        r, half = shape.radius, 0.5 * shape.length
        corner, axis = np.array([r, r, half + r]), np.array([0.0, 0.0, half])
        return Body(lambda x: np.linalg.norm(x - np.clip(x, -axis, axis), axis=1) - r, np.array([-corner, corner]))
    if isinstance(shape, SweptArc):
        far = np.full(3, math.inf)
        R, half_angle, H = shape.radius, shape.half_angle, 0.5 * shape.length
        s, h = R * math.sin(half_angle), -R * math.cos(half_angle)
        return Body(lambda x: groove_distance(x[:, 0], x[:, 1], x[:, 2], R, s, h, H), np.array([-far, far]))
    raise InputError(
        f"shape must be a Solid, MeshShape, Cylinder, Capsule, SweptArc or Body, got {type(shape).__name__}"
    )


def _prism(across: Array, along: Array) -> Array:
    """From the distances across and along the axis of what is drawn along it."""
    outside = np.sqrt(np.maximum(across, 0) ** 2 + np.maximum(along, 0) ** 2)
    return np.asarray(outside + np.minimum(np.maximum(across, along), 0))


def _outline(profile: Profile) -> Callable[[Array], Array]:
    """Signed distance of points (n, 2) from an outline, from the definition of its segments and arcs."""

    def distance(x: Array) -> Array:
        least, turn = np.full(len(x), math.inf), np.zeros(len(x))
        for edge in profile.edges:
            (au, av), (bu, bv), chord = (x - edge.start).T, (x - edge.end).T, np.subtract(edge.end, edge.start)
            is_whole = isinstance(edge, Arc) and abs(edge.sweep) >= 2.0 * math.pi - 1e-9
            beside = chord[0] * av - chord[1] * au + 0.0  # of a point on the chord no -0.0, which would turn it back
            if not is_whole:
                turn += np.arctan2(beside, au * bu + av * bv)
            if isinstance(edge, Arc):
                u, v = (x - edge.centre).T
                off = np.arctan2(v, u) - 0.5 * (edge.start_angle + edge.end_angle)
                is_beside = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi) <= 0.5 * abs(edge.sweep)
                rho, ends = np.hypot(u, v), np.minimum(np.hypot(au, av), np.hypot(bu, bv))
                near = np.where(is_beside, np.abs(rho - edge.radius), ends)
                # Between an arc and its chord the arc turns once more round the point than the chord does.
                sign = math.copysign(1.0, edge.sweep)
                is_between = is_whole | (sign * beside < 0.0)
                turn += 2.0 * math.pi * sign * ((rho < edge.radius) & is_between)
            else:
                s = np.clip((au * chord[0] + av * chord[1]) / (chord @ chord), 0.0, 1.0)
                near = np.hypot(au - s * chord[0], av - s * chord[1])
            least = np.minimum(least, near)
        return np.where(np.abs(turn) > math.pi, -least, least)

    return distance


def _solid(solid: Solid) -> Field:
    """The bodies less the holes; those along a body's axis are cut out of its outline: that keeps distances exact."""
    holes = [(hole, _outline(hole.profile)) for hole in solid.holes]
    bodies = [(extrusion, _outline(extrusion.profile)) for extrusion in solid.bodies]

    def field(x: Array) -> Array:
        least = np.full(len(x), math.inf)
        for extrusion, outline in bodies:
            local = x @ extrusion.frame
            along = np.maximum(extrusion.start - local[:, 2], local[:, 2] - extrusion.end)
            own = [-circle(local[:, :2]) for hole, circle in holes if hole.axis == extrusion.axis]
            value = _prism(np.max([outline(local[:, :2]), *own], axis=0), along)
            crossing = [-circle((x @ hole.frame)[:, :2]) for hole, circle in holes if hole.axis != extrusion.axis]
            least = np.minimum(least, np.max([value, *crossing], axis=0))
        return least

    return field


def groove_distance(x: Any, y: Any, z: Any, R: Any, sx: Any, h: Any, H: Any) -> NDArray[Any]:
    """Signed distance of points from grooves with lips at (+-sx, h) and ends at +-H, in the numbers that are given."""
    x = np.abs(x)
    # Squares neither overflow nor vanish in the exponents of a long double.
    rho = np.sqrt(x * x + y * y)
    lip = np.sqrt((x - sx) ** 2 + (y - h) ** 2)
    arc = np.where(x * -h + y * sx <= 0, np.abs(R - rho), lip)
    ray = np.where(x >= sx, np.abs(y - h), lip)
    inside = (y <= h) & (rho >= R)
    return _prism(np.where(inside, -1.0, 1.0) * np.minimum(arc, ray), np.abs(z) - H)


def _mesh(vertices: Array, faces: NDArray[np.int64]) -> Field:
    """Distance from the triangles, negative where they wind round the point."""
    import igl

    kind = igl.SIGNED_DISTANCE_TYPE_WINDING_NUMBER
    return lambda x: np.asarray(igl.signed_distance(x, vertices, faces, sign_type=kind)[0])
