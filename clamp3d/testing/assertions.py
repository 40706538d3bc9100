"""What every answer promises, as assertions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.motions import MotionDistance
from clamp3d.fit.features import FittedSurface
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array
from clamp3d.testing.bodies import AnyBody, Body, body
from clamp3d.testing.search import Common, common, nearest

_WAYS = 8
"""Directions in which bodies are moved to see whether less than their depth parts them."""


def directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over the sphere (Fibonacci)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    return np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])


def assert_distance(
    answer: Distance,
    a: AnyBody,
    b: AnyBody,
    T_a_b: Array | None = None,
    *,
    tolerance: float = 1e-6,
    cells: int = 20_000,
) -> None:
    """``lower <= true signed distance <= upper``, and the points and the normal are what they are said to be.

    Apart: no two points of the bodies are nearer than ``lower``; the named points lie on the bodies and are ``upper``
    apart. In an overlap: no translation shorter than ``-upper`` parts the bodies, one by ``-lower`` along the normal
    does. Moving by the distance along the normal makes them touch.

    Parameters
    ----------
    answer : Distance
        The answer, points in the frame of a.
    a, b, T_a_b
        As for `common`.
    tolerance : float
        What the answer may be wrong by, mm.
    cells : int
        Work of one search.
    """
    x, y = body(a), body(b) if T_a_b is None else body(b).at(T_a_b)
    assert answer.lower <= answer.upper + tolerance, f"bounds are crossed: {answer.lower} > {answer.upper}"
    p, q, n = answer.point_a, answer.point_b, answer.normal
    if p is not None and q is not None and answer.upper < math.inf:
        for name, it, point in (("a", x, p), ("b", y, q)):
            out = float(it.field(point[None])[0])
            assert out <= tolerance, f"point on {name} is {out:.3g} mm outside"
        if answer.upper >= 0.0:
            assert np.linalg.norm(q - p) <= answer.upper + tolerance, "the points are further apart than upper"
    shared = _shared(x, y, cells)
    truth = nearest(x, y, shared)
    if truth.upper > 0.0:
        assert answer.lower <= truth.upper + tolerance, f"lower {answer.lower} > attained {truth.upper}"
        # Zero is what the search begins with: it proves nothing of a shallow overlap.
        assert truth.lower <= max(answer.upper + tolerance, 0.0), f"upper {answer.upper} < proven {truth.lower}"
    else:
        deep = _deepest(x, y, shared, cells)
        assert answer.lower <= 2.0 * deep + tolerance, f"lower {answer.lower}, but they share a ball of {-deep} mm"
    if answer.upper < -tolerance:
        ways = directions(_WAYS) if n is None else np.vstack([n, directions(_WAYS)])
        for way in ways:
            kept = common(x, _moved(y, -0.999 * answer.upper * way), cells=cells // 10)
            assert kept.lower <= 0.0, f"parted by less than {-answer.upper} mm along {way}"
    if n is not None and math.isfinite(answer.lower):
        assert abs(float(np.linalg.norm(n)) - 1.0) <= 1e-9, "the normal is no unit vector"
        closed = common(x, _moved(y, -answer.lower * n), cells=cells).upper
        assert closed >= -0.5 * tolerance, f"moved by {-answer.lower} along the normal they overlap by {-2.0 * closed}"


def _shared(x: Body, y: Body, cells: int) -> Common:
    """The search of `separation`."""
    return common(x, y, accuracy=0.005, cells=cells)


def _deepest(x: Body, y: Body, answer: Common, cells: int) -> float:
    """The least field found in both: where a search has not ended a coarser one, which comes further, looks again."""
    return answer.upper if answer.ended else min(answer.upper, common(x, y, cells=cells).upper)


def _moved(it: Body, by: Array) -> Body:
    T = np.eye(4)
    T[:3, 3] = by
    return it.at(T)


def pose_at(motion: Motion, t: float, start: Array) -> Array:
    """Pose (4, 4) at time t of a body that stands at ``start`` (4, 4): the exponential of the motion's twist."""
    from scipy.linalg import expm

    u = motion.angle * motion.axis
    twist = np.zeros((4, 4))
    twist[:3, :3] = [[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]]
    turn = expm(t * twist)
    T = np.asarray(turn @ start)
    T[:3, 3] += motion.point - turn[:3, :3] @ motion.point + t * motion.travel
    return T


def assert_lower_on_way(
    lower: float, a: AnyBody, b: AnyBody, poses: Iterable[Array], *, tolerance: float = 1e-6, cells: int = 5_000
) -> None:
    """At none of the ``poses`` (4, 4) of b two points are nearer than ``lower`` mm, nor do the bodies overlap more."""
    if lower == -math.inf:
        return
    x, y = body(a), body(b)
    for k, T in enumerate(poses):
        placed = y.at(T)
        shared = _shared(x, placed, cells)
        apart = nearest(x, placed, shared).upper
        value = apart if apart > 0.0 else 2.0 * _deepest(x, placed, shared, cells)
        assert lower <= value + tolerance, f"lower {lower} on the way, but {value} at pose {k}"


def assert_motion(
    answer: MotionDistance,
    a: AnyBody,
    b: AnyBody,
    motion: Motion,
    T_a_b: Array,
    *,
    first: bool = False,
    times: int = 17,
    tolerance: float = 1e-6,
    cells: int = 5_000,
) -> None:
    """No time has a distance below the least one; with ``first``: none before the first contact has an overlap.

    Parameters
    ----------
    answer : MotionDistance
        What `min_clearance` or, with ``first``, `first_contact` (margin 0) said.
    a, b, motion, T_a_b
        What it was asked: b moves from its pose ``T_a_b`` (4, 4) in the frame of a.
    times : int
        Number of even times that are looked at.
    tolerance, cells
        As for `assert_distance`.
    """
    apart = np.abs(answer.pose - pose_at(motion, answer.t, T_a_b)).max()
    assert apart <= 1e-9 * (1.0 + np.abs(answer.pose).max()), f"the pose is not that of t = {answer.t}"
    until = answer.t if first and answer.touches else 1.0
    poses = [pose_at(motion, t, T_a_b) for t in np.linspace(0.0, until, times) if t < until or until == 1.0]
    if first and answer.touches:
        assert_lower_on_way(0.0, a, b, poses, tolerance=max(tolerance, answer.resolution), cells=cells)
    else:
        assert not (answer.touches and answer.distance.lower > tolerance), f"touches at {answer.distance.lower} mm"
        assert answer.touches or answer.distance.upper > -tolerance, f"touches nowhere, at {answer.distance.upper} mm"
        assert_lower_on_way(answer.distance.lower, a, b, poses, tolerance=tolerance, cells=cells)
        assert_distance(replace(answer.distance, lower=-math.inf), a, b, answer.pose, tolerance=tolerance, cells=cells)


def assert_fit(feature: FittedSurface, points: Array, *, assumed_round: bool = False) -> None:
    """Points (n, 3) of the true surface, between the feature's ends, lie within its stated error of the fitted one."""
    local = (points - feature.T_part_feature[:3, 3]) @ feature.T_part_feature[:3, :3]
    off = float(np.abs(np.hypot(local[:, 0], local[:, 1]) - feature.radius).max())
    error = feature.fit_error if assumed_round else feature.error_bound
    assert off <= error + 1e-12 * feature.radius, f"{feature.name}: {off} mm off, stated {error} mm"


def assert_pieces(whole: AnyBody, pieces: Iterable[AnyBody], *, outside: float, count: int = 20_000) -> None:
    """The pieces of a decomposition cover the body and stand out by ``outside`` mm at most, at ``count`` points."""
    it, parts = body(whole), [body(piece) for piece in pieces]
    low, high = np.min([p.box[0] for p in [it, *parts]], axis=0), np.max([p.box[1] for p in [it, *parts]], axis=0)
    from scipy.stats import qmc

    x = qmc.scale(qmc.Halton(3, seed=0).random(count), low, high)
    own, covered = it.field(x), np.min([p.field(x) for p in parts], axis=0)
    missing = (own < 0.0) & (covered > 1e-9)
    assert not missing.any(), f"{x[missing][0]} is in the body and in no piece"
    out = float(np.max(own, where=covered < 0.0, initial=-math.inf))
    assert out <= outside + 1e-9, f"a piece stands out by {out} mm"


def assert_returns(
    solve: Callable[[Array], Array], state: Array, neighbours: Iterable[Array], tolerance: float
) -> None:
    """An equilibrium solved again from its ``neighbours`` is the same to ``tolerance``; ``solve(start)`` -> state."""
    for start in neighbours:
        off = float(np.abs(solve(start) - state).max())
        assert off <= tolerance, f"from {start} it ends {off} away"
