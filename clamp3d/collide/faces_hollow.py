"""Compiled: hollow corners, grooves and pockets, where a solid in a ball lies below at least one of several surfaces.

No face alone has all of the solid below it there. What is above all of them is taken for planes that are parallel or
square to each other, with at most one hole of a cylinder along all their normals, and for two planes at any angle: each
of these has a convex upper side, so that what is above all of them in a ball is convex, in one piece.

From a point that is below one of them a step along its normal leads above it, and changes the height over those square
to it by nothing. So the point's way out of all of them has the squared length of the sum of the squares.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np

from clamp3d.collide.faces_math import (
    CYLINDER,
    OTHER,
    PLANE,
    band_over,
    bend_over,
    height_at,
    least_height,
    raise_by,
    spans,
    to_frame,
)
from clamp3d.collide.faces_open import is_open
from clamp3d.collide.faces_tree import nearest_marked
from clamp3d.core.jit import formula

MOST_TRIED = 16
"""Faces tried for one piece, with those beside the nearest."""
CAPACITY = 12
"""Faces at most that pieces are bounded over together."""
TRIED = MOST_TRIED + 3 * CAPACITY
"""Numbers that are kept for both: of the latter also what each is raised by, the height over it, its ball's radius."""
MOST_AROUND = 4
"""Faces of a hollow corner at most."""
_EXACT = 1e-6
"""Sine up to which two faces' directions count as the same, or as square to each other."""


@formula
def _dot(F, G):
    """Cosine of the angle between the axes of two frames (12)."""
    return F[9] * G[9] + F[10] * G[10] + F[11] * G[11]


@formula
def _alike(F, G):
    """1 if the axes of two frames are parallel, 2 if they are square to each other, 0 otherwise."""
    c = _dot(F, G)
    if abs(c) < _EXACT:
        return 2
    x, y, z = F[10] * G[11] - F[11] * G[10], F[11] * G[9] - F[9] * G[11], F[9] * G[10] - F[10] * G[9]
    return 1 if math.sqrt(x * x + y * y + z * z) < _EXACT else 0


@formula
def goes_with(kind, frame, sense, chosen, first, count, g):
    """Whether face g can be one of a hollow corner with those chosen from ``first`` on to ``count``."""
    if count - first >= MOST_AROUND or not (kind[g] == PLANE or (kind[g] == CYLINDER and sense[g] < 0.0)):
        return False
    for m in range(first, count):
        f = chosen[m]
        alike = _alike(frame[f], frame[g])
        if kind[f] == CYLINDER or kind[g] == CYLINDER:
            if kind[f] == kind[g] or alike != 1:
                return False
        elif alike == 0:
            return count - first == 1 and sense[f] * sense[g] * _dot(frame[f], frame[g]) > -0.8
    if count - first == 2 and kind[chosen[first]] == PLANE and kind[chosen[first + 1]] == PLANE:
        return _alike(frame[chosen[first]], frame[chosen[first + 1]]) != 0
    return True


@formula
def above_all(high, first, count, chosen, kind, frame, sense):
    """Lower bound, from heights ``high`` over the faces chosen from ``first`` on to ``count``, of how far above all.

    The least of the heights, or if one is negative, less the length of the way to what is above all of them.
    """
    low, total = np.inf, 0.0
    for m in range(first, count):
        low, total = min(low, high[m]), total + max(0.0, -high[m])
    if low >= 0.0 or low == -np.inf:
        return low
    if count - first == 2 and kind[chosen[first]] == PLANE and kind[chosen[first + 1]] == PLANE:
        f, g = chosen[first], chosen[first + 1]
        turn = sense[f] * sense[g] * _dot(frame[f], frame[g])
        one, two = max(0.0, -high[first]), max(0.0, -high[first + 1])
        if abs(turn) < 1.0 - 1e-9:
            if two <= one * turn or one <= two * turn:
                return -max(one, two)
            return -math.sqrt((one * one + two * two - 2.0 * turn * one * two) / (1.0 - turn * turn))
    # What the directions are not quite square may take of each height is stepped in addition.
    more, square = 4.0 * _EXACT * total, 0.0
    for m in range(first, count):
        step, f = max(0.0, more - high[m]), chosen[m]
        for n in range(first, count):
            g = chosen[n]
            if n == m or kind[f] != PLANE or kind[g] != PLANE or _alike(frame[f], frame[g]) != 1:
                continue
            if sense[f] * sense[g] * _dot(frame[f], frame[g]) < 0.0:
                if step > 0.0 and high[n] < step + more:  # too narrow for a way out of both
                    return -np.inf
            elif high[n] < high[m] or (high[n] == high[m] and n < m):
                step = 0.0  # the step out of that one is out of this one as well
        square += step * step
    return -math.sqrt(square) * (1.0 + 4.0 * _EXACT)


@formula
def _highest(count, solid, chosen, raised):
    """The highest of the heights over the first faces chosen, kept behind what these are raised by, or hollow corners.

    Behind that is a ball's radius for each, 0 for a face that goes with the one before it.
    """
    _, _, _, _, _, _, _, _, _, kind, _, frame, sense, _, _, _, _, _, _ = solid
    heights, clear, high, first = raised[CAPACITY : 2 * CAPACITY], raised[2 * CAPACITY :], -np.inf, 0
    for last in range(1, count + 1):
        if last == count or clear[last] > 0.0:
            h = heights[first]
            if last > first + 1:
                h = above_all(heights, first, last, chosen, kind, frame, sense)
            high, first = max(high, h), last
    return high


@formula
def piece_over(V, uv, g, rim, own, solid, count, scratch):
    """Lower bound, as `least_height`, of the highest that a piece of face g is over any of the first faces chosen."""
    akind, asize, aframe, _ = own
    _, _, _, _, _, _, _, _, _, kind, size, frame, sense, _, _, _, _, _, _ = solid
    _, chosen, raised, _, _, whole = scratch
    du, v0, v1, _, _ = spans(uv)
    for m in range(count):
        f = chosen[m]
        to_frame(frame[f], V, whole[0])
        a, up = raise_by(kind[f], size[f, 0], size[f, 1], sense[f], raised[m])
        e = bend_over(
            akind[g], asize[g, 0], asize[g, 1], aframe[g], du, v1 - v0, v0, v1, kind[f], frame[f]
        )  # fmt: skip
        h = least_height(kind[f], a, size[f, 1], sense[f], whole[0]) - e - rim
        if akind[g] != PLANE and akind[g] != OTHER:
            band = akind[g], asize[g, 0], asize[g, 1], aframe[g], v0, v1
            h = max(h, band_over(*band, kind[f], a, size[f, 1], frame[f], sense[f]) - rim)
        raised[CAPACITY + m] = h - up
    return _highest(count, solid, chosen, raised)


@formula
def point_over(point, solid, count, chosen, raised):
    """How high a point (3) is over the highest of the first faces chosen, as they are raised."""
    _, _, _, _, _, _, _, _, _, kind, size, frame, sense, _, _, _, _, _, _ = solid
    for m in range(count):
        f = chosen[m]
        h = sense[f] * height_at(kind[f], size[f, 0], size[f, 1], frame[f], point[0], point[1], point[2])
        raised[CAPACITY + m] = h - raised[m]
    return _highest(count, solid, chosen, raised)


@formula
def hollow(solid, chosen, first, rows, slack, point, least, x, y, z, rho, raised, high, whole, stack):
    """How many faces, of which the first is chosen, have in a ball about x, y, z the solid below at least one of them.

    0 if none are found. They go into ``chosen`` from ``first`` on, how far they are raised into ``raised``. ``rows`` is
    0 for these by the faces' slack, or the number of faces for rounding alone. Returns also the ball's radius: ``rho``
    and more, for the way out of a ``point`` (3), and so that the ball holds what is within ``rho`` of its middle's foot
    on what is above all. Not wanted if the point is not above all by more than ``least``.
    """
    _, _, face, _, _, _, _, _, _, kind, size, frame, sense, deviation, _, _, _, _, _ = solid
    count = first + 1
    while True:
        t = 0.0
        for m in range(first, count):
            f = chosen[m]
            raised[m] = slack[rows + f] + deviation[f]
            t = max(t, raised[m])
            high[m] = sense[f] * height_at(kind[f], size[f, 0], size[f, 1], frame[f], x, y, z) - raised[m]
        middle = above_all(high, first, count, chosen, kind, frame, sense)
        for m in range(first, count):
            f = chosen[m]
            h = height_at(kind[f], size[f, 0], size[f, 1], frame[f], point[0], point[1], point[2])
            high[m] = sense[f] * h - raised[m]
        way = above_all(high, first, count, chosen, kind, frame, sense)
        if way <= least or middle == -np.inf:
            return 0, 0.0
        # First what is near the point, which tells which corner it is in; then what else is in the ball.
        limit = max(1.1 * rho + 2.0 * max(0.0, -way) + 4.0 * t, rho + max(0.0, -middle) + t)
        corner = chosen[first:count]
        _, found = nearest_marked(
            solid, corner, rows, 0, 1, -1.0, slack, point[0], point[1], point[2], rho + limit, whole, stack
        )  # fmt: skip
        if found < 0 or not goes_with(kind, frame, sense, chosen, first, count, face[found]):
            clear, found = nearest_marked(solid, corner, rows, 0, 1, -1.0, slack, x, y, z, limit, whole, stack)
            if found < 0:
                break
        if not goes_with(kind, frame, sense, chosen, first, count, face[found]):
            return 0, 0.0
        chosen[count] = face[found]
        count += 1
    for m in range(first, count):
        f = chosen[m]
        if is_open(solid, f, raised[m], chosen[first:count], raised[first:count], clear, x, y, z, whole[1, 0], stack):
            return count - first, clear
    return 0, 0.0
