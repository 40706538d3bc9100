"""The polynomials that a free-form surface is made of: samples that miss none of them, and bounds of how they bend."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.core.mesh import Array

Spans = tuple[Array, int]
"""Knots, ascending, and the degree of what lies between two of them."""
_ONE: Spans = np.zeros(1), 0


def spans_of(surface: Any) -> tuple[Spans, Spans]:
    """Those of a BRepAdaptor_Surface in its first and its second parameter; none where it has no splines."""
    from OCP.GeomAbs import GeomAbs_SurfaceType as Kind

    what = surface.GetType()
    if what == Kind.GeomAbs_OffsetSurface:
        return spans_of(surface.BasisSurface())
    if what == Kind.GeomAbs_SurfaceOfExtrusion:
        return _of_curve(surface.BasisCurve()), _ONE
    if what == Kind.GeomAbs_SurfaceOfRevolution:
        return _ONE, _of_curve(surface.BasisCurve())
    if what == Kind.GeomAbs_BezierSurface:
        return (np.array([0.0, 1.0]), surface.UDegree()), (np.array([0.0, 1.0]), surface.VDegree())
    if what != Kind.GeomAbs_BSplineSurface:
        return _ONE, _ONE
    s = surface.BSpline()
    u = np.array([s.UKnot(i) for i in range(1, s.NbUKnots() + 1)])
    v = np.array([s.VKnot(i) for i in range(1, s.NbVKnots() + 1)])
    return _repeated(u, s.UDegree(), s.IsUPeriodic()), _repeated(v, s.VDegree(), s.IsVPeriodic())


def crossed(spans: Spans, t: Array) -> Array:
    """How many samples between the least and the largest of parameters (m, k) show all polynomials there, (m,)."""
    knots, degree = spans
    return np.asarray(_count(degree) * np.ptp(np.interp(t, knots, np.arange(len(knots))), axis=1))


def stations(spans: Spans, low: float, high: float) -> Array:
    """Parameters from ``low`` to ``high`` that show all polynomials there."""
    knots, degree = spans
    ends = np.concatenate([[low], knots[(knots > low) & (knots < high)], [high]])
    steps = np.arange(_count(degree) + 1) / (_count(degree) + 1)
    return np.append((ends[:-1, None] + np.diff(ends)[:, None] * steps).ravel(), high)


def _count(degree: int) -> int:
    """Samples of a polynomial: the hump of a single pole is a share of about 1 / sqrt(degree) wide."""
    return max(3, math.ceil(math.sqrt(2.0 * degree)))


def _of_curve(curve: Any) -> Spans:
    from OCP.GeomAbs import GeomAbs_CurveType as Kind

    if curve.GetType() == Kind.GeomAbs_BezierCurve:
        return np.array([0.0, 1.0]), curve.Degree()
    if curve.GetType() != Kind.GeomAbs_BSplineCurve:
        return _ONE
    s = curve.BSpline()
    return _repeated(np.array([s.Knot(i) for i in range(1, s.NbKnots() + 1)]), s.Degree(), s.IsPeriodic())


def _repeated(knots: Array, degree: int, periodic: bool) -> Spans:
    if not periodic:
        return knots, degree
    turn = knots[-1] - knots[0]
    return np.concatenate([knots[:-1] - turn, knots, knots[1:] + turn]), degree


@dataclass(frozen=True, slots=True, eq=False)
class _Spline:
    """A plain tensor product spline: ``poles`` (a, b, 3), and the ``knots`` and degrees ``p`` of both parameters."""

    poles: Array
    knots: tuple[Array, Array]
    p: tuple[int, int]

    def derived(self, k: int) -> _Spline:
        """Its derivative by the first (``k`` 0) or second parameter."""
        knots, p = list(self.knots), list(self.p)
        t = knots[k] = knots[k][1:-1]
        if p[k] == 0:
            return _Spline(np.zeros_like(self.poles), self.knots, self.p)
        width = np.reshape(t[p[k] :] - t[: -p[k]], (-1, 1, 1) if k == 0 else (1, -1, 1))
        step = np.diff(self.poles, axis=k)
        with np.errstate(divide="ignore", invalid="ignore"):
            poles = np.where(step == 0.0, 0.0, p[k] * step / width)
        p[k] -= 1
        return _Spline(poles, (knots[0], knots[1]), (p[0], p[1]))

    def largest(self, low: Array, high: Array) -> Array:
        """Bound (m,) of its size over boxes of parameters (m, 2): it lies in the hull of the poles that count there."""
        size, rows = np.linalg.norm(self.poles, axis=2), []
        for k in (0, 1):
            first = np.searchsorted(self.knots[k], low[:, k], side="right") - self.p[k] - 1
            last = np.searchsorted(self.knots[k], high[:, k], side="left")
            n = size.shape[k]
            rows += [first.clip(0, n - 1), last.clip(1, n)]
        made = np.stack(rows, axis=1)
        return np.array([size[a : max(b, a + 1), c : max(d, c + 1)].max() for a, b, c, d in made.tolist()])


class Bends:
    """Bounds of how far triangles can be from a plain B-spline surface that their corners are on."""

    def __init__(self, spline: Any) -> None:
        U, V = spline.NbUPoles(), spline.NbVPoles()
        poles = np.array([[spline.Pole(i, j).Coord() for j in range(1, V + 1)] for i in range(1, U + 1)])
        u = [spline.UKnot(i) for i in range(1, spline.NbUKnots() + 1) for _ in range(spline.UMultiplicity(i))]
        v = [spline.VKnot(i) for i in range(1, spline.NbVKnots() + 1) for _ in range(spline.VMultiplicity(i))]
        whole = _Spline(poles, (np.array(u), np.array(v)), (spline.UDegree(), spline.VDegree()))
        self.by_u, self.by_v = whole.derived(0), whole.derived(1)
        self.second = self.by_u.derived(0), self.by_u.derived(1), self.by_v.derived(1)

    @classmethod
    def of(cls, surface: Any) -> Bends | None:
        """Those of a BRepAdaptor_Surface; None where it is no plain B-spline surface."""
        from OCP.GeomAbs import GeomAbs_SurfaceType as Kind

        if surface.GetType() != Kind.GeomAbs_BSplineSurface:
            return None
        s = surface.BSpline()
        plain = not (s.IsURational() or s.IsVRational() or s.IsUPeriodic() or s.IsVPeriodic())
        return cls(s) if plain else None

    def at(self, uv: Array) -> Array:
        """The bounds (m,) for triangles with parameters (m, 3, 2): a mean of numbers over a span D varies by D^2 / 4.

        Infinite where the surface has a kink.
        """
        low, high = uv.min(axis=1), uv.max(axis=1)
        span = high - low
        uu, both, vv = (d.largest(low, high) for d in self.second)
        made = (uu * span[:, 0] ** 2 + 2.0 * both * span[:, 0] * span[:, 1] + vv * span[:, 1] ** 2) / 8.0
        return np.where(np.isfinite(made), made, np.inf)
