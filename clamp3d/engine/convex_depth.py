"""Penetration depth of two convex pieces: the least support of their Minkowski difference, from both sides.

The translations t of b at which it overlaps a are the convex set of all x - y, x in a, y in b. The depth is the
distance of the origin from that set's boundary: its support in any direction bounds it from above, and a polytope
inside the set from below (van den Bergen, *Proximity queries and penetration depth computation on 3D game objects*,
2001). Of polytopes the face normals and the cross products of edges hold every normal of the set, so it is exact.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from clamp3d.engine.answer import Distance
from clamp3d.engine.convex import Convex, Rod
from clamp3d.engine.hull import Hull, hull
from clamp3d.geometry.pose import Array, norm, to_target

_RIM = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
_EPS = 2.0**-52
_ROUNDS = 40
"""Times that the polytope inside is refined; each about quarters the gap at a round surface."""
_ALL = 20000
"""Pairs of edge directions up to which every cross product is asked."""
_SPHERE = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_SPHERE /= np.linalg.norm(_SPHERE, axis=1)[:, None]

Supports = Callable[[Array], Array]
"""Points (k, 3) of a convex set that lie furthest along directions (k, 3)."""


def supports(piece: Convex, T: Array) -> Supports:
    """Support points of a piece placed by ``T`` (4, 4)."""
    R = T[:3, :3]
    return lambda N: to_target(T, piece.support(N @ R))


def _outline(piece: Convex, T: Array) -> tuple[Array, Array, Array]:
    """Face normals (k, 3), edge directions (m, 3) and points (n, 3) that span the flat faces, placed by ``T``."""
    R, t = T[:3, :3], T[:3, 3]
    if isinstance(piece, Hull):
        V = piece.vertices
        E = directions(V[piece.edges[:, 1]] - V[piece.edges[:, 0]])
        return piece.planes[:, :3] @ R.T, E @ R.T, V @ R.T + t
    z = R @ piece.T[:3, 2]
    rim = piece.radius * np.column_stack([np.cos(_RIM), np.sin(_RIM)])
    ends = [np.column_stack([rim, np.full(len(rim), s * 0.5 * piece.length)]) for s in (-1.0, 1.0)]
    P = T @ piece.T
    return np.array([z, -z]), z[None], to_target(P, np.vstack(ends))


def directions(E: Array) -> Array:
    """Unit vectors (k, 3) of all different lines among ``E`` (m, 3)."""
    size = np.linalg.norm(E, axis=1)
    E = E[size > 0.0] / size[size > 0.0, None]
    first = np.argmax(np.abs(E) > 1e-7, axis=1)
    E = E * np.sign(E[np.arange(len(E)), first])[:, None]
    return np.asarray(E[np.unique(E.round(9), axis=0, return_index=True)[1]])


def crossed(E: Array, F: Array) -> Array:
    """Unit normals (k, 3), both ways, of all pairs of different lines ``E`` (m, 3) and ``F`` (n, 3)."""
    N = np.cross(E[:, None], F[None]).reshape(-1, 3)
    size = np.linalg.norm(N, axis=1)
    N = N[size > 1e-9] / size[size > 1e-9, None]
    return np.vstack([N, -N])


def convex_depth(a: Convex, Ta: Array, b: Convex, Tb: Array, *, tolerance: float = 0.0) -> Distance:
    """Penetration depth of two convex pieces as a signed distance; zero or more for pieces that do not overlap.

    Parameters
    ----------
    a, b : Convex
        The pieces, placed by ``Ta``, ``Tb`` (4, 4).
    tolerance : float
        Width (mm) of the interval that is enough; 2e-11 of the size at least.

    Returns
    -------
    Distance
        With ``normal``, along which b moves out, and points of the two surfaces that meet then.
    """
    sa, sb = supports(a, Ta), supports(b, Tb)

    def difference(N: Array) -> Array:
        return sa(N) - sb(-N)

    (Na, Ea, Va), (Nb, Eb, Vb) = _outline(a, Ta), _outline(b, Tb)
    scale = float(np.abs(Va).max() + np.abs(Vb).max())
    rounding = 16.0 * _EPS * scale
    if isinstance(a, Hull) and isinstance(b, Hull) and len(Ea) * len(Eb) <= _ALL:
        N = np.vstack([Na, -Nb, crossed(Ea, Eb)])
        h = (N * difference(N)).sum(axis=1)
        k = int(np.argmin(h))
        return _found(float(h[k]), float(h[k]), N[k], sa, sb, rounding)
    flat = np.vstack([Na[:200], -Nb[:200]])
    middle = Va.mean(axis=0) - Vb.mean(axis=0)
    seeds = [flat, _SPHERE, crossed(Ea[:8], Eb[:8])]
    for piece, T, sign in ((a, Ta, 1.0), (b, Tb, -1.0)):
        if isinstance(piece, Rod):  # across the axis, away from the other's middle
            z = T[:3, :3] @ piece.T[:3, 2]
            out = middle - (middle @ z) * z
            if norm(out) > 1e-9 * scale:
                seeds.append(np.array([sign, -sign])[:, None] * out / norm(out))
    N = np.vstack(seeds)
    P = [difference(N), _faces(flat, Va, Vb)]
    lower, upper, n = expand(difference, N, np.vstack(P), max(tolerance, 2e-11 * scale))
    return _found(lower, upper, n, sa, sb, rounding + 1e-14 * scale)


def _faces(N: Array, Va: Array, Vb: Array) -> Array:
    """Points (k, 3) that span the flat faces of the difference which look along ``N``."""
    points = []
    for n in N:
        A, B = (V[h >= h.max() - 1e-9 * (1.0 + np.ptp(h))] for V, h in ((Va, Va @ n), (Vb, -(Vb @ n))))
        if len(A) * len(B) <= 4096:
            points.append((A[:, None] - B[None]).reshape(-1, 3))
    return np.vstack(points) if points else np.empty((0, 3))


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


def _found(lower: float, upper: float, n: Array, sa: Supports, sb: Supports, rounding: float) -> Distance:
    p, q = sa(n[None])[0], sb(-n[None])[0]
    return Distance(-upper - rounding, -lower + rounding, p, q, n, None, "depth", "convex")
