"""What every family of hard cases offers, whatever its cases are: poses, motions, meshes or whole clamps."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from clamp3d.bench.stress.outcome import Outcome


class Family(Protocol):
    """A kind of difficulty. ``about`` says in one line what is hard, ``part`` which part of the cases asked for it has.

    ``methods`` maps each method that it can be put to on what that is.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def about(self) -> str: ...  # noqa: D102

    @property
    def part(self) -> float: ...  # noqa: D102

    @property
    def truth_error(self) -> float:
        """Largest error of a truth, in parts of the scene."""
        ...

    @property
    def methods(self) -> Mapping[str, str]: ...  # noqa: D102

    def run(
        self, methods: Sequence[str], n: int, seed: int, time_limit: float, check: int
    ) -> tuple[list[Outcome], float]:
        """Put n cases to ``methods``; outcomes, and the worst error found in ``check`` truths, in parts of the scene.

        ``time_limit`` s are for each method that is not the project's own.
        """
        ...

    def case(self, n: int, seed: int, i: int) -> str:
        """Case i of n as Python lines that run by themselves, the truth in the last one, a comment."""
        ...


def generator(family: str, seed: int) -> np.random.Generator:
    """The family's own stream of random numbers: the same for a seed, whatever else runs."""
    return np.random.default_rng([seed, zlib.crc32(family.encode())])
