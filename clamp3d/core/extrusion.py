"""An outline drawn along an axis: the building block of every drawn solid. No mesh here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.core.pose import Array
from clamp3d.core.profile import Profile

# Columns: directions of the outline's a, b and of the drawing axis in part axes; both are right-handed.
_FRAMES = {
    "Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "Z": np.eye(3),
}


@dataclass(frozen=True, slots=True)
class Extrusion:
    """An outline drawn along part axis Y or Z from ``start`` to ``end`` mm.

    Along Y the outline's coordinates are (u, v), u = X and v = -Z; along Z they are (X, Y).
    """

    profile: Profile
    axis: Literal["Y", "Z"]
    start: float
    end: float

    @property
    def frame(self) -> Array:
        """Rotation (3, 3): outline coordinates (a, b, along) to part axes (X, Y, Z)."""
        return _FRAMES[self.axis].copy()

    @property
    def length(self) -> float:
        """Length along the axis in mm."""
        return self.end - self.start

    @property
    def volume(self) -> float:
        """Area times length in mm^3."""
        return self.profile.area * self.length

    def support(self, direction: ArrayLike) -> float:
        """Largest dot product of ``direction`` (3,) in part axes with a point of the body, mm; exact on arcs."""
        da, db, along = (float(d) for d in np.asarray(direction) @ _FRAMES[self.axis])
        return self.profile.support(da, db) + max(along * self.start, along * self.end)
