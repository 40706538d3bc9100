"""A family of hard poses: how its truths are found, and how methods are put to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.family import generator
from clamp3d.bench.stress.outcome import OWN, Outcome, judge
from clamp3d.bench.stress.poses.cases import FEATURES, Cases, Shapes, random_shapes, shape_count, spread
from clamp3d.bench.stress.poses.methods import METHODS, method
from clamp3d.bench.stress.poses.truth import EXTENDED_ERROR, truth, truth_50_digits
from clamp3d.bench.stress.worker import run_here, run_isolated

Generator = Callable[[np.random.Generator, int], Cases]

_BLOCK = 5000
_MOST_DECIDED = 500


@dataclass(frozen=True, slots=True)
class PoseFamily:
    """A kind of difficulty of single poses: ``make(rng, n)`` builds n cases. See `Family`."""

    name: str
    about: str
    make: Generator
    part: float = 1.0
    truth_error: float = EXTENDED_ERROR

    @property
    def methods(self) -> Mapping[str, str]:
        """See `Family`."""
        return {name: about for name, (about, _) in METHODS.items()}

    def cases(self, n: int, seed: int) -> Cases:
        """The n cases for a seed: always the same ones.

        >>> from clamp3d.bench.stress.poses.families import POSES
        >>> POSES["tangency"].cases(3, 0).shapes.groove(0) == POSES["tangency"].cases(3, 0).shapes.groove(0)
        True
        """
        return self.make(generator(self.name, seed), n)

    def run(
        self, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
    ) -> tuple[list[Outcome], float]:
        """See `Family`. `cas` is the project's own and answers in this process; the others work in children."""
        cases = self.cases(n, seed)
        exact = _exact(cases)
        size = cases.scene()
        worst = 0.0
        for i in np.linspace(0, n - 1, min(check, n)).astype(int):
            high = float(exact[i])  # the long double as the sum of two floats, which mpmath takes to the last bit
            difference = truth_50_digits(cases, int(i)) - high - float(exact[i] - np.longdouble(high))
            worst = max(worst, abs(float(difference)) / float(size[i]))
        outcomes = []
        for name in methods:
            if name == OWN:
                answers = run_here(method(name), cases)
            else:
                answers = run_isolated(partial(method, name), cases, time_limit=time_limit)
            outcomes.append(judge(self.name, name, size, exact, answers, method(name).measures))
        return outcomes, worst

    def case(self, n: int, seed: int, i: int) -> str:
        """See `Family`."""
        cases = self.cases(n, seed)
        return f"{cases.snippet(i)}\n# truth: {float(truth_50_digits(cases, i))!r} mm"


def into(families: dict[str, PoseFamily]) -> Callable[[str, str], Callable[[Generator], Generator]]:
    """A decorator ``(name, about)`` for generators that adds them to ``families``."""

    def family(name: str, about: str) -> Callable[[Generator], Generator]:
        def register(make: Generator) -> Generator:
            families[name] = PoseFamily(name, about, make)
            return make

        return register

    return family


def setting(
    rng: np.random.Generator, n: int, features: tuple[str, ...] = FEATURES, **given: object
) -> tuple[Shapes, NDArray[np.intp], NDArray[np.str_]]:
    """Random shapes, the shape (n,) of each case, and the feature (n,) that it touches."""
    k = shape_count(n)
    shapes = random_shapes(rng, k, **given)  # type: ignore[arg-type]
    return shapes, spread(n, k), rng.choice(features, n)


def _exact(cases: Cases) -> NDArray[Any]:
    """Truths (n,). Where the quick search and the kernel differ, 50 digits decide: the search can miss a minimum."""
    n = len(cases)
    exact = np.concatenate([truth(cases.take(np.arange(i, min(i + _BLOCK, n)))) for i in range(0, n, _BLOCK)])
    kernel = run_here(method(OWN), cases)
    differ = np.flatnonzero(~(np.abs(np.asarray(kernel.distance - exact, np.float64)) <= kernel.bound))
    for i in differ[:_MOST_DECIDED]:
        high = truth_50_digits(cases, int(i))
        exact[i] = np.longdouble(float(high)) + np.longdouble(float(high - float(high)))
    return exact
