"""The edges of a face as its triangles see them: how far they bulge, and triangles split until that is little."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.surfaces import OTHER, PLANE, SAFETY, Size, from_sides, height, normals
from clamp3d.core.mesh import Array, IntArray
from clamp3d.core.triangles import side_keys

BORDER = 0.0003
"""Largest sag (mm) of a border that is not split: where two parts touch their borders decide."""
_MOST = 64
_ROUNDING = 1e-11
"""What is nearer (mm) than this is as good as there."""
_SHARES = (0.25, 0.5, 0.75)
"""Where pieces of such edges are sampled."""
Bends = tuple[Array, Array]
"""Knots, and sizes of the control points of the second derivative."""


class Curve:
    """The curve of an edge, a BRepAdaptor_Curve, for both faces beside it: what both ask for is worked out once."""

    def __init__(self, adaptor: Any) -> None:
        self.adaptor, self.kind = adaptor, adaptor.GetType()

    @cached_property
    def bends(self) -> Bends | None:
        """Those of a B-spline curve."""
        return _bends(self.adaptor.BSpline())

    def at(self, t: Array) -> Array:
        """Points (k, 3) at parameters (k,)."""
        value = self.adaptor.Value
        return np.array([value(x).Coord() for x in t.tolist()])


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Pieces of a face's edges: ``nodes`` (k, 2) of the face at their ends, and how far each bulges, ``sag`` (k,) mm.

    Each is ``count`` finer pieces: its points begin at row ``start`` of ``points`` (n, 3), the sags of its parts at the
    same row of ``fine`` (n,).
    """

    nodes: IntArray
    sag: Array
    count: IntArray
    start: IntArray
    points: Array
    fine: Array

    @classmethod
    def joined(cls, edges: list[Borders]) -> Borders:
        """Those of all edges of a face."""
        before = np.cumsum([0] + [len(edge.points) for edge in edges])
        start = [edge.start + n for edge, n in zip(edges, before, strict=False)]
        columns = ([getattr(edge, name) for edge in edges] for name in ("nodes", "sag", "count", "points", "fine"))
        nodes, sag, count, points, fine = (np.concatenate(column) for column in columns)
        return cls(nodes, sag, count, np.concatenate(start), points, fine)

    @classmethod
    def of(cls, curve: Curve, at: IntArray, t: Array, ends: Array, kind: int, frame: Array, size: Size) -> Borders:
        """Of one edge, with the face's nodes ``at`` (k + 1,) at its parameters ``t`` and places ``ends``."""
        k = len(t) - 1
        nodes = np.empty((k, 2), dtype=np.int64)
        nodes[:, 0], nodes[:, 1] = at[:-1], at[1:]
        sag = _sags(curve, t, ends, kind, frame, size)
        if kind == OTHER or sag.max() <= BORDER:
            return cls(nodes, sag, np.ones(k, np.int64), np.arange(k), ends, np.append(sag, 0.0))
        count = np.ceil(np.sqrt(sag / BORDER)).clip(1, _MOST).astype(np.int64)
        start = np.cumsum(count) - count
        step = np.arange(count.sum()) - np.repeat(start, count)
        along = np.append(np.repeat(t[:-1], count) + step * np.repeat(np.diff(t) / count, count), t[-1])
        points = curve.at(along)
        points[start], points[-1] = ends[:-1], ends[-1]
        fine = _sags(curve, along, points, kind, frame, size)
        return cls(nodes, sag, count, start, points, np.append(fine, 0.0))

    def at_sides(self, F: IntArray, n: int) -> IntArray:
        """Row of the piece that each triangle's side is (m, 3), of triangles of ``n`` nodes; -1 for none."""
        keys = side_keys(self.nodes[:, 0], self.nodes[:, 1], n)
        order = np.lexsort((-self.sag, keys))  # of two with the same ends the larger sag
        wanted = side_keys(F, F[:, [1, 2, 0]], n)
        row = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
        return np.asarray(np.where(keys[row] == wanted, row, -1))

    def split(self, F: IntArray, rows: IntArray, P: Array) -> tuple[IntArray, Array, IntArray]:
        """Triangles F (m, 3) of P, nodes and then `points`, cut into fans at the sides ``rows`` (m, 3) that bulge.

        Returns their corners (k, 3) in P, the sags of their sides (k, 3) and the triangle that each came from (k,).
        """
        sag = np.where(rows >= 0, self.sag[rows], 0.0)
        origin, first = np.arange(len(F)), len(P) - len(self.points)
        forward = self.nodes[rows, 0] == F
        outward = None
        for s in range(3):
            parts = np.where(rows[:, s] >= 0, self.count[rows[:, s]], 1)
            while (parts > 1).any():
                outward = normals(P[F]) if outward is None else outward
                made = self._fans(s, parts, F, rows, forward[:, s], sag, first)
                after = normals(P[made[0]])
                turned = np.einsum("ij,ij->i", after, outward[made[1]]) < 0.0
                if not turned.any():
                    F, source, rows, sag = made
                    forward, origin, outward = forward[source], origin[source], after
                    break
                parts[made[1][turned]] = 1  # too slim for its arc: it stays as it is
        return F, sag, origin

    def _fans(
        self,
        s: int,
        parts: IntArray,
        F: IntArray,
        rows: IntArray,
        forward: NDArray[np.bool_],
        sag: Array,
        first: int,
    ) -> tuple[IntArray, IntArray, IntArray, Array]:
        """Each triangle as ``parts`` (m,) ones along its side ``s``, and the triangle that each came from.

        ``first``: number of the first of the points as a node.
        """
        source = np.repeat(np.arange(len(parts)), parts)
        step = np.arange(len(source)) - np.repeat(np.cumsum(parts) - parts, parts)
        F, rows, sag = F[source], rows[source], sag[source]
        cut = parts[source] > 1
        left = parts[source] - 1 - step
        low = self.start[rows[:, s]] + np.where(forward[source], step, left)
        turned = ~forward[source][cut]
        F[cut, s], F[cut, (s + 1) % 3] = first + low[cut] + turned, first + low[cut] + ~turned
        sag[cut, s] = self.fine[low[cut]]
        for inner, side in ((left > 0, (s + 1) % 3), (step > 0, (s + 2) % 3)):
            sag[cut & inner, side], rows[cut & inner, side] = 0.0, -1
        return F, source, rows, sag


@cache
def _kinds() -> Any:
    from OCP.GeomAbs import GeomAbs_CurveType

    return GeomAbs_CurveType


def _sags(curve: Curve, t: Array, points: Array, kind: int, frame: Array, size: Size) -> Array:
    """How far each piece (k,) of an edge can be from the line on the surface that is straight in its parameters, mm."""
    what, Kind = curve.kind, _kinds()
    if what == Kind.GeomAbs_Line:
        return np.zeros(len(points) - 1)
    turn = 0.5 * np.minimum(np.abs(np.diff(t)), np.pi)
    if what == Kind.GeomAbs_Circle and kind in (PLANE, OTHER):
        return np.asarray(curve.adaptor.Circle().Radius() * (1.0 - np.cos(turn)))
    if what == Kind.GeomAbs_Ellipse and kind in (PLANE, OTHER):  # a circle stretched: at most by the longer half axis
        return np.asarray(curve.adaptor.Ellipse().MajorRadius() * (1.0 - np.cos(turn)))
    if what == Kind.GeomAbs_Circle and _is_around(curve.adaptor.Circle(), frame):
        off = np.abs(height(kind, frame, size, points[:1]))
        return np.where(np.repeat(off, len(turn)) > _ROUNDING, SAFETY * off, 0.0)
    if what == Kind.GeomAbs_BSplineCurve and kind in (PLANE, OTHER):
        found = _stretches(curve.bends, np.minimum(t[:-1], t[1:]), np.maximum(t[:-1], t[1:]))
        if found is not None:
            return found
    at = np.concatenate([(1.0 - share) * t[:-1] + share * t[1:] for share in _SHARES])
    true = curve.at(at)
    start, end = (np.tile(x, (len(_SHARES), 1)) for x in (points[:-1], points[1:]))
    off = from_sides(kind, frame, size, start, end, true).reshape(len(_SHARES), -1).max(axis=0)
    return np.where(off > _ROUNDING, SAFETY * off, 0.0)


def _is_around(circle: Any, frame: Array) -> bool:
    """Whether a circle goes around the axis of a round surface: its parameters lie on a line then."""
    axis, middle = circle.Axis().Direction().Coord(), circle.Location().Coord()
    o, _, _, z = frame.tolist()
    tilt = math.hypot(*(axis[i] * z[i - 1] - axis[i - 1] * z[i] for i in range(3)))
    out = [x - y for x, y in zip(middle, o, strict=True)]
    aside = math.hypot(*(out[i] * z[i - 1] - out[i - 1] * z[i] for i in range(3)))
    return aside + tilt * float(circle.Radius()) < 0.1 * _ROUNDING


def spline_sags(spline: Any, start: Array, end: Array) -> Array | None:
    """How far each stretch (k,) of a Geom_BSplineCurve can be from points on it joined by lines or triangles, mm.

    No mean of points on a stretch of length h is further from the point at the mean parameter than h^2 / 8 times the
    largest second derivative, and that lies in the hull of its control points (Piegl, Tiller, The NURBS Book, 3.3).
    None for a rational or periodic spline, for one of lines, and where it has a kink inside a stretch.
    """
    return _stretches(_bends(spline), start, end)


def _bends(spline: Any) -> Bends | None:
    """Knots and sizes of the control points of the second derivative of a plain Geom_BSplineCurve."""
    p = spline.Degree()
    if p < 2 or spline.IsRational() or spline.IsPeriodic():
        return None
    many = [spline.Multiplicity(i) for i in range(1, spline.NbKnots() + 1)]
    knots = np.repeat([spline.Knot(i) for i in range(1, spline.NbKnots() + 1)], many)
    D = np.array([spline.Pole(i).Coord() for i in range(1, spline.NbPoles() + 1)])
    for degree in (p, p - 1):
        knots = knots[1:-1]
        step, width = np.diff(D, axis=0), (knots[degree:] - knots[:-degree])[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            D = np.where(step == 0.0, 0.0, degree * step / width)
    return knots, np.linalg.norm(D, axis=1)


def _stretches(bends: Bends | None, start: Array, end: Array) -> Array | None:
    if bends is None:
        return None
    knots, size = bends
    active = (knots[: len(size)] < end[:, None]) & (knots[len(knots) - len(size) :] > start[:, None])
    sag = (end - start) ** 2 / 8.0 * np.where(active, size, 0.0).max(axis=1)
    return sag if np.isfinite(sag).all() else None
