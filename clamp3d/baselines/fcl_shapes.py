"""FCL used with care: shapes, poses, and one `measure` of a solid against a cylinder in this package's convention.

What python-fcl 0.7.0 does, measured on wedges of a groove of radius 12 against a wire of radius 10.5:

- Its tolerances are absolute (1e-6 in whatever unit). In millimetres most distances are right to 4e-7, but one in a
  thousand is off by 5e-5 and the worst of 40 000 by 2e-3, always too far; in metres the worst is off by 0.13 mm. So
  lengths go to FCL in units of 2^-14 mm (a power of two rounds nothing), which takes as long and leaves 2e-12 mm as
  the median and 1.5e-6 as the worst of 600 000 near contact, and up to 4e-6 of the distance apart (1.8e-5 at 5 mm).
- Signed distance (EPA) ends the interpreter on 1 to 3 % of the poses where a parallel wire just touches a face, and
  can run without end beside them. It is not asked for. Where two shapes overlap, a cylinder thinner and shorter by
  ``c`` all round is measured instead: if that is apart by d and the nearest point is on its side or end, the depth is
  c - d exactly, for a cylinder's support in such a direction is its core's and c more. Only at a rim, or deeper than
  40 % of the radius, FCL's contact depth is taken, which is never less than the true one but up to 4 times as much.
- For a mesh the signed distance is the depth of *some* triangle that is crossed; the deepest is taken here.
- The normal from two witness points is worthless where they nearly meet. It is taken from the cylinder's own surface.
- NaN, scaled poses, empty meshes and open "convex" shapes pass without a word or end the interpreter: refused here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import fcl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.core.mesh import Mesh, closed_mesh
from clamp3d.core.pose import Array
from clamp3d.core.primitives import Cylinder
from clamp3d.core.shells import corners_of, winding_number
from clamp3d.errors import InputError

UNIT = 16384.0
"""FCL units per mm. See the module."""

MIN_SIZE, MAX_SIZE = 0.1, 1e4
"""Extents in mm between which the accuracy stated above was measured; others are refused."""

_EROSION = 0.4  # of the radius or half length
_RIM = 1e-6  # of the cylinder's size: a witness point this near the rim lies on it
_WITNESS = 1e-3  # mm apart from which the witness points give a direction at a rim
_CONVEX = 1e-9  # of the size


Kind = Literal["convex", "mesh", "surface"]


@dataclass(frozen=True, slots=True)
class Measurement:
    """Signed distance in mm (positive apart) of solid a and cylinder b; ``point_b = point_a + distance * normal``.

    Points (3,) in mm and the unit normal from a to b (3,), all in the frame of a. ``face`` is the triangle of a mesh
    that is nearest (deepest), -1 for a convex shape.
    """

    distance: float
    point_a: Array
    point_b: Array
    normal: Array
    face: int = -1


@dataclass(frozen=True, slots=True)
class Shape:
    """A solid at the origin of its own frame, ready for FCL; ``bounds`` (2, 3) in mm. A surface need not be closed."""

    kind: Kind
    solid: Mesh
    bounds: Array
    collision_object: Any


def convex(vertices: ArrayLike, faces: ArrayLike, name: str = "convex shape") -> Shape:
    """A convex polytope (`fcl.Convex`) from its triangles; InputError if it is open, inside out or not convex."""
    solid = _solid(vertices, faces, name)
    V, F = solid.vertices, solid.faces
    corners = V[F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    real = length > 0.0
    height = ((V @ normals[real].T) - np.einsum("ij,ij->i", corners[real, 0], normals[real])) / length[real]
    if height.max() > _CONVEX * np.ptp(V, axis=0).max():
        raise InputError(f"{name} must be convex: a vertex stands {height.max():.3g} mm outside one of its faces")
    return _shape("convex", solid, fcl.Convex(V * UNIT, len(F), encoded(F)))


def encoded(faces: NDArray[Any]) -> NDArray[Any]:
    """Triangles (m, 3) as `fcl.Convex` takes them: each with its number of corners before it."""
    return np.insert(faces, 0, 3, axis=1).ravel()


def bvh(vertices: ArrayLike, faces: ArrayLike, name: str = "mesh") -> Shape:
    """A closed triangle mesh (`fcl.BVHModel`); InputError if it is empty, open or inside out."""
    return _tree("mesh", _solid(vertices, faces, name))


def tree(vertices: NDArray[Any], faces: NDArray[Any]) -> Any:
    """A triangle mesh as `fcl.BVHModel`, as it is."""
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return model


def facets(mesh: Shape) -> list[Shape]:
    """Each flat face of a mesh as an open surface of its own: it has no inside, and nothing is contained in it."""
    import trimesh

    V, F = mesh.solid.vertices, mesh.solid.faces
    flat = [np.asarray(group, dtype=np.int64) for group in trimesh.Trimesh(V, F, process=False).facets]
    alone = np.setdiff1d(np.arange(len(F)), np.concatenate([*flat, np.empty(0, dtype=np.int64)]))
    out = []
    for group in (*flat, *alone[:, None]):
        used, index = np.unique(F[group], return_inverse=True)
        out.append(_tree("surface", Mesh("facet", V[used], index.reshape(-1, 3), False)))
    return out


class Wire:
    """A cylinder to be placed and measured again and again (`fcl.Cylinder`); axis on z, centred.

    ``core`` is the same cylinder ``erosion`` mm smaller all round, None if this is a core.
    """

    def __init__(self, cylinder: Cylinder, *, is_core: bool = False) -> None:
        self.erosion = 0.0
        self.core: Wire | None = None
        if not is_core:
            _check_size("cylinder radius", cylinder.radius)
            _check_size("cylinder length", cylinder.length)
            self.erosion = e = _EROSION * min(cylinder.radius, cylinder.length / 2)
            self.core = Wire(Cylinder(cylinder.radius - e, cylinder.length - 2.0 * e), is_core=True)
        self.cylinder = cylinder
        self.T = np.eye(4)
        shape = fcl.Cylinder(cylinder.radius * UNIT, cylinder.length * UNIT)
        self.collision_object = fcl.CollisionObject(shape, transform(self.T))

    def place(self, T_a_wire: Array) -> None:
        """Put the wire at a pose (4, 4) that has passed `check_pose` or `check_pose_array`."""
        self.T = T_a_wire
        self.collision_object.setTransform(transform(T_a_wire))


def transform(T: Array) -> Any:
    """`fcl.Transform` (float64) of a checked pose (4, 4) in mm."""
    return fcl.Transform(T[:3, :3], T[:3, 3] * UNIT)


def distance(shape: Shape, wire: Wire) -> float:
    """Signed distance in mm as of `measure`, and faster where the two are apart."""
    if shape.kind != "mesh":
        result = fcl.DistanceResult()
        fcl.distance(shape.collision_object, wire.collision_object, fcl.DistanceRequest(), result)
        if result.min_distance > 0.0:
            return float(result.min_distance) / UNIT
    return measure(shape, wire).distance


def measure(shape: Shape, wire: Wire) -> Measurement:
    """Distance, witness points and normal of a shape and a wire that was placed in the shape's frame.

    Exact (see the module) apart, and overlapping up to 0.4 of the wire's radius; beyond, and where a rim dips in, the
    depth is an upper bound. A mesh has no inside for FCL: a wire (or its core) inside the wall without crossing the
    surface is contained, and the depth is its way out through the nearest place. The normal of a contact on a rim
    closer than 1e-3 mm is that of the round side.
    """
    found = _nearest(shape, wire)
    d = found.distance
    if d > 0.0:
        return _inside_out(found, d + 2.0 * wire.cylinder.radius) if contained(shape, wire) else found
    core = wire.core
    assert core is not None
    core.place(wire.T)
    inner = _nearest(shape, core)
    if inner.distance <= 0.0:
        return _deepest(shape, wire)
    d = inner.distance - wire.erosion
    if contained(shape, core):
        return _inside_out(inner, d + 2.0 * wire.cylinder.radius)
    if _rim(inner.point_b, core):
        return _deepest(shape, wire)
    n = inner.normal
    return Measurement(d, inner.point_a, inner.point_a + d * n, n, inner.face)


def contained(shape: Shape, wire: Wire) -> bool:
    """Whether a wire that does not cross a mesh's surface lies inside it (its middle has winding number 1)."""
    if shape.kind != "mesh" or wire.cylinder.length > np.linalg.norm(shape.bounds[1] - shape.bounds[0]):
        return False
    middle = wire.T[:3, 3]
    if (middle < shape.bounds[0]).any() or (middle > shape.bounds[1]).any():
        return False
    return winding_number(corners_of(shape.solid.vertices, shape.solid.faces), middle) > 0.5


def _nearest(shape: Shape, wire: Wire) -> Measurement:
    """What FCL says without a sign: the distance, or one that is not positive where the two overlap."""
    result = fcl.DistanceResult()
    fcl.distance(shape.collision_object, wire.collision_object, fcl.DistanceRequest(True), result)
    d = float(result.min_distance) / UNIT
    on_a, on_b = (np.asarray(point) / UNIT for point in result.nearest_points)
    face = -1 if shape.kind == "convex" else int(result.b1)
    if d <= 0.0:
        return Measurement(d, on_a, on_b, wire.T[:3, 0], face)
    normal = _normal(d, on_a, on_b, wire)
    return Measurement(d, on_b - d * normal, on_b, normal, face)


def _deepest(shape: Shape, wire: Wire) -> Measurement:
    """The deepest of FCL's contacts: one for a convex shape, one for each triangle crossed for a mesh."""
    request = fcl.CollisionRequest(num_max_contacts=len(shape.solid.faces), enable_contact=True)
    result = fcl.CollisionResult()
    fcl.collide(shape.collision_object, wire.collision_object, request, result)
    if not result.contacts:  # distance() and collide() disagree only where the two touch
        found = _nearest(shape, wire)
        return Measurement(0.0, found.point_a, found.point_a, found.normal, found.face)
    contact = max(result.contacts, key=lambda c: c.penetration_depth)
    depth = abs(float(contact.penetration_depth)) / UNIT
    normal = np.asarray(contact.normal, dtype=np.float64)
    middle = np.asarray(contact.pos) / UNIT
    face = -1 if shape.kind == "convex" else int(contact.b1)
    return Measurement(-depth, middle + 0.5 * depth * normal, middle - 0.5 * depth * normal, normal, face)


def _inside_out(found: Measurement, depth: float) -> Measurement:
    """The way out of a contained wire through the nearest place of the surface."""
    normal = -found.normal
    return Measurement(-depth, found.point_a, found.point_a - depth * normal, normal, found.face)


def _normal(d: float, on_a: Array, on_b: Array, wire: Wire) -> Array:
    """Unit normal from a to b. On the cylinder's side and ends it is the surface's own, turned inward."""
    across, height = _from_axis(on_b, wire)
    radius = np.linalg.norm(across)
    on_side, on_end = _places(radius, height, wire)
    if on_end and not on_side:
        return np.asarray(-np.copysign(1.0, height) * wire.T[:3, 2])
    if on_side and not (on_end and d > _WITNESS):
        return np.asarray(-across / radius)
    between = on_b - on_a
    return np.asarray(between / np.linalg.norm(between))


def _rim(point: Array, wire: Wire) -> bool:
    """Whether a point of the cylinder lies on the edge of an end."""
    across, height = _from_axis(point, wire)
    return all(_places(np.linalg.norm(across), height, wire))


def _places(radius: float, height: float, wire: Wire) -> tuple[bool, bool]:
    """Whether a point of the cylinder lies on its side, and on an end."""
    on_side = radius >= wire.cylinder.radius * (1.0 - _RIM)
    return on_side, abs(height) >= 0.5 * wire.cylinder.length * (1.0 - _RIM)


def _from_axis(point: Array, wire: Wire) -> tuple[Array, float]:
    """Vector from the cylinder's axis to a point, and the point's height along the axis."""
    axis = wire.T[:3, 2]
    from_middle = point - wire.T[:3, 3]
    height = float(from_middle @ axis)
    return from_middle - height * axis, height


def _shape(kind: Kind, solid: Mesh, geometry: Any) -> Shape:
    bounds = np.array([solid.vertices.min(axis=0), solid.vertices.max(axis=0)])
    return Shape(kind, solid, bounds, fcl.CollisionObject(geometry, transform(np.eye(4))))


def _tree(kind: Kind, solid: Mesh) -> Shape:
    return _shape(kind, solid, tree(solid.vertices * UNIT, solid.faces))


def _solid(vertices: ArrayLike, faces: ArrayLike, name: str) -> Mesh:
    solid = closed_mesh(vertices, faces, name)
    _check_size(f"{name}: largest extent", float(np.ptp(solid.vertices, axis=0).max()))
    return solid


def _check_size(name: str, size: float) -> None:
    if not MIN_SIZE <= size <= MAX_SIZE:
        raise InputError(
            f"{name} must be from {MIN_SIZE:g} to {MAX_SIZE:g} mm for FCL, whose tolerances are absolute, got {size:g}"
        )
