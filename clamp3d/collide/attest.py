"""Points that two bodies are proven to have, in place of those that their meshes name.

A mesh is near the true surface only where that is smooth: the edge that a hole cuts into a face at a grazing angle, and
the thin skin that chords leave where a hole just breaks through, lie much further away than a chord from its arc. The
closed form tells which points are material, so it alone says how near two bodies come at most.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from clamp3d.collide.answer import Distance
from clamp3d.collide.body import ClosedForm
from clamp3d.collide.convex import MEMBER
from clamp3d.collide.surface import Surface
from clamp3d.core.pose import Array

_EDGES = 12
"""Edges of either mesh, nearest to the point that it names, whose nearest points are tried too."""
_COMMON = 200
"""Points of an overlap of two meshes that are tried."""

_BALL = 1e-3
"""By so much (mm) a mesh can overstate a depth: the radius of the ball that it looks for the nearest triangle with."""

Body = tuple[Surface, tuple[ClosedForm, ...] | None]
"""A mesh and the closed form that it stands for; None where the mesh is the body."""


def attested(found: Distance, a: Body, b: Body, T: Array) -> Distance:
    """``found``, which the meshes of two bodies say, with an upper bound that points of the true bodies attest.

    ``T`` (4, 4) places b in a's frame. Without such points the upper bound is infinite.
    """
    R, t = T[:3, :3], T[:3, 3]
    if found.point_a is None or found.point_b is None:
        common = _common(a[0], b[0], T)
        in_a, in_b = _depth(a, common), _depth(b, (common - t) @ R)
        both, deep = np.minimum(in_a, in_b), np.maximum(in_a, in_b)
        inside = both >= -MEMBER * (1.0 + float(np.abs(common).max(initial=0.0)))
        if inside.any():
            k = int(np.argmax(np.where(inside, deep, -np.inf)))
            upper = max(found.lower, min(0.0, 2.0 * max(0.0, -float(both[k])) - float(deep[k])))
            return replace(found, upper=upper, point_a=common[k], point_b=common[k])
        p, q = common, (common - t) @ R
    else:
        p, q = (
            np.vstack([x, _on_edges(mesh, x)]) for x, mesh in ((found.point_a, a[0]), ((found.point_b - t) @ R, b[0]))
        )
    p, q = _onto(a, p), _onto(b, q) @ R.T + t
    if not len(p) or not len(q):
        return replace(found, upper=np.inf, point_a=None, point_b=None)
    gaps = np.linalg.norm(p[:, None] - q[None], axis=2)
    i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    return replace(found, upper=max(found.lower, float(gaps[i, j])), point_a=p[i], point_b=q[j])


def _on_edges(mesh: Surface, x: Array) -> Array:
    """Points (k, 3) of the mesh's edges that are nearest to ``x`` (3,): the edges of round surfaces lie on them."""
    start, end = mesh.vertices[mesh.faces], mesh.vertices[np.roll(mesh.faces, -1, axis=1)]
    start, way = start.reshape(-1, 3), (end - start).reshape(-1, 3)
    share = ((x - start) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300)
    points = start + np.clip(share, 0.0, 1.0)[:, None] * way
    return np.asarray(points[np.argsort(np.linalg.norm(points - x, axis=1))[:_EDGES]])


def _common(a: Surface, b: Surface, T: Array) -> Array:
    """Points (k, 3) in the overlap of two meshes: corners of it, and middles between them."""
    made = (a.manifold ^ b.manifold.transform(np.ascontiguousarray(T[:3]))).to_mesh64()
    V = np.asarray(made.vert_properties, dtype=np.float64)[:, :3]
    V = V[:: max(1, len(V) // _COMMON)]
    return np.vstack([V, 0.5 * (V + V.mean(axis=0)), V.mean(axis=0)]) if len(V) else V


def _depth(body: Body, points: Array) -> Array:
    """How deep points (k, 3) lie in the body, never too much; negative outside."""
    mesh, forms = body
    if forms is None:
        return mesh.depth(points) - _BALL
    return np.asarray(np.max([form.depth(points) for form in forms], axis=0))


def _onto(body: Body, points: Array) -> Array:
    """Those of the points (k, 3) that lie in the body, or do once they are pushed out of its bores."""
    _, forms = body
    if forms is None:
        return points
    slack = MEMBER * (1.0 + float(np.abs(points).max(initial=0.0)))
    found = []
    for form in forms:
        pushed = points
        for bore in form.bores:
            local = (pushed - bore.T[:3, 3]) @ bore.T[:3, :3]
            out = np.hypot(local[:, 0], local[:, 1])
            local[:, :2] *= np.maximum(1.0, bore.radius / np.maximum(out, 1e-300))[:, None]
            pushed = local @ bore.T[:3, :3].T + bore.T[:3, 3]
        found.append(pushed[form.depth(pushed) >= -slack])
    return np.asarray(list(itertools.chain.from_iterable(found))).reshape(-1, 3)
