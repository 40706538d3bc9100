"""Rigid motions in scenes: a translation, a rotation, or a screw from where a part stands to where it shall be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import array, items, number, text
from clamp3d.collide.bounds import FARTHEST
from clamp3d.core.pose import Array, check_pose, inverse, rotation, unit
from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """``parts`` move together, evenly, from t = 0 to 1: turn by ``angle`` rad about an axis, and go by ``travel``.

    ``axis`` (3,) unit and ``point`` (3,) on it, and ``travel`` (3,), in the world, mm. With ``to`` (4, 4) in place of
    these the first part goes to that pose by the one screw that leads there.
    """

    name: str
    parts: tuple[str, ...]
    axis: Array
    point: Array
    angle: float
    travel: Array
    to: Array | None = None

    @classmethod
    def translate(cls, parts: str | tuple[str, ...], by: ArrayLike, *, name: str = "translation") -> Motion:
        """Straight motion ``by`` (3,) mm. Raises InputError unless it is finite."""
        z = np.array([0.0, 0.0, 1.0])
        return cls(text("name", name), _names(parts), z, np.zeros(3), 0.0, _vector("by", by))

    @classmethod
    def screw(
        cls,
        parts: str | tuple[str, ...],
        axis: ArrayLike,
        angle: float,
        *,
        point: ArrayLike = (0.0, 0.0, 0.0),
        travel: float = 0.0,
        name: str = "screw",
    ) -> Motion:
        """Turn by ``angle`` rad about ``axis`` (3,) through ``point`` (3,) with ``travel`` mm along it.

        Raises InputError for an axis of length zero or numbers that are not finite.
        """
        u = unit(array("axis", axis, (3,)))
        angle, travel = number("angle", angle), number("travel", travel)
        if not abs(travel) <= FARTHEST:
            raise InputError(f"travel must be up to {FARTHEST:g} mm, got {travel:g}")
        return cls(text("name", name), _names(parts), u, _vector("point", point), angle, travel * u)

    @classmethod
    def to_pose(cls, parts: str | tuple[str, ...], to: ArrayLike, *, name: str = "to pose") -> Motion:
        """By one screw to the pose ``to`` (4, 4) of the first part; the others go along."""
        z = np.array([0.0, 0.0, 1.0])
        return cls(text("name", name), _names(parts), z, np.zeros(3), 0.0, np.zeros(3), scene_pose(to, "to"))

    def from_pose(self, T: Array) -> Motion:
        """The motion with ``to`` resolved for a first part that stands at ``T`` (4, 4)."""
        if self.to is None:
            return self
        M = self.to @ inverse(T)
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(M[:3, :3]).as_rotvec()
        angle = float(np.linalg.norm(turn))
        t = M[:3, 3]
        if angle < 1e-12:
            return Motion(self.name, self.parts, self.axis, self.point, 0.0, t)
        u = turn / angle
        along = float(t @ u) * u
        point = np.linalg.lstsq(np.eye(3) - M[:3, :3], t - along, rcond=1e-12)[0]
        return Motion(self.name, self.parts, u, point, angle, along)

    def at(self, t: float) -> Array:
        """World motion (4, 4) after the fraction ``t``; multiplies the start pose from the left."""
        M = rotation(self.axis, t * self.angle)
        M[:3, 3] = self.point - M[:3, :3] @ self.point + t * self.travel
        return M

    def distance_from_axis(self, points: Array) -> float:
        """Largest distance (mm) of points (k, 3) from the axis."""
        out = points - self.point
        out = out - np.outer(out @ self.axis, self.axis)
        return float(np.linalg.norm(out, axis=1).max())

    def speed(self, points: Array) -> float:
        """Bound (mm per unit of t) of the speed of points (k, 3), given in the world at the start."""
        turning = abs(self.angle) * self.distance_from_axis(points) if self.angle else 0.0
        return float(np.linalg.norm(self.travel)) + turning


def _names(parts: str | tuple[str, ...]) -> tuple[str, ...]:
    names = (parts,) if isinstance(parts, str) else items("parts of a motion", parts, "part names")
    for name in names:
        text("part of a motion", name)
    if not names:
        raise InputError("a motion must name at least one part")
    return names


def _vector(name: str, value: ArrayLike) -> Array:
    v = array(name, value, (3,))
    if not np.abs(v).max() <= FARTHEST:
        raise InputError(f"{name} must be three lengths up to {FARTHEST:g} mm, got {v.tolist()}")
    return v


def scene_pose(value: ArrayLike, name: str) -> Array:
    """A rigid pose (4, 4) with an offset up to `FARTHEST`. Raises InputError for any other."""
    T = check_pose(value, name)
    _vector(f"offset of {name}", T[:3, 3])
    return T
