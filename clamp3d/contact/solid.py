"""The check every mesh passes before a library sees it: a closed, outward-oriented triangle surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array

Faces = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Solid:
    """A checked triangle mesh: ``vertices`` (n, 3) mm, ``faces`` (m, 3) counter-clockwise seen from outside."""

    vertices: Array
    faces: Faces


def check_solid(vertices: ArrayLike, faces: ArrayLike, name: str = "mesh") -> Solid:
    """Return the mesh as a `Solid` (own, read-only arrays).

    Raises InputError, one line each, if it is empty, has a number that is not finite, a face index out of range, a
    face with two equal corners, an open or shared edge, faces of opposite winding, or a volume that is not > 0.
    CoACD and FCL end the interpreter on the first three and give a wrong answer without a word on the others.

    >>> tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> check_solid(tetrahedron, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).faces.shape
    (4, 3)
    >>> check_solid(tetrahedron, [[0, 2, 1], [0, 1, 3], [1, 2, 3]])
    Traceback (most recent call last):
    clamp3d.errors.InputError: mesh must be watertight: 3 of 6 edges belong to one face only; merge equal vertices first
    """
    V = _table(vertices, f"{name} vertices").astype(np.float64)
    corners = _table(faces, f"{name} faces")
    if not np.isfinite(corners).all() or (corners != np.rint(corners)).any():
        raise InputError(f"{name} faces must be whole numbers")
    F = corners.astype(np.int64)
    if not np.isfinite(V).all():
        row = int(np.flatnonzero(~np.isfinite(V).all(axis=1))[0])
        raise InputError(f"{name} vertices must be finite, got {V[row].tolist()} at row {row}")
    outside = np.flatnonzero((F.min(axis=1) < 0) | (F.max(axis=1) >= len(V)))
    if len(outside):
        row = int(outside[0])
        raise InputError(f"{name} faces must name vertices 0 to {len(V) - 1}, got {F[row].tolist()} at row {row}")
    folded = np.flatnonzero((np.diff(np.sort(F, axis=1), axis=1) == 0).any(axis=1))
    if len(folded):
        row = int(folded[0])
        raise InputError(f"{name} faces must have three different corners, got {F[row].tolist()} at row {row}")
    _check_edges(F, name)
    # The middle as origin: far from it the six volumes cancel badly.
    triangles = (V - 0.5 * (V.min(axis=0) + V.max(axis=0)))[F]
    volume = float(np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])).sum() / 6.0)
    if not volume > 0.0:
        raise InputError(f"{name} must enclose a volume > 0 mm^3, got {volume:.6g}; its faces may be inside out")
    V.flags.writeable = F.flags.writeable = False
    return Solid(V, F)


def _table(values: ArrayLike, name: str) -> NDArray[np.float64] | Faces:
    """Numbers as (n, 3), n > 0."""
    try:
        out = np.asarray(values)
        out = out if out.dtype.kind in "iu" else out.astype(np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be an array of numbers with shape (n, 3)") from None
    if out.size == 0:
        raise InputError(f"{name} must not be empty")
    if out.ndim != 2 or out.shape[1] != 3:
        raise InputError(f"{name} must have shape (n, 3), got {out.shape}")
    return out


def _check_edges(F: Faces, name: str) -> None:
    """Every edge has two faces, which run along it in opposite directions."""
    directed = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    forward = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    _, edge, uses = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    for count, what in (
        (uses == 1, "belong to one face only; merge equal vertices first"),
        (uses > 2, "have more than two faces"),
    ):
        if count.any():
            raise InputError(f"{name} must be watertight: {count.sum()} of {len(uses)} edges {what}")
    balance = np.bincount(edge.ravel(), weights=forward)
    if balance.any():
        raise InputError(
            f"{name} must have one winding: {int((balance != 0).sum())} edges run the same way in both faces"
        )
