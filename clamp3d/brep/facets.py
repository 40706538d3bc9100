"""The triangles of one face: the mesher's, or rows of them, and how far free-form ones can be from it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.borders import spline_sags
from clamp3d.brep.grid import divisions, gridded
from clamp3d.brep.surfaces import OTHER, PLANE, Size
from clamp3d.core.linear import dot, norm
from clamp3d.core.mesh import Array, IntArray
from clamp3d.core.triangles import distinct

_SAFETY = 2.0
"""Factor on the deviations of free-form faces, which are sampled, not computed."""


def facets(
    face: Any, found: Any, P: Array, kind: int, size: Size, border: list[IntArray], poles: list[IntArray], chord: float
) -> tuple[IntArray, Array, Array]:
    """Triangles of a face, its nodes, and how far each triangle can be from it besides what a round face bends.

    In rows, where its border allows it; of a free-form face only what is extruded.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    surface, made = BRepAdaptor_Surface(face), None
    uv = np.zeros((0, 2)) if kind == PLANE else np.array([found.UVNode(i).Coord() for i in range(1, len(P) + 1)])
    regular = kind != PLANE if kind != OTHER else surface.GetType() == GeomAbs_SurfaceType.GeomAbs_SurfaceOfExtrusion
    if regular and border:
        made = gridded(uv, distinct(np.concatenate(border)), lambda span: divisions(kind, size, span, chord))
    n = found.NbTriangles() if made is None else min(8, found.NbTriangles())
    F = np.array([found.Triangle(i).Get() for i in range(1, n + 1)], dtype=np.int64) - 1
    if made is not None:
        (a, b), (grid, new) = (uv[F[:, k]] - uv[F[:, 0]] for k in (1, 2)), made
        F = grid if (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() > 0.0 else grid[:, ::-1]
        uv = np.concatenate([uv, new])
        P = np.concatenate([P, np.reshape([surface.Value(u, v).Coord() for u, v in new.tolist()], (-1, 3))])
    own = np.zeros(len(F))
    closed = kind != PLANE and made is None and (surface.IsUClosed() or surface.IsVClosed())
    if not closed and kind != OTHER:
        return F, P, own
    corners = _without_poles(uv, F, poles)
    if closed:
        turns = np.array([
            surface.LastUParameter() - surface.FirstUParameter() if surface.IsUClosed() else np.inf,
            surface.LastVParameter() - surface.FirstVParameter() if surface.IsVClosed() else np.inf,
        ])  # fmt: skip
        # Two nodes a whole turn apart are at one place: a triangle of theirs can stand for all round it.
        own = np.where(_spread(corners, turns), norm(np.ptp(P, axis=0)), 0.0)
    if kind != OTHER:
        return F, P, own
    off = _swept(surface, corners, P[F])
    return F, P, np.maximum(own, _sampled(surface, F, corners, P) if off is None else off)


def _swept(surface: Any, uv: Array, corners: Array) -> Array | None:
    """How far triangles (m, 3, 3) with parameters ``uv`` (m, 3, 2) can be from an extruded or turned plain spline.

    A mean of points on a turned curve has the mean of their heights along the axis, and is as far from the axis as the
    mean of their distances from it, less the sagitta of an arc of that radius over the angle between them, at most.
    None for other surfaces.
    """
    from OCP.GeomAbs import GeomAbs_CurveType, GeomAbs_SurfaceType

    turned = surface.GetType() == GeomAbs_SurfaceType.GeomAbs_SurfaceOfRevolution
    if not turned and surface.GetType() != GeomAbs_SurfaceType.GeomAbs_SurfaceOfExtrusion:
        return None
    curve = surface.BasisCurve()
    if curve.GetType() != GeomAbs_CurveType.GeomAbs_BSplineCurve:
        return None
    along = uv[:, :, int(turned)]
    off = spline_sags(curve.BSpline(), along.min(axis=1), along.max(axis=1))
    if off is None or not turned:
        return off
    axis = surface.AxeOfRevolution()
    z = np.array(axis.Direction().Coord())
    away = corners - np.array(axis.Location().Coord())
    radius = np.linalg.norm(away - dot(away, z)[:, :, None] * z, axis=2).max(axis=1)
    span = np.ptp(uv[:, :, 0], axis=1)
    return np.asarray(off + radius * np.where(span < np.pi, 1.0 - np.cos(0.5 * span), 2.0))


def _without_poles(uv: Array, F: IntArray, poles: list[IntArray]) -> Array:
    """Parameters (m, 3, 2) of triangles' corners; a pole, where one of them is any, has that of the other corners."""
    found = uv[F]
    for nodes in poles:
        k = int(np.argmax(np.ptp(uv[nodes], axis=0)))
        other = ~np.isin(F, nodes)
        count = np.maximum(other.sum(axis=1), 1)
        mean = np.where(other, found[:, :, k], 0.0).sum(axis=1) / count
        found[:, :, k] = np.where(other, found[:, :, k], mean[:, None])
    return found


def _spread(uv: Array, turns: Array) -> NDArray[np.bool_]:
    """Whether parameters (m, k, 2) of each row are nearly half a turn apart or more."""
    return np.asarray((np.ptp(uv, axis=1) > 0.45 * turns).any(axis=1))


_SAMPLES = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=np.float64)
_SAMPLES /= _SAMPLES.sum(axis=1, keepdims=True)


def _sampled(surface: Any, F: IntArray, uv: Array, P: Array) -> Array:
    """Twice the largest distance (m,) of points of triangles from the surface, found from the same parameters on."""
    from OCP.gp import gp_Pnt, gp_Vec

    point, along, across = gp_Pnt(), gp_Vec(), gp_Vec()

    def at(uv: Array) -> Array:
        """Points (k, 0) of the surface and its tangents there (k, 1), (k, 2)."""
        made = np.empty((len(uv), 3, 3))
        for k, (u, v) in enumerate(uv.tolist()):
            surface.D1(u, v, point, along, across)
            made[k] = point.Coord(), along.Coord(), across.Coord()
        return made

    where = np.einsum("sk,mkd->msd", _SAMPLES, uv).reshape(-1, 2)
    flat = np.einsum("sk,mkd->msd", _SAMPLES, P[F]).reshape(-1, 3)
    made = at(where)
    off = flat - made[:, 0]
    # The same parameters are not the nearest point's. Least squares; at a pole, where a tangent is 0, along the other.
    (a, b), (_, c) = np.einsum("kid,kjd->ijk", made[:, 1:], made[:, 1:])
    u, v = np.einsum("kid,kd->ik", made[:, 1:], off)
    a, c = (1.0 + 1e-12) * a + 1e-100, (1.0 + 1e-12) * c + 1e-100
    step = np.stack([c * u - b * v, a * v - b * u], axis=1) / (a * c - b * b)[:, None]
    low, high = uv.min(axis=(0, 1)), uv.max(axis=(0, 1))
    nearer = at(np.clip(where + step, low, high))[:, 0]
    found = np.minimum(np.linalg.norm(off, axis=1), np.linalg.norm(flat - nearer, axis=1))
    return np.asarray(_SAFETY * found.reshape(len(F), -1).max(axis=1))
