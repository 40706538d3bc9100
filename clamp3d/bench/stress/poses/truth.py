"""The truth of a case, found without the kernel: least signed distance of a moving point from the groove.

Definition: ``min over |t| <= length/2 of sdf(c + t d) - r``, where ``sdf`` is the signed distance of a point from the
groove's solid. Here ``sdf`` is put together from the boundary pieces of the section (arc, two rays) and the prism rule;
at 50 digits by complex numbers, a construction that shares nothing with the kernel's. Branch and bound with the proven
slope bound of ``sdf`` along the axis finds the stretches that hold the minimum, so none deeper than 1e-6 of the scene
(at 50 digits: of the groove's radius) can hide; golden section goes down in each:

- `truth`: all cases at once in 80-bit floats (64-bit mantissa: about 2000 times finer than float64).
- `truth_50_digits`: one case with mpmath at 50 digits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.poses.cases import Cases, Extended, unit_rows
from clamp3d.errors import need
from clamp3d.testing.bodies import groove_distance

EXTENDED_WORKS = bool(np.finfo(Extended).eps < 1e-18)
"""Whether the platform's long double is wide enough for `truth`; if not, it calls `truth_50_digits` case by case."""

EXTENDED_ERROR = 64.0 * float(np.finfo(Extended).eps)
"""Error of `truth` in parts of the scene's size."""

_GOLDEN = (np.sqrt(Extended(5)) - 1) / 2
_FILL = 16
_MANY, _MOST = 500, 20_000
"""Stretches of a case at which branch and bound stops cutting: a plateau, all of it within rounding of the least. The
first is for all cases at once, the second for one."""


def truth(cases: Cases) -> NDArray[Any]:
    """Signed distances (n,) as long doubles, good to `EXTENDED_ERROR` of each scene."""
    if not EXTENDED_WORKS:
        return np.array([float(truth_50_digits(cases, i)) for i in range(len(cases))], Extended)
    scene = _Scene(cases)
    case, lo, hi, best = _brackets(scene, _MANY, scene.size)
    # A bracket may hold a plateau with two ends a rounding apart: look at it more closely before closing in.
    t = lo[:, None] + (hi - lo)[:, None] * (np.arange(_FILL + 1).astype(Extended) / _FILL)
    f = scene.sdf(case[:, None], t)
    np.minimum.at(best, case, f.min(1))
    beside = np.pad(f, ((0, 0), (1, 1)), mode="edge")
    i, j = np.nonzero((f <= beside[:, :-2]) & (f <= beside[:, 2:]))
    _golden(scene, case[i], t[i, np.maximum(j - 1, 0)], t[i, np.minimum(j + 1, _FILL)], best)
    return np.asarray(best - scene.r)


class _Scene:
    """Axes and grooves of all cases in long doubles, in the groove's frame."""

    def __init__(self, cases: Cases) -> None:
        s = cases.shapes
        k = cases.shape
        self.R, self.a, self.L, self.r, length = (
            np.asarray(v[k], Extended) for v in (s.R, s.half_angle, s.L, s.r, s.length)
        )
        self.H, self.half = self.L / 2, length / 2
        self.sx, self.h = self.R * np.sin(self.a), -self.R * np.cos(self.a)
        c = np.asarray(cases.T_groove_wire[:, :3, 3], Extended)
        d = np.asarray(cases.T_groove_wire[:, :3, 2], Extended)
        self.c, self.d = c, unit_rows(d)
        self.lean = np.sqrt((self.d[:, :2] ** 2).sum(1))
        self.size = np.asarray(cases.scene(), Extended)

    def slope(self, i: NDArray[np.intp], t: NDArray[Any], f: NDArray[Any], width: NDArray[Any]) -> NDArray[Any]:
        """Largest slope of sdf (value f at t) along the axis within t +- width.

        1 anywhere; the axis' lean where sdf is that of the section: between the end faces, and nearer to the section's
        boundary than to them if inside the material.
        """
        outside = np.abs(self.c[i, 2] + t * self.d[i, 2]) - self.H[i] + 0.999999 * width * np.abs(self.d[i, 2])
        sideways = (outside < 0) & ((f > width) | (outside + width < f))
        return np.where(sideways, self.lean[i], 1)

    def sdf(self, i: NDArray[np.intp], t: NDArray[Any]) -> NDArray[Any]:
        """Signed distance of the axis points t (m,) of cases i (m,) from their grooves."""
        x, y, z = (self.c[i, k] + t * self.d[i, k] for k in range(3))
        return groove_distance(x, y, z, self.R[i], self.sx[i], self.h[i], self.H[i])


def _brackets(
    scene: _Scene, most: int, size: NDArray[Any]
) -> tuple[NDArray[np.intp], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Stretches (case, lo, hi) of the axes, each with one minimum, and the least sdf of each case that was seen.

    Outside of them sdf is more than 1e-6 of ``size`` above its least value, by the bound on its slope along the axis.
    No stretch is cut across an end face; ``most`` stretches of a case are as fine as it gets.
    """
    n, half, slack = len(scene.half), scene.half, Extended(1e-6) * size
    with np.errstate(all="ignore"):
        faces = [
            np.where(np.abs(t) < half, t, half)
            for t in ((w * scene.H - scene.c[:, 2]) / scene.d[:, 2] for w in (-1, 1))
        ]
    edges = np.sort(np.stack([-half, half, *faces], 1), axis=1)
    best = scene.sdf(np.arange(n)[:, None], edges).min(1)
    case, k = np.nonzero(edges[:, 1:] > edges[:, :-1])
    lo, hi = edges[case, k], edges[case, k + 1]
    kept = []
    for _ in range(80):
        middle, width = (lo + hi) / 2, (hi - lo) / 2
        f = scene.sdf(case, middle)
        np.minimum.at(best, case, f)
        drop = width * scene.slope(case, middle, f, width)
        keep = f - drop <= best[case] + slack[case] / 1000
        done = keep & ((drop <= slack[case]) | (np.bincount(case, minlength=n)[case] > most))
        kept.append((case[done], lo[done], hi[done]))
        more = keep & ~done
        if not more.any():
            break
        case = np.tile(case[more], 2)
        lo, hi = np.concatenate([lo[more], middle[more]]), np.concatenate([middle[more], hi[more]])
    case, lo, hi = (np.concatenate(column) for column in zip(*kept, strict=True))
    return *_joined(scene, case, lo, hi, slack), best


def _joined(scene: _Scene, case: Any, lo: Any, hi: Any, slack: Any) -> tuple[Any, Any, Any]:
    """Kept stretches put together where they touch, cut at inner local maxima, so that each holds one minimum."""
    order = np.lexsort((lo, case))
    case, lo, hi = case[order], lo[order], hi[order]
    f = np.round(scene.sdf(case, (lo + hi) / 2) / (slack[case] / 1000000))  # what differs by rounding only is level
    touch = (case[1:] == case[:-1]) & (np.abs(lo[1:] - hi[:-1]) <= 1e-9 * (hi[1:] - lo[1:]))
    start = np.flatnonzero(np.append(True, ~(touch & (f[1:] == f[:-1]))))  # runs of one level
    stop, g = np.append(start[1:], len(f)) - 1, f[start]
    linked = np.append(False, touch)[start]  # to the run before
    after, higher = np.append(linked[1:], False), np.append(False, g[1:] > g[:-1])
    lower = np.append(g[1:] < g[:-1], False)
    lowest = np.flatnonzero(~(linked & higher) & ~(after & lower))
    first, last = start[lowest - linked[lowest]], stop[lowest + after[lowest]]
    return case[first], lo[first], hi[last]


def _golden(scene: _Scene, i: Any, a: NDArray[Any], b: NDArray[Any], best: NDArray[Any]) -> None:
    """Lower ``best`` (n,) to the least sdf between a and b (m,) of cases i, each with one minimum there."""
    u, v = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
    fu, fv = scene.sdf(i, u), scene.sdf(i, v)
    for step in range(96):
        left = fu < fv
        b, a = np.where(left, v, b), np.where(left, a, u)
        new = np.where(left, b - _GOLDEN * (b - a), a + _GOLDEN * (b - a))
        f = scene.sdf(i, new)
        u, v = np.where(left, new, v), np.where(left, u, new)
        fu, fv = np.where(left, f, fv), np.where(left, fu, f)
        if step % 8 == 7:
            f = np.minimum(fu, fv)
            np.minimum.at(best, i, f)
            width = b - a  # what cannot reach below the lowest any more is left
            on = f - width * scene.slope(i, u, f, width) < best[i] - EXTENDED_ERROR / 64 * scene.size[i]
            i, a, b, u, v, fu, fv = i[on], a[on], b[on], u[on], v[on], fu[on], fv[on]


def truth_50_digits(cases: Cases, i: int) -> Any:
    """Signed distance of case i as an mpmath number: branch and bound in long doubles, golden section at 50 digits.

    It is good to 1e-32 of the shortest length. Raises MissingLibraryError without mpmath.
    """
    need("mpmath", "an answer of 50 digits")
    import mpmath

    mp = mpmath.mp.clone()
    mp.dps = 50
    k = int(cases.shape[i])
    s = cases.shapes
    R, a, L, r, length = (mp.mpf(float(v[k])) for v in (s.R, s.half_angle, s.L, s.r, s.length))
    T = cases.T_groove_wire[i]
    c, d = [mp.mpf(v) for v in T[:3, 3].tolist()], [mp.mpf(v) for v in T[:3, 2].tolist()]
    norm = mp.sqrt(mp.fsum(v * v for v in d))
    d = [v / norm for v in d]
    half = length / 2
    corner = mp.mpc(R * mp.cos(a), R * mp.sin(a))  # of the section, turned so that -y is real

    def sdf(t: Any) -> Any:
        x, y, z = (c[j] + t * d[j] for j in range(3))
        point = mp.mpc(-y, abs(x))
        to_lip = abs(point - corner)
        to_arc = abs(abs(point) - R) if mp.arg(point) <= a else to_lip
        to_ray = abs(point.real - corner.real) if point.imag >= corner.imag else to_lip
        g, e = min(to_arc, to_ray), abs(z) - L / 2
        if point.real >= corner.real and abs(point) >= R:
            g = -g
        return max(g, e) if g <= 0 and e <= 0 else mp.hypot(max(g, 0), max(e, 0))

    best = min(sdf(-half), sdf(half))
    goal = mp.mpf(10) ** -32 * min(half, R, L)  # a distance has slope 1: more digits than two floats can hold
    scene = _Scene(cases.take([i]))
    _, starts, stops, _ = _brackets(scene, _MOST, np.minimum(scene.size, scene.R))  # a long groove may be thin
    for lo, hi in zip(starts, stops, strict=True):
        p, q = max(mp.mpf(float(lo)), -half), min(mp.mpf(float(hi)), half)
        grid = [p + (q - p) * j / _FILL for j in range(_FILL + 1)]
        values = [sdf(t) for t in grid]
        best = min(best, *values)
        for j in range(_FILL + 1):
            before, after = max(j - 1, 0), min(j + 1, _FILL)
            if values[j] <= min(values[before], values[after]):
                best = min(best, _golden_50_digits(mp, sdf, grid[before], grid[after], goal, best))
    return best - r


def _golden_50_digits(mp: Any, f: Callable[[Any], Any], lo: Any, hi: Any, goal: Any, enough: Any) -> Any:
    """Least value of ``f`` seen by golden section from ``lo`` to ``hi`` down to a stretch of ``goal``.

    f has a slope up to 1: it ends too when f cannot get below ``enough`` any more.
    """
    tau = (mp.sqrt(5) - 1) / 2
    x, y = hi - tau * (hi - lo), lo + tau * (hi - lo)
    fx, fy = f(x), f(y)
    while hi - lo > goal and min(fx, fy) - (hi - lo) <= enough:
        if fx < fy:
            hi, y, fy = y, x, fx
            x = hi - tau * (hi - lo)
            fx = f(x)
        else:
            lo, x, fx = x, y, fy
            y = lo + tau * (hi - lo)
            fy = f(y)
    return min(fx, fy)
