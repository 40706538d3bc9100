"""Least distance and first contact of a groove and a moving cylinder: the kernel, asked by the search over time."""

from __future__ import annotations

import numpy as np

from clamp3d.checks import positive
from clamp3d.core.distance import SignedDistance, signed_distance
from clamp3d.core.motion import Motion
from clamp3d.core.motion_search import ACCURACY, Outcome, first_time, least
from clamp3d.core.pose import Array
from clamp3d.core.primitives import LARGEST, AnyCylinder, Cylinder, SweptArc
from clamp3d.errors import SolverError

_MOST_IN_OVERLAP, _MOST_APART = 500, 5000
"""Poses at which the least distance is asked for; of bodies that overlap on their way how deep decides nothing."""
_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)


class Search:
    """One groove, one cylinder and its motion from ``start`` (4, 4), ``T_groove_cylinder``; counts ``evaluations``.

    ``slack`` mm is the accuracy of its answers: ``resolution``, or 1e-6 mm, or what the poses are rounded by.
    """

    def __init__(
        self, groove: SweptArc, cylinder: AnyCylinder, motion: Motion, start: Array, resolution: float | None
    ) -> None:
        self.groove, self.cylinder, self.motion, self.start = groove, cylinder, motion, start
        self.evaluations = 0
        size = max(groove.radius, groove.length, cylinder.radius, cylinder.length)
        rounding = self._rounding()
        if not rounding <= size:
            raise SolverError(f"the motion's poses are rounded by {rounding:.3g} mm, more than its bodies' size")
        self.slack = max(ACCURACY if resolution is None else positive("resolution", resolution), rounding)
        self._turn = motion.angle * motion.axis
        self._tilt_of_rim = cylinder.radius if isinstance(cylinder, Cylinder) else 0.0
        half = 0.5 * cylinder.length * start[:3, 2]
        tilting = self._tilt_of_rim * float(np.linalg.norm(np.cross(self._turn, start[:3, 2])))
        self.speed = (motion.speed(start[:3, 3] + np.array([-half, half])) + tilting) * (1.0 + 1e-12)

    def _rounding(self) -> float:
        """Largest rounding in mm of a point of the axis at a pose of the motion."""
        offset, motion = self.start[:3, 3], self.motion
        lengths = np.abs(offset).max() + np.abs(motion.travel).max() + 0.5 * self.cylinder.length
        if motion.angle != 0.0:
            # A small turn about a far axis takes no more of the rounding of that distance than of the distance itself.
            turned = min(1.0, abs(motion.angle))
            lengths += turned * (2.0 * np.abs(offset - motion.point).max() + np.abs(motion.point).max())
        return _ROUNDING * float(lengths) * (1.0 + abs(motion.angle))

    def _from_turn_axis(self, T: Array, t: float) -> Array:
        """Both ends (2, 3) of the cylinder's axis at its pose T, from where the axis of the turn is at that time."""
        half = 0.5 * self.cylinder.length * T[:3, 2]
        return np.asarray(T[:3, 3] - self.motion.point - t * self.motion.travel + np.array([-half, half]))

    def pose(self, t: float) -> Array:
        """``T_groove_cylinder`` (4, 4) at time ``t``."""
        return self.motion.at(t, self.start)

    def at(self, t: float) -> SignedDistance:
        """The kernel's answer at time ``t``."""
        self.evaluations += 1
        return signed_distance(self.groove, self.cylinder, self.pose(t))

    def bounds(self, t: float) -> tuple[float, float]:
        """Lower and upper bound of the distance at time ``t``."""
        answer = self.at(t)
        return answer.distance - answer.error_bound, answer.distance + answer.error_bound

    def bound_by_longer_bodies(self, start: float, stop: float) -> float:
        """Lower bound of the distance between two times.

        Lemma: let the cylinder's points move from the middle time on by ``(t - middle) (a d + b z)`` and a rest, d its
        axis and z that of the groove. What moves by ``a d`` stays in the cylinder made longer by that way, what moves
        by ``b z`` is as far from the groove as at rest from a longer one. So the distance is at least that of the two
        longer bodies at the middle time, less the rest. A wire that slides through a groove has hardly a rest.
        """
        middle, half = 0.5 * (start + stop), 0.5 * (stop - start)
        T = self.pose(middle)
        ends = self._from_turn_axis(T, middle)
        velocities = self.motion.travel + np.cross(self._turn, ends)
        d, z = T[:3, 2], np.array([0.0, 0.0, 1.0])
        a, b = _components(velocities.mean(axis=0), d)
        turning = float(np.linalg.norm(np.cross(self._turn, ends), axis=1).max())
        bend = abs(self.motion.angle) * turning * half  # by how much a velocity changes
        tilting = self._tilt_of_rim * float(np.linalg.norm(np.cross(self._turn, d)))
        rest = half * (float(np.linalg.norm(velocities - a * d - b * z, axis=1).max()) + bend + tilting)
        length, groove_length = self.cylinder.length + 2.0 * abs(a) * half, self.groove.length + 2.0 * abs(b) * half
        if max(length, groove_length) >= LARGEST:
            return -np.inf
        self.evaluations += 1
        longer = type(self.cylinder)(self.cylinder.radius, length)
        groove = SweptArc(self.groove.radius, self.groove.half_angle, groove_length)
        answer = signed_distance(groove, longer, T)
        return answer.distance - answer.error_bound - rest * (1.0 + 1e-12)

    def least(self) -> tuple[float, float]:
        """Time of the least distance, and what any other time can be lower by, mm."""
        for most in (_MOST_IN_OVERLAP, _MOST_APART):
            answer = least(self.bounds, self.speed, bound=self.bound_by_longer_bodies, accuracy=self.slack, most=most)
            if answer.upper <= 0.0 or answer.evaluations < most:
                break
        return answer.t, max(answer.upper - answer.lower, self.slack)

    def first_contact(self, margin: float) -> tuple[bool, float, float]:
        """Whether the distance comes down to ``margin`` mm; first time of that, or of the least distance; slack, mm."""
        start = self.at(0.0)
        if start.distance <= margin + start.error_bound:
            return True, 0.0, self.slack
        first = first_time(self.bounds, self.speed, margin, bound=self.bound_by_longer_bodies, accuracy=self.slack)
        if first.outcome is Outcome.UNDECIDED:
            raise SolverError(
                f"motion search did not end within {first.evaluations} poses: from t = {first.t:.6g} on the distance "
                f"stays near {margin:g} mm; give a larger resolution"
            )
        if first.outcome is Outcome.CLEAR:
            return False, *self.least()
        return True, self._crossing(first.t, margin), self.slack

    def _crossing(self, t: float, margin: float) -> float:
        """The root just after ``t`` where the distance passes ``margin``, or ``t`` where it only comes near."""
        from scipy.optimize import brentq

        def gap(time: float) -> float:
            return self.at(time).distance - margin

        later, step = t, self.slack / self.speed
        while later < 1.0 and 0.0 < gap(later) <= 2.0 * self.slack:
            later, step = min(1.0, later + step), 2.0 * step
        return float(brentq(gap, t, later, xtol=1e-16)) if gap(t) > 0.0 > gap(later) else t


def _components(velocity: Array, d: Array) -> tuple[float, float]:
    """The a and b for which ``a d + b z`` is nearest to a velocity (3,)."""
    along, along_z, cosine = float(velocity @ d), float(velocity[2]), float(d[2])
    sine2 = 1.0 - cosine * cosine
    if sine2 < 1e-6:
        return 0.0, along_z
    return (along - cosine * along_z) / sine2, (along_z - cosine * along) / sine2
