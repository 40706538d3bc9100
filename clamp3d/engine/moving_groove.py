"""A cylinder that moves past a groove: the kernel's distances, and its bound over a stretch of time."""

from __future__ import annotations

import numpy as np

from clamp3d.checks import positive
from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.closed_form import kernel_distance
from clamp3d.engine.motion_search import ACCURACY
from clamp3d.engine.moving_pair import MovingPair
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array, norm
from clamp3d.geometry.primitives import LARGEST, AnyCylinder, Cylinder, SweptArc
from clamp3d.kernel.distance import SignedDistance, signed_distance

_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)


class MovingInGroove(MovingPair):
    """A cylinder or capsule and its motion from ``start`` (4, 4), ``T_groove_cylinder``; distances as the groove sees.

    Its ``accuracy`` (mm) is ``resolution``, or 1e-6, or what the poses are rounded by.
    """

    overlaps = 500

    def __init__(
        self, groove: SweptArc, cylinder: AnyCylinder, motion: Motion, start: Array, resolution: float | None
    ) -> None:
        self.groove, self.cylinder, self.motion, self.start = groove, cylinder, motion, start
        self.evaluations = self.work = 0
        self._known = 0.0
        offsets = float(np.abs([start[:3, 3], motion.travel, motion.angle * motion.point]).max())
        rounding = _ROUNDING * max(offsets, cylinder.length, groove.length) * (1.0 + abs(motion.angle))
        self.accuracy = max(ACCURACY if resolution is None else positive("resolution", resolution), rounding)
        self._turn = motion.angle * motion.axis
        self._rim = cylinder.radius if isinstance(cylinder, Cylinder) else 0.0
        half = 0.5 * cylinder.length * start[:3, 2]
        tilting = self._rim * norm(np.cross(self._turn, start[:3, 2]))
        self.speed = (motion.speed(start[:3, 3] + np.array([-half, half])) + tilting) * (1.0 + 1e-12)

    def contact(self, t: float) -> SignedDistance:
        """The kernel's answer at time ``t``."""
        self.evaluations += 1
        return signed_distance(self.groove, self.cylinder, self.motion.at(t, self.start))

    def at(self, t: float, enough: Enough) -> Distance:
        """Distance at time ``t``: always as sharp as it gets."""
        self.work += 1
        return kernel_distance(self.contact(t))

    def as_seen(self, distance: Distance, t: float) -> Distance:
        """A distance at time ``t`` as the groove sees it, as which it was measured."""
        return distance

    def between(self, start: float, stop: float, by_speed: float = 0.0) -> float:
        """Lower bound (mm) of the distance between two times.

        Lemma: let the cylinder's points move from the middle time on by ``(t - middle) (a d + b z)`` and a rest, d its
        axis and z that of the groove. What moves by ``a d`` stays in the cylinder made longer by that way, what moves
        by ``b z`` is as far from the groove as at rest from a longer one. So the distance is at least that of the two
        longer bodies at the middle time, less the rest. A wire that slides through a groove has hardly a rest.
        """
        middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
        T = self.motion.at(middle, self.start)
        d = T[:3, 2]
        # Both ends of the axis from where the axis of the turn is at that time.
        ends = T[:3, 3] - self.motion.point - middle * self.motion.travel
        ends = ends + 0.5 * self.cylinder.length * np.array([-d, d])
        velocities = self.motion.travel + np.cross(self._turn, ends)
        along = np.column_stack([d, (0.0, 0.0, 1.0)])
        (a, b), *_ = np.linalg.lstsq(along, velocities.mean(axis=0), rcond=1e-6)
        turning = float(np.linalg.norm(np.cross(self._turn, ends), axis=1).max())
        bend = abs(self.motion.angle) * turning * half  # by how much a velocity changes
        tilting = self._rim * norm(np.cross(self._turn, d))
        rest = half * (float(np.linalg.norm(velocities - along @ (a, b), axis=1).max()) + bend + tilting)
        length, groove_length = self.cylinder.length + 2.0 * abs(a) * half, self.groove.length + 2.0 * abs(b) * half
        if max(length, groove_length) >= LARGEST:
            return -np.inf
        self.evaluations += 1
        longer = type(self.cylinder)(self.cylinder.radius, length)
        groove = SweptArc(self.groove.radius, self.groove.half_angle, groove_length)
        answer = signed_distance(groove, longer, T)
        return answer.distance - answer.error_bound - rest * (1.0 + 1e-12)

    def reached(self, first: float, level: float) -> float:
        """The root just after ``first`` where the distance passes ``level``, or ``first`` where it only comes near."""
        from scipy.optimize import brentq

        def gap(time: float) -> float:
            return self.contact(time).distance - level

        later, step = first, self.accuracy / max(self.speed, self.accuracy)
        while later < 1.0 and 0.0 < gap(later) <= 2.0 * self.accuracy:
            later, step = min(1.0, later + step), 2.0 * step
        return float(brentq(gap, first, later, xtol=1e-16)) if gap(first) > 0.0 > gap(later) else first
