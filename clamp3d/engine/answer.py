"""The signed distance of two bodies between proven bounds: one result type for every pair, model and command.

The signed distance of two bodies is their distance where they are apart. Where they overlap it is minus the
penetration depth: the length of the shortest translation that separates them, as in FCL, coal and Bullet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clamp3d.geometry.pose import Array, to_target

_TOUCHING = 1e-6
"""Overlap (mm) up to which pieces count as touching: a body that is thinner could be between two of them unseen."""


def lower_of_union(least: float) -> float:
    """Lower bound (mm) of a distance from the ``least`` of those of its pieces: of an overlap there is none."""
    return least if least >= -_TOUCHING else -math.inf


@dataclass(frozen=True, slots=True, eq=False)
class Distance:
    """Signed distance of two bodies, between proven bounds.

    Attributes
    ----------
    lower, upper : float
        The distance lies between these, mm; positive apart, in an overlap minus the depth. Infinite where nothing is
        known: of an overlap of which only ``upper`` is, the depth is at least ``-upper``. In a row of `check` whose
        verdict is contact or allowed they bound minus the interference, which decides it: ``lower`` then says how deep
        a point of one body can be inside the other, and the way out may be longer.
    point_a, point_b : ndarray (3,) or None
        Points on the two bodies: the nearest ones, in an overlap those that part last as b moves out; None if unknown.
    normal : ndarray (3,) or None
        Unit vector from a to b, ``point_b = point_a + value * normal`` to within the bounds; in an overlap the
        direction in which b moves out. None where no direction is known.
    interference : tuple of float or None
        Bounds of the greatest depth (mm) of a point of one body inside the other, which is never more than the
        penetration depth: of a pin pressed into a hole it is small, though the way out is long. None where not asked.
    unique : bool or None
        Whether the nearest points are the only ones; None where that is not known.
    level, method : str
        The refinement level and the method that gave the last word.
    estimate : float or None
        What a contact model says, mm; None for the exact engine, whose ``value`` is ``upper``.
    """

    lower: float = -math.inf
    upper: float = math.inf
    point_a: Array | None = None
    point_b: Array | None = None
    normal: Array | None = None
    unique: bool | None = None
    level: str = ""
    method: str = ""
    estimate: float | None = None
    interference: tuple[float, float] | None = None

    @property
    def value(self) -> float:
        """The distance in mm: the upper bound, or what a contact model says."""
        return self.upper if self.estimate is None else self.estimate

    @property
    def uncertainty(self) -> float:
        """How far ``value`` can be off, mm; infinite where a bound is."""
        if math.isinf(self.lower) or math.isinf(self.upper):
            return math.inf
        return max(self.upper - self.value, self.value - self.lower)

    @property
    def depth(self) -> float:
        """Penetration depth in mm, 0 for bodies that are apart: ``-value``, so the least one that the bounds allow."""
        return max(0.0, -self.value)

    @property
    def direction(self) -> Array | None:
        """Unit vector (3,) in which b moves out of an overlap; None where there is none for certain."""
        return self.normal if self.upper < 0.0 else None

    def meet(self, other: Distance) -> Distance:
        """Both at once: the tighter of the bounds on either side."""
        if other.lower <= self.lower and other.upper >= self.upper:
            return self if self.normal is not None else replace(self, normal=other.normal)
        best = self if self.upper <= other.upper else other
        by = (self if self.lower >= other.lower else other).normal
        normal = best.normal if by is None else by
        return replace(best, lower=max(self.lower, other.lower), normal=normal, level=other.level, method=other.method)

    def union(self, other: Distance) -> Distance:
        """Bounds for the nearer of two pieces; none of an overlap from below.

        Where the pieces meet, neither knows how deep a point lies in both together.
        """
        best, rest = (self, other) if (self.upper, self.lower) <= (other.upper, other.lower) else (other, self)
        unique = best.unique
        if rest.lower <= best.upper + 1e-9:  # the other may be as near, at another place
            unique = None
            if rest.point_a is not None and best.point_a is not None and rest.upper <= best.upper + 1e-9:
                unique = False if np.abs(rest.point_a - best.point_a).max() > 1e-6 else best.unique
        return replace(best, lower=lower_of_union(min(self.lower, other.lower)), unique=unique)

    def widened(self, error: float) -> Distance:
        """The interval enlarged by ``error`` mm on both sides."""
        return self if error == 0.0 else replace(self, lower=self.lower - error, upper=self.upper + error)

    def of_overlap(self) -> Distance:
        """What the engine says of an overlap, whose ``lower`` is not one of the depth, without it."""
        return replace(self, lower=-math.inf) if self.lower < 0.0 else self

    def moved(self, T: Array) -> Distance:
        """The same with points and normal taken along by ``T`` (4, 4)."""
        p, q = (None if x is None else to_target(T, x) for x in (self.point_a, self.point_b))
        n = None if self.normal is None else T[:3, :3] @ self.normal
        known = self.unique, self.level, self.method, self.estimate, self.interference
        return Distance(self.lower, self.upper, p, q, n, *known)

    def swapped(self) -> Distance:
        """The distance of b and a in place of a and b."""
        normal = None if self.normal is None else -self.normal
        return replace(self, point_a=self.point_b, point_b=self.point_a, normal=normal)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; unknown numbers are None."""
        return {
            "distance_mm": _finite(self.value),
            "error_bound_mm": _finite(self.uncertainty),
            "at_least_mm": _finite(self.lower),
            "at_most_mm": _finite(self.upper),
            "point_a": _list(self.point_a),
            "point_b": _list(self.point_b),
            "normal": _list(self.normal),
            "depth_mm": _finite(self.depth),
            "direction": _list(self.direction),
            "interference_mm": None if self.interference is None else [_finite(x) for x in self.interference],
            "unique": self.unique,
            "level": self.level,
            "method": self.method,
        }

    @property
    def text(self) -> str:
        """The value and how far it can be off; the inequality where only one bound is known."""
        if math.isfinite(self.uncertainty):
            return f"{self.value:.12g} mm, uncertainty {self.uncertainty:.1e}"
        said = "" if self.estimate is None else f"{self.estimate:.12g} mm by the model, "
        if math.isfinite(self.upper):
            return f"{said}at most {self.upper:.12g} mm"
        return f"{said}at least {self.lower:.12g} mm" if math.isfinite(self.lower) else f"{said}no bounds known"

    def __repr__(self) -> str:
        return f"Distance({self.text}, {self.method!r})"


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """The same for n poses: the fields of `Distance` as arrays, ``method`` for all of them.

    ``lower``, ``upper`` (n,); ``point_a``, ``point_b``, ``normal`` (n, 3), NaN where unknown.
    """

    lower: Array
    upper: Array
    point_a: Array
    point_b: Array
    normal: Array
    method: tuple[str, ...]

    @property
    def value(self) -> Array:
        """The distances (n,) in mm: the upper bounds."""
        return self.upper

    @property
    def uncertainty(self) -> Array:
        """How far each of ``value`` can be off, (n,) mm."""
        return self.upper - self.lower

    def __len__(self) -> int:
        return len(self.upper)

    def __repr__(self) -> str:
        least = f", least {self.upper.min():.9g} mm" if len(self) else ""
        return f"Distances({len(self)} poses{least})"


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def _list(x: Array | None) -> list[float] | None:
    return None if x is None else [float(v) for v in x]


Enough = Callable[[Distance], bool]
"""Whether what is known of a distance is enough for the one who asks."""
