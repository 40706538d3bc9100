"""Linear algebra of a few rows and columns, the same bits on every machine with the same mathematics library.

NumPy and SciPy hand these to BLAS and LAPACK, whose order of additions depends on the processor, on how many cores the
process may use, and on the library; and SciPy's optimize takes 0.4 s of CPU to import for one function. Arrays are
float64, and small: nothing here is blocked or made for large ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.core.pose import Array
from clamp3d.errors import SolverError


def _floats(value: ArrayLike) -> Array:
    return np.ascontiguousarray(value, dtype=np.float64)


def product(A: Array, B: Array) -> Array:
    """Matrix products as ``A @ B``, also of a stack (n, i, j) with one matrix or with as many."""
    from clamp3d.core import kernel_solve

    A, B = _floats(A), _floats(B)
    a, b = (X if X.ndim == 3 else X[None] for X in (A, B))
    if a.shape[2] != b.shape[1] or (len(a) != len(b) and 1 not in (len(a), len(b))):
        raise ValueError(f"cannot multiply {A.shape} by {B.shape}")
    out = np.empty((max(len(a), len(b)) if len(a) and len(b) else 0, a.shape[1], b.shape[2]))
    kernel_solve.product(a, b, out)
    return out if 3 in (A.ndim, B.ndim) else out[0]


def nnls(A: ArrayLike, b: ArrayLike) -> Array:
    """The x >= 0 (n,) with the least |A x - b|, A (m, n). Raises SolverError where the method does not end."""
    from clamp3d.core import kernel_solve

    A, b = _floats(A), _floats(b)
    m, n = A.shape
    x, w, order, y, Q = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty((m, n + 1))
    if kernel_solve.nnls(A, b, x, w, order, y, Q) < 0:
        raise SolverError(f"non-negative least squares of {m} by {n} does not end")
    return x


def svd(A: ArrayLike) -> tuple[Array, Array, Array]:
    """U diag(sizes) (m, n), the singular values (n,) falling, and all right singular vectors as rows (n, n)."""
    from clamp3d.core import kernel_solve

    U = np.array(A, dtype=np.float64, order="C", ndmin=2)
    n = U.shape[1]
    V, sizes = np.empty((n, n)), np.empty(n)
    kernel_solve.svd(U, V, sizes)
    return U, sizes, V.T


def lstsq(A: ArrayLike, b: ArrayLike, rcond: float = 2.0**-52) -> Array:
    """The shortest x (n,) with the least |A x - b|; singular values below ``rcond`` of the largest count as 0."""
    U, sizes, rows = svd(A)
    rank = int((sizes > rcond * sizes[:1].sum()).sum())
    b = _floats(b)[:, None]
    along = product(np.ascontiguousarray(U.T[:rank]), b)[:, 0] / sizes[:rank] ** 2
    return np.asarray(product(along[None], rows[:rank])[0]) if rank else np.zeros(len(rows))


def eigh(S: ArrayLike) -> tuple[Array, Array]:
    """Eigenvalues (n,) of a symmetric matrix, in no order, and their axes as columns (n, n)."""
    from clamp3d.core import kernel_solve

    diagonal = np.array(S, dtype=np.float64, order="C")
    axes = np.empty_like(diagonal)
    kernel_solve.eigh(diagonal, axes)
    return diagonal.diagonal(), axes
