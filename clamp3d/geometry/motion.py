"""Contact along a motion: first instant of contact, and least clearance, independent of any step count."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from clamp3d.errors import InputError, SolverError
from clamp3d.geometry.distance import SignedDistance, signed_distance
from clamp3d.geometry.pose import Array, check_pose, rotation
from clamp3d.geometry.shapes import Cylinder, SweptArc

RESOLUTION = 1e-9
"""Default resolution of a search, in parts of the largest length of the scene."""

_EVALUATIONS = 300_000


def _vector(name: str, value: ArrayLike, *, unit: bool = False) -> Array:
    try:
        v = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be three numbers, got {value!r}") from None
    if v.shape != (3,) or not np.isfinite(v).all():
        raise InputError(f"{name} must be three finite numbers, got {value!r}")
    if unit:
        n = float(np.linalg.norm(v))
        if n == 0.0:
            raise InputError(f"{name} must not be zero")
        v /= n
    return v


def _number(name: str, value: float) -> float:
    if not math.isfinite(value):
        raise InputError(f"{name} must be finite, got {value}")
    return float(value)


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
        _set(self, start=check_pose(self.start, "start").copy(), point=_vector("point", self.point))
        _set(self, axis=_vector("axis", self.axis, unit=True))
        _set(self, angle=_number("angle", self.angle), travel=_number("travel", self.travel))
        _set(self, _vector=self.travel * self.axis)

    def pose(self, instant: float) -> Array:
        """``T_groove_cylinder`` (4, 4) at an instant from 0 to 1."""
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


def _set(target: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(target, name, value)


class Translation(Screw):
    """Motion of a cylinder along ``vector`` (3,) mm, in the groove's frame, from ``start`` (4, 4)."""

    __slots__ = ()

    def __init__(self, start: ArrayLike, vector: ArrayLike) -> None:
        v = _vector("vector", vector)
        length = float(np.linalg.norm(v))
        super().__init__(np.asarray(start), np.zeros(3), v if length > 0.0 else np.array([0.0, 0.0, 1.0]), 0.0, length)
        _set(self, _vector=v)


class Rotation(Screw):
    """Motion of a cylinder that turns by ``angle`` rad about ``axis`` (3,) through ``point`` (3,), from ``start``."""

    __slots__ = ()

    def __init__(self, start: ArrayLike, point: ArrayLike, axis: ArrayLike, angle: float) -> None:
        super().__init__(np.asarray(start), np.asarray(point), np.asarray(axis), angle)


@dataclass(frozen=True, slots=True)
class MotionContact:
    """Answer of ``first_contact``: the first contact, or the closest approach if ``touches`` is False.

    ``instant`` is from 0 to 1, ``pose`` (4, 4) the cylinder's there, ``contact`` the distance, witnesses and feature.
    A contact less deep than ``resolution`` mm can be missed only if it begins and ends within ``resolution`` mm of
    travel; ``evaluations`` counts distances.
    """

    touches: bool
    instant: float
    pose: Array
    contact: SignedDistance
    resolution: float
    evaluations: int


@dataclass(frozen=True, slots=True)
class Clearance:
    """Answer of ``sweep``: the least signed distance along a motion, where and when.

    ``distance`` is that of ``contact`` at ``instant``; no instant of the motion is lower by more than ``resolution``.
    """

    distance: float
    instant: float
    pose: Array
    contact: SignedDistance
    resolution: float
    evaluations: int


class _Search:
    """One groove, one cylinder, one motion; counts what it evaluates."""

    def __init__(self, groove: SweptArc, cylinder: Cylinder, motion: Screw, resolution: float | None) -> None:
        if not isinstance(motion, Screw):
            raise InputError(f"motion must be a Translation, Rotation or Screw, got {type(motion).__name__}")
        self.groove, self.cylinder, self.motion = groove, cylinder, motion
        self.size = max(groove.radius, groove.length, cylinder.radius, cylinder.length)
        self.slack = RESOLUTION * self.size if resolution is None else resolution
        if not (math.isfinite(self.slack) and self.slack > 0.0):
            raise InputError(f"resolution must be a finite length > 0 mm, got {resolution}")
        self.evaluations = 0
        self._last = np.zeros(3)

    def at(self, instant: float) -> SignedDistance:
        self.evaluations += 1
        return signed_distance(self.groove, self.cylinder, self.motion.pose(instant))

    def distance(self, instant: float) -> float:
        return self.at(instant).distance

    def march(self, start: float, target: float, stop: float, near: float) -> tuple[int, float, float, float]:
        """Status and the last three instants of a march; the slack grows tenfold when the evaluations run out."""
        from clamp3d.geometry import kernel_motion

        numbers = self.motion._numbers()
        half, along = 0.5 * self.groove.length, 0.5 * self.cylinder.length
        for _ in range(8):
            self._last[:] = start
            status, count = kernel_motion.march(
                self.groove.radius, self.groove.half_angle, half, self.cylinder.radius, along, numbers,
                start, target, stop, self.slack, near, _EVALUATIONS, self._last,
            )  # fmt: skip
            self.evaluations += count
            before, middle, now = self._last.tolist()
            if status != kernel_motion.LIMIT:
                return status, before, middle, now
            self.slack *= 10.0
            start = now
        raise SolverError(f"motion search did not end within {self.evaluations} evaluations; shorten the motion")

    def lowest(self, a: float, b: float) -> tuple[float, float]:
        """Local minimum between two instants: instant, distance."""
        if b <= a:
            return a, self.distance(a)
        found = minimize_scalar(
            self.distance, bounds=(a, b), method="bounded", options={"xatol": 1e-13, "maxiter": 200}
        )
        options = [(float(found.fun), float(found.x)), (self.distance(a), a), (self.distance(b), b)]
        value, instant = min(options)
        return instant, value


def first_contact(
    groove: SweptArc, cylinder: Cylinder, motion: Screw, *, margin: float = 0.0, resolution: float | None = None
) -> MotionContact:
    """First instant at which ``cylinder`` comes within ``margin`` mm of ``groove`` on ``motion``.

    Conservative advancement finds the stretch, a root finder (a double root: a minimiser) the instant. If the margin is
    never reached the answer is the closest approach, with ``touches`` False. ``resolution`` mm is 1e-9 of the largest
    size by default. Raises InputError for a motion of another kind or a margin that is not finite.

    >>> import numpy as np
    >>> from clamp3d.geometry.pose import translation
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> hit = first_contact(groove, wire, Translation(translation(0.0, 20.0, 0.0), (0.0, -40.0, 0.0)))
    >>> hit.touches, round(hit.instant, 12), hit.contact.feature.name
    (True, 0.5375, 'ARC')
    """
    margin = _number("margin", margin)
    search = _Search(groove, cylinder, motion, resolution)
    first = search.at(0.0)
    if first.distance <= margin + first.error_bound:
        return MotionContact(True, 0.0, motion.pose(0.0), first, search.slack, search.evaluations)
    stop = margin + first.error_bound
    start = 0.0
    gap: Callable[[float], float] = lambda s: search.distance(s) - margin  # noqa: E731
    while start < 1.0:
        status, before, middle, now = search.march(start, margin, stop, 1e-3 * search.size)
        if status == 1:  # at or below the margin now, above it before
            low, high = max(middle, start), now
            if gap(high) > 0.0:  # by less than the error bound: the bottom of a grazing contact, or a crossing
                high, _ = search.lowest(low, min(1.0, now + 2.0 * (now - low)))
        else:
            low = before
            high, lowest = search.lowest(before, now)
            if lowest > stop:
                start = now
                continue
        instant = high
        if gap(low) > 0.0 > gap(high):
            instant = float(brentq(gap, low, high, xtol=1e-16, rtol=8.9e-16))
        return MotionContact(True, instant, motion.pose(instant), search.at(instant), search.slack, search.evaluations)
    least = sweep(groove, cylinder, motion, resolution=resolution)
    evaluations = search.evaluations + least.evaluations
    return MotionContact(
        False, least.instant, least.pose, least.contact, max(search.slack, least.resolution), evaluations
    )


def sweep(groove: SweptArc, cylinder: Cylinder, motion: Screw, *, resolution: float | None = None) -> Clearance:
    """Least signed distance of ``cylinder`` from ``groove`` along ``motion``, with its instant, witnesses and feature.

    A coarse look and a minimiser give a candidate; a march that cannot jump over anything lower by more than
    ``resolution`` mm (1e-9 of the largest size by default) proves it or finds a better one.

    >>> import numpy as np
    >>> from clamp3d.geometry.pose import translation
    >>> groove, wire = SweptArc(12.0, np.radians(70.0), 50.0), Cylinder(10.5, 80.0)
    >>> least = sweep(groove, wire, Translation(translation(-1.0, -1.0, 0.0), (2.0, 0.0, 0.0)))
    >>> round(least.distance, 12), least.instant
    (0.085786437627, 0.0)
    """
    search = _Search(groove, cylinder, motion, resolution)
    coarse = np.linspace(0.0, 1.0, 65)
    values = np.array([search.distance(s) for s in coarse])
    best = int(values.argmin())
    instant, least = search.lowest(float(coarse[max(0, best - 1)]), float(coarse[min(64, best + 1)]))
    if values[best] <= least:
        instant, least = float(coarse[best]), float(values[best])
    start = 0.0
    # Nothing is deeper than the middle between the end faces.
    bottom = -0.5 * groove.length - cylinder.radius + search.slack
    while start < 1.0 and least > bottom:
        status, _, middle, now = search.march(start, least, least - 1e-3 * search.slack, -math.inf)
        if status == 0:
            break
        ahead = min(1.0, now + max(now - middle, 1.0 / 64.0))
        found, value = search.lowest(middle, ahead)
        here = search.distance(now)
        instant, least = (found, value) if value < here else (now, here)
        start = now
    contact = search.at(instant)
    return Clearance(contact.distance, instant, motion.pose(instant), contact, search.slack, search.evaluations)
