"""Families of hard cases: how their truths are found and how methods are put to them, whatever the cases are."""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from clamp3d.bench.stress.outcome import REFERENCE, Outcome, judge
from clamp3d.bench.stress.worker import Answers, Measures, Method, run_here, run_isolated

Methods = Mapping[str, tuple[str, Callable[[], Method]]]
"""Name -> what the method is, and what makes it; that must pickle, for a process of its own."""


def generator(family: str, seed: int) -> np.random.Generator:
    """The family's own stream of random numbers: the same for a seed, whatever else runs."""
    return np.random.default_rng([seed, zlib.crc32(family.encode())])


class Family(ABC):
    """A kind of difficulty. ``about`` says in one line what is hard; ``make(rng, n)`` builds n cases.

    ``part`` is the share of the requested cases that it has, ``truth_error`` the largest error of a truth in parts of
    the scene.
    """

    methods: ClassVar[Methods]
    part = 1.0
    truth_error = 0.0

    def __init__(self, name: str, about: str, make: Callable[[np.random.Generator, int], Any]) -> None:
        self.name, self.about, self.make = name, about, make

    def cases(self, n: int, seed: int) -> Any:
        """The n cases for a seed: always the same ones."""
        return self.make(generator(self.name, seed), n)

    def run(
        self, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
    ) -> tuple[list[Outcome], float]:
        """Put n cases to ``methods``; scores, and the worst error found in ``check`` truths, in parts of the scene.

        ``time_limit`` s are for each method other than the reference.
        """
        cases = self.cases(n, seed)
        truths = self.truths(cases)
        checked = np.linspace(0, n - 1, min(check, n)).astype(int)
        worst = max((self.difference(cases, truths, int(i)) for i in checked), default=0.0)
        outcomes = []
        for name in methods:
            answers = self.ask(name, cases, truths, time_limit)
            outcomes.append(self.judge(name, cases, truths, answers))
        return outcomes, worst

    def ask(self, name: str, cases: Any, truths: Any, time_limit: float) -> Answers:
        """Answers of a method: of the reference in this process, of others in a child that may die."""
        make = self.methods[name][1]
        return run_here(make(), cases) if name == REFERENCE else run_isolated(make, cases, time_limit=time_limit)

    def judge(self, name: str, cases: Any, truths: Any, answers: Answers) -> Outcome:
        """Score the answers of a method."""
        measures: Measures = self.methods[name][1]().measures
        return judge(self.name, name, cases.scene(), truths, answers, measures)

    @abstractmethod
    def truths(self, cases: Any) -> Any:
        """Exact answers to all cases."""

    @abstractmethod
    def difference(self, cases: Any, truths: Any, i: int) -> float:
        """Difference of truth i from one that was found again by other means, in parts of the scene."""

    @abstractmethod
    def case(self, n: int, seed: int, i: int) -> str:
        """Case i of n as Python lines that run by themselves, the truth in the last one, a comment."""


class Makers(dict[str, tuple[str, Callable[..., Any]]]):
    """Name of a family -> what is hard in it, which its generator's docstring says, and the generator."""

    def __init__(self, kind: str = "") -> None:
        super().__init__()
        self._kind = kind

    def family(self, name: str, wrap: Callable[[Any], Any] = lambda make: make) -> Callable[[Any], Any]:
        """A decorator that adds a generator, ``wrap`` about it."""

        def register(make: Any) -> Any:
            about = " ".join((make.__doc__ or "").split("\n\n")[0].split()).rstrip(".")
            self[self._kind + name] = (about[:1].lower() + about[1:], wrap(make))
            return make

        return register
