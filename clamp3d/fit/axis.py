"""Cylinders without ends: distances from them, frames on their axis, and which angles about it are covered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clamp3d.geometry.pose import Array


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """A cylinder without ends: ``point`` (3,) on the axis, unit ``direction`` (3,), ``radius`` in mm."""

    point: Array
    direction: Array
    radius: float

    def radial(self, points: Array) -> tuple[Array, Array]:
        """Unit vectors (n, 3) from the axis to ``points`` (n, 3), and distances (n,) from the axis in mm."""
        q = points - self.point
        q = q - np.outer(q @ self.direction, self.direction)
        r = np.sqrt(np.einsum("ij,ij->i", q, q))
        return q / np.maximum(r, 1e-300)[:, None], r

    def residual(self, points: Array) -> Array:
        """Distance (n,) of ``points`` (n, 3) from the surface in mm, positive outside the radius."""
        return self.radial(points)[1] - self.radius


def perpendicular(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that make a right-handed frame with ``direction``."""
    helper = np.zeros(3)
    helper[int(np.argmin(np.abs(direction)))] = 1.0
    u = np.cross(helper, direction)
    u /= np.linalg.norm(u)
    return u, np.cross(direction, u)


def upward(direction: Array) -> Array:
    """``direction`` (3,) or its opposite: the sense of an axis is nobody's, so its largest coordinate is positive."""
    return direction if direction[int(np.argmax(np.abs(direction)))] > 0.0 else -direction


def frame(axis: Axis, turn: float, height: float) -> Array:
    """Pose (4, 4) with its origin at ``height`` mm on the axis, z along it, and -y turned by ``turn`` (rad) about it.

    The turn goes from the first `perpendicular` to the second.
    """
    u, w = perpendicular(axis.direction)
    y = -(np.cos(turn) * u + np.sin(turn) * w)
    T = np.eye(4)
    T[:3, :3] = np.stack([np.cross(y, axis.direction), y, axis.direction], axis=1)
    T[:3, 3] = axis.point + height * axis.direction
    return T


def turned(angle: Array, base: Array) -> Array:
    """Angles from ``base``, in [-pi, pi)."""
    return np.asarray((angle - base + np.pi) % (2.0 * np.pi) - np.pi)


def covered(u: Array, least: float) -> tuple[float, float]:
    """Middle and half of the arc that triangles' angles (m, 3) cover, rad; half a turn if no gap is ``least`` wide."""
    start = np.remainder(u.min(axis=1), 2.0 * np.pi)
    order = np.argsort(start, kind="stable")
    start, end = start[order], (start + np.ptp(u, axis=1))[order]
    reached = np.maximum.accumulate(end)
    gaps = np.append(start[1:], start[0] + 2.0 * np.pi) - np.maximum(reached, reached[-1] - 2.0 * np.pi)
    k = int(np.argmax(gaps))
    if gaps[k] < least:
        return 0.0, np.pi
    half = np.pi - 0.5 * float(gaps[k])
    return float(reached[k] + gaps[k]) + half, half
