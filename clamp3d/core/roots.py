"""The root of a function of one number between two places of different signs, by SciPy."""

from __future__ import annotations

from collections.abc import Callable


def root(function: Callable[[float], float], low: float, high: float, *, xtol: float = 1e-15) -> float:
    """A place where ``function``, of different signs at ``low`` and ``high``, is 0, to ``xtol`` or to rounding.

    >>> round(root(lambda x: x * x - 2.0, 0.0, 2.0), 12)
    1.414213562373
    """
    from scipy import optimize

    return float(optimize.brentq(function, low, high, xtol=xtol))
