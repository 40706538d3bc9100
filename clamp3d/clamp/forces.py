"""A contact force, per newton of bolt force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clamp3d.clamp.dimensions import PartName
from clamp3d.geometry.pose import Array

HELD = "held on the bolt's axis"
"""What carries the sideways force that frictionless contacts leave, where the joints are said to have no play."""


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """A contact force: part a pushes part b.

    Attributes
    ----------
    a, b : str
        The two parts.
    feature : str
        What touches, as the section names it; `HELD` is no contact but an assumption.
    force : float
        Newton per newton of bolt force.
    point : ndarray (3,)
        Where it acts, in the world, mm.
    direction : ndarray (3,)
        Unit vector in which b is pushed, in the world.
    """

    a: PartName
    b: PartName
    feature: str
    force: float
    point: Array
    direction: Array


def world_force(q: Array, a: PartName, b: PartName, feature: str, push: Array, at: Any) -> Force:
    """A force from what the section knows: ``push`` (2,) and ``at`` (2,) in P1's section frame at the state ``q``."""
    size = float(np.hypot(*push))
    point = np.array([at[0] - q[0], 0.0, q[1] - at[1]])
    return Force(a, b, feature, size, point, np.array([push[0], 0.0, -push[1]]) / size)
