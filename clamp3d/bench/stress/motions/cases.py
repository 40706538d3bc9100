"""Cases of the motion families: the motion of the wire in the groove's frame, built backwards from a contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.bench.stress.poses import draw
from clamp3d.bench.stress.poses.cases import Cases, Extended, Shapes, unit_rows
from clamp3d.bench.stress.worker import Rows
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array


@dataclass(frozen=True, slots=True)
class Motions(Rows):
    """n motions: ``shape`` (n,) row of ``shapes``; a turn by ``angle`` (n,) rad and a ``travel`` (n, 3) mm from 0 to 1.

    ``start`` (n, 4, 4) is ``T_groove_wire`` at instant 0. Where ``angle`` is 0 the motion is a translation; else a
    screw about ``axis`` (n, 3) through ``point`` (n, 3), and ``travel`` is along the axis: its first number is the
    length. ``gap`` (n,) mm is the least distance that the case was built for, NaN if it was built from none, and
    ``instant`` (n,) where; another place may come nearer. ``number`` (n,) tells the cases apart when some are taken.
    """

    shapes: Shapes
    shape: NDArray[np.intp]
    start: Array
    point: Array
    axis: Array
    angle: Array
    travel: Array
    gap: Array
    instant: Array
    number: NDArray[np.intp]

    def motion(self, i: int) -> Motion:
        """Case i as a `Motion`."""
        if self.angle[i] == 0.0:
            return Motion.translate(self.travel[i])
        angle, travel = float(self.angle[i]), float(self.travel[i, 0])
        return Motion.screw(self.axis[i], angle, point=self.point[i], travel=travel)

    def vector(self) -> Array:
        """Travel (n, 3) mm as a vector, as long doubles."""
        axis = self.unit_axis()
        turns = (self.angle != 0.0)[:, None]
        return np.asarray(np.where(turns, axis * self.travel[:, :1], self.travel.astype(np.longdouble)))

    def unit_axis(self) -> Array:
        """Axes (n, 3) of length 1, as long doubles."""
        return unit_rows(self.axis)

    def scene(self) -> Array:
        """Largest length of each case (n,), mm: sizes, the start, the point of the axis and the travel."""
        far = np.abs(np.concatenate([self.start[:, :3, 3], self.point, np.asarray(self.vector(), float)], 1)).max(1)
        return np.asarray(np.maximum(self.shapes.size()[self.shape], far))

    def snippet(self, i: int) -> str:
        """Python lines that ask for case i alone, bit by bit the same numbers."""
        if self.angle[i] == 0.0:
            motion = f"clamp3d.Motion.translate({self.travel[i].tolist()})"
        else:
            numbers = f"{self.axis[i].tolist()}, {float(self.angle[i])!r}, point={self.point[i].tolist()}"
            motion = f"clamp3d.Motion.screw({numbers}, travel={float(self.travel[i, 0])!r})"
        lines = [
            *self.shapes.snippet(int(self.shape[i])),
            f"motion = {motion}",
            f"start = np.array({self.start[i].tolist()})",
            "print(clamp3d.min_clearance(groove, wire, motion, start))",
            "print(clamp3d.first_contact(groove, wire, motion, start))",
        ]
        return "\n".join(lines)


def motions(
    shapes: Shapes,
    shape: NDArray[np.intp],
    start: Array,
    *,
    travel: ArrayLike,
    angle: ArrayLike = 0.0,
    point: ArrayLike = 0.0,
    axis: ArrayLike = (0.0, 0.0, 1.0),
    gap: ArrayLike = np.nan,
    instant: ArrayLike = np.nan,
) -> Motions:
    """Cases from columns, each spread to n rows; ``travel`` (n, 3) mm, or (n,) along the axis of a turn."""
    n = len(shape)

    def spread(x: ArrayLike, *more: int) -> Array:
        return np.array(np.broadcast_to(np.asarray(x, np.float64), (n, *more)))

    travel = np.asarray(travel, np.float64)
    if travel.ndim < 2:
        travel = spread(travel)[:, None] * [1.0, 0.0, 0.0]
    return Motions(
        shapes,
        shape,
        start,
        spread(point, 3),
        spread(axis, 3),
        spread(angle),
        spread(travel, 3),
        spread(gap),
        spread(instant),
        np.arange(n),
    )


def turned(x: NDArray[Any], axis: NDArray[Any], angle: NDArray[Any]) -> NDArray[Any]:
    """Vectors x turned by ``angle`` (n,) rad about unit axes, (n, 3) in the numbers that are given.

    Rodrigues' formula; x and axis are (n, 3) or (3,).
    """
    once = np.cross(axis, x)
    sine, versine = np.sin(angle)[:, None], 2 * np.sin(angle / 2)[:, None] ** 2
    return np.asarray(x + sine * once + versine * np.cross(axis, once))


def poses(cases: Motions, i: int, instants: Array) -> Array:
    """Poses (m, 4, 4) of case i at some instants."""
    motion = cases.motion(i)
    return np.array([motion.at(t, cases.start[i]) for t in instants.tolist()])


def touching(
    rng: np.random.Generator, shapes: Shapes, shape: NDArray[np.intp], feature: NDArray[np.str_], gap: Array
) -> tuple[Cases, NDArray[np.longdouble]]:
    """Poses at a contact, a third of them along the groove, and the unit normals (n, 3) there."""
    contact = draw.contact_on(rng, shapes, shape, feature)
    tilt = np.where(rng.random(len(shape)) < 0.33, 0.0, rng.uniform(-1.5, 1.5, len(shape)))
    return draw.place(rng, shapes, shape, contact, gap, tilt=tilt), unit_rows(contact.normal)


def square_to(rng: np.random.Generator, normal: NDArray[np.longdouble]) -> NDArray[np.longdouble]:
    """Random unit vectors (n, 3) square to ``normal``."""
    return unit_rows(np.cross(normal, rng.normal(size=normal.shape).astype(Extended)))


def moved(T: Array, by: NDArray[Any]) -> Array:
    """Poses moved by (n, 3) mm, rounded once."""
    out = T.copy()
    out[:, :3, 3] = T[:, :3, 3].astype(Extended) + by
    return out


def screws_through(cases: Cases, point: Array, axis: Array, angle: Array, travel: Array, instant: Array) -> Motions:
    """Screws that are at the poses of ``cases`` at ``instant`` (n,)."""
    point, axis = np.asarray(point, np.float64), np.asarray(axis, np.float64)
    p, u = point.astype(Extended), unit_rows(axis)
    s = instant.astype(Extended)
    start, back = cases.T_world_wire.copy(), -s * angle
    for column in range(4):  # turned back about the axis, rounded once
        x = cases.T_world_wire[:, :3, column].astype(Extended)
        foot = p if column == 3 else 0.0
        start[:, :3, column] = foot + turned(x - foot, u, back)
    start = moved(start, -(s * travel)[:, None] * u)
    turn = {"travel": travel, "angle": angle, "point": point, "axis": axis}
    return motions(cases.shapes, cases.shape, start, **turn, gap=cases.gap, instant=instant)
