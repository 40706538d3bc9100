"""Rigid poses: 4x4 column-vector matrices ``T_target_source``, and the paper's section frame.

World frame: X right, Y along the wires (away from the viewer), Z up. Section frame of the paper: x right, y down,
angles counter-clockwise as seen; so x = X, y = -Z, and a positive angle turns X towards Z.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.checks import array, number
from clamp3d.errors import InputError
from clamp3d.geometry.primitives import LARGEST

Array = NDArray[np.float64]

RIGID_TOLERANCE = 1e-9
"""Largest entry of R R^T - 1 that still counts as a rotation (rounding of a product of many poses)."""
REPAIR_TOLERANCE = 1e-4
"""Largest entry of R R^T - 1 that counts as rounding of the input: single precision has 1e-7, four decimals 3e-4."""
UNIT_TOLERANCE = 1e-3
"""How far from 1 the length of a quaternion that is given may be: three decimals are 9e-4 off at most."""
_AS_IT_IS = 0.999 * RIGID_TOLERANCE  # what the kernel refuses by another rounding of the same sums is mended


class PoseWarning(UserWarning):
    """A pose with rounding errors (single precision, few printed digits) was brought to the nearest rotation."""


def check_pose(pose: ArrayLike, name: str = "pose") -> Array:
    """Check that a pose is rigid, and mend its rounding errors.

    Parameters
    ----------
    pose : array_like of shape (4, 4)
        Pose ``T_target_source``; lengths in mm.
    name : str
        Name for the messages.

    Returns
    -------
    ndarray of shape (4, 4)
        The pose as float64: as it is if R R^T deviates from 1 by at most ``RIGID_TOLERANCE``, otherwise with the
        nearest rotation.

    Raises
    ------
    InputError
        If the shape is wrong, a number is not finite, or the matrix scales, shears or reflects: R R^T deviates from
        1 by more than ``REPAIR_TOLERANCE``, or the determinant is negative.

    Warns
    -----
    PoseWarning
        If the rotation was mended.

    Examples
    --------
    >>> check_pose(np.diag([2.0, 1.0, 1.0, 1.0]))
    Traceback (most recent call last):
    clamp3d.errors.InputError: pose must be rigid: its rotation part deviates from orthonormal by 3
    """
    T = array(name, pose, (4, 4), finite=False)
    checked: Array = _checked(T[None], lambda i: name)[0]
    return checked


def check_pose_array(poses: ArrayLike, name: str = "poses") -> Array:
    """Check many poses as `check_pose` does, with one warning for all that were mended.

    Parameters
    ----------
    poses : array_like of shape (n, 4, 4)
        Poses; lengths in mm.
    name : str
        Name for the messages, which add the index of the first pose that they mean.

    Returns
    -------
    ndarray of shape (n, 4, 4)
        The poses as float64; the same numbers if nothing was to be mended.

    Raises
    ------
    InputError
        For the first pose that is not rigid.
    """
    return _checked(array(name, poses, (None, 4, 4), finite=False), lambda i: f"{name}[{i}]")


def _checked(T: Array, label: Callable[[int], str]) -> Array:
    """Poses (n, 4, 4) with rounding errors mended; ``label`` names the pose of an index in messages."""
    R = T[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
        broken = np.array(
            [
                ~np.isfinite(T).all(axis=(1, 2)),
                (T[:, 3] != (0.0, 0.0, 0.0, 1.0)).any(axis=1),
                ~(np.abs(T[:, :3, 3]).sum(axis=1) < LARGEST),
                ~(deviation <= REPAIR_TOLERANCE),
                ~(np.linalg.det(R) > 0.0),
            ]
        )
    if broken.any():
        i = int(broken.any(axis=0).argmax())
        rules = (
            "be finite, got a NaN or infinite entry",
            f"have the last row 0 0 0 1, got {T[i, 3].tolist()}",
            f"have an offset below {LARGEST:g} mm, got {T[i, :3, 3].tolist()}",
            f"be rigid: its rotation part deviates from orthonormal by {deviation[i]:.3g}",
            "be rigid: it reflects (determinant -1)",
        )
        raise InputError(f"{label(i)} must {rules[int(broken[:, i].argmax())]}")
    rough = np.flatnonzero(deviation > _AS_IT_IS)
    if len(rough):
        i = int(rough[0])
        text = f"{label(i)} has rounding errors ({deviation[i]:.0e} from orthonormal): the nearest rotation is taken"
        warnings.warn(text, PoseWarning, stacklevel=4)
        T = T.copy()
        T[rough] = nearest_rigid(T[rough])
    return T


def nearest_rigid(T: Array) -> Array:
    """Poses with the nearest rotation (in the Frobenius norm) in place of their upper left 3x3 block.

    Parameters
    ----------
    T : ndarray of shape (4, 4) or (n, 4, 4)
        Finite poses; of one that reflects the direction that is stretched least is turned over.

    Returns
    -------
    ndarray
        Rigid poses, shape as ``T``.

    Examples
    --------
    >>> rounded = rotation((1, 2, 3), 0.5).round(6)
    >>> bool(np.abs(nearest_rigid(rounded) - rotation((1, 2, 3), 0.5)).max() < 1e-6)
    True
    """
    U, _, Vt = np.linalg.svd(T[..., :3, :3])  # SciPy's conversions take a small stretch for a turn
    U[..., 2] *= np.sign(np.linalg.det(T[..., :3, :3]))[..., None]
    out = T.copy()
    out[..., :3, :3] = U @ Vt
    return out


def inverse(T: Array) -> Array:
    """Inverse of rigid poses, by the transpose.

    Parameters
    ----------
    T : ndarray of shape (..., 4, 4)
        Rigid poses.

    Returns
    -------
    ndarray of shape (..., 4, 4)
        ``T_source_target`` for every ``T_target_source``.
    """
    out = np.zeros_like(T)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = Rt
    out[..., :3, 3] = -(Rt @ T[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def to_target(T: Array, points: Array) -> Array:
    """Points (n, 3), or one (3,), of the source of the pose ``T_target_source`` as its target sees them; mm.

    >>> T = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    >>> to_target(T, np.array([1.0, 2.0, 3.0])).tolist()
    [3.0, 1.0, 3.0]
    """
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def to_source(T: Array, points: Array) -> Array:
    """Points (n, 3), or one (3,), of the target of the pose ``T_target_source`` as its source sees them; mm.

    >>> T = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    >>> to_source(T, np.array([3.0, 1.0, 3.0])).tolist()
    [1.0, 2.0, 3.0]
    """
    return np.asarray((points - T[:3, 3]) @ T[:3, :3])


def norm(vector: ArrayLike) -> float:
    """Length of a vector (n,).

    >>> norm([3.0, -4.0])
    5.0
    """
    return float(np.linalg.norm(vector))


def cross(a: Array, b: Array) -> Array:
    """Cross product of two vectors (3,): ``numpy.cross`` is made for arrays of them, and takes ten times as long.

    >>> cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])).tolist()
    [0.0, 0.0, 2.0]
    """
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def translation(x: float, y: float, z: float) -> Array:
    """Pose of a translation.

    Parameters
    ----------
    x, y, z : float
        Components in mm.

    Returns
    -------
    ndarray of shape (4, 4)
        The pose.

    Raises
    ------
    InputError
        If a value is not a finite number.
    """
    T = np.eye(4)
    T[:3, 3] = number("x", x), number("y", y), number("z", z)
    return T


def unit(axis: Array, name: str = "axis") -> Array:
    """Unit vector along a finite vector.

    Parameters
    ----------
    axis : ndarray of shape (3,)
        Vector of any length but zero.
    name : str
        Name for the message.

    Returns
    -------
    ndarray of shape (3,)
        Its direction.

    Raises
    ------
    InputError
        If the vector is zero.
    """
    largest = float(np.abs(axis).max())
    if largest == 0.0:
        raise InputError(f"{name} must not be zero")
    # A power of two changes no digit, and no square overflows or underflows.
    scaled = np.ldexp(axis, -math.frexp(largest)[1]) if not 1e-100 < largest < 1e100 else axis
    return np.asarray(scaled / norm(scaled))


def rotation(axis: ArrayLike, angle: float) -> Array:
    """Pose of a rotation about an axis through the origin, right-handed.

    Parameters
    ----------
    axis : array_like of shape (3,)
        Direction of the axis, of any length but zero.
    angle : float
        Angle in rad.

    Returns
    -------
    ndarray of shape (4, 4)
        The pose.

    Raises
    ------
    InputError
        If a number is not finite, or the axis is zero.

    Examples
    --------
    >>> (rotation((0, 0, 2), np.pi / 2) @ (1.0, 0.0, 0.0, 1.0)).round(12).tolist()
    [0.0, 1.0, 0.0, 1.0]
    """
    a, angle = unit(array("axis", axis, (3,))), number("angle", angle)
    T = np.eye(4)
    # By its quaternion: a rotation vector of many turns would lose the digits of the angle's sine.
    x, y, z = (math.sin(0.5 * angle) * a).tolist()
    T[:3, :3] = turn_of(x, y, z, math.cos(0.5 * angle))
    return T


def turn_of(x: float, y: float, z: float, w: float) -> Array:
    """Rotation matrix (3, 3) of a quaternion that is not 0; SciPy's Rotation takes 0.4 s of CPU to import.

    >>> turn_of(0.0, 0.0, 1.0, 1.0).round(12).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    size = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / size, y / size, z / size, w / size
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )


@dataclass(frozen=True, slots=True)
class SectionPose:
    """Where a part lies in the paper's section frame.

    Attributes
    ----------
    x, y : float
        Position in mm, x right and y down.
    angle : float
        Angle in rad, counter-clockwise as seen.
    along : float
        How far the part's middle is behind the section, on the wires' direction Y; mm.
    """

    x: float
    y: float
    angle: float = 0.0
    along: float = 0.0

    def __post_init__(self) -> None:
        values = self.x, self.y, self.angle, self.along
        if set(map(type, values)) == {float} and math.isfinite(sum(values)):  # solvers make thousands of them
            return
        for name in ("x", "y", "angle", "along"):
            object.__setattr__(self, name, number(name, getattr(self, name)))

    def T(self) -> Array:
        """World pose (4, 4) of the part."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return np.array([[c, 0.0, -s, self.x], [0.0, 1.0, 0.0, self.along], [s, 0.0, c, -self.y], [0.0, 0.0, 0.0, 1.0]])

    def point(self, u: float, v: float) -> tuple[float, float]:
        """Section coordinates (x, y) in mm of the part's own point (u right, v down).

        Examples
        --------
        >>> SectionPose(1.0, 2.0, np.pi / 2).point(3.0, 0.0)
        (1.0000000000000002, -1.0)
        """
        right, down = self.direction(u, v)
        return self.x + right, self.y + down

    def direction(self, u: float, v: float) -> tuple[float, float]:
        """Section direction (right, down) of the part's own direction (u right, v down)."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return u * c + v * s, v * c - u * s

    def local(self, x: float, y: float) -> tuple[float, float]:
        """The part's own coordinates (u right, v down) in mm of a section point (x, y): the inverse of `point`."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        right, down = x - self.x, y - self.y
        return right * c - down * s, right * s + down * c
