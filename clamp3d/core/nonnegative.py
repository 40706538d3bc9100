"""Non-negative least squares by SciPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.core.pose import Array
from clamp3d.errors import SolverError


def nnls(A: ArrayLike, b: ArrayLike) -> Array:
    """The x >= 0 (n,) with the least |A x - b|, A (m, n). Raises SolverError where the method does not end."""
    from scipy import optimize

    try:
        return np.asarray(optimize.nnls(np.asarray(A, np.float64), np.asarray(b, np.float64))[0])
    except RuntimeError as error:
        raise SolverError(f"non-negative least squares does not end: {error}") from None
