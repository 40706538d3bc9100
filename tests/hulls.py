"""The distance of convex hulls of points: an oracle that knows neither faces nor trees nor boxes."""

import numpy as np
from scipy.optimize import nnls


def apart(one, other):
    """Distance of the convex hulls of two sets of points (k, 3) and (m, 3).

    By least squares over weights that are not negative (Lawson and Hanson, *Solving Least Squares Problems*, 1974,
    chapter 23).
    """
    ends = (one[:, None] - other[None]).reshape(-1, 3).T
    weights, _ = nnls(np.vstack([ends, np.ones(ends.shape[1])]), np.array([0.0, 0.0, 0.0, 1.0]))
    return float(np.linalg.norm(ends @ weights) / weights.sum())
