"""The oracle: how deep two bodies share a point, how far they are apart, by branch and bound over boxes of points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.geometry.pose import Array
from clamp3d.testing.bodies import AnyBody, Body, body

_PROJECTIONS, _FOLLOWED = 8, 3
"""How often near points are projected to and fro between two bodies, and how many of them are followed to the end."""
_STRIDES, _ROUNDS = np.array([0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0]), 40
"""How much further than a projection leads is tried, for projections that creep, and how often at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Common:
    """The least of ``max(field_a, field_b)`` over all points lies between ``lower`` and ``upper``, mm.

    Negative: the bodies share a ball of that radius; positive: they are at least twice as far apart. ``points`` (k, 3)
    are the lowest that were looked at, the first has ``upper``. ``ended``: before the cells were used up.
    """

    lower: float
    upper: float
    points: Array
    ended: bool


def common(
    a: AnyBody, b: AnyBody, T_a_b: Array | None = None, *, accuracy: float = 0.01, cells: int = 100_000
) -> Common:
    """How deep two bodies share a point, or how far both are from the point nearest to both, by branch and bound.

    Parameters
    ----------
    a, b : Body or shape
    T_a_b : ndarray (4, 4), optional
        Pose of b in the frame of a.
    accuracy : float
        Width in mm at which the search ends.
    cells : int
        Number of boxes looked at after which it ends with what is proven.
    """
    x, y = body(a), body(b) if T_a_b is None else body(b).at(T_a_b)
    low, high = _region(x, y)
    centre, half = 0.5 * (low + high)[None], 0.5 * (high - low)
    best, floor, seen = math.inf, math.inf, 0
    kept, values = np.empty((0, 3)), np.empty(0)
    while len(centre):
        value = np.maximum(x.field(centre), y.field(centre))
        seen += len(centre)
        best = min(best, float(value.min()))
        radius = float(np.linalg.norm(half))
        order = np.argsort(np.concatenate([values, value]), kind="stable")[:64]
        kept, values = np.concatenate([kept, centre])[order], np.concatenate([values, value])[order]
        open_ = value - radius < best - accuracy
        if seen > cells:
            floor = float((value - radius).min(initial=math.inf, where=open_))
            break
        centre = centre[open_]
        k = int(np.argmax(half))
        half = np.where(np.arange(3) == k, 0.5 * half, half)
        shift = np.eye(3)[k] * half[k]
        centre = np.concatenate([centre - shift, centre + shift])
    return Common(min(floor, best - accuracy), best, kept, not len(centre))


def _region(x: Body, y: Body) -> tuple[Array, Array]:
    """A box with every point that can be the nearest to both; of a body without end only what is near the other."""
    boxes = [x.box, y.box]
    for k, (one, other) in enumerate(((x, y), (y, x))):
        if not np.isfinite(one.box).all():
            middle, reach = other.box.mean(axis=0), float(np.linalg.norm(0.5 * np.diff(other.box, axis=0)))
            reach += max(0.0, float(one.field(middle[None])[0]))
            boxes[k] = np.array([other.box[0] - reach, other.box[1] + reach])
    return np.minimum(boxes[0][0], boxes[1][0]), np.maximum(boxes[0][1], boxes[1][1])


def separation(
    a: AnyBody, b: AnyBody, T_a_b: Array | None = None, *, accuracy: float = 0.01, cells: int = 20_000
) -> Distance:
    """Distance of two bodies, 0 where they meet: ``lower`` proven by `common`, ``upper`` by points of both.

    The points are found by descent from the lowest ones of the search: perhaps not the nearest ones, but real ones.
    """
    x, y = body(a), body(b) if T_a_b is None else body(b).at(T_a_b)
    return nearest(x, y, common(x, y, accuracy=0.5 * accuracy, cells=cells))


def nearest(x: Body, y: Body, shared: Common) -> Distance:
    """`separation` from what `common` gave as ``shared``."""
    if shared.upper <= 0.0:
        return Distance(0.0, 0.0, shared.points[0], shared.points[0])
    q = shared.points
    for _ in range(_PROJECTIONS):
        p = _onto(x, q)
        q = _onto(y, p)
        gaps = np.linalg.norm(q - p, axis=1)
        q = q[np.argsort(gaps)[: max(_FOLLOWED, len(q) // 2)]]
    best, quiet = np.full(len(q), math.inf), 0
    for _ in range(_ROUNDS):
        on = _onto(y, _onto(x, q))
        p, trials, gaps = _projected(x, y, (on[:, None] + _STRIDES[:, None] * (on - q)[:, None]).reshape(-1, 3))
        row, least = np.arange(len(q)), gaps.reshape(len(q), -1).argmin(axis=1)
        q, gaps = trials.reshape(len(q), -1, 3)[row, least], gaps.reshape(len(q), -1)[row, least]
        quiet = 0 if (gaps < best - 1e-11).any() else quiet + 1
        if quiet == 2:
            break
        best = np.minimum(best, gaps)
    p, q, gaps = _projected(x, y, q)
    k = int(np.argmin(gaps))
    return Distance(max(0.0, 2.0 * shared.lower), float(gaps[k]), p[k], q[k], method="branch and bound")


def _projected(x: Body, y: Body, points: Array) -> tuple[Array, Array, Array]:
    """Points (n, 3) moved onto x, from there onto y, and how far apart that shows the bodies to be at most (n,)."""
    p = _onto(x, points)
    q = _onto(y, p)
    # What the last projection has left outside is added: from there the bodies are no further.
    outside = np.maximum(x.field(p), 0.0) + np.maximum(y.field(q), 0.0)
    return p, q, np.where(outside <= 1e-9 * (1.0 + np.abs(p).max()), np.linalg.norm(q - p, axis=1) + outside, np.inf)


def _slope(it: Body, x: Array) -> Array:
    """Slopes (n, 3) of the field at points (n, 3), by differences."""
    step = 1e-6 * np.concatenate([np.eye(3), -np.eye(3)])
    values = it.field((x[None] + step[:, None]).reshape(-1, 3)).reshape(6, len(x))
    return np.asarray((values[:3] - values[3:]).T / 2e-6)


def _onto(it: Body, x: Array) -> Array:
    """Points (n, 3) moved down the field until they are on the body."""
    for _ in range(6):
        out = it.field(x)
        far = np.flatnonzero(out > 1e-14 * (1.0 + np.abs(x).max()))  # less is rounding
        if not len(far):
            break
        x = x.copy()
        x[far] -= out[far, None] * _slope(it, x[far])
    return x
