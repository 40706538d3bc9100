"""Contact along a motion: first instant of contact, and least clearance, independent of any step count."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from clamp3d.checks import array, number, positive
from clamp3d.core.distance import SignedDistance, signed_distance
from clamp3d.core.pose import Array, check_pose, rotation
from clamp3d.core.pose import unit as unit_vector
from clamp3d.core.primitives import LARGEST, Cylinder, SweptArc, check_shapes, place
from clamp3d.errors import InputError, SolverError

RESOLUTION = 1e-12
"""Default resolution of a search, in parts of the largest length of the scene."""

_FARTHEST = 1e6
_NEAR, _FEW = 1e-4, 400
"""Instants around the lowest, and cells, within which it is followed down to the rounding."""

_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)

_FARTHEST = 1e6


def _vector(name: str, value: ArrayLike, *, unit: bool = False) -> Array:
    v = array(name, value, (3,))
    if unit:
        return unit_vector(v, name)
    if not np.abs(v).max() <= LARGEST:
        raise InputError(f"{name} must be three lengths up to {LARGEST:g} mm, got {v.tolist()}")
    return v.copy()


@dataclass(frozen=True, slots=True, eq=False)
class Screw:
    """Motion of a cylinder: turn by ``angle`` rad about an axis and travel ``travel`` mm along it, at constant rates.

    ``start`` (4, 4) is ``T_groove_cylinder`` at instant 0; the axis goes through ``point`` (3,) along ``axis`` (3,), in
    the groove's frame. Instants run from 0 to 1. Raises InputError for values that are not finite, or a zero axis.
    """

    start: Array
    point: Array
    axis: Array
    angle: float
    travel: float = 0.0
    _vector: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        start = check_pose(self.start, "start").copy()
        _vector("start's offset", start[:3, 3])
        _set(self, start=start, point=_vector("point", self.point))
        _set(self, axis=_vector("axis", self.axis, unit=True))
        _set(self, angle=number("angle", self.angle), travel=place("travel", self.travel))
        _set(self, _vector=self.travel * self.axis)

    def pose(self, instant: float) -> Array:
        """``T_groove_cylinder`` (4, 4) at an instant from 0 to 1. Raises InputError for what is no finite number."""
        instant = number("instant", instant)
        if not abs(instant) <= _FARTHEST:
            raise InputError(f"instant must be from 0 to 1 (or at most {_FARTHEST:g} times as far), got {instant}")
        turn = rotation(self.axis, instant * self.angle)
        T = np.eye(4)
        T[:3, :3] = turn[:3, :3] @ self.start[:3, :3]
        # The turn minus one: what does not move is not rounded.
        offset = self.start[:3, 3] - self.point
        T[:3, 3] = self.start[:3, 3] + (turn[:3, :3] - np.eye(3)) @ offset + instant * self._vector
        return T

    def _numbers(self) -> Array:
        axis = self.start[:3, 2] / np.linalg.norm(self.start[:3, 2])
        return np.concatenate([self.start[:3, 3], axis, self.point, self.axis, self._vector, [self.angle]])

    def _speed(self, along: float) -> float:
        """No point of an axis that reaches ``along`` mm from its middle is faster, mm per unit of instant."""
        reach = float(np.linalg.norm(np.cross(self.axis, self.start[:3, 3] - self.point))) + along
        return math.hypot(abs(self.angle) * reach, float(np.linalg.norm(self._vector)))

    def _rounding(self, along: float) -> float:
        """Largest rounding in mm of a point of the axis at a pose of the motion."""
        lengths = np.abs(self.start[:3, 3]).max() + np.abs(self._vector).max() + along
        if self.angle != 0.0:
            lengths += 2.0 * np.abs(self.start[:3, 3] - self.point).max() + np.abs(self.point).max()
        return _ROUNDING * float(lengths) * (1.0 + abs(self.angle))


def _set(target: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(target, name, value)


class Translation(Screw):
    """Motion of a cylinder along ``vector`` (3,) mm, in the groove's frame, from ``start`` (4, 4)."""

    __slots__ = ()

    def __init__(self, start: ArrayLike, vector: ArrayLike) -> None:
        v = _vector("vector", vector)
        length = float(np.linalg.norm(v))
        super().__init__(
            check_pose(start, "start"), np.zeros(3), v if length > 0.0 else np.array([0.0, 0.0, 1.0]), 0.0, length
        )
        _set(self, _vector=v)


class Rotation(Screw):
    """Motion of a cylinder that turns by ``angle`` rad about ``axis`` (3,) through ``point`` (3,), from ``start``."""

    __slots__ = ()

    def __init__(self, start: ArrayLike, point: ArrayLike, axis: ArrayLike, angle: float) -> None:
        super().__init__(check_pose(start, "start"), _vector("point", point), array("axis", axis, (3,)), angle)


@dataclass(frozen=True, slots=True)
class MotionContact:
    """Answer of ``first_contact``: the first contact, or the closest approach if ``touches`` is False.

    ``instant`` is from 0 to 1, ``pose`` (4, 4) the cylinder's there, ``contact`` the distance, witnesses and feature.
    No contact deeper than ``resolution`` mm was missed before it; ``error_bound`` mm bounds the rounding of the
    distance and of the pose, and ``evaluations`` counts what was looked at.
    """

    touches: bool
    instant: float
    pose: Array
    contact: SignedDistance
    resolution: float
    error_bound: float
    evaluations: int


@dataclass(frozen=True, slots=True)
class Clearance:
    """Answer of ``sweep``: the least signed distance along a motion, where and when.

    ``distance`` is that of ``contact`` at ``instant``; no instant of the motion is lower by more than ``resolution``.
    ``error_bound`` mm bounds the rounding of the distance and of the pose, ``evaluations`` counts what was looked at.
    """

    distance: float
    instant: float
    pose: Array
    contact: SignedDistance
    resolution: float
    error_bound: float
    evaluations: int


class _Search:
    """One groove, one cylinder, one motion; counts what it looks at."""

    def __init__(self, groove: SweptArc, cylinder: Cylinder, motion: Screw, resolution: float | None) -> None:
        check_shapes(groove, cylinder)
        if not isinstance(motion, Screw):
            raise InputError(f"motion must be a Translation, Rotation or Screw, got {type(motion).__name__}")
        self.groove, self.cylinder, self.motion = groove, cylinder, motion
        size = max(groove.radius, groove.length, cylinder.radius, cylinder.length)
        slack = RESOLUTION * size if resolution is None else positive("resolution", resolution)
        # No search can tell apart what the rounding of the poses on the way cannot.
        self.rounding = motion._rounding(0.5 * cylinder.length)
        if not self.rounding <= size:
            raise SolverError(f"the motion's poses are rounded by {self.rounding:.3g} mm, more than its bodies' size")
        self.slack = max(slack, self.rounding)
        self.evaluations = 0
        self._sizes = (groove.radius, groove.half_angle, 0.5 * groove.length, 0.5 * cylinder.length)
        self._numbers = motion._numbers()

    def distance(self, instant: float) -> float:
        self.evaluations += 1
        return signed_distance(self.groove, self.cylinder, self.motion.pose(instant)).distance

    def least(self) -> Clearance:
        from clamp3d.core import kernel_motion

        out = np.empty(4)
        heap = np.empty((kernel_motion.CELLS, 5))
        self.evaluations += kernel_motion.least(*self._sizes, self._numbers, 0.0, 1.0, self.slack, heap, out)
        best, instant, _, bound = out.tolist()
        # Down to the rounding where that is cheap: what only just touches is to be known as that.
        low, high = max(0.0, instant - _NEAR), min(1.0, instant + _NEAR)
        heap = heap[:_FEW]
        self.evaluations += kernel_motion.least(*self._sizes, self._numbers, low, high, self.rounding, heap, out)
        if out[0] <= best:
            best, instant = out[:2].tolist()
        pose = self.motion.pose(instant)
        contact = signed_distance(self.groove, self.cylinder, pose)
        error = contact.error_bound + self.rounding
        return Clearance(
            contact.distance, instant, pose, contact, max(best - bound, self.slack), error, self.evaluations
        )

    def first(self, level: float) -> float | None:
        """First instant at which the distance is at most ``level``, None if it never is."""
        from clamp3d.core import kernel_motion

        out = np.empty(2)
        heap = np.empty((kernel_motion.CELLS, 5))
        r = self.cylinder.radius
        for _ in range(4):
            self.evaluations += kernel_motion.first(*self._sizes, self._numbers, level + r, self.slack, heap, out)
            hit, until = out.tolist()
            if until >= min(hit, 1.0):
                return hit if hit <= 1.0 else None
            self.slack *= 100.0  # it slides along at the level: what is as good as on it is not to be told apart
        raise SolverError(f"motion search did not end within {self.evaluations} cells; give a larger resolution")

    def crossing(self, instant: float, level: float, error: float) -> float:
        """The root near ``instant`` where the distance passes ``level``, or ``instant`` where it only touches."""
        gap: Callable[[float], float] = lambda s: self.distance(s) - level  # noqa: E731
        speed = max(self.motion._speed(0.5 * self.cylinder.length), 1e-300)
        step = max(error / speed, 4e-16)
        high = instant
        if gap(high) > 0.0:  # by rounding: just behind it
            high = min(1.0, high + 8.0 * step)
            if gap(high) > 0.0:
                return instant
        low = high
        while low > 0.0 and gap(low) <= 0.0:
            low = max(0.0, high - step)
            step *= 2.0
        return float(brentq(gap, low, high, xtol=1e-16, rtol=8.9e-16)) if gap(low) > 0.0 > gap(high) else high


def first_contact(
    groove: SweptArc, cylinder: Cylinder, motion: Screw, *, margin: float = 0.0, resolution: float | None = None
) -> MotionContact:
    """First instant at which ``cylinder`` comes within ``margin`` mm of ``groove`` on ``motion``.

    Branch and bound in the order of time: everything before the answer is proven to be free. If the margin is never
    reached the answer is the closest approach, with ``touches`` False. ``resolution`` mm is 1e-12 of the largest size
    by default. Raises InputError for a motion of another kind or a margin that is not finite, SolverError if the
    search would take too many cells or the motion goes so far that rounding moves it by more than the bodies' size.

    >>> import numpy as np
    >>> from clamp3d.core.pose import translation
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> hit = first_contact(groove, wire, Translation(translation(0.0, 20.0, 0.0), (0.0, -40.0, 0.0)))
    >>> hit.touches, round(hit.instant, 12), hit.contact.feature.name
    (True, 0.5375, 'ARC')
    """
    margin = place("margin", margin)
    search = _Search(groove, cylinder, motion, resolution)
    start = signed_distance(groove, cylinder, motion.pose(0.0))
    instant = 0.0
    if start.distance > margin + start.error_bound:
        least = search.least()
        error = least.error_bound
        if least.distance > margin + error:
            return MotionContact(
                False, least.instant, least.pose, least.contact, least.resolution, error, search.evaluations
            )
        # The lowest touches; what touches before it?
        first = search.first(margin + min(error, max(least.distance - margin, 0.0)))
        instant = search.crossing(least.instant if first is None else first, margin, error)
    pose = motion.pose(instant)
    contact = signed_distance(groove, cylinder, pose)
    error = contact.error_bound + search.rounding
    return MotionContact(True, instant, pose, contact, search.slack, error, search.evaluations)


def sweep(groove: SweptArc, cylinder: Cylinder, motion: Screw, *, resolution: float | None = None) -> Clearance:
    """Least signed distance of ``cylinder`` from ``groove`` along ``motion``, with its instant, witnesses and feature.

    Branch and bound over instants and the cylinder's axis: no instant is lower by more than ``resolution`` mm (1e-12 of
    the largest size by default; what was reached is in the answer).

    >>> import numpy as np
    >>> from clamp3d.core.pose import translation
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> least = sweep(groove, wire, Translation(translation(-1.0, -1.0, 0.0), (2.0, 0.0, 0.0)))
    >>> round(least.distance, 12), least.instant
    (0.085786437627, 0.0)
    """
    return _Search(groove, cylinder, motion, resolution).least()
