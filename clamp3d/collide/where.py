"""Where two parts overlap: the volume that they share between bounds, a box around it, and a point deep inside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from typing import Any

import numpy as np

from clamp3d.collide.model import Model
from clamp3d.collide.overlap import Common, common, deepest
from clamp3d.collide.surface import Surface
from clamp3d.core.linear import to_target
from clamp3d.core.pose import Array

_ERRORS = (0.064, 0.008, 0.001)
"""Chord errors (mm) of the meshes that are tried, until the volume is known to `_SHARE`."""
_SHARE = 0.005


@dataclass(frozen=True, eq=False)
class Overlap:
    """Where two parts overlap.

    Attributes
    ----------
    volume : (float, float)
        The volume that they share lies between these, mm^3.
    box : ndarray (2, 3)
        Lower and upper corner of a box in the world that holds all of the overlap, mm.
    of_facets : bool
        Whether volume, box and point are those of the given meshes, whose round faces are off by their chords.
    find : callable
        Finds ``point``; asked once, by those who want to know it.
    """

    volume: tuple[float, float]
    box: Array
    of_facets: bool = False
    find: Callable[[], Array | None] = field(default=lambda: None, repr=False)

    @cached_property
    def point(self) -> Array | None:
        """A point (3,) of the world that lies in both parts; None where no mesh inside them overlaps."""
        return self.find()

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
        inner = None
        if inner_a is outer_a and inner_b is outer_b:
            inner = outer
        elif inner_a is not None and inner_b is not None:
            inner = common(inner_a, inner_b, T_ab)
        within = None if inner is None or inner_a is None or inner_b is None else (inner_a, inner_b, T_ab, inner)
        world = to_target(T_a, outer.vertices)
        rounding = 1e-11 * (outer_a.scale + outer_b.scale)
        slack = rounding * float(outer.normals[1].sum())
        low, high = 0.0 if inner is None else max(0.0, inner.volume - slack), outer.volume + slack
        box = np.array([world.min(axis=0) - rounding, world.max(axis=0) + rounding])
        find = partial(_point, T_a, within)
        found = Overlap((low, high), box, outer_a.error + outer_b.error > 0.0, find)
        if high - low <= _SHARE * high or not (a.refines or b.refines):
            break
    return found


def _point(T: Array, within: tuple[Surface, Surface, Array, Common] | None) -> Array | None:
    """The deepest point of what two meshes share, in the world; None if they share nothing."""
    return None if within is None else to_target(T, deepest(*within)[1])
