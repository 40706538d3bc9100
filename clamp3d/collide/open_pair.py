"""A motion past a mesh that is not closed: nothing is said to be clear while that may come to wind round the other.

Into a closed surface nothing gets without crossing it, so one look at the middle of a stretch is enough. Through the
hole of an open one it does: how much of all directions the surface hides from a point changes along the way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.model import Model
from clamp3d.collide.moving_pair import MovingPair
from clamp3d.collide.open_mesh import OPEN_ERROR
from clamp3d.collide.surface import Surface
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.linear import norm, to_target
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array, inverse
from clamp3d.core.shells import corners_of, winding_number


def moving_pair(moving: Model, still: Model, motion: Motion, start: Array, T_still: Array) -> MovingPair:
    """A shape that moves against one that stands, both placed (4, 4) in the world at t = 0."""
    kind = MovingPair if moving.closed and still.closed else OpenPair
    return kind(moving, still, motion, start, T_still)


class OpenPair(MovingPair):
    """The same where one shape at least is a mesh that is not closed."""

    _asked: tuple[float, float, bool] | None = None
    _unknown = False

    def ask(self, t: float, enough: Callable[[Distance], bool], thresholds: Thresholds) -> Distance:
        """As of closed ones; an overlap of unknown depth is told as deeper than any, the more so the nearer they are.

        So the search goes on, towards where the surfaces come closest: they may cross, which is certain.
        """
        found = super().ask(t, enough, thresholds)
        if found.lower > 0.0:
            return found
        self._unknown = True
        return replace(found, lower=found.upper - 2.0 * self._deepest)

    def lower(self, t: float, half: float, here: float, wanted: float, meshes: float | None = None) -> float:
        """As of closed ones; deep in an overlap where one may be inside of the other at some time of the stretch."""
        if here <= 0.0:
            return here - self.speed * half
        low = super().lower(t, half, here, wanted, meshes)
        # Once an inside is unknown the motion is a clash or undecided, and only where surfaces come close matters.
        if (low <= 0.0 and self._unknown) or self._may_hold(t, half):
            return min(here, self._deepest) - self.speed * half - 2.0 * self._deepest
        return low

    @cached_property
    def _deepest(self) -> float:
        """More than any overlap of the two, mm."""
        (one, long), (other, wide) = ((min(size), norm(size)) for size in map(_size, (self.a, self.b)))
        return float(min(one + wide, other + long))

    def by_meshes(self, t: float, half: float, wanted: float, apart: bool = False) -> float:
        """As of closed ones; minus infinity also where one may be inside of the other at some time of the stretch."""
        low = super().by_meshes(t, half, wanted, apart)
        return -np.inf if low > 0.0 and self._may_hold(t, half) else low

    def _may_hold(self, t: float, half: float) -> bool:
        """Whether, for all that the middle says, one shape may wind round the other from t - half to t + half."""
        if self._asked is None or self._asked[:2] != (t, half):
            mine, other = self.a.outer(OPEN_ERROR), self.b.outer(OPEN_ERROR)
            core, kernel = self.a.inner(OPEN_ERROR) or mine, self.b.inner(OPEN_ERROR) or other
            T, way = self.pose(t), self.motion
            # Seen from the moving part a standing point turns about an axis that has travelled as well.
            standing = to_target(self.T_still, other.shell_points.reshape(-1, 3))
            speed = max(self.speed, way.speed(standing) + abs(way.angle) * norm(way.travel))
            held = _may_wind(other, core, inverse(T), half * speed) or _may_wind(mine, kernel, T, half * speed)
            self._asked = (t, half, held)
        return self._asked[2]


def _size(model: Model) -> Array:
    """Lengths (3,) of the box around a shape, mm."""
    return np.asarray(model.bounds[1] - model.bounds[0])


def _may_wind(outer: Surface, inner: Surface, T: Array, travel: float) -> bool:
    """Whether ``outer``, if it has an edge, may wind round ``inner``, placed by ``T`` (4, 4) but for ``travel`` mm."""
    if outer.rimless:
        return False
    points = to_target(T, inner.shell_points.reshape(-1, 3))
    points = points[((points >= outer.box[0] - travel) & (points <= outer.box[1] + travel)).all(axis=1)]
    start, way = outer.rim
    corners = corners_of(outer.vertices, outer.faces)
    length = np.linalg.norm(way, axis=1)
    for point in points:
        along = np.clip(np.einsum("ij,ij->i", point - start, way) / length**2, 0.0, 1.0)
        away = np.linalg.norm(start + along[:, None] * way - point, axis=1) - travel
        if away.min() <= 0.0:
            return True
        # The gradient of a solid angle is the field of a current in the surface's edge (Biot and Savart).
        change = travel * float((length / away**2).sum()) / (4.0 * np.pi)
        if change >= 0.5 or abs(winding_number(corners, point)) + change > 0.5:
            return True
    return False
