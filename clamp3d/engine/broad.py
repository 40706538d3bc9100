"""Which pairs can be near at all: boxes of all parts in an R-tree, then closer boxes and spheres, all at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.geometry.pose import Array

FEW = 32
"""So few boxes are compared with all others, without a tree."""
_AT_ONCE = 10_000
"""So few pairs of boxes as well: to load and fill a tree takes longer."""


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Oriented boxes of n parts in the world: ``centre`` (n, 3), ``half`` (n, 3), ``R`` (n, 3, 3)."""

    centre: Array
    half: Array
    R: Array

    @classmethod
    def of(cls, bounds: Array, T: Array) -> Boxes:
        """From boxes (n, 2, 3) in the parts' own frames and poses (n, 4, 4)."""
        middle = 0.5 * (bounds[:, 0] + bounds[:, 1])
        R = T[:, :3, :3]
        centre = np.einsum("nij,nj->ni", R, middle) + T[:, :3, 3]
        return cls(centre, 0.5 * (bounds[:, 1] - bounds[:, 0]), R)

    @property
    def reach(self) -> Array:
        """Half sizes (n, 3) of the boxes along the world's axes around them."""
        return np.asarray(np.einsum("nij,nj->ni", np.abs(self.R), self.half))


def near_pairs(boxes: Boxes, reach: float) -> NDArray[np.int64]:
    """Pairs (m, 2), first < second, whose boxes along the world's axes come within ``reach`` mm; sorted."""
    pairs = near_between(boxes, boxes, reach)
    return pairs[pairs[:, 0] < pairs[:, 1]]


def near_between(boxes: Boxes, others: Boxes, reach: float) -> NDArray[np.int64]:
    """Pairs (m, 2) of one of ``boxes`` and one of ``others`` within ``reach`` mm of each other, as `near_pairs`."""
    grown = 0.5 * reach * (1.0 + 1e-9)
    low, high = boxes.centre - (boxes.reach + grown), boxes.centre + (boxes.reach + grown)
    lows, highs = others.centre - (others.reach + grown), others.centre + (others.reach + grown)
    if min(len(low), len(lows)) <= FEW or len(low) * len(lows) <= _AT_ONCE:
        return np.argwhere(((low[:, None] <= highs) & (lows <= high[:, None])).all(axis=2))
    from rtree import index

    tree: Any = index.Index((np.arange(len(lows)), lows, highs), properties=index.Property(dimension=3))
    second, count = tree.intersection_v(low, high)
    first = np.repeat(np.arange(len(low)), count.astype(np.int64))
    return np.column_stack([first, second]).astype(np.int64)[np.lexsort((second, first))]


def box_gaps(boxes: Boxes, pairs: NDArray[np.int64]) -> Array:
    """Distances (m,) mm that the parts of each pair certainly keep, from their boxes and spheres alone.

    The largest of: distance of the boxes along the world's axes, distance of the spheres around the boxes, and the
    separations along the fifteen axes of the separating axis theorem. Negative: nothing is certain.
    """
    i, j = pairs[:, 0], pairs[:, 1]
    d = boxes.centre[j] - boxes.centre[i]
    gap = np.abs(d) - boxes.reach[i] - boxes.reach[j]
    lower = np.where((gap > 0.0).any(axis=1), np.linalg.norm(np.maximum(gap, 0.0), axis=1), gap.max(axis=1))
    radius = np.linalg.norm(boxes.half, axis=1)
    lower = np.maximum(lower, np.linalg.norm(d, axis=1) - radius[i] - radius[j])
    A, B = np.swapaxes(boxes.R[i], 1, 2), np.swapaxes(boxes.R[j], 1, 2)  # rows: the boxes' own axes
    (ax, ay, az), (bx, by, bz) = np.moveaxis(A[:, :, None], 3, 0), np.moveaxis(B[:, None], 3, 0)
    crossed = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=3).reshape(len(pairs), 9, 3)
    axes = np.concatenate([A, B, crossed], axis=1)
    size = np.linalg.norm(axes, axis=2)
    axes = axes / np.maximum(size, 1e-300)[..., None]
    spread = [(np.abs(axes @ np.swapaxes(X, 1, 2)) * boxes.half[k][:, None]).sum(axis=2) for X, k in ((A, i), (B, j))]
    apart = np.abs(np.einsum("mkj,mj->mk", axes, d)) - spread[0] - spread[1]
    lower = np.maximum(lower, np.where(size > 1e-6, apart, -np.inf).max(axis=1))
    return np.asarray(lower - 1e-12 * (1.0 + np.abs(d).max(axis=1)))
