"""An outline drawn along an axis: the building block of every drawn solid. No mesh here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.geometry.pose import Array
from clamp3d.geometry.profile import Profile

# Columns: directions of the outline's a, b and of the drawing axis in part axes; both are right-handed.
_FRAMES = {
    "Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "Z": np.eye(3),
}


@dataclass(frozen=True, slots=True)
class Extrusion:
    """An outline drawn along a part axis.

    Attributes
    ----------
    profile : Profile
        The outline. Its coordinates are (X, Y) along Z; along Y they are (u, v) with u = X and v = -Z.
    axis : {"Y", "Z"}
        Part axis that it is drawn along.
    start, end : float
        Coordinates of the ends on that axis in mm.

    Examples
    --------
    >>> Extrusion(Profile.rectangle(2.0, 3.0), "Z", -5.0, 5.0).volume
    60.0
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
        """Support function of the body, exact on arcs.

        Parameters
        ----------
        direction : array_like of shape (3,)
            Direction in part axes, of any length.

        Returns
        -------
        float
            Largest dot product of ``direction`` with a point of the body, in mm.
        """
        da, db, along = (float(d) for d in np.asarray(direction) @ _FRAMES[self.axis])
        return self.profile.support(da, db) + max(along * self.start, along * self.end)
