"""The truth of a motion, found without the kernel: least signed distance of a swept axis, by brute force.

Definition: ``min over 0 <= s <= 1 and |t| <= length / 2 of sdf(c(s) + t d(s)) - r``. A search in (s, t) by the slope of
``sdf`` (`search`) finds the low places; from each, and from the instants that the case was built for or that anybody
claims to be lowest, golden section goes down. The value is one that the motion takes, so it is never too low; and as it
is no higher than at any place named by a method or by the construction, a method cannot be lower and right. Done twice:
the second time with the motion written anew from the lowest instant, in long doubles: a far start costs no digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.bench.stress.digits import fifty_digits, golden, point_distance
from clamp3d.bench.stress.motions.cases import Motions, turned
from clamp3d.bench.stress.poses.cases import unit_rows
from clamp3d.core.pose import Array

TRUTH_ERROR = 2e-13
"""Largest error of a truth in parts of the scene."""

_CELLS = 1000


@dataclass(frozen=True, slots=True)
class Least:
    """Least signed distance (n,) mm, the ``instant`` (n,) of it and the place ``along`` (n,) mm on the axis.

    By the slope of the distance alone no instant is lower by more than ``slack`` (n,) mm.
    """

    distance: Array
    instant: Array
    along: Array
    slack: Array


def truth(cases: Motions, until: Array | None = None, hints: Array | None = None, cells: int = _CELLS) -> Least:
    """Least signed distances; ``until`` (n,) ends the motions early, ``hints`` (n, k) are instants to go down from."""
    from clamp3d.bench.stress.motions.search import least_of

    n = len(cases)
    s, k = cases.shapes, cases.shape
    shapes = np.ascontiguousarray(np.stack([s.R, s.half_angle, 0.5 * s.L, 0.5 * s.length], 1)[k])
    size = s.size()[k]
    end = np.ones(n) if until is None else np.asarray(until, float)
    built = np.where(np.isfinite(cases.instant), cases.instant, -1.0)[:, None]
    first = np.ascontiguousarray(built if hints is None else np.concatenate([built, hints], 1))
    _, base, _, slack = least_of(shapes, _numbers(cases, np.zeros(n)), np.zeros(n), end, first, size, cells).T
    # From the lowest place of all once more, to the last digit.
    value, instant, along, _ = least_of(shapes, _numbers(cases, base), -base, end - base, np.zeros((n, 1)), size, 1).T
    return Least(value - s.r[k], base + instant, along, slack)


def _numbers(cases: Motions, base: Array) -> Array:
    """Motions (n, 16) that start at instants ``base``: centre, direction, point, axis, travel (3 each), angle."""
    wide = np.longdouble
    c, d = cases.start[:, :3, 3].astype(wide), unit_rows(cases.start[:, :3, 2])
    u, p, v = cases.unit_axis(), cases.point.astype(wide), cases.vector()
    b = base.astype(wide)[:, None]
    theta = b[:, 0] * cases.angle.astype(wide)
    c = np.where(theta[:, None] == 0, c, p + turned(c - p, u, theta)) + b * v
    d = turned(d, u, theta)
    # The axis' point nearest to the wire: a point far away on the axis would cost digits.
    p = p + u * ((c - p) * u).sum(1)[:, None]
    return np.ascontiguousarray(np.concatenate([c, d, p, u, v, cases.angle[:, None]], 1), dtype=np.float64)


def truth_50_digits(cases: Motions, i: int, found: Least) -> Any:
    """Least signed distance of case i as an mpmath number: golden section in golden section about ``found`` (of i).

    It answers for the value of a minimum that is there, not for its being the lowest.
    Raises MissingLibraryError without mpmath.
    """
    mp = fifty_digits()
    k = int(cases.shape[i])
    s = cases.shapes
    R, a, L, r, length = (mp.mpf(float(v[k])) for v in (s.R, s.half_angle, s.L, s.r, s.length))
    half, sdf = length / 2, point_distance(mp, R, a, L)

    def vector(values: Array) -> Any:
        return [mp.mpf(float(v)) for v in values]

    def unit(w: Any) -> Any:
        norm = mp.sqrt(mp.fsum(v * v for v in w))
        return [v / norm for v in w]

    c, d = vector(cases.start[i, :3, 3]), unit(vector(cases.start[i, :3, 2]))
    p, u, angle = vector(cases.point[i]), unit(vector(cases.axis[i])), mp.mpf(float(cases.angle[i]))
    travel = vector(cases.travel[i])
    v = [travel[0] * w for w in u] if angle else travel

    def turned(w: Any, theta: Any) -> Any:
        """By the matrix of a rotation, entry by entry."""
        cos, sin = mp.cos(theta), mp.sin(theta)
        out = []
        for row in range(3):
            one, two = (row + 1) % 3, (row + 2) % 3
            out.append(
                (cos + u[row] ** 2 * (1 - cos)) * w[row]
                + (u[row] * u[one] * (1 - cos) - u[two] * sin) * w[one]
                + (u[row] * u[two] * (1 - cos) + u[one] * sin) * w[two]
            )
        return out

    def least(f: Any, lo: Any, hi: Any, goal: Any) -> Any:
        return min(f(lo), f(hi), golden(mp, f, lo, hi, goal))

    def at(s: Any) -> Any:
        if angle:
            turn = turned([c[j] - p[j] for j in range(3)], s * angle)
            centre = [p[j] + turn[j] + s * v[j] for j in range(3)]
            way = turned(d, s * angle)
        else:
            centre, way = [c[j] + s * v[j] for j in range(3)], d
        lo, hi = max(-half, t0 - span), min(half, t0 + span)
        return least(lambda t: sdf([centre[j] + t * way[j] for j in range(3)]), lo, hi, span * mp.mpf(10) ** -12)

    t0, s0 = mp.mpf(float(found.along[i])), mp.mpf(float(found.instant[i]))
    scene = float(cases.scene()[i])
    speed = abs(float(cases.angle[i])) * scene + float(np.abs(cases.travel[i]).max())
    span = mp.mpf(1e-5 * float(cases.shapes.size()[k]))
    around = span / mp.mpf(speed) if speed else mp.mpf(0)
    lo, hi = max(mp.mpf(0), s0 - around), min(mp.mpf(1), s0 + around)
    return (least(at, lo, hi, around * mp.mpf(10) ** -12) if hi > lo else at(lo)) - r
