"""Compiled entry point of `Surface.nearest`: the triangle of a mesh, and its point, that is nearest to a point."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from clamp3d.collide.faces_math import point_triangle
from clamp3d.collide.faces_tree import box_distance, put_children
from clamp3d.core.jit import entry


def _nearest(P, box, link, order, points, stack, away, face, foot):
    """Into ``away`` (k,), ``face`` (k,) and ``foot`` (k, 3), for ``points`` (k, 3) and triangles P (m, 3, 3).

    ``box``, ``link`` and ``order`` are their tree, as `faces_tree` builds it.
    """
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        least = np.inf
        stack[0], top = 0, 1
        while top > 0:
            top -= 1
            i = stack[top]
            if box_distance(box, i, x, y, z, x, y, z) >= least:
                continue
            if link[i, 1] < 0:
                top = put_children(box, link, i, x, y, z, x, y, z, stack, top)
                continue
            for j in range(link[i, 0], link[i, 0] + link[i, 1]):
                t = order[j]
                d, v, w = point_triangle(x, y, z, P[t])
                if d < least:
                    least = d
                    face[k] = t
                    for c in range(3):
                        foot[k, c] = P[t, 0, c] + v * (P[t, 1, c] - P[t, 0, c]) + w * (P[t, 2, c] - P[t, 0, c])
        away[k] = least


nearest = entry(
    _nearest,
    "void(f8[:,:,::1],f8[:,::1],i8[:,::1],i8[::1],f8[:,::1],i8[::1],f8[::1],i8[::1],f8[:,::1])",
)
