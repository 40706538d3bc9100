"""Which faces of two solids can hold their nearest points while one goes along an axis, turns about it, or both.

Nearest points of two solids that are apart see each other along a normal of either: on an edge or in a corner along one
between those of the faces that meet there. Such a motion leaves the slope of each normal to the axis as it is, so two
faces whose slopes can never be opposite need not be measured, unless an edge or a corner of theirs would be left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.surfaces import CONE, CYLINDER, PLANE, Faces
from clamp3d.core.linear import crosses, dot
from clamp3d.core.mesh import edges_of
from clamp3d.core.pose import Array

Mask = NDArray[np.bool_]

CANONICAL = 1e-9
"""Deviation (mm) of a face from its plane, cylinder, ... up to which the normals are those of that surface."""
_OPPOSITE = 1e-6
"""Slopes that differ by no more than this may be opposite."""
_MOST = 4_000_000
"""Pairs of borders beyond which all faces are kept."""


def facing(a: BrepSolid, b: BrepSolid, axis_a: Array, axis_b: Array) -> Mask:
    """Pairs of faces (n, k) among which are the nearest points of two solids that are apart, however they have moved.

    ``axis_a``, ``axis_b`` (3,) are the axis of the motion in each solid's frame.
    """
    slopes, borders = [], []
    for solid, axis in ((a, axis_a), (b, axis_b)):
        slopes.append(_slopes(solid.surfaces, axis))
        borders.append(_borders(solid))
    kept = _opposite(*slopes)
    if len(borders[0]) * len(borders[1]) > _MOST:
        return np.ones_like(kept)
    # An edge or corner has all slopes between those of its faces.
    one, other = (
        np.stack([np.where(m, s[:, 0], 1.0).min(axis=1), np.where(m, s[:, 1], -1.0).max(axis=1)], axis=1)
        for m, s in zip(borders, slopes, strict=True)
    )
    sets_a, sets_b = (m.astype(np.float64) for m in borders)
    covered = dot(dot(sets_a, kept.astype(np.float64)), sets_b.T) > 0.0
    missing = _opposite(one, other) & ~covered
    return kept | (dot(dot(sets_a.T, missing.astype(np.float64)), sets_b) > 0.0)


def _opposite(a: Array, b: Array) -> Mask:
    """Whether some slope of each range (n, 2) is the opposite of one of each other range (k, 2)."""
    low, high = a[:, None, 0] + b[None, :, 0], a[:, None, 1] + b[None, :, 1]
    return np.asarray((low <= _OPPOSITE) & (high >= -_OPPOSITE))


def _slopes(faces: Faces, axis: Array) -> Array:
    """Least and largest cosine (n, 2) between the outward normals of each face and ``axis`` (3,), unit."""
    z = np.ascontiguousarray(faces.frame[:, 3])
    along, across = dot(z, axis), np.linalg.norm(crosses(z, np.broadcast_to(axis, z.shape)), axis=1)
    middle, half = np.zeros(len(z)), np.ones(len(z))
    known = faces.deviation <= CANONICAL
    tip = np.zeros(len(z), dtype=bool)  # at the tip of a cone normals of all slopes may see a point
    tip[faces.face[np.isnan(faces.uv).any(axis=(1, 2))]] = True
    for kind in (PLANE, CYLINDER, CONE):
        rows = np.flatnonzero(known & (faces.kind == kind) & ~tip)
        angle = faces.size[rows, 1]
        rise, out = {PLANE: (1.0, 0.0), CYLINDER: (0.0, 1.0), CONE: (-np.sin(angle), np.cos(angle))}[kind]
        middle[rows], half[rows] = faces.sense[rows] * rise * along[rows], out * across[rows]
    return np.stack([middle - half, middle + half], axis=1)


def _borders(solid: BrepSolid) -> Mask:
    """The faces (k, n) that belong to each place of a solid: within a face, along an edge, and in a corner."""
    n = len(solid.surfaces.kind)
    _, pairs, _ = edges_of(solid.mesh.faces, 2)
    edges = np.unique(np.sort(solid.face[pairs], axis=1), axis=0)
    found = np.zeros((len(edges), n), dtype=bool)
    np.put_along_axis(found, edges, True, axis=1)
    at = np.unique(np.stack([solid.mesh.faces.ravel(), np.repeat(solid.face, 3)], axis=1), axis=0)
    corner, number = np.unique(at[:, 0], return_inverse=True)
    many = np.bincount(number, minlength=len(corner)) > 2
    place = np.cumsum(many) - 1
    corners = np.zeros((int(many.sum()), n), dtype=bool)
    rows = many[number]
    corners[place[number[rows]], at[rows, 1]] = True
    return np.unique(np.concatenate([np.eye(n, dtype=bool), found, corners]), axis=0)
