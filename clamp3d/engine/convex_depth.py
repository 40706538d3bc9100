"""Penetration depth of two convex pieces: the least support of their Minkowski difference, from both sides.

The translations t of b at which it overlaps a are the convex set of all x - y, x in a, y in b. The depth is the
distance of the origin from that set's boundary: its support in any direction bounds it from above, and a polytope
inside the set from below (van den Bergen, *Proximity queries and penetration depth computation on 3D game objects*,
2001). Of two polyhedra that polytope ends as the set itself, so the depth is exact.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.convex import Convex, face_normals, nearest_points
from clamp3d.engine.hull import hull
from clamp3d.geometry.pose import Array, to_target

_EPS = 2.0**-52
_ROUNDS = 40
"""Times that the polytope inside is refined; each about quarters the gap at a round surface."""
_WIDTH = 2e-11
"""Relative to the size: bounds this close are enough."""
_SPHERE = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_SPHERE /= np.linalg.norm(_SPHERE, axis=1)[:, None]

Supports = Callable[[Array], Array]
"""Points (k, 3) of a convex set that lie furthest along directions (k, 3)."""


def supports(piece: Convex, T: Array) -> Supports:
    """Support points of a piece placed by ``T`` (4, 4)."""
    R = T[:3, :3]
    return lambda N: to_target(T, piece.support(N @ R))


def convex_depth(a: Convex, Ta: Array, b: Convex, Tb: Array) -> Distance:
    """Penetration depth of two convex pieces as a signed distance; zero or more for pieces that do not overlap.

    Parameters
    ----------
    a, b : Convex
        The pieces, placed by ``Ta``, ``Tb`` (4, 4).

    Returns
    -------
    Distance
        With ``normal``, along which b moves out, and points of the two surfaces that meet then.
    """
    sa, sb = supports(a, Ta), supports(b, Tb)

    def difference(N: Array) -> Array:
        return sa(N) - sb(-N)

    N = np.vstack([face_normals(a, Ta, b, Tb), _SPHERE])
    P = difference(N)
    scale = float(np.abs(P).max() + np.abs(Ta[:3, 3]).max() + np.abs(Tb[:3, 3]).max())
    lower, upper, n = expand(difference, N, P, _WIDTH * scale)
    rounding = 16.0 * _EPS * scale
    p = _last_to_part(a, Ta, b, Tb, n, upper, scale)
    p = sa(n[None])[0] if p is None else p
    return Distance(-upper - rounding, -lower + rounding, p, p - upper * n, n, None, "depth", "convex")


def _last_to_part(a: Convex, Ta: Array, b: Convex, Tb: Array, n: Array, depth: float, size: float) -> Array | None:
    """The point (3,) of ``a`` that is nearest to ``b`` just after that has moved out by ``depth`` along ``n`` (3,)."""
    T = Tb.copy()
    T[:3, 3] += (depth + 1e-4 * size) * n
    nearest = nearest_points(a, Ta, b, T)
    return None if nearest is None else nearest[0]


def expand(difference: Supports, N: Array, P: Array, tolerance: float) -> tuple[float, float, Array]:
    """Bounds of the distance of the origin from the boundary of a convex set around it, and the direction.

    ``difference`` gives its support points; ``N`` (k, 3) are directions to start with, ``P`` (m, 3) points of it.
    """
    h = (N * difference(N)).sum(axis=1)
    k = int(np.argmin(h))
    upper, n = float(h[k]), N[k]
    lower = -np.inf
    for _ in range(_ROUNDS):
        if upper <= 0.0:
            return upper, upper, n
        try:
            inner = hull(P)
        except ValueError:  # the points are too near to each other for it; the bounds so far hold
            break
        planes = inner.planes
        lower = max(lower, -float(planes[:, 3].max()))
        if upper - lower <= tolerance:
            break
        near = planes[np.argsort(-planes[:, 3], kind="stable")[:24]]
        near = near[-near[:, 3] < upper - tolerance]
        new = difference(near[:, :3])
        h = (near[:, :3] * new).sum(axis=1)
        k = int(np.argmin(h))
        if h[k] < upper:
            upper, n = float(h[k]), near[k, :3]
        fresh = h > -near[:, 3] + 0.1 * tolerance
        if not fresh.any():
            lower = min(float((-planes[:, 3]).min()), upper)
            break
        P = np.vstack([inner.vertices, new[fresh]])
    return lower, upper, n
