"""The surfaces of a solid's faces: planes, cylinders, cones, spheres and tori with their sizes, splines among them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.files.open_cascade import explore, from_bytes, occ
from clamp3d.geometry.pose import Array

KINDS = ("plane", "cylinder", "cone", "sphere", "torus", "other")
"""Kinds of a face; the index is the kind's number in `Surfaces.kind`."""
PLANE, CYLINDER, CONE, SPHERE, TORUS, OTHER = range(6)
_SIZES: dict[str, tuple[str, ...]] = {
    "plane": (),
    "cylinder": ("Radius",),
    "cone": ("RefRadius", "SemiAngle"),
    "sphere": ("Radius",),
    "torus": ("MajorRadius", "MinorRadius"),
}
"""Open CASCADE's names of `Surfaces.size`."""

_ALIKE = 1e-7
"""How far (mm) a spline may be from a plane, cylinder, cone, ... to count as one: Open CASCADE's confusion."""
_TOLERANCES = (_ALIKE, 1e-6, 1e-5)
"""What Open CASCADE is asked with: it takes planes that are turned for splines at less than some 1e-6."""
_MOST_PLACES = 20_000
"""Points of a spline that are looked at to see that it is a plain surface, at most: some 50 ms."""
_STEP = 1e-4
"""Step (mm) off a surface to see on which side its normal is."""


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """The surfaces of n faces, part frame, mm.

    Attributes
    ----------
    kind : ndarray of int (n,)
        Index into `KINDS`.
    frame : ndarray (n, 4, 3)
        Origin and the axes x, y, z of each surface; z is the plane's normal or the axis.
    size : ndarray (n, 2)
        Cylinder and sphere: radius; cone: radius at the origin and semi-angle (rad); torus: major and minor radius.
    sense : ndarray (n,)
        1.0 where the material lies below the plane or inside the cylinder, sphere, ...; -1.0 for holes and hollows.
    """

    kind: NDArray[np.int64]
    frame: Array
    size: Array
    sense: Array


@lru_cache(maxsize=512)
def surfaces(brep: bytes) -> Surfaces:
    """The surfaces of a solid's faces, in the explorer's order; kept, since splines take a while to recognise."""
    return surfaces_of([*explore(from_bytes(brep), "FACE")])


def surfaces_of(faces: list[Any]) -> Surfaces:
    """The same of a list of TopoDS_Face."""
    rows = []
    for face in faces:
        kind, frame, size = _canonical(face)
        rows.append((kind, frame, size, 1.0 if kind == OTHER else _sense(face, kind, frame, size)))
    return Surfaces(*map(np.array, zip(*rows, strict=True)))


def _canonical(face: Any) -> tuple[int, Array, Array]:
    """Kind, frame (4, 3) and sizes (2,) of a face's surface, also where a file gives it as a spline."""
    kind, frame, size = form_of(occ.BRepAdaptor_Surface(face))
    spline = occ.BRep_Tool.Surface_s(face)
    if kind == OTHER and isinstance(spline, occ.Geom_BSplineSurface):
        for tolerance in _TOLERANCES:
            plain = occ.GeomConvert_SurfToAnaSurf(spline).ConvertToAnalytical(tolerance)
            if plain is not None and _coincides(spline, *(form := form_of(occ.GeomAdaptor_Surface(plain)))):
                return form
    return kind, frame, size


def form_of(surface: Any) -> tuple[int, Array, Array]:
    """Kind, frame (4, 3) and sizes (2,) of a BRepAdaptor_Surface or GeomAdaptor_Surface."""
    name, size = surface.GetType().name.removeprefix("GeomAbs_").lower(), np.zeros(2)
    if name not in _SIZES:
        return OTHER, np.vstack([np.zeros(3), np.eye(3)]), size
    form = getattr(surface, name.capitalize())()
    place = form.Position()
    axes = (place.XDirection(), place.YDirection(), place.Direction())
    size[: len(_SIZES[name])] = [getattr(form, of)() for of in _SIZES[name]]
    return KINDS.index(name), np.array([place.Location().Coord(), *(axis.Coord() for axis in axes)]), size


def _coincides(spline: Any, kind: int, frame: Array, size: Array) -> bool:
    """Whether a spline is a plane, quadric or torus: Open CASCADE looks at some points, and may miss a bump.

    Lemma: between two knots a spline of degree p, put into the equation of a surface of degree 4, gives a polynomial of
    degree 4 p over a denominator. If it is zero at 4 p + 1 places in each direction, it is zero. A spline with so many
    knots that this takes too long is nothing that somebody drew as a plain surface.
    """
    u = _places([spline.UKnot(i) for i in range(1, spline.NbUKnots() + 1)], 4 * spline.UDegree() + 1)
    v = _places([spline.VKnot(i) for i in range(1, spline.NbVKnots() + 1)], 4 * spline.VDegree() + 1)
    if kind == OTHER or len(u) * len(v) > _MOST_PLACES:
        return False
    points = np.array([spline.Value(x, y).Coord() for x in u for y in v])
    return bool(np.abs(height(kind, frame, size, points)).max() <= _ALIKE)


def _places(knots: list[float], each: int) -> list[float]:
    """As many parameters between each two knots."""
    shares = (np.arange(each) + 0.5) / each
    return [a + share * (b - a) for a, b in itertools.pairwise(knots) for share in shares.tolist()]


def _sense(face: Any, kind: int, frame: Array, size: Array) -> float:
    """1.0 where the face's outward normal is that of its surface, else -1.0."""
    surface = occ.BRepAdaptor_Surface(face)
    u = 0.5 * (surface.FirstUParameter() + surface.LastUParameter())
    v = 0.5 * (surface.FirstVParameter() + surface.LastVParameter())
    point, normal = occ.gp_Pnt(), occ.gp_Vec()
    occ.BRepGProp_Face(face).Normal(u, v, point, normal)
    step = np.array(normal.Coord()) * (_STEP / max(normal.Magnitude(), 1e-300))
    below, above = height(kind, frame, size, np.array(point.Coord()) + np.array([-step, step]))
    return 1.0 if above > below else -1.0


def points_on(face: Any, uv: Array) -> Array:
    """Points (k, 3) of a face's surface at its parameters (k, 2); Open CASCADE is asked for those of splines alone.

    Formulas as in its `ElSLib`: it takes a microsecond and more for each point by itself.
    """
    surface = occ.BRepAdaptor_Surface(face)
    kind, frame, size = form_of(surface)
    if kind == OTHER:
        return np.array([surface.Value(u, v).Coord() for u, v in uv.tolist()]).reshape(-1, 3)
    u, v = uv.T
    if kind == PLANE:
        return np.asarray(frame[0] + uv @ frame[1:3])
    across, along = {
        CYLINDER: (size[0], v),
        CONE: (size[0] + v * math.sin(size[1]), v * math.cos(size[1])),
        SPHERE: (size[0] * np.cos(v), size[0] * np.sin(v)),
        TORUS: (size[0] + size[1] * np.cos(v), size[1] * np.sin(v)),
    }[kind]
    return np.asarray(frame[0] + np.column_stack([across * np.cos(u), across * np.sin(u), along]) @ frame[1:])


def distinct_points_on(face: Any, uv: Array) -> tuple[Array, NDArray[np.int64]]:
    """The points (n, 3) of a face's surface at the distinct ones of parameters (k, 2), and which (k,) is whose."""
    # Triangles share their corners and edges; pairs of numbers are sorted soonest as complex ones.
    places, rows = np.unique(uv @ (1.0, 1.0j), return_inverse=True)
    return points_on(face, np.column_stack([places.real, places.imag])), rows.reshape(-1)


def height(kind: int, frame: Array, size: Array, points: Array) -> Array:
    """Signed distance (k,) of points (k, 3) from a whole surface; positive on the side of the normal or outside."""
    x, y, z = ((points - frame[0]) @ frame[1:].T).T
    across = np.hypot(x, y)
    if kind == PLANE:
        return np.asarray(z)
    if kind == CYLINDER:
        return np.asarray(across - size[0])
    if kind == CONE:
        return np.asarray((across - size[0]) * math.cos(size[1]) - z * math.sin(size[1]))
    if kind == SPHERE:
        return np.asarray(np.sqrt(across**2 + z**2) - size[0])
    return np.asarray(np.hypot(across - size[0], z) - size[1])
