"""Quantiles of samples, and of Fisher's F and Student's t distribution.

SciPy's are the same; to import its special functions takes longer than to find all round surfaces of a CAD part.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from clamp3d.core.pose import Array


def quantile(values: Array, share: float) -> float:
    """What a ``share`` of some values (n,) is at most, between two of them by their distance.

    ``numpy.quantile`` and ``numpy.median`` are the same, and ask numpy.ma whether the values are masked.

    >>> quantile(np.array([4.0, 1.0, 3.0, 2.0]), 0.5)
    2.5
    """
    ordered, place = np.sort(values), share * (len(values) - 1)
    low = int(place)
    between = place - low
    return float(ordered[low] if not between else (1.0 - between) * ordered[low] + between * ordered[low + 1])


@lru_cache
def fisher(k: int, n: int, tail: float) -> float:
    """What a ratio F with ``k`` and ``n`` degrees of freedom exceeds with probability ``tail``.

    >>> round(fisher(5, 10, 0.05), 4)
    3.3258
    """
    # By u = log F the density is log-concave, so log P(F > e^u) is concave: Newton's iteration converges.
    u = 0.0
    for _ in range(200):
        ratio = k * math.exp(u) / n
        log_density = 0.5 * k * math.log(ratio) - 0.5 * (k + n) * math.log1p(ratio) - _log_beta(0.5 * k, 0.5 * n)
        above = _beta_share(0.5 * n, 0.5 * k, 1.0 / (1.0 + ratio), ratio / (1.0 + ratio))
        step = min(math.log(above / tail) * above / math.exp(log_density), 0.5)
        u += step
        if abs(step) < 1e-14:
            break
    return math.exp(u)


def student(n: int, tail: float) -> float:
    """What t with ``n`` degrees of freedom exceeds with probability ``tail``, below one half.

    >>> round(student(10, 0.025), 4)
    2.2281
    """
    return math.sqrt(fisher(1, n, 2.0 * tail))


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)


def _beta_share(a: float, b: float, x: float, y: float) -> float:
    """Regularised incomplete beta function I_x(a, b), x + y = 1 (continued fraction: DLMF 8.17.22)."""
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - _beta_share(b, a, y, x)
    # Lentz's evaluation: the ratios of neighbouring numerators and of neighbouring denominators.
    c, d = 1.0, 1.0 / (1.0 - (a + b) / (a + 1.0) * x)
    value = d
    for m in range(1, 100_000):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        d = 1.0 / (1.0 + even * d)
        c = 1.0 + even / c
        value *= c * d
        d = 1.0 / (1.0 + odd * d)
        c = 1.0 + odd / c
        value *= c * d
        if abs(c * d - 1.0) < 1e-16:
            break
    return value * math.exp(a * math.log(x) + b * math.log(y) - _log_beta(a, b)) / a
