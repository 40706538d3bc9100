"""Rigid motions at constant rates: a translation, a rotation, or a screw, in normalised time t from 0 to 1."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import array, items, number, text
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose, cross, norm, rotation, unit

FARTHEST = 1e9
"""Largest coordinate of a scene or a motion, mm: beyond, positions are rounded by nearly 1e-6 mm."""
_LATEST = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A turn by ``angle`` about an axis together with a straight ``travel``, both at constant rates.

    Made by `translate`, `screw` or `to_pose`. In a scene ``parts`` move together and lengths are in the world's frame;
    in `first_contact` and `min_clearance` body b moves in the frame of body a.

    Attributes
    ----------
    axis, point : ndarray (3,)
        Unit direction of the axis and a point (mm) on it.
    angle : float
        Turn in rad, right-handed.
    travel : ndarray (3,)
        Straight way in mm.
    parts : tuple of str
        The parts that move, where the motion belongs to a scene.
    name : str
        What results call it.
    to : ndarray (4, 4) or None
        In place of all these: the pose that the first part goes to, by the one screw that leads there.

    Examples
    --------
    >>> Motion.translate((0.0, 0.0, 8.0)).at(0.25)[:3, 3].tolist()
    [0.0, 0.0, 2.0]
    """

    axis: Array
    point: Array
    angle: float
    travel: Array
    parts: tuple[str, ...] = ()
    name: str = "motion"
    to: Array | None = None

    @classmethod
    def translate(cls, by: ArrayLike, *, parts: str | tuple[str, ...] = (), name: str = "translation") -> Motion:
        """Straight motion ``by`` (3,) mm. Raises InputError unless it is finite."""
        return cls(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, _place("by", by), _names(parts), text("name", name))

    @classmethod
    def screw(
        cls,
        axis: ArrayLike,
        angle: float,
        *,
        point: ArrayLike = (0.0, 0.0, 0.0),
        travel: float = 0.0,
        parts: str | tuple[str, ...] = (),
        name: str = "screw",
    ) -> Motion:
        """Turn by ``angle`` rad about ``axis`` (3,) through ``point`` (3,) with ``travel`` mm along it.

        Raises InputError for an axis of length zero or numbers that are not finite.
        """
        u = unit(array("axis", axis, (3,)))
        angle, travel = number("angle", angle), number("travel", travel)
        if not abs(travel) <= FARTHEST:
            raise InputError(f"travel must be up to {FARTHEST:g} mm, got {travel:g}")
        return cls(u, _place("point", point), angle, travel * u, _names(parts), text("name", name))

    @classmethod
    def to_pose(cls, to: ArrayLike, *, parts: str | tuple[str, ...] = (), name: str = "to pose") -> Motion:
        """By one screw to the pose ``to`` (4, 4) of the first part; the others follow rigidly."""
        still = cls.translate(np.zeros(3), parts=parts, name=name)
        return replace(still, to=scene_pose(to, "to"))

    def resolved(self, start: Array) -> Motion:
        """The motion with ``to`` turned into a screw, for a first part that stands at ``start`` (4, 4)."""
        if self.to is None:
            return self
        from scipy.spatial.transform import Rotation

        way = self.to[:3, 3] - start[:3, 3]
        turn = Rotation.from_matrix(self.to[:3, :3] @ start[:3, :3].T).as_rotvec()
        angle = norm(turn)
        if angle < 1e-12:
            return replace(self, travel=way, to=None)
        u = turn / angle
        along = float(way @ u) * u
        across = way - along
        # The middle of the chord, and from there as far as it is wide for the angle: exact however far the axis is.
        point = start[:3, 3] + 0.5 * (across + cross(u, across) / math.tan(0.5 * angle))
        return replace(self, axis=u, point=point, angle=angle, travel=along, to=None)

    def at(self, t: float, start: Array | None = None) -> Array:
        """Pose (4, 4) at time ``t`` of a body that stands at ``start`` (4, 4; the origin by default) at t = 0.

        Raises InputError unless all are finite numbers and ``t`` at most 1e6 times as far as the motion.
        """
        t = number("t", t)
        if not abs(t) <= _LATEST:
            raise InputError(f"t must be from 0 to 1 (or at most {_LATEST:g} times as far), got {t}")
        T = np.eye(4) if start is None else array("start", start, (4, 4)).copy()
        if self.angle:
            # The turn minus one, by its sine and versine: what hardly turns is hardly rounded, however far the axis is.
            square = cross(self.axis, T[:3, 3] - self.point)
            half = math.sin(0.5 * t * self.angle)
            T[:3, 3] += math.sin(t * self.angle) * square + 2.0 * half * half * cross(self.axis, square)
            T[:3, :3] = rotation(self.axis, t * self.angle)[:3, :3] @ T[:3, :3]
        T[:3, 3] += t * self.travel
        return T

    def from_axis(self, points: Array) -> Array:
        """Distances (...) in mm of points (..., 3) from the axis."""
        out = points - self.point
        return np.asarray(np.linalg.norm(out - (out @ self.axis)[..., None] * self.axis, axis=-1))

    @property
    def is_screw(self) -> bool:
        """Whether it has one axis all the time: a turn is not carried across its own."""
        return not self.angle or norm(cross(self.travel, self.axis)) <= 1e-14 * norm(self.travel)

    def speed(self, points: Array) -> float:
        """Bound (mm per unit of t) of the speed of points (k, 3), given where they are at the start."""
        turning = abs(self.angle) * float(self.from_axis(points).max()) if self.angle else 0.0
        return norm(self.travel) + turning


def _names(parts: str | tuple[str, ...]) -> tuple[str, ...]:
    names = (parts,) if isinstance(parts, str) else items("parts of a motion", parts, "part names")
    for name in names:
        text("part of a motion", name)
    return names


def _place(name: str, value: ArrayLike) -> Array:
    v = array(name, value, (3,))
    if not np.abs(v).max() <= FARTHEST:
        raise InputError(f"{name} must be three lengths up to {FARTHEST:g} mm, got {v.tolist()}")
    return v.copy()


def scene_pose(value: ArrayLike, name: str) -> Array:
    """A rigid pose (4, 4) with an offset up to `FARTHEST`. Raises InputError for any other."""
    T = check_pose(value, name)
    _place(f"offset of {name}", T[:3, 3])
    return T
