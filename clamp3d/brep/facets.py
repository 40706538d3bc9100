"""The triangles of one face: the mesher's, or rows of them, and how far free-form ones can be from it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.borders import spline_sags
from clamp3d.brep.grid import divisions, gridded
from clamp3d.brep.spans import Bends, Spans, crossed, spans_of
from clamp3d.brep.surfaces import OTHER, PLANE, SAFETY, Size
from clamp3d.core.linear import dot, norm
from clamp3d.core.mesh import Array, IntArray
from clamp3d.core.triangles import distinct, halved, side_keys

FREE = 0.02
"""Largest chord error (mm) of free-form faces: their triangles stand for them to the end, others say where to look."""
_FEW, _PLENTY, _MOST = 3, 24, 300
"""Samples along a triangle's side: `_SAMPLES` are so few; a triangle is halved that takes more; the most there are."""
_ROUNDS = 12


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
    closed = kind != PLANE and made is None and (surface.IsUClosed() or surface.IsVClosed())
    if not closed and kind != OTHER:
        return F, P, np.zeros(len(F))
    corners, off = _without_poles(uv, F, poles), None
    if kind == OTHER:
        off = _swept(surface, corners, P[F])
        if off is None:
            F, uv, P, corners, off = _resolved(surface, F, uv, P, border, poles, min(chord, FREE))
    own = np.zeros(len(F))
    if closed:
        turns = np.array([
            surface.LastUParameter() - surface.FirstUParameter() if surface.IsUClosed() else np.inf,
            surface.LastVParameter() - surface.FirstVParameter() if surface.IsVClosed() else np.inf,
        ])  # fmt: skip
        # Two nodes a whole turn apart are at one place: a triangle of theirs can stand for all round it.
        own = np.where(_spread(corners, turns), norm(np.ptp(P, axis=0)), 0.0)
    return F, P, own if off is None else np.maximum(own, off)


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


def _resolved(
    surface: Any, F: IntArray, uv: Array, P: Array, border: list[IntArray], poles: list[IntArray], wanted: float
) -> tuple[IntArray, Array, Array, Array, Array]:
    """Triangles halved where they stand for several polynomials of a surface and are off by more than is ``wanted``.

    A mesher looks at few points and passes over what bulges between them. Sides at the border stay as they are. Returns
    triangles, parameters and points, the parameters of the triangles' corners, and how far they can be off.
    """
    spans, bends = spans_of(surface), Bends.of(surface)
    whole = np.concatenate([np.column_stack([nodes[:-1], nodes[1:]]) for nodes in border])
    for last in (*[False] * _ROUNDS, True):
        corners = _without_poles(uv, F, poles)
        off = _deviations(surface, spans, bends, corners, P[F], wanted)
        ends = F[:, [1, 2, 0]]
        across = _order(spans, np.stack([uv[F], uv[ends]], axis=2).reshape(-1, 2, 2)).reshape(-1, 3)
        order = across.max(axis=1, keepdims=True)
        keys = side_keys(F, ends, len(P))
        cut = (off > wanted)[:, None] & (order > _FEW) & (across > 0.4 * order)
        cut &= ~np.isin(keys, side_keys(whole[:, 0], whole[:, 1], len(P)))
        for nodes in poles:
            cut &= ~np.isin(F, nodes) & ~np.isin(ends, nodes)
        if last or not cut.any():
            break
        sides = distinct(keys[cut])
        middle = 0.5 * (uv[sides // len(P)] + uv[sides % len(P)])
        at = np.minimum(np.searchsorted(sides, keys), len(sides) - 1)
        F = halved(F, np.where(sides[at] == keys, len(P) + at, -1))
        uv = np.concatenate([uv, middle])
        P = np.concatenate([P, [surface.Value(u, v).Coord() for u, v in middle.tolist()]])
    wide = np.flatnonzero(np.isinf(off))
    count = _order(spans, corners[wide]).clip(_FEW, _MOST)
    off[wide] = _sampled(surface, corners[wide], P[F[wide]], count)
    return F, uv, P, corners, off


def _order(spans: tuple[Spans, Spans], uv: Array) -> Array:
    """Samples along a side (m,) that show all polynomials between parameters (m, k, 2)."""
    return np.maximum(crossed(spans[0], uv[:, :, 0]), crossed(spans[1], uv[:, :, 1]))


_SAMPLES = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3], [4, 1, 1], [1, 4, 1], [1, 1, 4]], dtype=np.float64)
_SAMPLES /= _SAMPLES.sum(axis=1, keepdims=True)


def _lattice(order: int) -> Array:
    """Weights (s, 3) of samples of a triangle, so many along a side."""
    if order <= _FEW:
        return _SAMPLES
    i, j = np.divmod(np.arange((order + 1) ** 2), order + 1)
    weights = np.column_stack([i, j, order - i - j])
    return np.asarray(weights[(weights >= 0).all(axis=1) & (weights < order).all(axis=1)] / order)


def _deviations(
    surface: Any, spans: tuple[Spans, Spans], bends: Bends | None, uv: Array, corners: Array, wanted: float
) -> Array:
    """How far triangles (m, 3, 3) with parameters ``uv`` (m, 3, 2) can be from a surface.

    Of one that stands for several polynomials what the ``bends`` say, where that is less than is ``wanted`` or it takes
    more than `_PLENTY` samples to see them all; else samples. Infinite where neither tells.
    """
    order, found = _order(spans, uv), np.full(len(uv), np.inf)
    if bends is not None:
        wide = np.flatnonzero(order > _FEW)
        found[wide] = bends.at(uv[wide])
    rows = np.flatnonzero((found > wanted) & (order <= _PLENTY))
    found[rows] = _sampled(surface, uv[rows], corners[rows], order[rows].clip(_FEW))
    return found


def _sampled(surface: Any, uv: Array, corners: Array, order: Array) -> Array:
    """How far samples of triangles (m, 3, 3), ``order`` (m,) of them along a side, can be from a surface."""
    count, found = np.ceil(order).astype(np.int64), np.empty(len(uv))
    for n in distinct(count):
        rows = np.flatnonzero(count == n)
        found[rows] = _sampled_at(surface, uv[rows], corners[rows], _lattice(int(n)))
    return found


def _sampled_at(surface: Any, uv: Array, corners: Array, weights: Array) -> Array:
    """Twice the largest distance (m,) of points of triangles (m, 3, 3) from a surface, of those at ``weights`` (s, 3).

    It is found from the same parameters on.
    """
    from OCP.gp import gp_Pnt, gp_Vec

    point, along, across = gp_Pnt(), gp_Vec(), gp_Vec()

    def at(uv: Array) -> Array:
        """Points (k, 0) of the surface and its tangents there (k, 1), (k, 2)."""
        made = np.empty((len(uv), 3, 3))
        for k, (u, v) in enumerate(uv.tolist()):
            surface.D1(u, v, point, along, across)
            made[k] = point.Coord(), along.Coord(), across.Coord()
        return made

    where = np.einsum("sk,mkd->msd", weights, uv).reshape(-1, 2)
    flat = np.einsum("sk,mkd->msd", weights, corners).reshape(-1, 3)
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
    return np.asarray(SAFETY * found.reshape(len(corners), -1).max(axis=1))
