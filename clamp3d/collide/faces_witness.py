"""Compiled: the point of a trimmed face that attests a distance, and whether triangles wind round a point."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    CONE,
    CYLINDER,
    OTHER,
    PLANE,
    SPHERE,
    height_at,
    point_triangle,
    slope_at,
    surface_point,
)
from clamp3d.core.jit import formula


@formula
def over_triangle(kind, a, b, F, uv, x, y, z):
    """Whether the foot of a point on a surface lies in the triangle uv (3, 2) of its parameters."""
    x, y, z = x - F[0], y - F[1], z - F[2]
    X, Y = x * F[3] + y * F[4] + z * F[5], x * F[6] + y * F[7] + z * F[8]
    Z = x * F[9] + y * F[10] + z * F[11]
    u, v = X, Y
    if kind != PLANE:
        h = math.sqrt(X * X + Y * Y)
        u = math.atan2(Y, X)
        if kind == CYLINDER:
            v = Z
        elif kind == CONE:
            v = ((h - a) * math.sin(b) + Z * math.cos(b)) * math.cos(b)
        elif kind == SPHERE:
            v = math.atan2(Z, h)
        else:
            v = math.atan2(Z, h - a)
            v += 2.0 * math.pi * math.floor((uv[0, 1] - v) / (2.0 * math.pi) + 0.5)
        u += 2.0 * math.pi * math.floor((uv[0, 0] - u) / (2.0 * math.pi) + 0.5)
    one, other = True, True
    for i in range(3):
        k = (i + 1) % 3
        side = (uv[k, 0] - uv[i, 0]) * (v - uv[i, 1]) - (uv[k, 1] - uv[i, 1]) * (u - uv[i, 0])
        one = one and side >= 0.0  # NaN, a pole: neither
        other = other and side <= 0.0
    return one or other


@formula
def weighted(kind, a, b, F, P, uv, v, w, q):
    """The point q (3) of the surface piece of triangle P that has the weights v, w of its second and third corner."""
    r = 1.0 - v - w
    for k in range(3):
        q[k] = r * P[0, k] + v * P[1, k] + w * P[2, k]
    if kind != OTHER and kind != PLANE:
        s, t, n = 0.0, 0.0, 0.0
        weights = (r, v, w)
        for i in range(3):
            t += weights[i] * uv[i, 1]
            if not np.isnan(uv[i, 0]):
                s += weights[i] * uv[i, 0]
                n += weights[i]
        if n > 0.0:
            surface_point(kind, a, b, F, s / n, t, q)


@formula
def witness(kind, a, b, F, P, uv, x, y, z, q):
    """A point q (3) of the surface piece of triangle P near a point; returns their distance."""
    if kind != OTHER and over_triangle(kind, a, b, F, uv, x, y, z):
        at, h = (x, y, z), height_at(kind, a, b, F, x, y, z)
        for k in range(3):
            q[k] = at[k] - h * slope_at(kind, a, b, F, k, x, y, z)
        return abs(h)
    _, v, w = point_triangle(x, y, z, P)
    weighted(kind, a, b, F, P, uv, v, w, q)
    return math.sqrt((x - q[0]) ** 2 + (y - q[1]) ** 2 + (z - q[2]) ** 2)


@formula
def winding(P, x, y, z):
    """How often the triangles wind round a point that is on none of them: 1 inside, 0 outside."""
    total = 0.0
    for t in range(P.shape[0]):
        ax, ay, az = P[t, 0, 0] - x, P[t, 0, 1] - y, P[t, 0, 2] - z
        bx, by, bz = P[t, 1, 0] - x, P[t, 1, 1] - y, P[t, 1, 2] - z
        cx, cy, cz = P[t, 2, 0] - x, P[t, 2, 1] - y, P[t, 2, 2] - z
        a, b = math.sqrt(ax * ax + ay * ay + az * az), math.sqrt(bx * bx + by * by + bz * bz)
        c = math.sqrt(cx * cx + cy * cy + cz * cz)
        triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
        total += math.atan2(triple, a * b * c + ab * c + bc * a + ca * b)
    return total / (2.0 * math.pi)
