"""What a motion leaves unchanged tells which triangles of two meshes can never come near each other.

A rotation keeps the height of a point along its axis and the distance from it, a translation the place across its
direction. Triangles that are apart in these coordinates stay apart by as much at every time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.core.linear import dot, svd
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array

Mask = NDArray[np.bool_]


def can_meet(
    motion: Motion, moving: tuple[Array, Array], still: tuple[Array, Array], limit: float
) -> tuple[Mask, Mask]:
    """Which triangles of two meshes may ever come within ``limit`` mm: masks (m,) and (n,).

    The meshes are triangles, (m, 3, 3) and (n, 3, 3) in the world at t = 0, each with how far the true surface may be
    from it, (m,) and (n,) mm. All other triangles of either mesh stay at least ``limit`` from the whole other one.
    """
    from shapely import STRtree

    boxes = [boxes_of(motion, *moving), boxes_of(motion, *still)]
    reach = max(limit, float(np.finfo(float).tiny))  # shapely takes no 0
    found = []
    for mine, other in (boxes, boxes[::-1]):
        near, _ = STRtree(other).query_nearest(mine, max_distance=reach, all_matches=False)
        mask = np.zeros(len(mine), dtype=bool)
        mask[near] = True
        found.append(mask)
    return found[0], found[1]


def boxes_of(motion: Motion, triangles: Array, errors: Array) -> NDArray[np.object_]:
    """Boxes (m,) that hold the true surface of triangles (m, 3, 3) in the coordinates that the motion leaves."""
    from shapely import box

    low, high = unchanged(motion, triangles)
    reach = (errors + rounding_of(motion, triangles))[:, None]
    return np.asarray(box(*(low - reach).T, *(high + reach).T))


def rounding_of(motion: Motion, triangles: Array) -> float:
    """How far (mm) rounding moves triangles (m, 3, 3) in these coordinates."""
    return 1e-12 * float(np.abs(triangles).max(initial=0.0) + np.abs(motion.point).max())


def unchanged(motion: Motion, triangles: Array) -> tuple[Array, Array]:
    """Least and greatest values (m, 2) over each triangle of two coordinates that differ by no more than places do.

    Across a straight way they are Cartesian; of a turn the height along its axis and the distance from it, of a screw
    0 and that distance.
    """
    if not motion.angle:
        across = dot(triangles, svd(motion.travel[None])[2][1:].T)
        return across.min(axis=1), across.max(axis=1)
    local = triangles - motion.point
    height = dot(local, motion.axis)
    flat = local - height[..., None] * motion.axis
    far = np.linalg.norm(flat, axis=2).max(axis=1)
    near = _from_origin(flat, motion.axis)
    if motion.travel.any():  # a screw, or a turn that is carried along
        height = np.zeros_like(height)
        if not motion.is_screw:
            near, far = np.zeros_like(near), np.zeros_like(far)
    return np.stack([height.min(axis=1), near], axis=1), np.stack([height.max(axis=1), far], axis=1)


def _from_origin(flat: Array, axis: Array) -> Array:
    """Distances (m,) from the origin of triangles (m, 3, 3) in the plane across ``axis``."""
    start, way = flat, np.roll(flat, -1, axis=1) - flat
    square = np.maximum((way**2).sum(axis=2), np.finfo(float).tiny)
    t = np.clip(-(start * way).sum(axis=2) / square, 0.0, 1.0)
    edges = np.linalg.norm(start + t[..., None] * way, axis=2).min(axis=1)
    side = dot(np.cross(start, way), axis)
    holds = (side > 0.0).all(axis=1) | (side < 0.0).all(axis=1)
    return np.where(holds, 0.0, edges)
