"""Nearest points of corners, edges, faces and rims, in closed form and many at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from clamp3d.geometry.pose import Array

Found = tuple[float, Array, Array]
"""A distance in mm and the two points (3,) that have it."""


def cross(a: Array, b: Array) -> Array:
    """Cross products (k, 3), by columns: a third of the time of `numpy.cross` on few rows."""
    (x, y, z), (u, v, w) = a.T, b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def segment_pairs(a: Array, b: Array) -> Found:
    """Nearest points of all segments ``a`` (k, 2, 3) and ``b`` (m, 2, 3)."""
    p, q = a[:, None, 0], b[None, :, 0]
    u, v = (a[:, 1] - a[:, 0])[:, None], (b[:, 1] - b[:, 0])[None]
    r = p - q
    uu, vv = np.maximum((u * u).sum(-1), 1e-300), np.maximum((v * v).sum(-1), 1e-300)
    uv, ur, vr = (u * v).sum(-1), (u * r).sum(-1), (v * r).sum(-1)
    square = uu * vv - uv * uv
    with np.errstate(over="ignore"):  # long segments that are parallel but for rounding: any point, then the ends
        inner = np.clip((uv * vr - ur * vv) / np.maximum(square, 1e-300), 0.0, 1.0)
    # The ends too: of nearly parallel lines the inner point is known to few digits.
    start = np.stack([inner, np.zeros_like(inner), np.ones_like(inner)])
    t = np.clip((uv * start + vr) / vv, 0.0, 1.0)
    s = np.clip((uv * t - ur) / uu, 0.0, 1.0)
    x, y = p + s[..., None] * u, q + t[..., None] * v
    d = np.sqrt(((x - y) ** 2).sum(-1))
    k = np.unravel_index(int(np.argmin(d)), d.shape)
    return float(d[k]), x[k], y[k]


def to_faces(points: Array, triangles: Array) -> Found:
    """Nearest of ``points`` (k, 3) to the insides of ``triangles`` (m, 3, 3); infinite if none lies before one."""
    a = triangles[:, 0]
    u, v = triangles[:, 1] - a, triangles[:, 2] - a
    n = cross(u, v)
    nn = np.maximum((n * n).sum(-1), 1e-300)
    w = points[:, None] - a[None]
    height = (w * n).sum(-1) / np.sqrt(nn)
    beta = (w * cross(v, n)).sum(-1) / nn
    gamma = (w * cross(n, u)).sum(-1) / nn
    inside = (beta >= 0.0) & (gamma >= 0.0) & (beta + gamma <= 1.0)
    d = np.where(inside, np.abs(height), np.inf)
    i, j = np.unravel_index(int(np.argmin(d)), d.shape)
    foot = points[i] - height[i, j] * n[j] / np.sqrt(nn[j])
    return float(d[i, j]), points[i], foot


def rim_minimum(closest: Callable[[Array], Array], T: Array, radius: float) -> tuple[Array, Array] | None:
    """Point of a circle about z of ``T`` (4, 4) that is nearest to a convex body, and that body's point.

    ``closest`` gives the body's nearest points for (k, 3). The distance from a convex body has a continuous slope, so
    a change of its sign brackets the place.
    """

    def rim(angle: Array) -> Array:
        return np.asarray(T[:3, 3] + radius * (np.outer(np.cos(angle), T[:3, 0]) + np.outer(np.sin(angle), T[:3, 1])))

    def slope(angle: float) -> float:
        x = rim(np.array([angle]))
        along = -np.sin(angle) * T[:3, 0] + np.cos(angle) * T[:3, 1]
        return float((x - closest(x))[0] @ along)

    turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    x = rim(turn)
    d = np.linalg.norm(x - closest(x), axis=1)
    if d.min() <= 0.0:
        return None
    middle, step = float(turn[int(np.argmin(d))]), float(turn[1])
    low, high = middle - step, middle + step
    if slope(low) < 0.0 < slope(high):
        from scipy.optimize import brentq  # 0.2 s of CPU to import

        middle = float(brentq(slope, low, high, xtol=1e-15))
    p = rim(np.array([middle]))
    return p[0], closest(p)[0]
