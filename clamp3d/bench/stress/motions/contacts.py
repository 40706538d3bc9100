"""Contacts that motions are built backwards from: a pose at one, and screws through it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.motions.cases import Motions, motions
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


def turned(
    T: Array, point: NDArray[np.longdouble], axis: NDArray[np.longdouble], angle: NDArray[np.longdouble]
) -> Array:
    """Poses turned by ``angle`` (n,) about axes (n, 3), rounded once."""
    sine, versine = np.sin(angle)[:, None], 2 * np.sin(angle / 2)[:, None] ** 2

    def turn(x: NDArray[np.longdouble]) -> NDArray[np.longdouble]:
        once = np.cross(axis, x)
        return np.asarray(x + sine * once + versine * np.cross(axis, once))

    out = T.copy()
    wide = T.astype(Extended)
    for j in range(3):
        out[:, :3, j] = turn(wide[:, :3, j])
    out[:, :3, 3] = point + turn(wide[:, :3, 3] - point)
    return out


def screws_through(
    cases: Cases, point: Array, axis: Array, angle: Array, travel: Array, instant: Array, *, built: bool = True
) -> Motions:
    """Screws that are at the poses of ``cases`` at ``instant`` (n,)."""
    point, axis = np.asarray(point, np.float64), np.asarray(axis, np.float64)
    p, u = point.astype(Extended), axis.astype(Extended)
    u = u / np.sqrt((u * u).sum(1))[:, None]
    s = instant.astype(Extended)
    start = turned(cases.T_world_wire, p, u, -s * angle)
    start = moved(start, -(s * travel)[:, None] * u)
    gap = cases.gap if built else np.nan
    return motions(cases.shapes, cases.shape, start, travel=travel, angle=angle, point=point, axis=axis, gap=gap,
                   instant=instant)  # fmt: skip
