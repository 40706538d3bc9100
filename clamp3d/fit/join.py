"""Joining the pieces of one cylinder that a cut, a crack or a hole parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.fit.cylinder import Axis, fit_axis, perpendicular
from clamp3d.fit.grow import Region
from clamp3d.fit.measure import arc
from clamp3d.fit.surface import Surface, sagitta

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


def join(surface: Surface, regions: list[Region]) -> list[Region]:
    """Join pieces of one cylinder that a cut, a crack or a hole parts, if one fit holds for both and they are close."""
    regions = list(regions)
    merged = True
    while merged:
        merged = False
        for i in range(len(regions)):
            for j in range(i + 1, len(regions)):
                both = _one(surface, regions[i], regions[j])
                if both is not None:
                    regions[i] = both
                    del regions[j]
                    merged = True
                    break
            if merged:
                break
    return regions


def _one(surface: Surface, a: Region, b: Region) -> Region | None:
    if a.sign != b.sign or abs(a.axis.radius - b.axis.radius) > 0.2 * a.axis.radius:
        return None
    if abs(a.axis.direction @ b.axis.direction) < 0.97:
        return None
    large = a if len(a.points) >= len(b.points) else b
    V = surface.V
    tolerance = max(a.tolerance, b.tolerance)
    if _side_by_side(surface, large.axis, a.faces, b.faces):
        tolerance = max(tolerance, 0.3 * sagitta(large.axis.radius, max(a.span, b.span)))
    points = np.union1d(a.points, b.points)
    axis = fit_axis(V[points], large.axis)
    if axis is None:
        return None
    for region in (a, b):
        if float(np.quantile(np.abs(axis.residual(V[region.points])), 0.9)) > tolerance:
            return None
    faces = np.concatenate([a.faces, b.faces])
    # Far apart along the axis they are two features: one groove would claim material where there is none.
    za, zb = ((V[np.unique(surface.F[r.faces])] - axis.point) @ axis.direction for r in (a, b))
    gap = max(float(za.min() - zb.max()), float(zb.min() - za.max()))
    if gap > 0.25 * min(float(np.ptp(za)), float(np.ptp(zb))):
        return None
    u, w = perpendicular(axis.direction)
    half = arc(surface, axis, u, w, faces)[1]
    z = np.concatenate([za, zb])
    area = float(surface.areas[faces].sum())
    if area < 0.5 * 2.0 * half * axis.radius * float(np.ptp(z)):
        return None
    return Region(axis, a.sign, faces, points, tolerance, max(a.span, b.span), a.strips and b.strips)


def _side_by_side(surface: Surface, axis: Axis, a: IntArray, b: IntArray) -> bool:
    """True if both sets of faces cover much the same length of the axis."""
    za, zb = ((surface.V[np.unique(surface.F[f])] - axis.point) @ axis.direction for f in (a, b))
    shared = min(float(za.max()), float(zb.max())) - max(float(za.min()), float(zb.min()))
    return shared > 0.5 * min(float(np.ptp(za)), float(np.ptp(zb)))
