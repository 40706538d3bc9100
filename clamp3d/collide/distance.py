"""The distance of any two bodies: one function, one result type, whatever the bodies are made of."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.collide.bounds import Bounds, Thresholds
from clamp3d.collide.broad import Boxes, box_gaps
from clamp3d.collide.ladder import climb
from clamp3d.collide.model import Workshop
from clamp3d.collide.scene import Scene
from clamp3d.core.pose import Array, check_pose, inverse
from clamp3d.core.shapes import AnyShape, as_shape

ACCURACY = 1e-7
"""Width (mm) of the interval at which a distance counts as known."""


@dataclass(frozen=True, slots=True, eq=False)
class Distance:
    """Signed distance of two bodies, between proven bounds.

    Attributes
    ----------
    lower, upper : float
        The distance lies between these, mm; positive apart, negative inside. Infinite where nothing is known.
    point_a, point_b : ndarray (3,) or None
        Points on the two bodies that attest ``upper``; None where it is infinite.
    normal : ndarray (3,) or None
        Unit vector from a to b, ``point_b = point_a + upper * normal``; None where no direction is known.
    unique : bool or None
        Whether the nearest points are the only ones; None where that is not known.
    level, method : str
        The refinement level and the method that gave the last word.
    """

    lower: float
    upper: float
    point_a: Array | None
    point_b: Array | None
    normal: Array | None
    unique: bool | None
    level: str
    method: str

    @property
    def value(self) -> float:
        """The distance in mm: the upper bound, which the witness points attest."""
        return self.upper

    @property
    def uncertainty(self) -> float:
        """How far ``value`` can be off, mm."""
        return self.upper - self.lower

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; unknown numbers are None."""
        return {
            "distance_mm": _finite(self.value),
            "error_bound_mm": _finite(self.uncertainty),
            "at_least_mm": _finite(self.lower),
            "at_most_mm": _finite(self.upper),
            "point_a": _list(self.point_a),
            "point_b": _list(self.point_b),
            "normal": _list(self.normal),
            "unique": self.unique,
            "level": self.level,
            "method": self.method,
        }


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _list(x: Array | None) -> list[float] | None:
    return None if x is None else [float(v) for v in x]


def distance(
    a: AnyShape, b: AnyShape, T_a_b: ArrayLike | None = None, *, accuracy: float = ACCURACY, model: Any = None
) -> Distance:
    """Signed distance of body ``b``, placed by ``T_a_b`` (4, 4) in the frame of body ``a``; points in that frame."""
    T = np.eye(4) if T_a_b is None else check_pose(T_a_b, "T_a_b")
    return _measured(Workshop(), as_shape(a), as_shape(b), T, accuracy)


def measure(
    scene: Scene,
    pairs: Iterable[tuple[str, str]] | None = None,
    *,
    accuracy: float = ACCURACY,
    model: Any = None,
    workshop: Workshop | None = None,
) -> dict[tuple[str, str], Distance]:
    """Distances of all pairs of a scene (or of ``pairs``), points and normals in the world; first part first."""
    shop = workshop or Workshop()
    parts = {part.name: part for part in scene.parts}
    asked = itertools.combinations(parts, 2) if pairs is None else pairs
    found = {}
    for a, b in asked:
        T_a, T_b = parts[a].T_world, parts[b].T_world
        local = _measured(shop, parts[a].shape, parts[b].shape, inverse(T_a) @ T_b, accuracy)
        found[a, b] = _moved(local, T_a)
    return found


def _measured(shop: Workshop, a: Any, b: Any, T: Array, accuracy: float) -> Distance:
    x, y = shop.model(a), shop.model(b)
    boxes = Boxes.of(np.array([x.bounds, y.bounds]), np.array([np.eye(4), T]))
    start = Bounds(float(box_gaps(boxes, np.array([[0, 1]]))[0]))
    answer = climb(x, y, T, start, Thresholds(), lambda known: known.high - known.low <= accuracy, shop.ledger)
    low, high = answer.bounds.low, answer.bounds.high
    p, q = answer.bounds.point_a, answer.bounds.point_b
    normal = answer.bounds.normal
    if p is not None and q is not None and high > 1e-6:
        normal = (q - p) / np.linalg.norm(q - p)
    return Distance(low, high, p, q, normal, None, answer.rung, answer.method)


def _moved(d: Distance, T: Array) -> Distance:
    R, t = T[:3, :3], T[:3, 3]
    p, q = (None if x is None else R @ x + t for x in (d.point_a, d.point_b))
    n = None if d.normal is None else R @ d.normal
    return Distance(d.lower, d.upper, p, q, n, d.unique, d.level, d.method)
