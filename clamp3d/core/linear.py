"""Small linear algebra by NumPy, under the names that the package calls it by."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

dot = np.matmul
atan2 = np.arctan2


def norm(x: ArrayLike) -> float:
    """Square root of the sum of all squares.

    >>> norm([3.0, -4.0])
    5.0
    """
    return float(np.linalg.norm(np.ravel(x)))


def cross(a: Array, b: Array) -> Array:
    """Cross product of two vectors (3,): ``numpy.cross`` is made for arrays of them, and takes ten times as long.

    >>> cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])).tolist()
    [0.0, 0.0, 2.0]
    """
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


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
