"""Joining the pieces of one cylinder that a cut, a crack or a hole parts."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from clamp3d.core.linear import dot
from clamp3d.core.mesh import IntArray
from clamp3d.core.profile import sagitta
from clamp3d.fit.cylinder import Axis, fit_axis, perpendicular
from clamp3d.fit.grow import Region
from clamp3d.fit.measure import arc
from clamp3d.fit.surface import Surface


def join(surface: Surface, regions: list[Region]) -> list[Region]:
    """Join pieces of one cylinder that a cut, a crack or a hole parts, if one fit holds for both and they are close."""
    regions = list(regions)
    while True:
        for i, j in combinations(range(len(regions)), 2):
            both = _joined(surface, regions[i], regions[j])
            if both is not None:
                regions[i] = both
                del regions[j]
                break
        else:
            return regions


def _joined(surface: Surface, a: Region, b: Region) -> Region | None:
    if a.sign != b.sign or abs(a.axis.radius - b.axis.radius) > 0.2 * a.axis.radius:
        return None
    if abs(dot(a.axis.direction, b.axis.direction)) < 0.97:
        return None
    V, span = surface.V, max(a.span, b.span)
    large = (a if len(a.points) >= len(b.points) else b).axis
    tolerance = max(a.tolerance, b.tolerance)
    gap, _, shorter = _along(surface, large, a.faces, b.faces)
    if -gap > 0.5 * shorter:  # side by side
        tolerance = max(tolerance, 0.3 * sagitta(large.radius, span))
    points = np.union1d(a.points, b.points)
    axis = fit_axis(V[points], large)
    if axis is None:
        return None
    if any(np.quantile(np.abs(axis.residual(V[region.points])), 0.9) > tolerance for region in (a, b)):
        return None
    # Far apart along the axis they are two features: one groove would claim material where there is none.
    gap, length, shorter = _along(surface, axis, a.faces, b.faces)
    if gap > 0.25 * shorter:
        return None
    faces = np.concatenate([a.faces, b.faces])
    half = arc(surface, axis, *perpendicular(axis.direction), faces)[1]
    if float(surface.areas[faces].sum()) < 0.5 * 2.0 * half * axis.radius * length:
        return None
    return Region(axis, a.sign, faces, points, tolerance, span, a.strips and b.strips)


def _along(surface: Surface, axis: Axis, a: IntArray, b: IntArray) -> tuple[float, float, float]:
    """Gap along the axis between two sets of faces (negative: the length they share), length of both, and the shorter.

    All in mm.
    """
    spans = [dot(surface.V[np.unique(surface.F[f])] - axis.point, axis.direction) for f in (a, b)]
    (low_a, high_a), (low_b, high_b) = ((float(z.min()), float(z.max())) for z in spans)
    length = max(high_a, high_b) - min(low_a, low_b)
    return max(low_a - high_b, low_b - high_a), length, min(high_a - low_a, high_b - low_b)
