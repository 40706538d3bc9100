"""A convex polyhedron inside a body around a given point, as large as one step of planes makes it.

Each obstacle around the point, a groove or hole of a closed form or a triangle of a mesh, lies beyond a plane between
the two; what lies before all those planes is convex, holds the point and no obstacle (the first step of Deits and
Tedrake, *Computing large convex regions of obstacle-free space*, 2015).
"""

from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.body import ClosedForm
from clamp3d.collide.convex import Rod
from clamp3d.collide.hull import Hull, hull
from clamp3d.collide.surface import Surface
from clamp3d.core.linear import dot, norm, to_source
from clamp3d.core.pose import Array
from clamp3d.core.triangles import closest_points, distinct

_AROUND = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
_CLOSE = np.array([-0.05, -2e-3, -1e-4, -5e-6, 0.0, 5e-6, 1e-4, 2e-3, 0.05])
"""Angles (rad) about the point's own of the polygon in place of a round side, which is nearly exact there."""
_OWN = 0.3
"""A triangle's own plane is taken if it is at least this far away, as a part of the triangle's distance."""
_LARGE = 5000
"""Triangles of a mesh beyond which those far away are left out."""
LEAST = 1e-11
"""Relative to the size: a point nearer to the surface than this has no polyhedron around it."""


def around_in_form(form: ClosedForm, x: Array) -> Hull | None:
    """Polyhedron around ``x`` (3,) inside a closed form; None if the point is not well inside."""
    planes = []
    for piece in form.outers:
        planes.append(_prism(piece, x) if isinstance(piece, Rod) else piece.planes)
    for bore in form.bores:
        radial = dot(bore.T[:3, :2], dot(x - bore.T[:3, 3], bore.T[:3, :2]))
        size = norm(radial)
        if size <= bore.radius:
            return None
        n = radial / size
        planes.append(np.array([[*-n, bore.radius + float(dot(n, bore.T[:3, 3]))]]))
    shrunk = np.vstack(planes)
    shrunk[:, 3] += form.error
    return _hull_of(shrunk, x)


def _prism(rod: Rod, x: Array) -> Array:
    """Planes (k, 4) of a prism in a cylinder, with edges all around and many near ``x`` (3,)."""
    local = to_source(rod.T, x)
    own = math.atan2(local[1], local[0])
    angle = distinct(np.concatenate([(own + _AROUND) % (2.0 * np.pi), (own + _CLOSE) % (2.0 * np.pi)]))
    gap = np.diff(np.append(angle, angle[0] + 2.0 * np.pi))
    angle, gap = angle[gap > 1e-9], gap[gap > 1e-9]
    middle = angle + 0.5 * gap
    flat = np.column_stack([np.cos(middle), np.sin(middle), np.zeros(len(middle))])
    ends = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    N = dot(np.vstack([flat, ends]), rod.T[:3, :3].T)
    d = np.append(-rod.radius * np.cos(0.5 * gap), [-0.5 * rod.length] * 2)
    return np.column_stack([N, d - dot(N, rod.T[:3, 3])])


def around_in_mesh(mesh: Surface, x: Array, half_extent: float) -> Hull | None:
    """Polyhedron around ``x`` (3,), which lies inside the mesh; None if the point is not well inside.

    Of more than `_LARGE` triangles it is cut to the box of this ``half_extent`` (mm) about the point.
    """
    corners = mesh.vertices[mesh.faces]
    error = np.zeros(len(corners)) if mesh.face_error is None else mesh.face_error
    N, d = mesh.planes
    planes = []
    if len(corners) > _LARGE:
        within = (corners.min(axis=1) - error[:, None] < x + half_extent).all(axis=1)
        within &= (corners.max(axis=1) + error[:, None] > x - half_extent).all(axis=1)
        corners, error, N, d = corners[within], error[within], N[within], d[within]
        planes = [np.array([*n, -dot(n, x) - half_extent]) for n in np.vstack([np.eye(3), -np.eye(3)])]
    feet = closest_on_triangles(corners, x) if len(corners) else corners[:, 0]
    away = np.linalg.norm(feet - x, axis=1)
    height = d - dot(N, x)  # of the triangles' own planes above the point
    left = np.argsort(away - error, kind="stable")
    while len(left):
        k = left[0]
        if away[k] - error[k] <= LEAST * mesh.scale:
            return None
        own = height[k] >= _OWN * away[k] and height[k] > error[k]
        n = N[k] if own else (feet[k] - x) / away[k]
        offset = float(d[k] if own else dot(n, feet[k])) - error[k]
        planes.append(np.array([*n, -offset]))
        beyond = dot(corners[left], n).min(axis=1) - error[left] >= offset - 1e-12 * mesh.scale
        left = left[~beyond & (left != k)]
    return _hull_of(np.array(planes), x)


def closest_on_triangles(corners: Array, x: Array) -> Array:
    """Points (m, 3) of triangles (m, 3, 3) that are nearest to ``x`` (3,)."""
    return closest_points(corners, np.broadcast_to(x, (len(corners), 3)))


def _hull_of(planes: Array, x: Array) -> Hull | None:
    """The polyhedron of all points with n . y + d <= 0; None if ``x`` (3,) is not well inside."""
    depth = -(dot(planes[:, :3], x) + planes[:, 3])
    if not depth.min() > LEAST * float(np.abs(planes[:, 3]).max() + np.abs(x).max()):
        return None
    try:
        # About the point and in its scale, so that thin polyhedra keep their digits; then about their middle.
        middle = _corners(planes[:, :3], depth).mean(axis=0)
        made = hull(_corners(planes[:, :3], depth - dot(planes[:, :3], middle)) + middle)
    except ValueError:
        return None
    moved = np.column_stack([made.planes[:, :3], made.planes[:, 3] - dot(made.planes[:, :3], x)])
    return Hull(made.vertices + x, moved, made.faces)


def _corners(N: Array, depth: Array) -> Array:
    """Corners (m, 3) of the polyhedron of points with N . y <= depth, all of ``depth`` (k,) being positive.

    They are the planes of the polar set. As those lie as high as its highest points no corner is beyond any plane.
    """
    polar = hull(N / depth[:, None]).planes
    polar = polar[polar[:, 3] < 0.0]
    return np.asarray(polar[:, :3] / -polar[:, 3:])
