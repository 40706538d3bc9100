"""Many boxes that touch, all at once: stacks of plates and blocks need no closed form for each pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distance
from clamp3d.collide.broad import Boxes
from clamp3d.collide.model import Model
from clamp3d.core.pose import Array
from clamp3d.core.profile import Segment
from clamp3d.core.shapes import Solid

_TURNS = 20
"""Times that a point is put into one box and then into the other: boxes with parallel sides need one."""
TOUCHING = 1e-9
"""Boxes that are certainly no further into each other (mm) may touch."""


def is_box(model: Model) -> bool:
    """Whether a part is the box around it."""
    shape = model.shape
    if not isinstance(shape, Solid) or len(shape.bodies) != 1 or shape.holes:
        return False
    (body,) = shape.bodies
    if len(body.profile.edges) != 4 or not all(isinstance(edge, Segment) for edge in body.profile.edges):
        return False
    low, high = shape.bounds
    return bool(abs(body.volume - np.prod(high - low)) <= 1e-14 * body.volume)


def touching_boxes(boxes: Boxes, box: NDArray[np.bool_], pairs: NDArray[np.int64], gaps: Array) -> dict[int, Distance]:
    """Distances of those of the ``pairs`` (m, 2) that are boxes (``box``, by part) and touch, by row.

    ``gaps`` (m,) are lower bounds in mm. A point that lies in both boxes, or this near either, bounds from above.
    Points in the world.
    """
    rows = np.flatnonzero(box[pairs].all(axis=1) & (np.abs(gaps) <= TOUCHING))
    i, j = pairs[rows].T
    x = 0.5 * (boxes.centre[i] + boxes.centre[j])
    for _ in range(_TURNS):
        p = _inside(boxes, i, x)
        x = _inside(boxes, j, p)
        if np.abs(x - p).max(initial=0.0) <= 1e-15:
            break
    upper = np.linalg.norm(x - p, axis=1) + 1e-14 * np.abs(x).max(axis=1, initial=1.0)
    return {
        int(row): Distance(float(gaps[row]), float(upper[k]), p[k], x[k], None, None, "boxes", "boxes")
        for k, row in enumerate(rows)
        if upper[k] <= TOUCHING
    }


def _inside(boxes: Boxes, index: NDArray[np.int64], points: Array) -> Array:
    """The points (m, 3) of boxes that are nearest to ``points`` (m, 3)."""
    R = boxes.R[index]
    local = np.einsum("mji,mj->mi", R, points - boxes.centre[index])
    local = np.clip(local, -boxes.half[index], boxes.half[index])
    return np.asarray(np.einsum("mij,mj->mi", R, local) + boxes.centre[index])
