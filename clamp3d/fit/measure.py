"""From the triangles of a cylinder to its frame, extent and errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import stdtrit

from clamp3d.fit.axis import Axis, covered, frame, perpendicular, turned, upward
from clamp3d.fit.cylinder import CONFIDENCE, covariance, surface_error
from clamp3d.fit.grow import Region
from clamp3d.fit.surface import BoolArray, Surface, angles, border
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array, to_source
from clamp3d.geometry.profile import sagitta

FULL_TURN_GAP = np.radians(30.0)
"""A surface whose largest uncovered angle is below this goes all the way round; chosen: a mouth is wider."""


def arc(surface: Surface, axis: Axis, faces: IntArray) -> tuple[float, float]:
    """Middle (rad, as `frame` turns) and half angle of the arc that ``faces`` cover; half angle pi for a full turn."""
    a = angles(surface, axis, faces, *perpendicular(axis.direction))
    return covered(a[:, :1] + turned(a, a[:, :1]), FULL_TURN_GAP)


def _ends(values: Array, lengths: Array, sides: list[BoolArray], step: float) -> tuple[float, float, float] | None:
    """Low and high end of ``values`` (k,) and their error: medians of border edges by their lengths on two ``sides``.

    None where one side has no border. Triangles across the border, facets of ``step``, may straddle an edge and belong
    to neither side: the end lies about half a facet further, half a facet uncertain.
    """
    ends, errors = [], []
    for sign, side in zip((-1.0, 1.0), sides, strict=True):
        if not side.any():
            return None
        v, w = values[side], lengths[side]
        middle = float(np.quantile(v, 0.5, method="inverted_cdf", weights=w))
        # A few border edges belong to a corner or a pock mark: nine tenths of the border say how far it strays.
        stray = float(np.quantile(np.abs(v - middle), 0.9, method="inverted_cdf", weights=w))
        ends.append(middle + sign * 0.5 * step)
        errors.append(stray + 0.5 * step)
    return ends[0], ends[1], max(errors)


def measure(surface: Surface, region: Region) -> dict[str, Any] | None:
    """Frame, extent, residuals and errors of ``region``; None if the points leave the cylinder open."""
    axis = Axis(region.axis.point, upward(region.axis.direction), region.axis.radius)
    middle, half = arc(surface, axis, region.faces)
    T = frame(axis, middle, 0.0)
    corners = to_source(T, surface.V[np.unique(surface.F[region.faces])])
    z0, z1 = float(corners[:, 2].min()), float(corners[:, 2].max())
    crossing, _, _ = border(surface, region.faces)
    edges = np.concatenate([surface.edges[crossing], surface.rim[np.isin(surface.rim_faces, region.faces)]])
    local = to_source(T, surface.V[edges])
    lengths = np.linalg.norm(local[:, 1] - local[:, 0], axis=1)
    along = np.abs(local[:, 1, 2] - local[:, 0, 2]) > 0.5 * lengths
    z, angle = local[:, :, 2].mean(axis=1), np.arctan2(local[:, :, 0], -local[:, :, 1]).mean(axis=1)
    # Off the corners, where the two kinds of border mix.
    v, t = (2.0 * z - z0 - z1) / (z1 - z0), angle / half
    length_error = arc_error = 0.0
    rounds = [~along & (k * v > 0.8) & (np.abs(t) < 0.85) for k in (-1, 1)]
    facet = float(np.median(np.ptp((surface.V[surface.F[region.faces]]) @ axis.direction, axis=1)))
    if ends := _ends(z, lengths, rounds, _straddling(region, facet, z1 - z0)):
        z0, z1, length_error = ends
    lips = [along & (k * t > 0.8) & (np.abs(v) < 0.85) for k in (-1, 1)]
    corner = angles(surface, axis, region.faces, *perpendicular(axis.direction))
    facet = float(np.median(np.ptp(turned(corner, corner[:, :1]), axis=1)))
    if half < np.pi and (ends := _ends(angle, lengths, lips, _straddling(region, facet, 2.0 * half))):
        a, b, arc_error = ends
        half, middle = 0.5 * (b - a), middle + 0.5 * (a + b)
    if z1 <= z0 or half <= 0.0:
        return None
    errors = _errors(surface, region, axis, frame(axis, middle, 0.5 * (z0 + z1)), (half, z1 - z0))
    return None if errors is None else errors | {"arc_error": arc_error, "length_error": length_error}


def _errors(
    surface: Surface, region: Region, axis: Axis, T: Array, extent: tuple[float, float]
) -> dict[str, Any] | None:
    """Values of a `FittedSurface` with frame ``T`` (4, 4) and ``extent`` (half angle, length); None if it is open."""
    half, length = extent
    points = to_source(T, surface.V[region.points])
    residual = np.hypot(points[:, 0], points[:, 1]) - axis.radius
    worst = float(np.abs(residual).max())
    if region.strips:
        worst = max(worst, _off_ridges(surface, region))
    freedom = max(len(points) - 5, 1)
    rms = float(np.sqrt((residual @ residual) / freedom))
    noise = float(np.hypot(rms, surface.mesh.rounding))
    C = covariance(points, axis.radius, noise)
    if C is None:
        return None
    area = float(surface.areas[region.faces].sum())
    return {
        "radius": axis.radius,
        "half_angle": half,
        "length": length,
        "T_part_feature": T,
        "residual_rms": rms,
        "residual_max": float(np.abs(residual).max()),
        "points": len(points),
        "covered_area": area,
        # Few points know their own scatter badly: three standard errors shall mean 99.73 % all the same.
        "covariance": C * (stdtrit(freedom, 0.5 * (1.0 - CONFIDENCE)) / 3.0) ** 2,
        "covariance_error": surface_error(C, half, length, freedom),
        "form_error": worst + 2.0 * surface.mesh.rounding,
        "chord_error": sagitta(axis.radius, region.span),
        "faces": surface.rows[region.faces],
    }


def _straddling(region: Region, facet: float, extent: float) -> float:
    """Size of the triangles that may straddle a region's border: those of strips, and as long ones, end at it."""
    return 0.0 if region.strips or facet >= 0.5 * extent else facet


def _off_ridges(surface: Surface, region: Region) -> float:
    """How far (mm) the lines between the strips are at most off the surface: what lies on chords is within a strip.

    An exact tessellation has no scatter that would average out, and the fit may have taken some lines for chords.
    """
    within = border(surface, region.faces)[2] & (surface.step > surface.floor)
    ends = surface.V[np.unique(surface.edges[within])]
    return float(np.abs(region.axis.residual(ends)).max(initial=0.0))
