"""The check every mesh passes before a library sees it: a closed, outward-oriented triangle surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.core.pose import Array
from clamp3d.core.shells import LARGEST_COORDINATE, Faces, inside_out, volume
from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True)
class Solid:
    """A checked triangle mesh: ``vertices`` (n, 3) mm, ``faces`` (m, 3) counter-clockwise seen from outside."""

    vertices: Array
    faces: Faces


def check_solid(vertices: ArrayLike, faces: ArrayLike, name: str = "mesh") -> Solid:
    """Return the mesh as a `Solid` (own, read-only arrays). Vertices that are equal to the bit become one where needed.

    Raises InputError, one line each, if it is empty, has a number that is not finite, a face index out of range, a
    face with two equal corners, an open or shared edge, faces of opposite winding, a volume that is not > 0, or a
    body inside out. CoACD and FCL end the interpreter on the first three and give a wrong answer without a word on the
    others.

    >>> tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> check_solid(tetrahedron, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]).faces.shape
    (4, 3)
    >>> check_solid(tetrahedron, [[0, 2, 1], [0, 1, 3], [1, 2, 3]])
    Traceback (most recent call last):
    clamp3d.errors.InputError: mesh must be watertight: 3 of 6 edges have one face only, at face 0, vertices 0 and 2
    """
    V = _table(vertices, f"{name} vertices").astype(np.float64)
    corners = _table(faces, f"{name} faces")
    if not np.isfinite(corners).all() or (corners != np.rint(corners)).any():
        raise InputError(f"{name} faces must be whole numbers")
    bad = np.flatnonzero(~(np.abs(V) < LARGEST_COORDINATE).all(axis=1))
    if len(bad):
        row = int(bad[0])
        rule = "finite" if not np.isfinite(V[row]).all() else f"below {LARGEST_COORDINATE:g} mm"
        raise InputError(f"{name} vertices must be {rule}, got {V[row].tolist()} at row {row}")
    bad = np.flatnonzero((corners.min(axis=1) < 0) | (corners.max(axis=1) >= len(V)))
    if len(bad):
        row = int(bad[0])
        raise InputError(
            f"{name} faces must name vertices 0 to {len(V) - 1}, got {[int(x) for x in corners[row]]} at row {row}"
        )
    F = corners.astype(np.int64)
    folded = np.flatnonzero((np.diff(np.sort(F, axis=1), axis=1) == 0).any(axis=1))
    if len(folded):
        row = int(folded[0])
        raise InputError(f"{name} faces must have three different corners, got {F[row].tolist()} at row {row}")
    V, F = _closed(V, F, name)
    size = volume(V, F)
    if not size > 0.0:
        raise InputError(f"{name} must enclose a volume > 0 mm^3, got {size:.6g}; its faces may be inside out")
    for rows in inside_out(V, F):
        raise InputError(
            f"{name} must have all bodies the right way out: the one of face {int(rows[0])} ({len(rows)} faces) "
            f"encloses {volume(V, F[rows]):.6g} mm^3 and is no cavity of another"
        )
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


def _closed(V: Array, F: Faces, name: str) -> tuple[Array, Faces]:
    """The mesh with two faces at every edge, which run along it in opposite directions; InputError if it has others.

    An open one is tried again with its equal vertices merged: an STL gives every triangle corners of its own.
    """
    directed, edge, uses = _edges(F)
    if (uses == 1).any():
        merged, index = np.unique(V + 0.0, axis=0, return_inverse=True)
        if len(merged) < len(V):
            G = index.reshape(-1)[F]
            G = G[(G[:, 0] != G[:, 1]) & (G[:, 1] != G[:, 2]) & (G[:, 2] != G[:, 0])]
            if len(G) and not (_edges(G)[2] == 1).any():
                V, F = merged, np.ascontiguousarray(G)
                directed, edge, uses = _edges(F)
    for wrong, what in ((uses == 1, "have one face only"), (uses > 2, "have more than two faces")):
        if wrong.any():
            raise InputError(
                f"{name} must be watertight: {wrong.sum()} of {len(uses)} edges {what}, {_place(directed, wrong[edge])}"
            )
    balance = np.bincount(edge, weights=np.where(directed[:, 0] < directed[:, 1], 1, -1)) != 0
    if balance.any():
        raise InputError(
            f"{name} must have one winding: {balance.sum()} edges run the same way in both faces, "
            f"{_place(directed, balance[edge])}"
        )
    return V, F


def _edges(F: Faces) -> tuple[Faces, NDArray[np.intp], NDArray[np.intp]]:
    """Edges (3m, 2) face by face, the number (3m,) of each without direction, and how many faces each of those has."""
    directed = F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, edge, uses = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    return directed, edge.reshape(-1), uses


def _place(directed: Faces, wrong: NDArray[np.bool_]) -> str:
    k = int(np.argmax(wrong))
    return f"at face {k // 3}, vertices {directed[k, 0]} and {directed[k, 1]}"
