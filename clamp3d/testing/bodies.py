"""Bodies by their definition: functions of points, written from what the shapes are said to be."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.core.extrusion import Extrusion
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc
from clamp3d.core.profile import Arc, Profile
from clamp3d.core.shapes import MeshShape, Solid
from clamp3d.errors import InputError

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
        corner = np.array([r, r, half + r])
        return Body(
            lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]), np.maximum(np.abs(x[:, 2]) - half, 0.0)) - r,
            np.array([-corner, corner]),
        )
    if isinstance(shape, SweptArc):
        far = np.full(3, math.inf)
        return Body(_groove(shape), np.array([-far, far]))
    raise InputError(
        f"shape must be a Solid, MeshShape, Cylinder, Capsule, SweptArc or Body, got {type(shape).__name__}"
    )


def convex_body(vertices: ArrayLike) -> Body:
    """The convex hull of points (n, 3), mm."""
    from scipy.spatial import ConvexHull

    V = np.asarray(vertices, dtype=np.float64)
    planes = ConvexHull(V).equations
    return Body(lambda x: (x @ planes[:, :3].T + planes[:, 3]).max(axis=1), np.array([V.min(axis=0), V.max(axis=0)]))


def _prism(across: Array, along: Array) -> Array:
    """From the distances across and along the axis of what is drawn along it."""
    return np.asarray(np.hypot(np.maximum(across, 0), np.maximum(along, 0)) + np.minimum(np.maximum(across, along), 0))


def _outline(profile: Profile) -> Callable[[Array], Array]:
    """Signed distance of points (n, 2) from an outline, from the definition of its segments and arcs."""

    arcs = [edge for edge in profile.edges if isinstance(edge, Arc)]
    edges = [edge for edge in profile.edges if not isinstance(edge, Arc)] + arcs
    k = len(edges) - len(arcs)
    # All edges at once: columns (edges, 1) of their numbers against rows of points.
    su, sv, eu, ev = (np.array([(*edge.start, *edge.end) for edge in edges]).T)[..., None]
    lu, lv = eu - su, ev - sv
    square = (lu * lu + lv * lv)[:k]
    numbers = [(*arc.centre, arc.radius, 0.5 * (arc.start_angle + arc.end_angle), arc.sweep) for arc in arcs]
    mu, mv, radius, middle, sweep = np.array(numbers).reshape(-1, 5).T[..., None]
    sign, whole = np.sign(sweep), np.abs(sweep) >= 2.0 * math.pi - 1e-9
    closed = np.concatenate([np.zeros((k, 1), bool), whole])

    def distance(x: Array) -> Array:
        u, v = x.T
        au, av, bu, bv = u - su, v - sv, u - eu, v - ev
        turn = np.where(closed, 0.0, np.arctan2(au * bv - av * bu, au * bu + av * bv)).sum(axis=0) / (2.0 * math.pi)
        least = np.full(len(x), np.inf)
        if k:
            s = np.clip((au[:k] * lu[:k] + av[:k] * lv[:k]) / square, 0.0, 1.0)
            least = np.hypot(au[:k] - s * lu[:k], av[:k] - s * lv[:k]).min(axis=0)
        if arcs:
            rho, off = np.hypot(u - mu, v - mv), np.arctan2(v - mv, u - mu) - middle
            on = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi) <= 0.5 * np.abs(sweep)
            ends = np.minimum(np.hypot(au[k:], av[k:]), np.hypot(bu[k:], bv[k:]))
            least = np.minimum(least, np.where(on, np.abs(rho - radius), ends).min(axis=0))
            # Between an arc and its chord the arc turns once more round the point than the chord does.
            side = (lu[k:] * av[k:] - lv[k:] * au[k:]) * sign
            turn += (sign * ((rho < radius) & ((side < 0.0) | whole))).sum(axis=0)
        return np.asarray(np.where(np.round(turn) != 0, -least, least))

    return distance


def _solid(solid: Solid) -> Field:
    """The bodies less the holes; those along a body's axis are cut out of its outline: that keeps distances exact."""
    holes = [(hole, _outline(hole.profile)) for hole in solid.holes]

    def one(extrusion: Extrusion) -> Field:
        outline, frame = _outline(extrusion.profile), extrusion.frame
        middle, half = 0.5 * (extrusion.start + extrusion.end), 0.5 * (extrusion.end - extrusion.start)

        def field(x: Array) -> Array:
            local = x @ frame
            across = outline(local[:, :2])
            for hole, circle in holes:
                if hole.axis == extrusion.axis:
                    across = np.maximum(across, -circle(local[:, :2]))
            return _prism(across, np.abs(local[:, 2] - middle) - half)

        return field

    fields = [one(extrusion) for extrusion in solid.bodies]
    crossing = [(hole, f) for hole, f in holes if any(hole.axis != extrusion.axis for extrusion in solid.bodies)]

    def field(x: Array) -> Array:
        value = np.min([f(x) for f in fields], axis=0)
        for hole, circle in crossing:
            value = np.maximum(value, -circle((x @ hole.frame)[:, :2]))
        return np.asarray(value)

    return field


def _groove(groove: SweptArc) -> Field:
    R, s, h = groove.radius, groove.radius * math.sin(groove.half_angle), -groove.radius * math.cos(groove.half_angle)

    def field(x: Array) -> Array:
        u, v = np.abs(x[:, 0]), x[:, 1]
        rho, lip = np.hypot(u, v), np.hypot(u - s, v - h)
        edge = np.minimum(
            np.where(np.arctan2(u, -v) <= groove.half_angle, np.abs(rho - R), lip), np.where(u >= s, np.abs(v - h), lip)
        )
        return _prism(np.where((v <= h) & (rho >= R), -edge, edge), np.abs(x[:, 2]) - 0.5 * groove.length)

    return field


def _mesh(vertices: Array, faces: NDArray[np.int64]) -> Field:
    """Distance from the triangles, negative where they wind round the point."""
    import igl

    kind = igl.SIGNED_DISTANCE_TYPE_WINDING_NUMBER
    return lambda x: np.asarray(igl.signed_distance(x, vertices, faces, sign_type=kind)[0])
