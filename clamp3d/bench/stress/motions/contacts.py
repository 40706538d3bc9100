"""Contacts that motions are built backwards from: a pose at one, and screws through it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.motions.cases import Motions, motions, turned
from clamp3d.bench.stress.poses.cases import Cases, Contact, Extended, Shapes, contact_on, place
from clamp3d.core.pose import Array


def touching(
    rng: np.random.Generator, shapes: Shapes, shape: NDArray[np.intp], feature: NDArray[np.str_], gap: Array
) -> tuple[Cases, NDArray[np.longdouble]]:
    """Poses at a contact, a third of them along the groove, and the unit normals (n, 3) there."""
    contact = contact_on(rng, shapes, shape, feature)
    tilt = np.where(rng.random(len(shape)) < 0.33, 0.0, rng.uniform(-1.5, 1.5, len(shape)))
    return place(rng, shapes, shape, contact, gap, tilt=tilt), unit(contact)


def unit(contact: Contact) -> NDArray[np.longdouble]:
    """Unit normals (n, 3) there."""
    return np.asarray(contact.normal / np.sqrt((contact.normal**2).sum(1))[:, None])


def square_to(rng: np.random.Generator, normal: NDArray[np.longdouble]) -> NDArray[np.longdouble]:
    """Random unit vectors (n, 3) square to ``normal``."""
    v = rng.normal(size=normal.shape).astype(Extended)
    v = np.cross(normal, v)
    return np.asarray(v / np.sqrt((v * v).sum(1))[:, None])


def moved(T: Array, by: NDArray[Any]) -> Array:
    """Poses moved by (n, 3) mm, rounded once."""
    out = T.copy()
    out[:, :3, 3] = T[:, :3, 3].astype(Extended) + by
    return out


def screws_through(cases: Cases, point: Array, axis: Array, angle: Array, travel: Array, instant: Array) -> Motions:
    """Screws that are at the poses of ``cases`` at ``instant`` (n,)."""
    point, axis = np.asarray(point, np.float64), np.asarray(axis, np.float64)
    p, u = point.astype(Extended), axis.astype(Extended)
    u = u / np.sqrt((u * u).sum(1))[:, None]
    s = instant.astype(Extended)
    start, back = cases.T_world_wire.copy(), -s * angle
    for column in range(4):  # turned back about the axis, rounded once
        x = cases.T_world_wire[:, :3, column].astype(Extended)
        foot = p if column == 3 else 0.0
        start[:, :3, column] = foot + turned(x - foot, u, back)
    start = moved(start, -(s * travel)[:, None] * u)
    turn = {"travel": travel, "angle": angle, "point": point, "axis": axis}
    return motions(cases.shapes, cases.shape, start, **turn, gap=cases.gap, instant=instant)
