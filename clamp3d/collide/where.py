"""Where two parts overlap: the volume that they share between bounds, a box around it, and a point deep inside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from clamp3d.collide.model import Model
from clamp3d.collide.overlap import common, deepest
from clamp3d.core.linear import to_target
from clamp3d.core.pose import Array

_ERRORS = (0.064, 0.008, 0.001)
"""Chord errors (mm) of the meshes that are tried, until the volume is known to `_SHARE`."""
_SHARE = 0.005


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """Where two parts overlap.

    Attributes
    ----------
    volume : (float, float)
        The volume that they share lies between these, mm^3.
    box : ndarray (2, 3)
        Lower and upper corner of a box in the world that holds all of the overlap, mm.
    point : ndarray (3,) or None
        A point of the world that lies in both parts; None where no mesh inside them overlaps.
    of_facets : bool
        Whether volume, box and point are those of the given meshes, whose round faces are off by their chords.
    """

    volume: tuple[float, float]
    box: Array
    point: Array | None
    of_facets: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        low, high = self.volume
        return {
            "volume_at_least_mm3": low,
            "volume_at_most_mm3": high,
            "volume_of_facets": self.of_facets,
            "box_mm": self.box.tolist(),
            "point": None if self.point is None else self.point.tolist(),
        }


def locator(a: Model, b: Model, T_a: Array, T_ab: Array) -> Callable[[], Overlap | None]:
    """`locate` when asked, once: ``b`` at ``T_ab`` (4, 4) in a's frame, ``a`` at ``T_a`` in the world."""
    return cache(lambda: locate(a, b, T_a, T_ab))


def locate(a: Model, b: Model, T_a: Array, T_ab: Array) -> Overlap | None:
    """Where two parts overlap; None if not even meshes around them do, or one has no inside that is known."""
    found = None
    if not (a.closed and b.closed):
        return found
    for error in _ERRORS:
        outer_a, outer_b = a.outer(error), b.outer(error)
        outer = common(outer_a, outer_b, T_ab)
        if outer is None:
            return found
        inner_a, inner_b = a.inner(error), b.inner(error)
        inner, point = None, None
        if inner_a is not None and inner_b is not None:
            inner = common(inner_a, inner_b, T_ab) if a.refines or b.refines else outer
            if inner is not None:
                point = to_target(T_a, deepest(inner_a, inner_b, T_ab, inner)[1])
        world = to_target(T_a, outer.vertices)
        rounding = 1e-11 * (outer_a.scale + outer_b.scale)
        slack = rounding * float(outer.normals[1].sum())
        low, high = 0.0 if inner is None else max(0.0, inner.volume - slack), outer.volume + slack
        box = np.array([world.min(axis=0) - rounding, world.max(axis=0) + rounding])
        found = Overlap((low, high), box, point, outer_a.error + outer_b.error > 0.0)
        if high - low <= _SHARE * high or not (a.refines or b.refines):
            break
    return found
