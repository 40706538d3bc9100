"""Lower bounds that hold for a whole stretch of a motion: one part still, the other's pieces swept.

A cylinder is swept into a longer and thicker one: sliding along its own axis costs nothing, so a pin in its bore
keeps its clearance over any stretch. A ball is swept into a larger one, a polyhedron into the hull of its first and
last position.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import lower_of_union
from clamp3d.engine.closed_form import ClosedForm, bore_rod
from clamp3d.engine.convex import Ball, Convex, Rod, convex_distance
from clamp3d.engine.hull import Hull, hull
from clamp3d.engine.model import Model
from clamp3d.geometry.pose import Array, inverse, to_target

HALF_TURN = 0.5 * math.pi
"""Turn (rad) of half a stretch from which on nothing bounds what is swept on all of it."""


def swept_lower(
    a: Model, b: Model, before: Array, middle: Array, after: Array, *, angle: float, screw: bool = True
) -> float:
    """Distance (mm) that ``b`` certainly keeps from ``a`` while it goes from ``before`` over ``middle`` to ``after``.

    All three (4, 4) in a's frame, evenly spaced on a way that turns by ``angle`` (rad) between two of them: one screw,
    or a turn of a that is carried across its axis. ``angle`` must be less than `HALF_TURN`.
    """
    there: tuple[Array, ...] = (before, middle, after)
    back = tuple(inverse(T) for T in there)
    if not screw:  # seen from a, the points of b are on spirals, which no arc bounds
        a, b, there, back = b, a, back, there
    best = np.inf
    for x, y in itertools.product(a.enclosing, b.enclosing):
        bounds = [*_bounds(x, y, there, angle)]
        if screw:
            # Swept, a ball is a larger ball: the hull of a polyhedron that comes to it holds less.
            is_angular = any(isinstance(piece, Hull) for piece in x.outers)
            rounds = tuple(piece for piece in y.outers if is_angular and not isinstance(piece, Hull))
            bounds += _bounds(replace(y, outers=rounds), x, back, angle)
        best = min(best, max(bounds, default=-np.inf) - x.error - y.error)
    is_one = len(a.enclosing) == len(b.enclosing) == 1
    return float(best) if is_one else lower_of_union(float(best))


def _bounds(still: ClosedForm, moving: ClosedForm, poses: tuple[Array, ...], angle: float) -> Iterator[float]:
    """Lower bounds of the distance from each bore and piece of ``still`` and each swept piece of ``moving``."""
    for piece in moving.outers:
        swept, place, sag = _swept(piece, poses, angle)
        if not isinstance(swept, Hull):
            yield from (bore_rod(bore, swept, place).lower for bore in still.bores)
        for other in still.outers:
            yield convex_distance(other, np.eye(4), swept, place, sharp=False).lower - sag


def _swept(piece: Convex, poses: tuple[Array, ...], angle: float) -> tuple[Convex, Array, float]:
    """What holds a piece all the time, at a pose (4, 4), and how far (mm) it leaves that."""
    match piece:
        case Rod():
            return _swept_rod(piece, poses, angle), poses[1], 0.0
        case Ball():
            ways = np.array([to_target(T, piece.ends) for T in poses])
            reach = float(np.linalg.norm(ways - ways[1], axis=2).max()) + _sagitta(ways, angle)
            return Ball(piece.radius + reach, piece.T), poses[1], 0.0
    ways = np.array([to_target(T, piece.vertices) for T in poses])  # of a polyhedron at all three, and their hull
    return hull((ways if angle else ways[::2]).reshape(-1, 3)), np.eye(4), _sagitta(ways, angle)


def _swept_rod(rod: Rod, poses: tuple[Array, ...], angle: float) -> Rod:
    """A rod, in its own part's frame at the middle pose, that holds the moving one all the time."""
    home = inverse(poses[1] @ rod.T)
    ways = np.array([to_target(home, to_target(T, rod.ends)) for T in poses])
    local, sag = ways.reshape(-1, 3), _sagitta(ways, angle)
    axes = [home[:3, :3] @ T[:3, :3] @ rod.T[:3, 2] for T in poses]
    tilt = rod.radius * max(float(np.hypot(axis[0], axis[1])) for axis in axes)
    low, high = float(local[:, 2].min() - sag - tilt), float(local[:, 2].max() + sag + tilt)
    aside = float(np.hypot(local[:, 0], local[:, 1]).max())
    T = rod.T.copy()
    T[:3, 3] += 0.5 * (low + high) * rod.T[:3, 2]
    return Rod(rod.radius + aside + sag, high - low, T)


def _sagitta(ways: Array, angle: float) -> float:
    """How far points stray from straight lines between their places ``ways`` (3, k, 3), ``angle`` of a turn apart."""
    # Straight travel leaves no second difference; on an arc of angle a and radius r it is 4 r sin^2(a / 2), and the
    # arc leaves its chord by 2 r sin^2(a / 4).
    bend = float(np.linalg.norm(ways[0] - 2.0 * ways[1] + ways[2], axis=1).max())
    return bend / (8.0 * math.cos(0.25 * angle) ** 2)
