"""The block as libraries want it, as far as the wire can come near it: boxes, triangles; and which box can be nearest.

Behind each chord of the arc lies a box, beside the mouth one on either side. The wire is at most 0.3 mm deep in the
block, so that boxes of 3 mm show it the same surface as wedges down to the block's back, and bounding boxes that fit
far better. As triangles it is the faces of the groove and beside its mouth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from clamp3d.bench.compare.scene import DEPTH, GROOVE, WIDTH, WIRE
from clamp3d.geometry.pose import Array, translation
from clamp3d.geometry.profile import chord_count

THICKNESS = 3.0
"""Of the boxes behind the chords, mm."""
AXIS = (np.array([[0.0, 0.0, z] for z in (-0.5 * WIRE.length, 0.0, 0.5 * WIRE.length)]), np.array([[0, 1, 2]]))
"""The wire's axis as a mesh: a triangle whose corners (3, 3) lie in a line. Its distance less the wire's radius is the
wire's, with a depth, as long as the axis is outside the material; it has no facets, and boxes about it are thin.
"""

_START = -0.5 * math.pi - GROOVE.half_angle
_HALF_LENGTH = 0.5 * GROOVE.length
_MOUTH = GROOVE.radius * math.sin(GROOVE.half_angle), -GROOVE.radius * math.cos(GROOVE.half_angle)


def _rim(unit_angle: float) -> Array:
    """Ends (n, 2) of chords of at most ``unit_angle`` rad."""
    angles = np.linspace(_START, _START + 2.0 * GROOVE.half_angle, chord_count(2.0 * GROOVE.half_angle, unit_angle) + 1)
    return GROOVE.radius * np.column_stack([np.cos(angles), np.sin(angles)])


def boxes(unit_angle: float) -> list[tuple[Array, Array]]:
    """Size (3,) and pose (4, 4) in the groove's frame: the box behind each chord, then the two beside the mouth."""
    rim, placed = _rim(unit_angle), []
    for a, b in pairwise(rim):
        middle, width = 0.5 * (a + b), math.dist(a, b)
        along, out = (b - a) / width, middle / math.hypot(*middle)
        T = np.eye(4)
        T[:2, 0], T[:2, 1], T[:2, 3] = along, out, middle + 0.5 * THICKNESS * out
        T[2, 2] = along[0] * out[1] - along[1] * out[0]
        placed.append((np.array([width, THICKNESS, GROOVE.length]), T))
    side, face = _MOUTH
    for s in (-1.0, 1.0):
        T = translation(s * 0.5 * (side + 0.5 * WIDTH), face - 0.5 * DEPTH, 0.0)
        placed.append((np.array([0.5 * WIDTH - side, DEPTH, GROOVE.length]), T))
    return placed


def surface(unit_angle: float) -> tuple[Array, Array]:
    """Corners (n, 3) and triangles (m, 3): two for each chord in order, between those of the faces beside the mouth."""
    outline = [(-0.5 * WIDTH, _MOUTH[1]), *_rim(unit_angle), (0.5 * WIDTH, _MOUTH[1])]
    V = np.array([(*p, z) for p in outline for z in (-_HALF_LENGTH, _HALF_LENGTH)])
    return V, np.array([t for k in range(0, len(V) - 2, 2) for t in ((k, k + 2, k + 3), (k, k + 3, k + 1))])


def sectors(count: int) -> Callable[[Array], tuple[int, int]]:
    """The two of ``count`` chords that the wire's axis points at where it passes the block's end faces.

    The distance from the axis to the arc is least at one of these two places (it is concave along the axis).
    """
    step, H = 2.0 * GROOVE.half_angle / count, _HALF_LENGTH

    def at(x: float, y: float) -> int:
        k = int((math.atan2(y, x) - _START) % (2.0 * math.pi) / step)
        return k if k < count else count - 1 if k < 0.5 * (count + 2.0 * math.pi / step) else 0

    def find(T: Array) -> tuple[int, int]:
        (_, _, dx, x), (_, _, dy, y), (_, _, dz, z), _ = T.tolist()  # Python's floats are quicker than NumPy's
        low, high = (-H - z) / dz, (H - z) / dz
        return at(x + low * dx, y + low * dy), at(x + high * dx, y + high * dy)

    return find
