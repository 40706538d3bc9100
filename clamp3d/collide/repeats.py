"""Pairs of the same two shapes in the same relative pose, as of a bolt and its nut: measured once."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.model import Model
from clamp3d.collide.verdict import Verdict
from clamp3d.core.linear import to_target
from clamp3d.core.pose import Array

SAME = 1e-9
"""No point of the second shape is further (mm) from where it was, for a pose to be the same but for rounding."""
_DIGITS = 6
_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


class Repeats:
    """What was measured of pairs of ``models`` that can occur again, both being there more than once."""

    def __init__(self, models: Iterable[Model]) -> None:
        self._often = Counter(models)
        self._known: dict[tuple[object, ...], tuple[Array, Verdict, Distance]] = {}

    def find(self, a: Model, b: Model, T: Array) -> tuple[Verdict, Distance] | None:
        """Verdict and distance of ``b`` at ``T`` (4, 4) in a's frame from another pair; None if there is none.

        The bounds are wider than that pair's by as much as b is moved: so much a distance, or a depth, can differ.
        """
        known = self._known.get(self._key(a, b, T)) if self._twice(a, b) else None
        if known is None:
            return None
        before, verdict, found = known
        corners = np.take_along_axis(b.bounds, _CORNERS, axis=0)
        way = to_target(T, corners) - to_target(before, corners)
        moved = float(np.linalg.norm(way, axis=1).max())
        if moved > SAME or verdict is Verdict.CONTAINED:
            return None
        a.counters.queries["repeats"] += 1
        return verdict, found.widened(moved)

    def keep(self, a: Model, b: Model, T: Array, verdict: Verdict, found: Distance) -> None:
        """Keep what was measured of a pair."""
        if self._twice(a, b):
            self._known[self._key(a, b, T)] = T, verdict, found

    def _twice(self, a: Model, b: Model) -> bool:
        return a.faces is not None and b.faces is not None and self._often[a] > 1 and self._often[b] > 1

    @staticmethod
    def _key(a: Model, b: Model, T: Array) -> tuple[object, ...]:
        return a, b, *np.round(T[:3].ravel(), _DIGITS).tolist()
