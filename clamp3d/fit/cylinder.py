"""Least-squares cylinder through points, with the covariance of radius and axis.

Distances are geometric (orthogonal), so the answer does not depend on where the part lies. The unknowns follow
Lukacs, Martin and Marshall (Faithful least-squares fitting of spheres, cylinders, cones and tori, ECCV 1998): the
offset of the *surface* from the points' centroid and the curvature 1/R, in place of the distant centre and R. So a
shallow arc, whose centre is hardly known, stays a well scaled problem, and a plane is the harmless limit 1/R = 0.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.special import fdtri

from clamp3d.fit.axis import Axis, perpendicular
from clamp3d.geometry.pose import Array

_DIGITS = 1e-15  # rounding alone stops the fit: exact tessellations are fitted exactly
CONFIDENCE = 0.9973
"""Probability of the covariance part of every error bound: three standard deviations of a normal distribution."""


def fit_axis(points: Array, start: Axis, *, robust_scale: float | None = None) -> Axis | None:
    """Least-squares cylinder through ``points`` (n, 3), n >= 5, from ``start``; None if it is a plane or diverges.

    ``robust_scale`` (mm) switches on the Cauchy loss with that scale, so that few stray points do not pull.

    >>> t = np.linspace(-0.5, 0.5, 9)
    >>> ring = np.stack([7 * np.sin(t), -7 * np.cos(t), 0 * t], axis=1)
    >>> points = np.concatenate([ring, ring + [0.0, 0.0, 30.0]])
    >>> start = Axis(np.array([0.2, 0.3, 0.0]), np.array([0.0, 0.0, 1.0]), 7.5)
    >>> round(fit_axis(points, start).radius, 9)
    7.0
    """
    if len(points) < 5:
        return None
    centroid = points.mean(axis=0)
    w = start.direction
    inward = start.point - centroid
    inward = inward - (inward @ w) * w
    size = float(np.abs(points - centroid).max())
    reach = np.linalg.norm(inward)
    # On a full turn the centroid lies on the axis and any direction serves.
    e = inward / reach if reach > 1e-6 * size else perpendicular(w)[0]
    f = np.cross(w, e)
    local = (points - centroid) @ np.stack([e, f, w], axis=1)
    scale = np.array([1.0, 1.0, 1.0 / size, 1.0 / size, 1.0 / size**2])

    def cylinder(x: Array) -> Axis:
        h, g, a, b, k = x * scale
        radius = 1.0 / k if abs(k) > 1e-12 / size else 1e12 * size
        return Axis(np.array([h + radius, g, 0.0]), np.array([a, b, 1.0]) / np.sqrt(1.0 + a * a + b * b), radius)

    def residual(x: Array) -> Array:
        axis = cylinder(x)
        return np.asarray(axis.radial(local)[1] - abs(axis.radius))

    def jacobian(x: Array) -> Array:
        axis = cylinder(x)
        u = axis.radial(local)[0]
        tilt = -((local - axis.point) @ axis.direction) * axis.direction[2]
        # The centre moves away as the radius grows: 1 + u.e is 1 - cos(angle from the arc's middle), tiny on an arc.
        bend = axis.radius * axis.radius * (np.sign(axis.radius) + u[:, 0])
        return np.asarray(np.column_stack([-u[:, :2], tilt[:, None] * u[:, :2], bend]) * scale)

    first = np.array([reach - start.radius, 0.0, 0.0, 0.0, 1.0 / start.radius]) / scale
    try:
        if robust_scale is None:
            x = least_squares(residual, first, jacobian, x_scale="jac", xtol=_DIGITS, ftol=_DIGITS, gtol=_DIGITS).x
        else:
            x = least_squares(residual, first, jacobian, loss="cauchy", f_scale=robust_scale, max_nfev=25).x
    except (ValueError, np.linalg.LinAlgError):
        return None
    if not np.isfinite(x).all() or x[4] * scale[4] * size < 1e-3:
        return None
    axis, to_world = cylinder(x), np.stack([e, f, w])
    middle = axis.point - (axis.point @ axis.direction) * axis.direction
    return Axis(centroid + (middle @ to_world), axis.direction @ to_world, float(axis.radius))


def axis_along(direction: Array, points: Array) -> Axis | None:
    """Cylinder along a unit ``direction`` (3,) by the circle of ``points`` (n, 3) seen along it; None if on a line.

    The circle is the algebraic one (Kasa's).
    """
    frame = np.stack(perpendicular(direction))
    p = points @ frame.T
    middle = p.mean(axis=0)
    p = p - middle
    A = np.column_stack([2.0 * p, np.ones(len(p))])
    solution, _, rank, _ = np.linalg.lstsq(A, (p * p).sum(axis=1), rcond=1e-9)
    if rank < 3:
        return None
    centre, square = solution[:2], float(solution[2] + solution[:2] @ solution[:2])
    return Axis((middle + centre) @ frame, direction, float(np.sqrt(max(square, 0.0))))


def covariance(local: Array, radius: float, noise: float) -> Array | None:
    """Covariance (5, 5) of (radius, x, y, tilt_x, tilt_y) for points ``local`` (n, 3) in the cylinder's own frame.

    The axis is (x + z tilt_x, y + z tilt_y, z); lengths in mm, tilts in rad. ``noise`` is the standard deviation of a
    point's distance from the surface. None if the points leave a parameter open (all in one ring, or on one line).
    """
    u = local[:, :2] / np.maximum(np.hypot(local[:, 0], local[:, 1]), 1e-300)[:, None]
    z = local[:, 2:]
    size = float(np.abs(local).max())
    J = np.column_stack([np.ones(len(u)), u, z * u / size])
    values, vectors = np.linalg.eigh(J.T @ J)
    if values[0] < 1e-10 * values[-1]:
        return None
    vectors[3:] /= size
    return np.asarray(((vectors / values) @ vectors.T) * noise**2)


def surface_error(C: Array, half_angle: float, length: float, freedom: int) -> float:
    """Largest distance (mm) between fitted and true surface over the arc, from the covariance ``C`` alone.

    Holds for the whole arc and length at once with probability ``CONFIDENCE`` (Scheffe's simultaneous band with five
    parameters and ``freedom`` degrees of freedom); the arc is centred on -y.
    """
    a, z = (
        q.ravel() for q in np.meshgrid(np.linspace(-half_angle, half_angle, 49), length * np.array([-0.5, 0.0, 0.5]))
    )
    g = np.column_stack([np.ones_like(a), np.sin(a), -np.cos(a), z * np.sin(a), -z * np.cos(a)])
    worst = float(np.einsum("ij,jk,ik->i", g, C, g).max())
    return float(np.sqrt(5.0 / fdtri(max(freedom, 1), 5, 1.0 - CONFIDENCE) * worst))  # F is the inverse of 1 / F
