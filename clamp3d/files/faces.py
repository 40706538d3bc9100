"""The surfaces of a solid's faces: planes, cylinders, cones, spheres and tori with their sizes, splines among them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.files.open_cascade import explore, from_bytes, occ
from clamp3d.geometry.mesh import Array

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


def surfaces(brep: bytes) -> Surfaces:
    """The surfaces of a solid's faces, in the explorer's order."""
    return surfaces_of([*explore(from_bytes(brep), "FACE")])


def surfaces_of(faces: list[Any]) -> Surfaces:
    """The same of a list of TopoDS_Face."""
    kinds, frames, sizes, senses = [], [], [], []
    for face in faces:
        name, form = _canonical(face)
        kind, frame, size, sense = KINDS.index(name), np.vstack([np.zeros(3), np.eye(3)]), np.zeros(2), 1.0
        if kind != OTHER:
            place = form.Position()
            axes = (place.XDirection(), place.YDirection(), place.Direction())
            frame = np.array([place.Location().Coord(), *(axis.Coord() for axis in axes)])
            size[: len(_SIZES[name])] = [getattr(form, of)() for of in _SIZES[name]]
            sense = _sense(face, kind, frame, size)
        kinds.append(kind)
        frames.append(frame)
        sizes.append(size)
        senses.append(sense)
    return Surfaces(
        np.array(kinds, dtype=np.int64),
        np.array(frames).reshape(-1, 4, 3),
        np.array(sizes).reshape(-1, 2),
        np.array(senses),
    )


def _canonical(face: Any) -> tuple[str, Any]:
    """Kind of a face and its surface (gp_Pln, gp_Cylinder, ...), also where a file gives it as a spline."""
    surface = occ.BRepAdaptor_Surface(face)
    if (name := _kind(surface)) == "other":
        plain = occ.GeomConvert_SurfToAnaSurf(occ.BRep_Tool.Surface_s(face)).ConvertToAnalytical(_ALIKE)
        if plain is not None:
            surface = occ.GeomAdaptor_Surface(plain)
            name = _kind(surface)
    return name, None if name == "other" else getattr(surface, name.capitalize())()


def _kind(surface: Any) -> str:
    """The kind of a GeomAdaptor_Surface or BRepAdaptor_Surface, of `KINDS`."""
    name: str = surface.GetType().name.removeprefix("GeomAbs_").lower()
    return name if name in _SIZES else "other"


def _sense(face: Any, kind: int, frame: Array, size: Array) -> float:
    """1.0 where the face's outward normal is that of its surface, else -1.0."""
    surface = occ.BRepAdaptor_Surface(face)
    u = 0.5 * (surface.FirstUParameter() + surface.LastUParameter())
    v = 0.5 * (surface.FirstVParameter() + surface.LastVParameter())
    point, along_u, along_v = occ.gp_Pnt(), occ.gp_Vec(), occ.gp_Vec()
    surface.D1(u, v, point, along_u, along_v)
    step = np.array(along_u.Crossed(along_v).Coord())
    step *= _STEP / max(float(np.linalg.norm(step)), 1e-300)
    below, above = height(kind, frame, size, np.array(point.Coord()) + np.array([-step, step]))
    is_outward = face.Orientation() != occ.TopAbs_Orientation.TopAbs_REVERSED
    return 1.0 if is_outward is bool(above > below) else -1.0


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
