"""The scene on which all methods are compared: a wire in a 140 degree groove, at poses whose distance is known.

Groove R 12, wire radius 10.5, block 137 x 30 x 60: a scene with published figures for chords and for CoACD. The poses
and their signed distances to 25 digits are data (``data/compare_poses.csv``), found at 50 digits by a search that
knows only the distance of a point from the groove (``scripts/make-compare-poses``).
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines import chords
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.pose import Array, rotation
from clamp3d.geometry.primitives import Cylinder, SweptArc
from clamp3d.geometry.profile import Arc, Profile
from clamp3d.geometry.shapes import Solid
from clamp3d.kernel.contact_model import GroovePair


def grooved_block(groove: SweptArc, *, width: float, depth: float) -> Solid:
    """Block ``width`` x ``depth`` mm in section, as long as its groove, whose mouth is in the middle of the top face.

    The arc centre is the part's origin, the mouth is up (+Z), the groove runs along Y: of the block so
    turned the figures of CoACD's hulls are known.

    >>> block = grooved_block(SweptArc(12.0, math.radians(70.0), 60.0), width=137.0, depth=30.0)
    >>> block.bounds.round(3).tolist()
    [[-68.5, -30.0, -34.104], [68.5, 30.0, -4.104]]
    """
    R, half = groove.radius, groove.half_angle
    face = R * math.cos(half)
    w, bottom = width / 2, face + depth
    outline = Profile.of(
        (-w, face), Arc((0.0, 0.0), R, math.pi / 2 + half, math.pi / 2 - half), (w, face), (w, bottom), (-w, bottom)
    )
    body = Extrusion(outline, "Y", -groove.length / 2, groove.length / 2)
    return Solid("P1", (body,), title="Grooved block", volume=body.volume)


def block_pair(groove: SweptArc, wire: Cylinder) -> GroovePair:
    """The groove of `grooved_block` (as part P1) and a wire (P6) whose own frame has its axis on Y."""
    lay: Array = rotation([1.0, 0.0, 0.0], math.pi / 2)
    lay = lay.round()  # a quarter turn has no rounding: mouth +y to Z, groove axis z to -Y
    return GroovePair("P1", "P6", groove, lay, wire, lay)


GROOVE = SweptArc(12.0, math.radians(70.0), 60.0)
WIRE = Cylinder(10.5, 200.0)
WIDTH, DEPTH = 137.0, 30.0
"""Of the block in mm; it is as long as its groove."""
BLOCK = grooved_block(GROOVE, width=WIDTH, depth=DEPTH)
"""The grooved block in its part frame."""
PAIR = block_pair(GROOVE, WIRE)
"""Groove and wire for a contact model."""

BANDS = (0.02, 1e-4, 1e-6)
"""Near contact: poses with a distance of either sign up to so many mm."""
CLEAR, OVERLAP = "clear", "overlap"


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses ``T`` (n, 4, 4) of the wire in the groove's frame with their ``distance`` (n,) mm, exact to rounding.

    ``group`` (n,) is 'clear' (1e-3 to 1 mm apart), 'overlap' (up to 0.3 mm deep) or a band as '0.02', '0.0001',
    '1e-06'; ``parallel`` (n,) tells the poses with parallel axes. ``residual`` (n,) is what the 25 digits have beyond
    ``distance``.
    """

    T: Array
    distance: Array
    residual: Array
    group: NDArray[np.str_]
    parallel: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.distance)

    def select(self, keep: NDArray[np.bool_]) -> Poses:
        """Those where ``keep`` (n,) is true."""
        return Poses(self.T[keep], self.distance[keep], self.residual[keep], self.group[keep], self.parallel[keep])

    def error(self, values: Array) -> Array:
        """``values`` (n,) less the exact distances, in mm, right to far below rounding."""
        return np.asarray((values - self.distance) - self.residual)


@lru_cache(maxsize=1)
def known_poses() -> Poses:
    """All poses, 210 with parallel axes and 210 tilted by up to 1.7 degrees.

    >>> poses = known_poses()
    >>> len(poses), int((poses.group == CLEAR).sum())
    (420, 120)
    """
    from fractions import Fraction

    text = resources.files("clamp3d.bench").joinpath("data/compare_poses.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    T = np.array(
        [pose([float(row[k]) for k in ("x", "y", "z")], [float(row[k]) for k in ("a", "b", "c")]) for row in rows]
    )
    distance = np.array([float(row["distance"]) for row in rows])
    residual = [float(Fraction(row["distance"]) - Fraction(d)) for row, d in zip(rows, distance.tolist(), strict=True)]
    group, lean = (np.array([row[k] for row in rows]) for k in ("group", "lean"))
    return Poses(T, distance, np.array(residual), group, lean == "parallel")


def pose(origin: list[float], turn: list[float]) -> Array:
    """Pose (4, 4) from ``origin`` (mm) and Cayley parameters: lean ``(a, b)`` of the axis, then ``c`` about itself.

    Only sums, products and quotients make the axis, so that it is the same to the last bit on every machine.
    """
    a, b, c = turn
    lean = 1.0 + a * a + b * b
    C = np.array(
        [
            [1.0 + a * a - b * b, 2.0 * a * b, 2.0 * b],
            [2.0 * a * b, 1.0 - a * a + b * b, -2.0 * a],
            [-2.0 * b, 2.0 * a, 1.0 - a * a - b * b],
        ]
    )
    spin = 1.0 + c * c
    S = np.array([[(1.0 - c * c) / spin, -2.0 * c / spin, 0.0], [2.0 * c / spin, (1.0 - c * c) / spin, 0.0]])
    T = np.eye(4)
    T[:3, 2] = C[:, 2] / lean
    T[:3, :2] = (C / lean)[:, :2] @ S[:, :2]
    T[:3, 3] = origin
    return T


def chord_error(unit_angle: float) -> float:
    """Largest distance in mm between the groove's arc and equal chords of at most ``unit_angle`` rad.

    >>> [round(chord_error(math.radians(a)), 5) for a in (1.0, 5.0, 10.0, 20.0)]
    [0.00046, 0.01142, 0.04566, 0.18231]
    """
    return chords.chord_error(GROOVE, unit_angle)
