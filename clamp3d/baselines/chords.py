"""The paper's convex partitioning in the section: each arc replaced by equal chords (its Section 4.2, Fig. 9)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from clamp3d.baselines.model import Pieces, check_unit_angle, pose_of, poses_of
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose
from clamp3d.geometry.primitives import SweptArc
from clamp3d.geometry.profile import chord_count, sagitta
from clamp3d.kernel.contact_model import GroovePair

_PARALLEL = 1e-9  # rad: over a wire of 1 m it is 1e-6 mm
_FACE = 1e3
"""The flat faces beside the mouth are drawn this long, in radii; the material has no end there."""


class Chords:
    """Arcs as ``ceil(arc / unit_angle)`` equal chords with their ends on the arc; angles in rad.

    Works in the section: the cylinder must be parallel to the groove (InputError otherwise). The chords lie inside
    the hollow by up to R (1 - cos(unit_angle / 2)), so the model sees the groove too tight and never too wide.
    """

    name = "chords"
    limits = ("parallel axes only", "groove too tight by the chord error")
    meshes_built = 0

    def __init__(self, unit_angle: float = math.radians(5.0)) -> None:
        self.unit_angle = check_unit_angle(unit_angle)

    def segments(self, pairs: Iterable[GroovePair]) -> int:
        """Chords of the grooves of ``pairs`` together: m of Table 5."""
        return sum(len(_polyline(pair.groove, self.unit_angle)[2]) - 2 for pair in pairs)

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every chord and to the two faces; see `ContactModel`."""
        T_a_b = check_pose(pose_of(pair, T_a_b), "T_a_b")
        T = (pair.T_groove_a @ T_a_b) @ pair.T_b_cylinder
        centre = _section_point(T[None])[0]
        starts, ends, features = _polyline(pair.groove, self.unit_angle)
        distance, foot, normal = _signed(centre, starts, ends)
        R, p = pair.T_a_groove[:3, :3], pair.T_a_groove[:3, 3]
        point = (np.column_stack([foot, np.full(len(foot), T[2, 3])]) @ R.T) + p
        return Pieces(distance - pair.cylinder.radius, point, np.column_stack([normal, 0.0 * distance]) @ R.T, features)

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) for poses (n, 4, 4); see `ContactModel`."""
        T = (pair.T_groove_a @ poses_of(pair, T_a_b)) @ pair.T_b_cylinder
        starts, ends, _ = _polyline(pair.groove, self.unit_angle)
        signed = [_signed(centre, starts, ends)[0].min() for centre in _section_point(T)]
        return np.array(signed) - pair.cylinder.radius


def chord_error(groove: SweptArc, unit_angle: float) -> float:
    """Largest distance in mm between the groove's arc and equal chords of at most ``unit_angle`` rad."""
    arc = 2.0 * groove.half_angle
    return sagitta(groove.radius, arc / chord_count(arc, unit_angle))


@lru_cache(maxsize=64)
def _polyline(groove: SweptArc, unit_angle: float) -> tuple[Array, Array, tuple[str, ...]]:
    """Starts and ends (m + 2, 2) of the segments from left to right, hollow on their left side."""
    m = chord_count(2.0 * groove.half_angle, unit_angle)
    phi = np.linspace(-groove.half_angle, groove.half_angle, m + 1)
    on_arc = groove.radius * np.column_stack([np.sin(phi), -np.cos(phi)])
    far = np.array([_FACE * groove.radius, 0.0])
    points = np.vstack([on_arc[0] - far, on_arc, on_arc[-1] + far])
    features = ("face left", *(f"chord {i + 1}" for i in range(m)), "face right")
    return points[:-1], points[1:], features


def _section_point(T: Array) -> Array:
    """The cylinder's axis point (n, 2) in the groove's section; InputError where the axes are not parallel."""
    lean = np.abs(T[:, :2, 2]).max(initial=0.0)
    if lean > _PARALLEL:
        raise InputError(
            f"method 'chords' measures parallel axes only, got {lean:.3g} rad; use cas, wedges, hulls or mesh"
        )
    return T[:, :2, 3]


def _signed(centre: Array, starts: Array, ends: Array) -> tuple[Array, Array, Array]:
    """Distance (k,), foot (k, 2) and normal (k, 2) from each segment to a point, negative where it is in the material.

    The hollow is convex: below the faces a point is in the material if it is behind any chord. Above them it is not,
    though it may be behind the last chords of a major arc.
    """
    along = ends - starts
    length = np.sqrt((along**2).sum(1))
    unit = along / length[:, None]
    left = np.column_stack([-unit[:, 1], unit[:, 0]])
    offset = centre - starts
    t = (offset * unit).sum(1)
    clamped = np.clip(t, 0.0, length)
    foot = starts + clamped[:, None] * unit
    height = (offset * left).sum(1)
    gap = np.hypot(t - clamped, height)
    within = t == clamped
    solid = centre[1] <= starts[0, 1] and (height[1:-1] < 0.0).any()
    facing = within & (solid | (height >= 0.0))
    distance = np.where(facing, height, gap)
    normal = np.where(facing[:, None], left, (centre - foot) / np.where(gap > 0.0, gap, 1.0)[:, None])
    return distance, foot, normal
