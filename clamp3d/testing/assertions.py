"""What every answer promises, as assertions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.motions import MotionDistance
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, translation
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
    shared = common(x, y, accuracy=0.005, cells=cells)
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
            kept = common(x, y.at(translation(*(-0.999 * answer.upper * way))), cells=cells // 10)
            assert kept.lower <= 0.0, f"parted by less than {-answer.upper} mm along {way}"
    if n is not None and math.isfinite(answer.lower):
        assert abs(float(np.linalg.norm(n)) - 1.0) <= 1e-9, "the normal is no unit vector"
        closed = common(x, y.at(translation(*(-answer.lower * n))), cells=cells).upper
        assert closed >= -0.5 * tolerance, f"moved by {-answer.lower} along the normal they overlap by {-2.0 * closed}"


def _deepest(x: Body, y: Body, answer: Common, cells: int) -> float:
    """The least field found in both: where a search has not ended a coarser one, which comes further, looks again."""
    return answer.upper if answer.ended else min(answer.upper, common(x, y, cells=cells).upper)


def pose_at(motion: Motion, t: float, start: Array) -> Array:
    """Pose (4, 4) at time t of a body that stands at ``start`` (4, 4): by SciPy's rotation."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(t * motion.angle * motion.axis).as_matrix()
    T = np.eye(4)
    T[:3, :3] = turn @ start[:3, :3]
    T[:3, 3] = motion.point + turn @ (start[:3, 3] - motion.point) + t * motion.travel
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
        shared = common(x, placed, accuracy=0.005, cells=cells)
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
