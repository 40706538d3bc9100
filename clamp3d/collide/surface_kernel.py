"""Compiled entry point of `Surface.nearest`: the triangle of a mesh, and its point, that is nearest to a point."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from clamp3d.collide.faces_tree import nearest_triangle
from clamp3d.core.jit import entry


def _nearest(P, err, box, link, order, points, stack, away, face, foot):
    """Into ``away`` (k,), ``face`` (k,) and ``foot`` (k, 3), for ``points`` (k, 3) and triangles P (m, 3, 3).

    ``box``, ``link`` and ``order`` are their tree, as `faces_tree` builds it; the errors ``err`` (m,) are 0.
    """
    for k in range(points.shape[0]):
        least, t, v, w = nearest_triangle(P, err, box, link, order, 0, points[k, 0], points[k, 1], points[k, 2], stack)
        away[k], face[k] = least, t
        for c in range(3):
            foot[k, c] = P[t, 0, c] + v * (P[t, 1, c] - P[t, 0, c]) + w * (P[t, 2, c] - P[t, 0, c])


nearest = entry(
    _nearest,
    "void(f8[:,:,::1],f8[::1],f8[:,::1],i8[:,::1],i8[::1],f8[:,::1],i8[::1],f8[::1],i8[::1],f8[:,::1])",
)
