"""Least distance and first contact of a moving cylinder and a groove, to rounding: the kernel's branch and bound."""

from __future__ import annotations

import numpy as np

from clamp3d.checks import positive
from clamp3d.core.distance import SignedDistance, signed_distance
from clamp3d.core.linear import cross, norm
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array
from clamp3d.core.primitives import AnyCylinder, Capsule, Cylinder, SweptArc
from clamp3d.core.roots import root
from clamp3d.errors import SolverError

RESOLUTION = 1e-12
"""Default resolution of a search, in parts of the largest length of the scene."""
FLAT_RESOLUTION = 1e-9
"""The same where a flat end decides: there the search knows only how fast the cylinder's points move."""
_NEAR, _FEW = 1e-4, 400
"""Times around the lowest, and cells, within which it is followed down to the rounding."""
_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)


class Search:
    """One groove, one cylinder and its motion from ``start`` (4, 4), ``T_groove_cylinder``; counts ``evaluations``.

    A flat-ended cylinder lies in its capsule: the capsule's answer is a bound, and the answer where both are equally
    far. Only where a flat end decides the cylinder's own motion is searched.
    """

    def __init__(
        self, groove: SweptArc, cylinder: AnyCylinder, motion: Motion, start: Array, resolution: float | None
    ) -> None:
        self.groove, self.cylinder, self.motion, self.start = groove, cylinder, motion, start
        size = max(groove.radius, groove.length, cylinder.radius, cylinder.length)
        slack = RESOLUTION * size if resolution is None else positive("resolution", resolution)
        # No search can tell apart what the rounding of the poses on the way cannot.
        self.rounding = self._rounding(0.5 * cylinder.length)
        if not self.rounding <= size:
            raise SolverError(f"the motion's poses are rounded by {self.rounding:.3g} mm, more than its bodies' size")
        self.slack = max(slack, self.rounding)
        self.evaluations = 0
        self._sizes = (groove.radius, groove.half_angle, 0.5 * groove.length, 0.5 * cylinder.length)
        axis = start[:3, 2] / norm(start[:3, 2])
        self._capsule: Search | None = None
        if isinstance(cylinder, Cylinder):
            self._capsule = Search(groove, Capsule(cylinder.radius, cylinder.length), motion, start, resolution)
            self.flat_slack = max(self.slack, FLAT_RESOLUTION * size if resolution is None else 0.0)
        self._numbers = np.concatenate([start[:3, 3], axis, motion.point, motion.axis, motion.travel, [motion.angle]])

    def _rounding(self, along: float) -> float:
        """Largest rounding in mm of a point of the axis at a pose of the motion."""
        offset, motion = self.start[:3, 3], self.motion
        lengths = np.abs(offset).max() + np.abs(motion.travel).max() + along
        if motion.angle != 0.0:
            # A small turn about a far axis takes no more of the rounding of that distance than of the distance itself.
            turned = min(1.0, abs(motion.angle))
            lengths += turned * (2.0 * np.abs(offset - motion.point).max() + np.abs(motion.point).max())
        return _ROUNDING * float(lengths) * (1.0 + abs(motion.angle))

    def pose(self, t: float) -> Array:
        """``T_groove_cylinder`` (4, 4) at time ``t``."""
        return self.motion.at(t, self.start)

    def at(self, t: float) -> SignedDistance:
        """The kernel's answer at time ``t``."""
        self.evaluations += 1
        return signed_distance(self.groove, self.cylinder, self.pose(t))

    def least(self) -> tuple[float, float]:
        """Time of the least distance, and what any other time can be lower by, mm."""
        if self._capsule is not None:
            return self._flat_least(self._capsule)
        from clamp3d.core import kernel_motion

        out, heap = np.empty(4), np.empty((kernel_motion.CELLS, 5))
        self.evaluations += kernel_motion.least(*self._sizes, self._numbers, 0.0, 1.0, self.slack, len(heap), heap, out)
        best, t, _, bound = out.tolist()
        # Down to the rounding where that is cheap: what only just touches is to be known as that.
        low, high = max(0.0, t - _NEAR), min(1.0, t + _NEAR)
        self.evaluations += kernel_motion.least(*self._sizes, self._numbers, low, high, self.rounding, _FEW, heap, out)
        if out[0] <= best:
            best, t = out[:2].tolist()
        return t, max(best - bound, self.slack)

    def _flat_least(self, capsule: Search) -> tuple[float, float]:
        t, slack = capsule.least()
        self.evaluations += capsule.evaluations
        here, held = self.at(t), capsule.at(t)
        if here.distance - held.distance <= here.error_bound + held.error_bound:
            return t, slack
        best, found, low = self._flat_search(0.0, -np.inf)
        return found, max(best - max(low, held.distance - slack), self.rounding)

    def _flat_search(self, begin: float, level: float) -> list[float]:
        """What the compiled search fills in, from time ``begin`` on."""
        from clamp3d.core import kernel_motion_flat

        R, half_angle, H, half = self._sizes
        r = self.cylinder.radius
        out, pad, heap = np.empty(3), np.empty((128, 5)), np.empty((kernel_motion_flat.MOST, 5))
        arm = norm(cross(self.motion.axis, self.start[:3, 3] - self.motion.point))
        speed = norm(self.motion.travel) + abs(self.motion.angle) * (arm + float(np.hypot(r, half)))
        self.evaluations += kernel_motion_flat.search(
            R,
            half_angle,
            H,
            r,
            half,
            self._numbers,
            speed * (1.0 + 1e-12),
            begin,
            1.0,
            level,
            self.flat_slack,
            pad,
            heap,
            out,
        )
        return out.tolist()

    def first_contact(self, margin: float) -> tuple[bool, float, float]:
        """Whether the distance comes down to ``margin`` mm; first time of that, or of the least distance; slack, mm."""
        start = self.at(0.0)
        if start.distance <= margin + start.error_bound:
            return True, 0.0, self.slack
        t, slack = self.least()
        least = self.at(t)
        error = least.error_bound + self.rounding
        if least.distance > margin + error:
            return False, t, slack
        # The lowest touches; what touches before it?
        first = self._first(margin + min(error, max(least.distance - margin, 0.0)))
        return True, self._crossing(t if first is None else first, margin, error), self.slack

    def _first(self, level: float) -> float | None:
        """First time at which the distance is at most ``level``, None if it never is."""
        if self._capsule is not None:
            return self._flat_first(self._capsule, level)
        from clamp3d.core import kernel_motion

        out, heap = np.empty(2), np.empty((kernel_motion.CELLS, 5))
        r = self.cylinder.radius
        for _ in range(4):
            self.evaluations += kernel_motion.first(*self._sizes, self._numbers, level + r, self.slack, heap, out)
            hit, until = out.tolist()
            if until >= min(hit, 1.0):
                return hit if hit <= 1.0 else None
            self.slack *= 100.0  # it slides along at the level: what is as good as on it is not to be told apart
        raise SolverError(f"motion search did not end within {self.evaluations} cells; give a larger resolution")

    def _flat_first(self, capsule: Search, level: float) -> float | None:
        held = capsule._first(level)
        self.evaluations += capsule.evaluations
        self.slack = max(self.slack, capsule.slack)
        if held is None or self.at(held).distance <= level:
            return held
        for _ in range(4):
            _, hit, until = self._flat_search(held, level)
            if hit <= 1.0 or until >= 1.0:
                self.slack = max(self.slack, self.flat_slack)
                return hit if hit <= 1.0 else None
            held = until
            self.flat_slack *= 100.0
        raise SolverError(f"motion search did not end within {self.evaluations} poses; give a larger resolution")

    def _crossing(self, t: float, level: float, error: float) -> float:
        """The root near ``t`` where the distance passes ``level``, or ``t`` where it only touches."""

        def gap(s: float) -> float:
            return self.at(s).distance - level

        offset, u = self.start[:3, 3] - self.motion.point, self.motion.axis
        reach = norm(cross(u, offset)) + 0.5 * self.cylinder.length
        speed = max(abs(self.motion.angle) * reach + norm(self.motion.travel), 1e-300)
        step = max(error / speed, 4e-16)
        high = t
        if gap(high) > 0.0:  # by rounding: just behind it
            high = min(1.0, high + 8.0 * step)
            if gap(high) > 0.0:
                return t
        low = high
        while low > 0.0 and gap(low) <= 0.0:
            low = max(0.0, high - step)
            step *= 2.0
        return root(gap, low, high, xtol=1e-16) if gap(low) > 0.0 > gap(high) else high
