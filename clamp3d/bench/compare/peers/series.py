"""What a peer's file states about each of its series."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from clamp3d.bench.compare.methods import Prepared
from clamp3d.core.pose import Array

ANGLES_DEG = (1.0, 5.0, 20.0)
"""Unit angles of the pieces, degrees."""
SECTOR_ANGLES_DEG = (0.1, 1.0, 5.0)
"""Of pieces that are looked up: their number costs nothing."""


@dataclass(frozen=True, slots=True)
class Series:
    """One way to use a library: ``make`` takes the unit angle in rad, ``package`` is what pip installs, ``needs`` are
    modules to import first, ``angles`` the settings in degrees (None: there is none).
    """

    make: Callable[[float], Prepared]
    package: str
    needs: tuple[str, ...]
    angles: tuple[float | None, ...] = ANGLES_DEG


def ready(one: Callable[[Array], float], pieces: int, *, depth: bool) -> Prepared:
    """A method that is asked pose by pose; asked once here, for what it makes when it is first used."""

    def many(poses: Array) -> Array:
        return np.array([one(T) for T in poses])

    many(np.eye(4)[None])
    return Prepared(one, many, pieces, depth=depth)
