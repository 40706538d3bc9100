"""Whether round holes through a box leave something of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from clamp3d.core.pose import Array, norm

Circle = tuple[float, float, float]
"""Radius, and the centre along x and across, from the middle of the box."""
_ROUNDING = 1e-12
"""Relative to the box: what is thinner is nothing."""


def leaves_something(half: Array, across: Mapping[str, Sequence[Circle]]) -> bool:
    """Whether something of a box of ``half`` sizes (x, y, z) mm is in no hole; holes by their axis, "y" or "z".

    At one x the holes along z cover stretches of y, those along y stretches of z; both must leave one. Which stretches
    meet changes only where a circle begins or ends, meets another one or a side: it is asked between these places.

    >>> leaves_something(np.array([5.0, 5.0, 5.0]), {"z": [(6.0, -3.0, 0.0), (6.0, 3.0, 0.0)]})
    False
    >>> leaves_something(np.array([5.0, 5.0, 5.0]), {"z": [(5.5, -3.0, 0.0), (5.5, 3.0, 0.0)]})
    True
    """
    sides = {"z": float(half[1]), "y": float(half[2])}
    # No x is covered where all circles together are too small for it, which they nearly always are.
    if sum(math.pi * r * r / (2.0 * sides[axis]) for axis in across for r, _, _ in across[axis]) < 2.0 * half[0]:
        return True
    places = {-float(half[0]), float(half[0])}
    for axis, circles in across.items():
        for r, x, v in circles:
            places |= {x - r, x + r}
            for side in (-sides[axis], sides[axis]):
                wide = r * r - (side - v) ** 2
                places |= {x - math.sqrt(wide), x + math.sqrt(wide)} if wide > 0.0 else set()
        for one, other in itertools.combinations(circles, 2):
            places |= _meeting(one, other)
    inside = sorted(x for x in places if abs(x) <= half[0])
    least = _ROUNDING * float(half.max())
    return any(
        all(_leaves(circles, 0.5 * (a + b), sides[axis], least) for axis, circles in across.items())
        for a, b in itertools.pairwise(inside)
        if b - a > least
    )


def _meeting(one: Circle, other: Circle) -> set[float]:
    """Where along x two circles meet."""
    way = np.array(other[1:]) - one[1:]
    size = norm(way)
    if size == 0.0:
        return set()
    along = 0.5 * (size + (one[0] ** 2 - other[0] ** 2) / size)
    aside = one[0] ** 2 - along**2
    if aside < 0.0:
        return set()
    middle, off = one[1] + along * way[0] / size, math.sqrt(aside) * way[1] / size
    return {float(middle - off), float(middle + off)}


def _leaves(circles: Sequence[Circle], x: float, side: float, least: float) -> bool:
    """Whether the circles leave a stretch of the line at ``x`` from -side to side."""
    covered = sorted((v - h, v + h) for r, c, v in circles if (h := math.sqrt(max(r * r - (x - c) ** 2, 0.0))) > 0.0)
    reached = -side
    for start, end in covered:
        if start > reached + least:
            break
        reached = max(reached, end)
    return reached < side - least
