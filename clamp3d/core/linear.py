"""Linear algebra in one order: the same bits on every processor, whatever BLAS and cores are there.

NumPy's ``@``, ``dot`` and ``linalg`` leave the order of a sum, and whether a product is rounded before it is added, to
the BLAS, which chooses by the processor. What reaches a printed number goes through here; the matrices are small.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.errors import SolverError

try:  # numpy.einsum without what chooses an order of many factors: three fifths of a small product's time
    from numpy._core.multiarray import c_einsum as _einsum
except ImportError:
    _einsum = np.einsum

Array = NDArray[np.float64]

_SUMS = {(1, 1): "i,i->", (1, 2): "i,ij->j", (2, 1): "ij,j->i", (2, 2): "ij,jk->ik", (3, 1): "nij,j->ni"}
_MANY = 300
"""Entries of a product that is worth a compiled loop."""


def dot(a: Any, b: Any) -> Array:
    """``a @ b`` of arrays.

    >>> dot(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([10.0, 1.0])).tolist()
    [12.0, 34.0]
    """
    if a.ndim == b.ndim == 2 and a.shape[0] * b.shape[1] > _MANY and a.shape[1] == b.shape[0] > 0:
        from clamp3d.core import kernel_linear

        out = np.empty((a.shape[0], b.shape[1]))
        kernel_linear.product(np.ascontiguousarray(a, np.float64), np.ascontiguousarray(b, np.float64), out)
        return out
    return np.asarray(_einsum(_SUMS.get((a.ndim, b.ndim), "...ij,...jk->...ik"), a, b, order="C"))


def norm(x: ArrayLike) -> float:
    """Square root of the sum of all squares.

    >>> norm([3.0, -4.0])
    5.0
    """
    return math.hypot(*np.ravel(x).tolist())


def cross(a: Array, b: Array) -> Array:
    """``numpy.cross`` of two vectors (3,), which it takes ten times as long for: it is made for arrays of them.

    >>> cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0])).tolist()
    [0.0, 0.0, 2.0]
    """
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def crosses(a: Array, b: Array) -> Array:
    """``numpy.cross`` of the rows of two arrays (n, 3), which takes longer to see that they are rows than to compute.

    >>> crosses(np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 2.0, 0.0]])).tolist()
    [[0.0, 0.0, 2.0]]
    """
    (x, y, z), (u, v, w) = a.T, b.T
    made = np.empty(a.shape)
    made[:, 0], made[:, 1], made[:, 2] = y * w - z * v, z * u - x * w, x * v - y * u
    return made


def atan2(y: Array, x: Array) -> Array:
    """``numpy.arctan2`` of the C library: NumPy has one for each kind of processor.

    >>> atan2(np.array([0.0, 1.0]), np.array([-1.0, 0.0])).round(3).tolist()
    [3.142, 1.571]
    """
    y, x = np.broadcast_arrays(y, x)
    return np.reshape(list(map(math.atan2, y.ravel().tolist(), x.ravel().tolist())), x.shape)


def to_target(T: Array, points: Array) -> Array:
    """Points (n, 3), or one (3,), of the source of the pose ``T_target_source`` as its target sees them; mm.

    >>> T = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    >>> to_target(T, np.array([1.0, 2.0, 3.0])).tolist()
    [3.0, 1.0, 3.0]
    """
    return dot(points, T[:3, :3].T) + T[:3, 3]


def to_source(T: Array, points: Array) -> Array:
    """Points (n, 3), or one (3,), of the target of the pose ``T_target_source`` as its source sees them; mm.

    >>> T = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    >>> to_source(T, np.array([3.0, 1.0, 3.0])).tolist()
    [1.0, 2.0, 3.0]
    """
    return dot(points - T[:3, 3], T[:3, :3])


def svd(A: ArrayLike) -> tuple[Array, Array, Array]:
    """Singular values (n,) of A (m, n), largest first, with rows (n, m) of lengths 1 or 0 and (n, n) of length 1.

    ``A = (left.T * sizes) @ right``. Unlike NumPy's, there are always n of them, also where A has fewer rows.

    >>> left, sizes, right = svd([[3.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    >>> sizes.tolist(), abs(right[2]).tolist()
    ([4.0, 3.0, 0.0], [0.0, 0.0, 1.0])
    """
    from clamp3d.core import kernel_linear

    left = np.array(np.asarray(A, np.float64).T, order="C")
    if not np.isfinite(left).all():
        raise SolverError("no singular values: an entry is not finite")
    right = np.eye(len(left))
    if kernel_linear.columns(left, right) < 0:
        raise SolverError(f"no singular values of {left.shape[1]} by {left.shape[0]}: the rotations do not end")
    sizes = np.sqrt((left * left).sum(axis=1))
    order = np.argsort(-sizes, kind="stable")
    left, sizes, right = left[order], sizes[order], right[order]
    return left / np.where(sizes > 0.0, sizes, 1.0)[:, None], sizes, right


def eigh(A: Array) -> tuple[Array, Array]:
    """Eigenvalues (n,), smallest first, and eigenvectors (n, n) in columns of a symmetric matrix.

    >>> eigh(np.array([[0.0, 2.0], [2.0, 0.0]]))[0].round(12).tolist()
    [-2.0, 2.0]
    """
    shift = norm(A)  # makes it positive, where singular values are eigenvalues
    _, sizes, right = svd(A + shift * np.eye(len(A)))
    return (sizes - shift)[::-1], right[::-1].T


def lstsq(A: Array, b: Array, least: float = 1e-15) -> tuple[Array, int]:
    """The shortest of the x with the least ``|A x - b|``, and the rank of A.

    Singular values below ``least`` times the largest count as 0.

    >>> lstsq(np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([1.0, 3.0]))
    (array([2., 0.]), 1)
    """
    left, sizes, right = svd(A)
    rank = int((sizes > least * sizes.max(initial=0.0)).sum())
    return dot(dot(left[:rank], b) / sizes[:rank], right[:rank]), rank
