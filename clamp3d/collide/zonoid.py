"""Boxes and cylinders as sums of segments and discs, and the signed distance of two of them, exact in both signs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clamp3d.collide.answer import Distance
from clamp3d.core.linear import cross, dot, norm, svd
from clamp3d.core.nonnegative import nnls
from clamp3d.core.pose import Array

_EPS = 2.0**-52
_CELLS = 50_000
"""Cells of directions that are looked at before a wider bound is told; the hardest of 2e4 poses needs 36 000."""

_POINTS = 100
"""Points that are tried for the nearest one."""

_PARALLEL = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Zonoid:
    """``centre`` (3,) plus half segments ``lines`` (m, 3), both ways, and ``discs`` (k, 4): unit normals and radii.

    ``error`` (mm): the piece it stands for is this near.
    """

    centre: Array
    lines: Array
    discs: Array
    error: float = 0.0

    def at(self, T: Array) -> Zonoid:
        """The same placed by ``T`` (4, 4)."""
        R = T[:3, :3].T
        discs = np.column_stack([dot(self.discs[:, :3], R), self.discs[:, 3]])
        return Zonoid(dot(self.centre, R) + T[:3, 3], dot(self.lines, R), discs, self.error)


def box_of(vertices: Array, edges: NDArray[np.int64]) -> Zonoid | None:
    """A parallelepiped of 8 ``vertices`` (8, 3) and 12 ``edges`` (12, 2); None for any other polyhedron."""
    if len(vertices) != 8 or len(edges) != 12:
        return None
    at_first = edges[(edges == 0).any(axis=1)].sum(axis=1)
    if len(at_first) != 3:
        return None
    centre, half = vertices.mean(axis=0), 0.5 * (vertices[at_first] - vertices[0])
    corners = centre + dot(np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]), half)
    off = np.linalg.norm(corners[:, None] - vertices, axis=2).min(axis=1).max()
    if off > 1e-14 * (1.0 + np.abs(vertices).max()):
        return None
    return Zonoid(centre, half, np.empty((0, 4)), float(off))


def zonoid_distance(a: Zonoid, b: Zonoid) -> Distance:
    """Signed distance of two pieces: where they overlap minus the shortest translation that parts them.

    The points are the nearest ones; in an overlap those that meet when b has moved out along the normal.
    """
    from clamp3d.core.kernel_zonoid import CELLS, zonoid

    if len(a.discs) == len(b.discs) == 1 and (known := _parallel(a, b)) is not None:
        return known
    lines, discs = np.vstack([a.lines, b.lines]), np.vstack([a.discs, b.discs])
    parts, out = np.empty((len(lines) + len(discs), 3)), np.empty(5)
    c = b.centre - a.centre
    size = float(np.abs(a.centre).sum() + np.abs(b.centre).sum() + np.abs(lines).sum() + discs[:, 3].sum())
    zonoid(c, lines, discs, 1e-12 * size, _CELLS, np.empty((CELLS, 5)), parts, out)
    error = 4.0 * _EPS * size + a.error + b.error
    lower, upper = -float(out[1]) - error, -float(out[0]) + error
    meet, far = c - min(upper, 0.0) * out[2:], max(upper, 0.0)
    if norm(parts.sum(axis=0) - meet) > far + 1e-11 * size:
        parts = _nearest(meet, lines, discs, parts, far, size)
    of_a = np.zeros(len(parts), dtype=bool)
    of_a[: len(a.lines)] = of_a[len(lines) : len(lines) + len(a.discs)] = True
    p, q = a.centre + parts[of_a].sum(axis=0), b.centre - parts[~of_a].sum(axis=0)
    if upper >= 0.0:  # what the points attest
        upper = max(upper, norm(q - p) + error)
    return Distance(lower, upper, p, q, out[2:].copy(), None, "features", "convex")


def _nearest(c: Array, lines: Array, discs: Array, parts: Array, far: float, size: float) -> Array:
    """What each segment and disc adds (m, 3) to the point of their sum that is nearest to ``c`` (3,), from ``parts``.

    The search knows how ``far`` that is, but has found a point that is not: where a face all but meets an edge or a
    rim, its steps along one segment at a time are short. This is Gilbert's and Wolfe's: the nearest point of the
    polytope of the points so far, and the point that lies furthest towards ``c`` from there.
    """
    corners = parts[None]
    for _ in range(_POINTS):
        V, x = corners.sum(axis=1) - c, parts.sum(axis=0) - c
        w = nnls(np.vstack([V.T / norm(x), np.ones(len(V))]), np.array([0.0, 0.0, 0.0, 1.0]))
        corners, w = corners[w > 0.0], w[w > 0.0] / w.sum()
        parts = np.tensordot(w, corners, 1)
        x = parts.sum(axis=0) - c
        if norm(x) <= far + 1e-13 * size:
            break
        across = x - dot(discs[:, :3], x)[:, None] * discs[:, :3]
        across *= (discs[:, 3] / np.maximum(np.linalg.norm(across, axis=1), 1e-300))[:, None]
        new = -np.vstack([np.sign(dot(lines, x))[:, None] * lines, across])
        if dot(x - (new.sum(axis=0) - c), x) <= 1e-13 * size * norm(x):  # no point is nearer
            break
        corners = np.concatenate([corners, new[None]])
    return np.asarray(parts)


def _parallel(a: Zonoid, b: Zonoid) -> Distance | None:
    """Two cylinders that overlap, axes parallel to 1e-9: coaxial ones come free in any direction across."""
    z, c = a.discs[0, :3], b.centre - a.centre
    tilt = norm(cross(z, b.discs[0, :3]))
    if tilt > _PARALLEL:
        return None
    along = float(dot(c, z))
    away = c - along * z
    off = norm(away)
    out = away / off if off > 0.0 else svd(z[None])[2][1]
    half = [norm(x.lines) for x in (a, b)]
    radii = [float(x.discs[0, 3]) for x in (a, b)]
    side, end = sum(radii) - off, sum(half) - abs(along)
    depth = min(side, end)
    error = tilt * (radii[1] + half[1])  # b turned about its middle: so far it moves
    size = float(np.abs(a.centre).sum() + np.abs(b.centre).sum()) + sum(radii + half)
    error += a.error + b.error + 16.0 * _EPS * size
    if depth <= error:
        return None
    if end <= side:
        n = np.copysign(1.0, along) * z
        x = 0.5 * (max(-radii[0], off - radii[1]) + min(radii[0], off + radii[1])) * out
        p = a.centre + half[0] * n + x
    else:
        n = out
        x = 0.5 * (max(-half[0], along - half[1]) + min(half[0], along + half[1])) * z
        p = a.centre + radii[0] * n + x
    return Distance(-depth - error, -depth + error, p, p - depth * n, n, None, "features", "convex")
