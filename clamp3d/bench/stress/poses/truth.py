"""The truth of a case, found without the kernel: least signed distance of a moving point from the groove.

Definition: ``min over |t| <= length/2 of sdf(c + t d) - r``, where ``sdf`` is the signed distance of a point from the
groove's solid. Here ``sdf`` is put together from the boundary pieces of the section (arc, two rays) and the prism
rule, and the minimum is searched for: samples between all places where the axis changes sides, then golden section.

- `truth`: all cases at once in 80-bit floats (64-bit mantissa: about 2000 times finer than float64).
- `truth_50_digits`: one case with mpmath at 50 digits; the search is branch and bound with the proven slope bound of
  ``sdf`` along the axis, so no minimum deeper than 1e-6 of the scene can hide.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.digits import fifty_digits, golden, point_distance
from clamp3d.bench.stress.poses.cases import Cases, Extended

EXTENDED_WORKS = bool(np.finfo(Extended).eps < 1e-18)
"""Whether the platform's long double is wide enough for `truth`; if not, it calls `truth_50_digits` case by case."""

EXTENDED_ERROR = 64.0 * float(np.finfo(Extended).eps)
"""Error of `truth` in parts of the scene's size."""

_GOLDEN = (np.sqrt(Extended(5)) - 1) / 2
_FILL = 8
_MANY = 20_000
"""Stretches at once at which branch and bound stops cutting: a plateau, all of it within rounding of the least."""


def truth(cases: Cases) -> NDArray[Any]:
    """Signed distances (n,) as long doubles, good to `EXTENDED_ERROR` of each scene."""
    if not EXTENDED_WORKS:
        return np.array([float(truth_50_digits(cases, i)) for i in range(len(cases))], Extended)
    scene = _Scene(cases)
    rows = np.arange(len(cases))
    t = _samples(scene)
    f = np.stack([scene.sdf(rows, t[:, j]) for j in range(t.shape[1])], 1)
    low = _Lowest(f.min(1), t[rows, f.argmin(1)])
    case, lo, hi = _brackets(scene, rows, t, f, low.f)
    # Once more within each: two minima can lie between neighbouring samples.
    w = np.arange(_FILL * 2 + 1).astype(Extended) / (_FILL * 2)
    t = lo[:, None] + w * (hi - lo)[:, None]
    f = np.stack([scene.sdf(case, t[:, j]) for j in range(t.shape[1])], 1)
    low.take(case, t[np.arange(len(t)), f.argmin(1)], f.min(1))
    case, lo, hi = _brackets(scene, case, t, f, low.f)
    _golden(scene, case, lo, hi, low)
    # Samples closer than their rounding can hide which side falls: look both ways from the lowest, near and far.
    steps = np.concatenate([[0], 0.5 ** np.arange(1, 60, dtype=Extended)])
    steps = np.concatenate([-steps[1:], steps])
    for _ in range(20):
        span = 2 * scene.half[rows]
        t = np.clip(low.t[rows, None] + span[:, None] * steps, -scene.half[rows, None], scene.half[rows, None])
        f = np.stack([scene.sdf(rows, t[:, j]) for j in range(t.shape[1])], 1)
        j = f.argmin(1)
        here, there = t[np.arange(len(t)), j], f[np.arange(len(t)), j]
        better = there < low.f[rows] - EXTENDED_ERROR / 16 * scene.size[rows]
        rows, here, there = rows[better], here[better], there[better]
        if not len(rows):
            break
        step = 3 * np.abs(here - low.t[rows])
        low.take(rows, here, there)
        _golden(scene, rows, np.maximum(here - step, -scene.half[rows]), np.minimum(here + step, scene.half[rows]), low)
    return np.asarray(low.f - scene.r)


class _Lowest:
    """Lowest sdf of each case so far, and where."""

    def __init__(self, f: NDArray[Any], t: NDArray[Any]) -> None:
        self.f, self.t = f, t

    def take(self, case: Any, t: NDArray[Any], f: NDArray[Any]) -> None:
        order = np.argsort(-f, kind="stable")  # of several for one case the last assigned is the lowest
        case, t, f = case[order], t[order], f[order]
        better = f < self.f[case]
        self.f[case[better]], self.t[case[better]] = f[better], t[better]


def _brackets(scene: _Scene, case: Any, t: NDArray[Any], f: NDArray[Any], best: NDArray[Any]) -> tuple[Any, Any, Any]:
    """Stretches (case, lo, hi) around samples no higher than their neighbours that could reach below the best.

    Samples that rounding alone tells apart are level; of a level run only the two ends are looked at.
    """
    grain = EXTENDED_ERROR / 16 * scene.size[case][:, None]
    f = np.round(f / grain) * grain
    left = np.concatenate([f[:, :1], f[:, :-1]], 1)
    right = np.concatenate([f[:, 1:], f[:, -1:]], 1)
    lower, upper = np.concatenate([t[:, :1], t[:, :-1]], 1), np.concatenate([t[:, 1:], t[:, -1:]], 1)
    i, j = np.nonzero((f <= left) & (f <= right) & ((f < left) | (f < right) | _first_or_last(f)) & (upper > lower))
    lo, hi, middle = lower[i, j], upper[i, j], f[i, j]
    width = np.maximum(hi - t[i, j], t[i, j] - lo)
    reach = middle - width * scene.slope(case[i], t[i, j], middle, width)
    near = reach < best[case[i]] - EXTENDED_ERROR / 64 * scene.size[case[i]]
    return case[i[near]], lo[near], hi[near]


def _first_or_last(f: NDArray[Any]) -> NDArray[np.bool_]:
    mask = np.zeros(f.shape, bool)
    mask[:, [0, -1]] = True
    return mask


class _Scene:
    """Axes and grooves of all cases in long doubles, in the groove's frame."""

    def __init__(self, cases: Cases) -> None:
        s = cases.shapes
        k = cases.shape
        self.R, self.a, self.L, self.r, length = (
            np.asarray(v, Extended)[k] for v in (s.R, s.half_angle, s.L, s.r, s.length)
        )
        self.H, self.half = self.L / 2, length / 2
        self.sx, self.h = self.R * np.sin(self.a), -self.R * np.cos(self.a)
        c = np.asarray(cases.T_world_wire[:, :3, 3], Extended)
        d = np.asarray(cases.T_world_wire[:, :3, 2], Extended)
        if cases.T_world_groove is not None:
            T = np.asarray(cases.T_world_groove, Extended)
            c = np.einsum("nij,ni->nj", T[:, :3, :3], c - T[:, :3, 3])
            d = np.einsum("nij,ni->nj", T[:, :3, :3], d)
        self.c, self.d = c, d / np.sqrt((d * d).sum(1))[:, None]
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
        R, h, sx = self.R[i], self.h[i], self.sx[i]
        x = np.abs(x)
        # Squares neither overflow nor vanish in the exponents of a long double.
        rho = np.sqrt(x * x + y * y)
        lip = np.sqrt((x - sx) ** 2 + (y - h) ** 2)
        arc = np.where(x * -h + y * sx <= 0, np.abs(R - rho), lip)
        ray = np.where(x >= sx, np.abs(y - h), lip)
        inside = (y <= h) & (rho >= R)
        g = np.where(inside, -1.0, 1.0) * np.minimum(arc, ray)
        e = np.abs(z) - self.H[i]
        outside = np.sqrt(np.maximum(g, 0) ** 2 + np.maximum(e, 0) ** 2)
        return np.asarray(np.where((g <= 0) & (e <= 0), np.maximum(g, e), outside))


def _samples(s: _Scene) -> NDArray[Any]:
    """Places on each axis (n, m), sorted: ends, where it changes sides or comes nearest to something, and between."""
    with np.errstate(all="ignore"):
        cx, cy, cz = s.c.T
        dx, dy, dz = s.d.T
        e2 = dx * dx + dy * dy
        t = [-s.half, s.half, 0 * s.half]
        t += [(w * s.H - cz) / dz for w in (-1, 1)] + [(s.h - cy) / dy, -cx / dx, -cy / dy]
        t += [(w * s.sx - cx) / dx for w in (-1, 1)]
        t += [-(cx * dx + cy * dy) / e2]  # nearest to the groove's axis
        t += [-((cx - w * s.sx) * dx + (cy - s.h) * dy) / e2 for w in (-1, 1)]  # nearest to the lips
        yz = dy * dy + dz * dz
        t += [-((cy - s.h) * dy + (cz - w * s.H) * dz) / yz for w in (-1, 1)]  # nearest to the end edges
        t += [
            -((cx - u * s.sx) * dx + (cy - s.h) * dy + (cz - w * s.H) * dz) for u in (-1, 1) for w in (-1, 1)
        ]  # nearest to the corners
        half = (cx * dx + cy * dy) / e2
        root = np.sqrt(np.maximum(half * half - (cx * cx + cy * cy - s.R * s.R) / e2, 0))
        t += [-half - root, -half + root]  # through the arc's surface
    places = np.stack(t, 1)
    places = np.where(np.isfinite(places), places, 0)
    places = np.sort(np.clip(places, -s.half[:, None], s.half[:, None]), axis=1)
    w = np.arange(_FILL).astype(Extended) / _FILL
    between = places[:, :-1, None] + w * (places[:, 1:, None] - places[:, :-1, None])
    return np.concatenate([between.reshape(len(places), -1), places[:, -1:]], 1)


def _golden(scene: _Scene, i: Any, a: NDArray[Any], b: NDArray[Any], low: _Lowest) -> None:
    """Lower ``low`` to the least sdf between a and b (m,) of cases i, each with one minimum there."""
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
            low.take(i, np.where(fu < fv, u, v), f)
            width = b - a  # what cannot reach below the lowest any more is left
            on = f - width * scene.slope(i, u, f, width) < low.f[i] - EXTENDED_ERROR / 64 * scene.size[i]
            i, a, b, u, v, fu, fv = i[on], a[on], b[on], u[on], v[on], fu[on], fv[on]


def truth_50_digits(cases: Cases, i: int) -> Any:
    """Signed distance of case i as an mpmath number: branch and bound in float64, then golden section at 50 digits.

    Raises MissingLibraryError without mpmath.
    """
    mp = fifty_digits()
    k = int(cases.shape[i])
    s = cases.shapes
    R, a, L, r, length = (mp.mpf(float(v[k])) for v in (s.R, s.half_angle, s.L, s.r, s.length))
    T = cases.T_world_wire[i]
    c, d = [mp.mpf(v) for v in T[:3, 3].tolist()], [mp.mpf(v) for v in T[:3, 2].tolist()]
    if cases.T_world_groove is not None:
        G = cases.T_world_groove[i]
        w = [c[j] - mp.mpf(float(G[j, 3])) for j in range(3)]
        c = [mp.fsum(mp.mpf(float(G[m, j])) * w[m] for m in range(3)) for j in range(3)]
        d = [mp.fsum(mp.mpf(float(G[m, j])) * d[m] for m in range(3)) for j in range(3)]
    norm = mp.sqrt(mp.fsum(v * v for v in d))
    d = [v / norm for v in d]
    half = length / 2
    point = point_distance(mp, R, a, L)

    def sdf(t: Any) -> Any:
        return point([c[j] + t * d[j] for j in range(3)])

    best = min(sdf(-half), sdf(half))
    goal = mp.mpf(10) ** -45 * (half + 1)
    for lo, hi in _branch_and_bound(cases, i):
        # A bracket may hold a plateau with two ends a rounding apart: look at it at 50 digits before closing in.
        p, q = max(mp.mpf(lo), -half), min(mp.mpf(hi), half)
        grid = [p + (q - p) * j / 16 for j in range(17)]
        values = [sdf(t) for t in grid]
        best = min(best, *values)
        for j in range(17):
            before, after = max(j - 1, 0), min(j + 1, 16)
            if values[j] <= min(values[before], values[after]):
                best = min(best, golden(mp, sdf, grid[before], grid[after], goal, enough=best))
    return best - r


def _branch_and_bound(cases: Cases, i: int) -> list[tuple[float, float]]:
    """Stretches of the axis outside of which sdf is more than 1e-6 of the scene above its least value, in float64.

    By the bound on sdf's slope along the axis (`_Scene.slope`); no stretch is cut across an end face.
    """
    one = cases.take([i])
    scene = _Scene(one)
    half, H = float(scene.half[0]), float(scene.H[0])
    cz, dz = float(scene.c[0, 2]), float(scene.d[0, 2])
    slack = 1e-6 * float(one.scene()[0])
    cuts = [-half, half] + ([t for t in ((-H - cz) / dz, (H - cz) / dz) if abs(t) < half] if dz else [])
    edges = np.unique(cuts)
    lo, hi = edges[:-1], edges[1:]
    best, kept_lo, kept_hi = math.inf, [], []

    def sdf(t: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(scene.sdf(np.zeros(len(t), np.intp), t.astype(Extended)), np.float64)

    best = float(sdf(edges).min())
    for _ in range(80):
        middle, width = 0.5 * (lo + hi), 0.5 * (hi - lo)
        f = sdf(middle)
        best = min(best, float(f.min(initial=best)))
        slope = np.asarray(scene.slope(np.zeros(len(f), np.intp), middle, f, width), np.float64)
        keep = f - width * slope <= best + 1e-3 * slack
        done = keep & ((width * slope <= slack) | (len(f) > _MANY))
        kept_lo.append(lo[done])
        kept_hi.append(hi[done])
        more = keep & ~done
        if not more.any():
            break
        cuts_lo, cuts_mid, cuts_hi = lo[more], middle[more], hi[more]
        lo, hi = np.concatenate([cuts_lo, cuts_mid]), np.concatenate([cuts_mid, cuts_hi])
    a, b = np.concatenate(kept_lo), np.concatenate(kept_hi)
    return _joined(a, b, sdf, slack)


def _joined(a: Any, b: Any, sdf: Any, slack: float) -> list[tuple[float, float]]:
    """Kept stretches put together where they touch, cut at inner local maxima, so that each holds one minimum."""
    order = np.argsort(a)
    a, b = a[order], b[order]
    f = np.round(sdf(0.5 * (a + b)) / (1e-6 * slack))  # what differs by rounding only is level
    joined = np.concatenate([[False], np.abs(a[1:] - b[:-1]) <= 1e-9 * (b[1:] - a[1:])])
    level = joined & np.concatenate([[False], f[1:] == f[:-1]])
    start = np.flatnonzero(~level)  # runs of one level
    stop = np.concatenate([start[1:], [len(a)]]) - 1
    g = f[start]
    brackets = []
    for k in range(len(start)):
        before = k > 0 and joined[start[k]]
        after = k + 1 < len(start) and joined[start[k + 1]]
        if (before and g[k - 1] < g[k]) or (after and g[k + 1] < g[k]):
            continue
        lo = a[start[k - 1]] if before else a[start[k]]
        hi = b[stop[k + 1]] if after else b[stop[k]]
        brackets.append((float(lo), float(hi)))
    return brackets
