"""Small linear algebra by NumPy, under the names that the package calls it by."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.errors import SolverError

Array = NDArray[np.float64]

dot = np.matmul
atan2 = np.arctan2
crosses = np.cross


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


def svd(A: ArrayLike) -> tuple[Array, Array, Array]:
    """Singular values (n,) of A (m, n), largest first, with rows (n, m) and (n, n): ``A = (left.T * sizes) @ right``.

    Unlike NumPy's, there are always n of them, also where A has fewer rows.

    >>> left, sizes, right = svd([[3.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    >>> sizes.tolist(), abs(right[2]).tolist()
    ([4.0, 3.0, 0.0], [0.0, 0.0, 1.0])
    """
    rows = np.asarray(A, np.float64)
    if not np.isfinite(rows).all():
        raise SolverError("no singular values: an entry is not finite")
    m, n = rows.shape
    left, sizes, right = np.linalg.svd(np.vstack([rows, np.zeros((max(0, n - m), n))]), full_matrices=False)
    return left.T[:, :m], sizes, right


def eigh(A: Array) -> tuple[Array, Array]:
    """Eigenvalues (n,), smallest first, and eigenvectors (n, n) in columns of a symmetric matrix."""
    values, vectors = np.linalg.eigh(A)
    return values, vectors


def lstsq(A: Array, b: Array, least: float = 1e-15) -> tuple[Array, int]:
    """The shortest of the x with the least ``|A x - b|``, and the rank of A.

    Singular values below ``least`` times the largest count as 0.

    >>> x, rank = lstsq(np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([1.0, 3.0]))
    >>> x.round(12).tolist(), rank
    ([2.0, 0.0], 1)
    """
    x, _, rank, _ = np.linalg.lstsq(A, b, rcond=least)
    return np.asarray(x, dtype=np.float64), int(rank)
