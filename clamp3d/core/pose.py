"""Rigid poses: 4x4 column-vector matrices ``T_target_source``, and the paper's section frame.

World frame: X right, Y along the wires (away from the viewer), Z up. Section frame of the paper: x right, y down,
angles counter-clockwise as seen; so x = X, y = -Z, and a positive angle turns X towards Z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import array, number
from clamp3d.core.primitives import LARGEST
from clamp3d.errors import InputError

Array = NDArray[np.float64]

RIGID_TOLERANCE = 1e-9
"""Largest entry of R R^T - 1 that still counts as a rotation (rounding of a product of many poses)."""


def check_pose(pose: ArrayLike, name: str = "pose") -> Array:
    """Return ``pose`` as a (4, 4) float64 array if it is rigid.

    Raises InputError if the shape is wrong, a number is not finite, or the matrix scales, shears or reflects.

    >>> check_pose(np.diag([2.0, 1.0, 1.0, 1.0]))
    Traceback (most recent call last):
    clamp3d.errors.InputError: pose must be rigid: its rotation part deviates from orthonormal by 3
    """
    T = array(name, pose, (4, 4), finite=False)
    if not np.isfinite(T).all():
        raise InputError(f"{name} must be finite, got a NaN or infinite entry")
    if not np.array_equal(T[3], (0.0, 0.0, 0.0, 1.0)):
        raise InputError(f"{name} must have the last row 0 0 0 1, got {T[3].tolist()}")
    if not np.abs(T[:3, 3]).max() < LARGEST:
        raise InputError(f"{name} must have an offset below {LARGEST:g} mm, got {T[:3, 3].tolist()}")
    R = T[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = float(np.abs(R @ R.T - np.eye(3)).max())
    if not deviation <= RIGID_TOLERANCE:
        raise InputError(f"{name} must be rigid: its rotation part deviates from orthonormal by {deviation:.3g}")
    if np.linalg.det(R) < 0:
        raise InputError(f"{name} must be rigid: it reflects (determinant -1)")
    return T


def inverse(T: Array) -> Array:
    """Inverse of rigid poses, shape (..., 4, 4)."""
    out = np.zeros_like(T)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = Rt
    out[..., :3, 3] = -(Rt @ T[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def translation(x: float, y: float, z: float) -> Array:
    """Pose that moves by (x, y, z) mm. Raises InputError for what is no finite number."""
    T = np.eye(4)
    T[:3, 3] = number("x", x), number("y", y), number("z", z)
    return T


def unit(axis: Array, name: str = "axis") -> Array:
    """Direction (3,) of a finite vector, of any length but zero. Raises InputError for that."""
    largest = float(np.abs(axis).max())
    if largest == 0.0:
        raise InputError(f"{name} must not be zero")
    # A power of two changes no digit, and no square overflows or underflows.
    scaled = np.ldexp(axis, -math.frexp(largest)[1]) if not 1e-100 < largest < 1e100 else axis
    return np.asarray(scaled / np.linalg.norm(scaled))


def rotation(axis: ArrayLike, angle: float) -> Array:
    """Pose that turns by ``angle`` rad about ``axis`` (3,) through the origin, right-handed (Rodrigues' formula).

    Raises InputError for numbers that are not finite, or an axis of length zero.
    """
    a, angle = array("axis", axis, (3,)), number("angle", angle)
    a = unit(a)
    K = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    T = np.eye(4)
    # 2 sin^2(t/2) in place of 1 - cos t keeps small angles exact.
    T[:3, :3] += np.sin(angle) * K + 2.0 * np.sin(0.5 * angle) ** 2 * (K @ K)
    return T


@dataclass(frozen=True, slots=True)
class SectionPose:
    """Where a part lies in the paper's section frame: ``x`` right and ``y`` down in mm, ``angle`` ccw in rad."""

    x: float
    y: float
    angle: float = 0.0

    def __post_init__(self) -> None:
        for name in ("x", "y", "angle"):
            object.__setattr__(self, name, number(name, getattr(self, name)))

    def T(self, along: float = 0.0) -> Array:
        """World pose (4, 4), the part's middle at ``along`` mm on the wires' direction Y."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, 0.0, -s, self.x], [0.0, 1.0, 0.0, along], [s, 0.0, c, -self.y], [0.0, 0.0, 0.0, 1.0]])

    def point(self, u: float, v: float) -> tuple[float, float]:
        """Section coordinates (x, y) of the part's own point (u right, v down).

        >>> SectionPose(1.0, 2.0, np.pi / 2).point(3.0, 0.0)
        (1.0000000000000002, -1.0)
        """
        c, s = np.cos(self.angle), np.sin(self.angle)
        return float(self.x + u * c + v * s), float(self.y - u * s + v * c)
