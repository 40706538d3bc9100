"""Non-negative least squares of a few rows and columns.

SciPy has it too, but its `optimize` takes 0.3 s of CPU to import, which is most of what a run of the reference takes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.core.pose import Array
from clamp3d.errors import SolverError


def nnls(A: ArrayLike, b: ArrayLike) -> Array:
    """The x >= 0 (n,) with the least |A x - b|, A (m, n). Raises SolverError where the method does not end."""
    from clamp3d.core import kernel_nonnegative

    A, b = (np.ascontiguousarray(value, dtype=np.float64) for value in (A, b))
    m, n = A.shape
    x, w, order, y, Q = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty((m, n + 1))
    if kernel_nonnegative.solve(A, b, x, w, order, y, Q) < 0:
        raise SolverError(f"non-negative least squares of {m} by {n} does not end")
    return x
