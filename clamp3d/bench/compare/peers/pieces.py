"""The block as few and thin convex pieces as its surface needs near the groove, and which of them can be nearest.

Behind each chord of the arc lies a prism of four corners, beside the mouth a box on either side. The wire is at most
0.3 mm deep in the block, so that prisms of 3 mm show it the same surface as wedges down to the block's back, and
bounding boxes that fit far better.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from clamp3d.bench.compare.scene import DEPTH, GROOVE, WIDTH
from clamp3d.core.pose import Array
from clamp3d.core.profile import chord_count

THICKNESS = 3.0
"""Of the prisms, mm."""
TRIANGLES = np.array(
    [
        (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
        (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
    ]
)  # fmt: skip
"""Of a prism's corners, outward."""

_START = -0.5 * math.pi - GROOVE.half_angle
_HALF_LENGTH = 0.5 * GROOVE.length


def prisms(unit_angle: float) -> list[Array]:
    """Corners (8, 3) of the prism behind each chord of at most ``unit_angle`` rad, in the groove's frame."""
    angles = np.linspace(_START, _START + 2.0 * GROOVE.half_angle, chord_count(2.0 * GROOVE.half_angle, unit_angle) + 1)
    rim = np.column_stack([np.cos(angles), np.sin(angles)])
    near, far = GROOVE.radius * rim, (GROOVE.radius + THICKNESS) * rim
    made = []
    for k in range(len(angles) - 1):
        section = [near[k], far[k], far[k + 1], near[k + 1]]
        made.append(np.array([(*p, z) for z in (-_HALF_LENGTH, _HALF_LENGTH) for p in section]))
    return made


def boxes() -> list[tuple[Array, Array]]:
    """Size (3,) and centre (3,) of the two boxes beside the mouth, mm."""
    side, face = GROOVE.radius * math.sin(GROOVE.half_angle), -GROOVE.radius * math.cos(GROOVE.half_angle)
    size = np.array([0.5 * WIDTH - side, DEPTH, GROOVE.length])
    return [(size, np.array([s * 0.5 * (side + 0.5 * WIDTH), face - 0.5 * DEPTH, 0.0])) for s in (-1.0, 1.0)]


def sectors(count: int) -> Callable[[Array], tuple[int, int]]:
    """The two of ``count`` prisms that the wire's axis points at where it passes the block's end faces.

    The distance from the axis to the arc is least at one of these two places (it is concave along the axis).
    """
    step, H = 2.0 * GROOVE.half_angle / count, _HALF_LENGTH

    def at(x: float, y: float) -> int:
        k = int((math.atan2(y, x) - _START) % (2.0 * math.pi) / step)
        return k if k < count else count - 1 if k < 0.5 * (count + 2.0 * math.pi / step) else 0

    def find(T: Array) -> tuple[int, int]:
        dx, dy, dz, x, y, z = T[0, 2], T[1, 2], T[2, 2], T[0, 3], T[1, 3], T[2, 3]
        low, high = (-H - z) / dz, (H - z) / dz
        return at(x + low * dx, y + low * dy), at(x + high * dx, y + high * dy)

    return find
