"""Which pairs can be near at all: boxes of all parts in an R-tree, then closer boxes and spheres, all at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.linear import dot
from clamp3d.core.pose import Array

FEW = 32
"""Parts up to which all boxes are compared, without a tree."""

FIRST = np.zeros(1, dtype=np.int64)
"""Which box all of many poses have."""


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

    def joined(self, other: Boxes) -> Boxes:
        """These, then those of ``other``."""
        return Boxes(
            np.concatenate([self.centre, other.centre]),
            np.concatenate([self.half, other.half]),
            np.concatenate([self.R, other.R]),
        )

    @property
    def reach(self) -> Array:
        """Half sizes (n, 3) of the boxes along the world's axes around them."""
        return np.asarray(np.einsum("nij,nj->ni", np.abs(self.R), self.half))


def box_sizes(bounds: Array) -> Array:
    """Centre and half sizes (m, 6) of boxes (m, 2, 3)."""
    return np.hstack([0.5 * (bounds[:, 0] + bounds[:, 1]), 0.5 * (bounds[:, 1] - bounds[:, 0])])


def world_boxes(bounds: Array, T: Array, which: NDArray[np.int64] = FIRST) -> Array:
    """Lower and upper corners (6, n) along the world's axes of the boxes at poses (n, 4, 4).

    ``bounds`` (m, 2, 3): boxes in their own frames; ``which`` (n,): those of the poses, the first of all by default.
    """
    from clamp3d.collide.poses_kernel import boxes

    around = np.empty((6, len(T)))
    boxes(T, box_sizes(bounds), which, np.inf, around)
    return around


def near_pairs(boxes: Boxes, reach: float) -> NDArray[np.int64]:
    """Pairs (m, 2), first < second, whose boxes along the world's axes come within ``reach`` mm; sorted."""
    n = len(boxes.centre)
    half = boxes.reach + 0.5 * reach * (1.0 + 1e-9)
    low, high = boxes.centre - half, boxes.centre + half
    if n <= FEW:
        meet = (low[:, None] <= high).all(axis=2)
        return np.argwhere(np.triu(meet & meet.T, 1))
    from rtree import index

    tree = index.Index((np.arange(n), low, high), properties=index.Property(dimension=3))
    second, count = tree.intersection_v(low, high)  # type: ignore[no-untyped-call]
    first = np.repeat(np.arange(n), count.astype(np.int64))
    second = np.asarray(second, dtype=np.int64)
    pairs = np.column_stack([first, second])[first < second]
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))])


def box_gaps(boxes: Boxes, pairs: NDArray[np.int64]) -> Array:
    """Distances (m,) mm that the parts of each pair certainly keep, from their boxes and spheres alone.

    The largest of: distance of the boxes along the world's axes, distance of the spheres around the boxes, and the
    separations along the fifteen axes of the separating axis theorem. Negative: nothing is certain.
    """
    i, j = pairs[:, 0], pairs[:, 1]
    d = boxes.centre[j] - boxes.centre[i]
    gap = np.abs(d) - boxes.reach[i] - boxes.reach[j]
    found = np.where((gap > 0.0).any(axis=1), np.linalg.norm(np.maximum(gap, 0.0), axis=1), gap.max(axis=1))
    radius = np.linalg.norm(boxes.half, axis=1)
    found = np.maximum(found, np.linalg.norm(d, axis=1) - radius[i] - radius[j])
    A, B = np.swapaxes(boxes.R[i], 1, 2), np.swapaxes(boxes.R[j], 1, 2)  # rows: the boxes' own axes
    (ax, ay, az), (bx, by, bz) = np.moveaxis(A[:, :, None], 3, 0), np.moveaxis(B[:, None], 3, 0)
    crossed = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=3).reshape(len(pairs), 9, 3)
    axes = np.concatenate([A, B, crossed], axis=1)
    size = np.linalg.norm(axes, axis=2)
    axes = axes / np.maximum(size, 1e-300)[..., None]
    spread = [
        (np.abs(dot(axes, np.swapaxes(X, 1, 2))) * boxes.half[k][:, None]).sum(axis=2) for X, k in ((A, i), (B, j))
    ]
    apart = np.abs(np.einsum("mkj,mj->mk", axes, d)) - spread[0] - spread[1]
    found = np.maximum(found, np.where(size > 1e-6, apart, -np.inf).max(axis=1))
    return np.asarray(found - 1e-12 * (1.0 + np.abs(d).max(axis=1)))
