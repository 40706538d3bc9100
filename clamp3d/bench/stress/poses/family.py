"""All families of hard poses: what has broken collision code, and how their truths are found."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.family import Family
from clamp3d.bench.stress.poses import features, magnitudes
from clamp3d.bench.stress.poses.cases import Cases
from clamp3d.bench.stress.poses.methods import METHODS, CasMethod
from clamp3d.bench.stress.poses.truth import EXTENDED_ERROR, truth, truth_50_digits
from clamp3d.bench.stress.worker import run_here

_BLOCK = 5000
_MOST_DECIDED = 500


class PoseFamily(Family):
    """A kind of difficulty of single poses."""

    methods = METHODS
    truth_error = EXTENDED_ERROR

    def truths(self, cases: Cases) -> NDArray[Any]:
        """Long doubles. Where quick search and kernel differ, 50 digits decide: the search can miss a minimum."""
        n = len(cases)
        exact = np.concatenate([truth(cases.take(np.arange(i, min(i + _BLOCK, n)))) for i in range(0, n, _BLOCK)])
        kernel = run_here(CasMethod(), cases)
        differ = np.flatnonzero(~(np.abs(np.asarray(kernel.distance - exact, np.float64)) <= kernel.bound))
        for i in differ[:_MOST_DECIDED]:
            high = truth_50_digits(cases, int(i))
            exact[i] = np.longdouble(float(high)) + np.longdouble(float(high - float(high)))
        return exact

    def difference(self, cases: Cases, truths: NDArray[Any], i: int) -> float:
        """See `Family`."""
        high = float(truths[i])  # the long double as the sum of two floats, which mpmath takes to the last bit
        difference = truth_50_digits(cases, i) - high - float(truths[i] - np.longdouble(high))
        return abs(float(difference)) / float(cases.scene()[i])

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        return f"{cases.snippet(i)}\n# truth: {float(truth_50_digits(cases, i))!r} mm"


POSES = {name: PoseFamily(name, *made) for name, made in (features.MAKERS | magnitudes.MAKERS).items()}
