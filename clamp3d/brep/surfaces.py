"""Canonical surfaces of faces: planes, cylinders, cones, spheres, tori; heights over them and parameters on them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.spans import spans_of, stations
from clamp3d.core.linear import atan2, crosses, dot, norm
from clamp3d.core.pose import Array

KINDS = ("plane", "cylinder", "cone", "sphere", "torus", "other")
"""Kinds of a face; the index is the kind's number in `Faces.kind`."""
PLANE, CYLINDER, CONE, SPHERE, TORUS, OTHER = range(6)
RECOGNISED = 1e-3
"""Largest deviation (mm) of a free-form surface from the canonical one that it is taken for."""

SAFETY = 2.0
"""Factor on deviations that are sampled, not computed."""

Size = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """The faces of a solid and triangles on them, part frame, mm.

    Attributes
    ----------
    kind : ndarray of int (n,)
        Index into `KINDS`.
    frame : ndarray (n, 4, 3)
        Origin and the axes x, y, z of each surface; z is the plane's normal or the axis.
    size : ndarray (n, 2)
        Cylinder and sphere: radius; cone: radius at the origin and semi-angle (rad); torus: major and minor radius.
    sense : ndarray (n,)
        1.0 where the material lies below the plane, inside the cylinder, ...; -1.0 for holes and hollows.
    deviation : ndarray (n,)
        The file's surface is this near the canonical one (a recognised B-spline), or the triangles (kind "other").
    error : ndarray (m,)
        Largest distance of each triangle from its face. Each point of the face is that near to one of them: on cones,
        balls and tori not always to the one that has its parameters.
    corners : ndarray (m, 3, 3)
        Corners of the triangles, outward; on the surface to within the face's deviation.
    uv : ndarray (m, 3, 2)
        Their surface parameters; u of a pole or apex is NaN.
    face : ndarray of int (m,)
        Face of each triangle.
    sag : ndarray (m, 3)
        How far the trimmed face's border can be from the side that starts at each corner; 0 inside the face.
    """

    kind: NDArray[np.int64]
    frame: Array
    size: Array
    sense: Array
    deviation: Array
    error: Array
    corners: Array
    uv: Array
    face: NDArray[np.int64]
    sag: Array

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """All of it by name."""
        return {f"faces_{field.name}": getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Faces:
        """From what `to_arrays` gave."""
        return cls(**{field.name: np.ascontiguousarray(arrays[f"faces_{field.name}"]) for field in fields(cls)})


def height(kind: int, frame: Array, size: Size, points: Array) -> Array:
    """Signed distance (k,) of points (k, 3) from the whole surface; positive on the side of the normal or outside."""
    local = dot(points - frame[0], frame[1:].T)
    x, y, z = local.T
    across = np.hypot(x, y)
    if kind == PLANE:
        return np.asarray(z)
    if kind == CYLINDER:
        return np.asarray(across - size[0])
    if kind == CONE:
        return np.asarray((across - size[0]) * math.cos(size[1]) - z * math.sin(size[1]))
    if kind == SPHERE:
        return np.asarray(np.linalg.norm(local, axis=1) - size[0])
    return np.asarray(np.hypot(across - size[0], z) - size[1])


def parameters(kind: int, frame: Array, size: Size, points: Array) -> Array:
    """Surface parameters (k, 2) of the feet of points (k, 3); u is NaN on the axis of a sphere or cone."""
    local = dot(points - frame[0], frame[1:].T)
    x, y, z = local.T
    if kind in (PLANE, OTHER):
        return np.ascontiguousarray(local[:, :2])
    across, u = np.hypot(x, y), atan2(y, x)
    if kind == CYLINDER:
        return np.column_stack([u, z])
    if kind == TORUS:
        return np.column_stack([u, atan2(z, across - size[0])])
    u = np.where(across > 1e-9 * (1.0 + np.abs(z).max()), u, np.nan)
    if kind == SPHERE:
        return np.column_stack([u, atan2(z, across)])
    along = (across - size[0]) * math.sin(size[1]) + z * math.cos(size[1])
    return np.column_stack([u, along * math.cos(size[1])])


def points_at(kind: int, frame: Array, size: Size, uv: Array) -> Array:
    """Points (k, 3) of a surface at parameters (k, 2)."""
    u, v = np.nan_to_num(uv[:, 0]), uv[:, 1]
    if kind == PLANE:
        local = np.column_stack([u, v, 0.0 * u])
    else:
        if kind == CYLINDER:
            across, z = np.full_like(u, size[0]), v
        elif kind == CONE:
            across, z = size[0] + v * math.tan(size[1]), v
        elif kind == SPHERE:
            across, z = size[0] * np.cos(v), size[0] * np.sin(v)
        else:
            across, z = size[0] + size[1] * np.cos(v), size[1] * np.sin(v)
        local = np.column_stack([across * np.cos(u), across * np.sin(u), z])
    return np.asarray(dot(local, frame[1:]) + frame[0])


def unwrapped(kind: int, uv: Array) -> Array:
    """Parameters (m, 3, 2) of triangles' corners with no jump of a whole turn inside a triangle."""
    if kind in (PLANE, OTHER):
        return uv
    made = uv.copy()
    for column in (0, 1) if kind == TORUS else (0,):
        angle = made[:, :, column]
        first = np.where(np.isnan(angle[:, 0]), angle[:, 1], angle[:, 0])[:, None]
        made[:, :, column] = first + np.remainder(angle - first + math.pi, 2.0 * math.pi) - math.pi
    return made


def normals(corners: Array) -> Array:
    """Normals (m, 3) of triangles (m, 3, 3), as long as twice their areas."""
    return crosses(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def sense_of(kind: int, frame: Array, size: Size, corners: Array) -> float:
    """Whether the triangles' outward normals point up the surface's height."""
    if kind == OTHER:
        return 1.0
    normal = normals(corners)
    k = int(np.argmax(np.einsum("ij,ij->i", normal, normal)))
    middle = corners[k].mean(axis=0)
    step = 1e-4 * math.sqrt(norm(normal[k]))
    two = np.stack([middle, middle + step * normal[k] / norm(normal[k])])
    low, high = height(kind, frame, size, two)
    return 1.0 if high > low else -1.0


def surface_of(face: Any) -> tuple[int, Array, Size, float]:
    """Kind, frame, sizes and deviation of a face's surface, recognised where it is free-form."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    surface = BRepAdaptor_Surface(face)
    number = KINDS.index(kind) if (kind := surface.GetType().name.removeprefix("GeomAbs_").lower()) in KINDS else OTHER
    if number != OTHER:
        name = KINDS[number].capitalize()
        made = _canonical(number, getattr(surface, name)())
        if number != TORUS or made[1][0] > made[1][1]:
            return number, *made, 0.0
        return OTHER, made[0], made[1], 0.0
    return _recognised(face)


def _recognised(face: Any) -> tuple[int, Array, Size, float]:
    from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Sphere
    from OCP.ShapeAnalysis import ShapeAnalysis_CanonicalRecognition

    for number, name, empty in (
        (PLANE, "IsPlane", gp_Pln),
        (CYLINDER, "IsCylinder", gp_Cylinder),
        (CONE, "IsCone", gp_Cone),
        (SPHERE, "IsSphere", gp_Sphere),
    ):
        asked, found = ShapeAnalysis_CanonicalRecognition(face), empty()
        if not getattr(asked, name)(RECOGNISED, found) or asked.GetGap() > RECOGNISED:
            continue
        frame, size = _canonical(number, found)
        # Open CASCADE looks at few points, and passes over what bulges between them.
        off = float(np.abs(height(number, frame, size, _stations(face))).max())
        deviation = max(float(asked.GetGap()), SAFETY * off)
        if deviation <= RECOGNISED:
            return number, frame, size, deviation
    return OTHER, np.vstack([np.zeros(3), np.eye(3)]), (0.0, 0.0), 0.0


def _stations(face: Any) -> Array:
    """Points (k, 3) of a face's surface that show all polynomials it is made of."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    surface = BRepAdaptor_Surface(face)
    along, across = spans_of(surface)
    u = stations(along, surface.FirstUParameter(), surface.LastUParameter())
    v = stations(across, surface.FirstVParameter(), surface.LastVParameter())
    return np.array([surface.Value(a, b).Coord() for a in u.tolist() for b in v.tolist()])


def _canonical(kind: int, found: Any) -> tuple[Array, Size]:
    position = found.Position()
    frame = np.array(
        [
            position.Location().Coord(),
            position.XDirection().Coord(),
            position.YDirection().Coord(),
            position.Direction().Coord(),
        ]
    )
    if kind == CONE:
        return frame, (float(found.RefRadius()), float(found.SemiAngle()))
    if kind == TORUS:
        return frame, (float(found.MajorRadius()), float(found.MinorRadius()))
    return frame, (0.0 if kind == PLANE else float(found.Radius()), 0.0)


def from_sides(kind: int, frame: Array, size: Size, a: Array, b: Array, true: Array) -> Array:
    """Distance (k,) of ``true`` (k, 3) from the lines, straight in parameters, between ``a`` and ``b`` (k, 3)."""
    if kind == OTHER:
        ways = np.linspace(0.0, 1.0, 17)
        lines = a[:, None] * (1.0 - ways)[:, None] + b[:, None] * ways[:, None]
        return np.asarray(np.linalg.norm(lines - true[:, None], axis=2).min(axis=1))
    uv = unwrapped(kind, np.stack([parameters(kind, frame, size, x) for x in (a, b, true)], axis=1))
    for k in (0, 1):  # a pole takes the direction of the other end
        uv[:, k, 0] = np.where(np.isnan(uv[:, k, 0]), uv[:, 2, 0], uv[:, k, 0])
    way = uv[:, 1] - uv[:, 0]
    foot = np.clip(((uv[:, 2] - uv[:, 0]) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points_at(kind, frame, size, uv[:, 0] + foot[:, None] * way) - true, axis=1))


def bends(kind: int, size: Size, uv: Array, corners: Array) -> Array:
    """Largest distance (m,) of triangles from the surface that their corners are on.

    A weighted mean of points on an arc lies no deeper than its sagitta; a triangle lies no deeper in a ball than the
    plane of its smallest enclosing circle.
    """

    def turn(k: int) -> Array:
        u = uv[:, :, k]
        with np.errstate(invalid="ignore"):
            span = np.fmax(np.fmax(u[:, 0], u[:, 1]), u[:, 2]) - np.fmin(np.fmin(u[:, 0], u[:, 1]), u[:, 2])
        return np.asarray(1.0 - np.cos(0.5 * np.minimum(np.nan_to_num(span), math.pi)))

    if kind == CYLINDER:
        return size[0] * turn(0)
    if kind == CONE:
        return np.asarray(np.abs(size[0] + math.tan(size[1]) * uv[:, :, 1]).max(axis=1) * turn(0))
    if kind == SPHERE:
        return np.asarray(size[0] - np.sqrt(np.maximum(size[0] ** 2 - _enclosing(corners) ** 2, 0.0)))
    if kind == TORUS:
        return np.asarray((size[0] + size[1]) * turn(0) + size[1] * turn(1))
    return np.zeros(len(uv))


def _enclosing(P: Array) -> Array:
    """Radius (m,) of the smallest ball around each of triangles (m, 3, 3)."""
    side = np.linalg.norm(np.roll(P, -1, axis=1) - P, axis=2)
    long = side.max(axis=1)
    twice_area = np.linalg.norm(normals(P), axis=1)
    around = side.prod(axis=1) / np.maximum(2.0 * twice_area, 1e-300)
    obtuse = 2.0 * long**2 >= (side**2).sum(axis=1)
    return np.asarray(np.where(obtuse, 0.5 * long, np.minimum(around, long)))
