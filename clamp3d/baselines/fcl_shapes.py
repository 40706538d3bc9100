"""FCL used with care: shapes, poses, and one `measure` of a solid against a cylinder in this package's convention.

What python-fcl 0.7.0 does, measured on wedges of a groove of radius 12 against a wire of radius 10.5:

- Its tolerances are absolute (1e-6 in whatever unit). In millimetres most distances are right to 4e-7, but one in a
  thousand is off by 5e-5 and the worst of 40 000 by 2e-3, always too far; in metres the worst is off by 0.13 mm. So
  lengths go to FCL in units of 2^-14 mm (a power of two rounds nothing), which takes as long and leaves 2e-12 mm as
  the median and 1.5e-6 as the worst of 600 000 near contact, and up to 4e-6 of the distance apart (1.8e-5 at 5 mm).
- Signed distance (EPA) ends the interpreter on 1 to 3 % of the poses where a parallel wire just touches a face, and
  can run without end beside them. It is not asked for. Where two shapes overlap, a cylinder thinner and shorter by
  ``c`` all round is measured instead, 40 % and then 90 % of the radius: if that is apart by d and the nearest point is
  on its side or end, the depth is c - d exactly, for a cylinder's support in such a direction is its core's and c more.
  At a rim the depth is understated, as of a cylinder whose rims are rounded by c (1e-12 mm at least).
  Deeper than that it is only known to be at least c.
- The normal from two witness points is worthless where they nearly meet. It is taken from the cylinder's own surface.
- NaN, scaled poses, empty meshes and open "convex" shapes pass without a word or end the interpreter: none gets there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import fcl
import numpy as np
import trimesh
from numpy.typing import ArrayLike

from clamp3d.engine.surface import fcl_tree
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.primitives import Cylinder
from clamp3d.geometry.shells import winding_numbers

UNIT = 16384.0
"""FCL units per mm. See the module."""

MIN_SIZE, MAX_SIZE = 0.1, 1e4
"""Extents in mm between which the accuracy stated above was measured; others are refused."""

_EROSIONS = (0.4, 0.9)  # of the radius or half length: a thick core for small depths, a thin one for most others
_SHALLOWEST = 1e-12  # mm: what overlaps by a rim alone is this deep at least
_RIM = 1e-6  # of the cylinder's size: a witness point this near the rim lies on it
_WITNESS = 1e-3  # mm apart from which the witness points give a direction at a rim


@dataclass(frozen=True, slots=True)
class Measurement:
    """Signed distance in mm (positive apart) of solid a and cylinder b; b's point is ``point + distance * normal``.

    Point (3,) of a in mm and the unit normal from a to b (3,), both in the frame of a.
    """

    distance: float
    point: Array
    normal: Array


@dataclass(frozen=True, slots=True)
class Shape:
    """A solid at the origin of its own frame, ready for FCL; mm.

    ``is_mesh``: a closed mesh, which is but a surface for FCL; else a convex solid, or a surface that has no inside.
    """

    is_mesh: bool
    solid: trimesh.Trimesh
    collision_object: Any


def convex(points: ArrayLike, name: str = "convex shape") -> Shape:
    """The convex hull of points (n, 3) as `fcl.Convex`."""
    hull = trimesh.convex.convex_hull(np.asarray(points))
    faces = np.insert(hull.faces, 0, 3, axis=1).ravel()
    return _shape(False, hull, fcl.Convex(hull.vertices * UNIT, len(hull.faces), faces), name)


def bvh(mesh: trimesh.Trimesh, name: str = "mesh") -> Shape:
    """A closed triangle mesh (`fcl.BVHModel`)."""
    return _shape(True, mesh, fcl_tree(mesh.vertices * UNIT, mesh.faces), name)


def facets(mesh: Shape) -> list[Shape]:
    """Each flat face of a mesh as an open surface of its own: it has no inside, and nothing is contained in it."""
    flat = list(mesh.solid.facets)
    alone = np.setdiff1d(np.arange(len(mesh.solid.faces)), np.concatenate([*flat, np.empty(0, dtype=np.int64)]))
    parts = mesh.solid.submesh([*flat, *alone[:, None]], repair=False)
    assert isinstance(parts, list)  # as one mesh only with append=True
    return [Shape(False, part, _placed(fcl_tree(part.vertices * UNIT, part.faces))) for part in parts]


class Wire:
    """A cylinder to be placed and measured again and again (`fcl.Cylinder`); axis on z, centred.

    ``cores`` are the same cylinder, each ``erosion`` mm smaller all round; a core has none.
    """

    def __init__(self, cylinder: Cylinder, erosion: float = 0.0) -> None:
        self.cylinder = Cylinder(cylinder.radius - erosion, cylinder.length - 2.0 * erosion)
        self.erosion = erosion
        self.cores: tuple[Wire, ...] = ()
        if not erosion:
            _check_size("cylinder radius", cylinder.radius)
            _check_size("cylinder length", cylinder.length)
            thick = min(cylinder.radius, cylinder.length / 2)
            self.cores = tuple(Wire(cylinder, share * thick) for share in _EROSIONS)
        cylinder = self.cylinder
        self.T = np.eye(4)
        shape = fcl.Cylinder(cylinder.radius * UNIT, cylinder.length * UNIT)
        self.collision_object = _placed(shape)

    def place(self, T_a_wire: Array) -> None:
        """Put the wire at a pose (4, 4) that has passed `check_pose` or `check_pose_array`."""
        self.T = T_a_wire
        self.collision_object.setTransform(transform(T_a_wire))


def transform(T: Array) -> Any:
    """`fcl.Transform` (float64) of a checked pose (4, 4) in mm."""
    return fcl.Transform(T[:3, :3], T[:3, 3] * UNIT)


def distance(shape: Shape, wire: Wire) -> float:
    """Signed distance in mm as of `measure`, and faster where the two are apart."""
    if not shape.is_mesh:
        result = fcl.DistanceResult()
        fcl.distance(shape.collision_object, wire.collision_object, fcl.DistanceRequest(), result)
        if result.min_distance > 0.0:
            return float(result.min_distance) / UNIT
    return measure(shape, wire).distance


def measure(shape: Shape, wire: Wire) -> Measurement:
    """Distance, point and normal of a shape and a wire that was placed in the shape's frame.

    Exact (see the module) apart, and overlapping up to 0.9 of the wire's radius. A mesh has no inside for FCL: a wire
    (or its core) inside the wall without crossing the surface is contained, and the depth is its way out through the
    nearest place. The normal of a contact on a rim closer than 1e-3 mm is that of the round side.
    """
    for each in (wire, *wire.cores):
        each.place(wire.T)
        nearest = _nearest(shape, each)
        d = nearest.distance - each.erosion
        if nearest.distance <= 0.0:
            continue
        if contained(shape, each):
            return Measurement(-d - 2.0 * wire.cylinder.radius, nearest.point, -nearest.normal)
        return Measurement(min(d, -_SHALLOWEST) if each.erosion else d, nearest.point, nearest.normal)
    return Measurement(-wire.cores[-1].erosion, nearest.point, nearest.normal)


def contained(shape: Shape, wire: Wire) -> bool:
    """Whether a wire that does not cross a mesh's surface lies inside it (its middle does)."""
    if not shape.is_mesh or wire.cylinder.length > shape.solid.scale:
        return False
    middle = wire.T[:3, 3]
    return bool(winding_numbers(shape.solid.vertices, shape.solid.faces, middle[None])[0] > 0.5)


def _nearest(shape: Shape, wire: Wire) -> Measurement:
    """What FCL says without a sign: the distance, or one that is not positive where the two overlap."""
    result = fcl.DistanceResult()
    fcl.distance(shape.collision_object, wire.collision_object, fcl.DistanceRequest(True), result)
    d = float(result.min_distance) / UNIT
    on_a, on_b = (np.asarray(point) / UNIT for point in result.nearest_points)
    normal = _normal(d, on_a, on_b, wire) if d > 0.0 else wire.T[:3, 0]
    return Measurement(d, on_b - d * normal, normal)


def _normal(d: float, on_a: Array, on_b: Array, wire: Wire) -> Array:
    """Unit normal from a to b. On the cylinder's side and ends it is the surface's own, turned inward."""
    height = float((on_b - wire.T[:3, 3]) @ wire.T[:3, 2])
    across = on_b - wire.T[:3, 3] - height * wire.T[:3, 2]
    radius = float(np.linalg.norm(across))
    on_side = radius >= wire.cylinder.radius * (1.0 - _RIM)
    on_end = abs(height) >= 0.5 * wire.cylinder.length * (1.0 - _RIM)
    if on_end and not on_side:
        return np.asarray(-np.copysign(1.0, height) * wire.T[:3, 2])
    if on_side and not (on_end and d > _WITNESS):
        return np.asarray(-across / radius)
    between = on_b - on_a
    return np.asarray(between / np.linalg.norm(between))


def _shape(is_mesh: bool, solid: trimesh.Trimesh, geometry: Any, name: str) -> Shape:
    _check_size(f"{name}: largest extent", float(solid.extents.max()))
    return Shape(is_mesh, solid, _placed(geometry))


def _placed(geometry: Any) -> Any:
    return fcl.CollisionObject(geometry, transform(np.eye(4)))


def _check_size(name: str, size: float) -> None:
    if not MIN_SIZE <= size <= MAX_SIZE:
        raise InputError(
            f"{name} must be from {MIN_SIZE:g} to {MAX_SIZE:g} mm for FCL, whose tolerances are absolute, got {size:g}"
        )
