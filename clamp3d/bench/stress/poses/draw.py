"""Random cases of the pose families: shapes, poses and the answer they were built from.

A case is built backwards: choose the groove, the feature that is to be touched, the contact point on it, a normal of
the feature there and the gap; the wire's axis then passes ``radius + gap`` from the point along the normal. What is
rounded on the way to float64 poses is not forgotten: the truth of a case is worked out for the pose as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clamp3d.bench.stress.poses.cases import Cases, Extended, Shapes, unit_rows
from clamp3d.geometry.pose import Array

PARALLEL_FEATURES = ("arc", "lip", "flat")
FEATURES = (*PARALLEL_FEATURES, "end face", "end arc", "end edge", "corner")


def powers(rng: np.random.Generator, n: int, low: float, high: float, zeros: float = 0.1) -> Array:
    """+-10^u (n,) with u uniform in [low, high]; a share ``zeros`` of them is 0."""
    x = 10.0 ** rng.uniform(low, high, n) * rng.choice([-1.0, 1.0], n)
    return np.where(rng.random(n) < zeros, 0.0, x)


def shapes(rng: np.random.Generator, k: int, **fixed: ArrayLike) -> Shapes:
    """k grooves and wires of clamp-like proportions; ``fixed`` replaces any of the columns."""
    R = 10.0 ** rng.uniform(0.0, 2.0, k)
    columns: dict[str, Any] = {
        "R": R,
        "half_angle": np.where(rng.random(k) < 0.3, rng.uniform(1.6, 3.1, k), rng.uniform(0.1, 1.57, k)),
        "L": R * 10.0 ** rng.uniform(-0.5, 1.0, k),
        "r": R * rng.uniform(0.3, 0.999, k),
        "length": R * 10.0 ** rng.uniform(-0.5, 1.5, k),
    }
    arrays: dict[str, Any] = {name: np.array(value, np.float64) for name, value in (columns | fixed).items()}
    return Shapes(**arrays)


def spread(n: int, k: int) -> NDArray[np.intp]:
    """Row of shape (n,) for n cases on k shapes, in blocks."""
    return (np.arange(n) * k // max(n, 1)).astype(np.intp)


def count(n: int) -> int:
    """Shapes for n cases: 20 poses each."""
    return max(1, n // 20)


def setting(
    rng: np.random.Generator, n: int, features: tuple[str, ...] = FEATURES
) -> tuple[Shapes, NDArray[np.intp], NDArray[np.str_]]:
    """Random shapes, the shape (n,) of each case, and the feature (n,) that it touches."""
    drawn = shapes(rng, count(n))
    return drawn, spread(n, len(drawn)), rng.choice(features, n)


def poses_from_axes(rng: np.random.Generator, centre: Any, direction: Any) -> Array:
    """Poses (n, 4, 4) with origin ``centre`` and z axis ``direction`` (n, 3), turned at random about it."""
    d = unit_rows(direction)
    helper = np.where(np.abs(d[:, :1]) < 0.6, np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]])).astype(Extended)
    x = unit_rows(np.cross(helper, d))
    y = np.cross(d, x)
    turn = rng.uniform(-np.pi, np.pi, len(d)).astype(Extended)
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    T = np.zeros((len(d), 4, 4))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = c * x + s * y, c * y - s * x, d
    T[:, :3, 3], T[:, 3, 3] = centre, 1.0
    return T


def free(rng: np.random.Generator, shapes: Shapes, shape: NDArray[np.intp], centre: Any, direction: Any) -> Cases:
    """Cases that were built from no answer: wires with their middles and axes (n, 3) as fixed."""
    return Cases(shapes, shape, poses_from_axes(rng, centre, direction), np.full(len(shape), np.nan))


@dataclass
class Contact:
    """Where a case is to touch: ``q`` (n, 3) on the groove and a ``normal`` of its cone there, long doubles.

    ``ends`` says that only the wire's end can touch there (arc, flat and end face are not convex towards the wire).
    """

    q: NDArray[Any]
    normal: NDArray[Any]
    ends: NDArray[np.bool_]


def contact_on(
    rng: np.random.Generator,
    shapes: Shapes,
    shape: NDArray[np.intp],
    feature: NDArray[np.str_],
    *,
    phi: ArrayLike | None = None,
    cone: ArrayLike | None = None,
) -> Contact:
    """A random contact on the named ``feature`` (n,) of each groove.

    ``phi`` (n,) rad sets the place on the arc from its deepest line, ``cone`` (n,) in [0, 1] the normal within the
    cone of an edge, from the face's normal (0) to the other one.
    """
    n = len(shape)
    R, a, H = (np.asarray(v, Extended)[shape] for v in (shapes.R, shapes.half_angle, shapes.L / 2))
    side = rng.choice([-1.0, 1.0], n).astype(Extended)
    end = rng.choice([-1.0, 1.0], n).astype(Extended)
    p = a * rng.uniform(-1.0, 1.0, n) if phi is None else np.asarray(phi, Extended)
    w = np.asarray(rng.random(n) if cone is None else cone, Extended)
    w2 = rng.random(n).astype(Extended)
    sin, cos = np.sin(a), np.cos(a)
    zero, one = np.zeros(n, Extended), np.ones(n, Extended)
    lip = np.stack([side * R * sin, -R * cos, zero], 1)
    beside = lip + np.stack([side * R * rng.uniform(0.01, 3.0, n), zero, zero], 1)
    # Under the end face; beside a major arc, so that it is not in the hollow.
    widest = np.where(a > np.pi / 2, R, R * sin)
    below = np.stack([side * (widest + R * rng.uniform(0.0, 3.0, n)), -R * (cos + rng.uniform(0.0, 2.0, n)), zero], 1)
    on_arc = np.stack([R * np.sin(p), -R * np.cos(p), zero], 1)
    upward, out = np.stack([zero, one, zero], 1), np.stack([zero, zero, end], 1)
    inward = -on_arc / R[:, None]
    at_end, within = H * end, H * rng.uniform(-1.0, 1.0, n)
    # The lip's cone: turned from +y towards the arc's inner normal there, by pi - half_angle in all.
    turn = w * (np.pi - a)
    lip_normal = np.stack([-side * np.sin(turn), np.cos(turn), zero], 1)

    def mix(u: NDArray[Any], v: NDArray[Any], weight: NDArray[Any]) -> NDArray[Any]:
        angle = weight * Extended(np.pi) / 2
        return np.asarray(np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)

    q, normal = np.zeros((n, 3), Extended), np.zeros((n, 3), Extended)
    table = {
        "arc": (on_arc, within, inward),
        "lip": (lip, within, lip_normal),
        "flat": (beside, within, upward),
        "end face": (below, at_end, out),
        "end arc": (on_arc, at_end, mix(inward, out, w)),
        "end edge": (beside, at_end, mix(upward, out, w)),
        "corner": (lip, at_end, mix(lip_normal, out, w2)),
    }
    for name, (place, z, direction) in table.items():
        here = feature == name
        q[here], normal[here] = place[here], direction[here]
        q[here, 2] = z[here]
    return Contact(q, normal, np.isin(feature, ["arc", "flat", "end face"]))


def place(
    rng: np.random.Generator,
    shapes: Shapes,
    shape: NDArray[np.intp],
    contact: Contact,
    gap: Array,
    *,
    tilt: ArrayLike | None = None,
) -> Cases:
    """Put each wire at ``gap`` (n,) from its contact.

    ``tilt`` (n,) rad is the axis' lean out of the groove's direction within the plane square to the normal, by
    default any; it touches anywhere on the axis. Features that a wire can only touch with its end get that end, and an
    axis that leads away.
    """
    n = len(shape)
    r, half = np.asarray(shapes.r, Extended)[shape], np.asarray(shapes.length, Extended)[shape] / 2
    nrm = unit_rows(contact.normal)
    # Square to the normal: what is left of z (or of x where the normal is z), and the third direction.
    z = np.where((np.abs(nrm[:, 2]) < 0.9)[:, None], [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]).astype(Extended)
    u = unit_rows(z - (z * nrm).sum(1)[:, None] * nrm)
    v = np.cross(nrm, u)
    lean = np.asarray(rng.uniform(-np.pi, np.pi, n) if tilt is None else tilt, Extended)
    d = np.cos(lean)[:, None] * u + np.sin(lean)[:, None] * v
    t = half * np.asarray(rng.uniform(-1.0, 1.0, n), Extended)
    away = np.asarray(rng.uniform(0.0, np.pi / 2, n), Extended)
    if tilt is None:
        ended = np.cos(away)[:, None] * d + np.sin(away)[:, None] * nrm
    else:  # leans away from the contact by the tilt itself
        ended = np.cos(lean)[:, None] * u + np.abs(np.sin(lean))[:, None] * nrm
    d = np.where(contact.ends[:, None], ended, d)
    t = np.where(contact.ends, -half, t)
    flip = rng.choice([-1.0, 1.0], n)
    axis_point = contact.q + (r + np.asarray(gap, Extended))[:, None] * nrm
    centre = axis_point - t[:, None] * d
    return Cases(shapes, shape, poses_from_axes(rng, centre, flip[:, None] * d), np.asarray(gap, np.float64))


def touching(
    rng: np.random.Generator, n: int, shapes: Shapes, gap: tuple[float, float], *, tilt: tuple[float, ...] | None = None
) -> Cases:
    """n cases on any of `FEATURES`, at gaps of +-10^u of the wire's radius with u in ``gap``, or 0.

    ``tilt`` are the arguments of `powers` for the lean in rad, None for any lean.
    """
    shape, feature = spread(n, len(shapes)), rng.choice(FEATURES, n)
    off = shapes.r[shape] * powers(rng, n, *gap)
    contact = contact_on(rng, shapes, shape, feature)
    lean = None if tilt is None else powers(rng, n, *tilt)
    return place(rng, shapes, shape, contact, off, tilt=lean)
