"""Compiled passes over many poses: boxes, poses between bodies, depths of points, verdicts."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from clamp3d.core.jit import entry, inlined
from clamp3d.core.kernel_pose import rigid


@inlined
def there(T, k, x, y, z):
    """The point (x, y, z) by the pose k of ``T`` (n, 4, 4)."""
    return (
        T[k, 0, 0] * x + T[k, 0, 1] * y + T[k, 0, 2] * z + T[k, 0, 3],
        T[k, 1, 0] * x + T[k, 1, 1] * y + T[k, 1, 2] * z + T[k, 1, 3],
        T[k, 2, 0] * x + T[k, 2, 1] * y + T[k, 2, 2] * z + T[k, 2, 3],
    )


@inlined
def back(T, k, x, y, z):
    """The point (x, y, z) by the inverse of pose k."""
    x, y, z = x - T[k, 0, 3], y - T[k, 1, 3], z - T[k, 2, 3]
    return (
        T[k, 0, 0] * x + T[k, 1, 0] * y + T[k, 2, 0] * z,
        T[k, 0, 1] * x + T[k, 1, 1] * y + T[k, 2, 1] * z,
        T[k, 0, 2] * x + T[k, 1, 2] * y + T[k, 2, 2] * z,
    )


@inlined
def frame(P, c):
    """Rotation, by rows, and place of P[c]: read once, for a loop that stores numbers does not know that they last."""
    return (
        (P[c, 0, 0], P[c, 0, 1], P[c, 0, 2]),
        (P[c, 1, 0], P[c, 1, 1], P[c, 1, 2]),
        (P[c, 2, 0], P[c, 2, 1], P[c, 2, 2]),
        (P[c, 0, 3], P[c, 1, 3], P[c, 2, 3]),
    )


@inlined
def turned_back(at, x, y, z):
    """A vector as seen from the frame ``at``."""
    (a, b, c), (d, e, f), (g, h, k), _ = at
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + k * z


def _boxes(T, sizes, which, far, out):
    """Lower and upper corners (6, n) along the world's axes of boxes at poses; the first that is not rigid, or -1.

    ``sizes`` (m, 6): centre and half sizes in the bodies' own frames; ``which`` (n,) or (1,): those of each pose, or of
    all. No pose may lie further than ``far`` off; if that is infinite all poses are taken as they are.
    """
    for k in range(T.shape[0]):
        if far < math.inf and not (
            rigid(T, k) and abs(T[k, 0, 3]) <= far and abs(T[k, 1, 3]) <= far and abs(T[k, 2, 3]) <= far
        ):
            return k
        j = which[min(k, which.shape[0] - 1)]
        centre = there(T, k, sizes[j, 0], sizes[j, 1], sizes[j, 2])
        for i in range(3):
            half = abs(T[k, i, 0]) * sizes[j, 3] + abs(T[k, i, 1]) * sizes[j, 4] + abs(T[k, i, 2]) * sizes[j, 5]
            out[i, k], out[3 + i, k] = centre[i] - half, centre[i] + half
    return -1


def _around(moving, n, below, above, others):
    """Into ``others`` the boxes from ``below`` to ``above`` (3, m) that come near any of the first n ``moving`` (6, n).

    Returns their number.
    """
    low_x = low_y = low_z = math.inf
    high_x = high_y = high_z = -math.inf
    for k in range(n):
        low_x, low_y, low_z = min(low_x, moving[0, k]), min(low_y, moving[1, k]), min(low_z, moving[2, k])
        high_x, high_y, high_z = max(high_x, moving[3, k]), max(high_y, moving[4, k]), max(high_z, moving[5, k])
    count = 0
    for j in range(below.shape[1]):
        meets = below[0, j] <= high_x and above[0, j] >= low_x
        meets = meets and below[1, j] <= high_y and above[1, j] >= low_y
        others[count] = j
        count += 1 if meets and below[2, j] <= high_z and above[2, j] >= low_z else 0
    return count


def _meet(moving, n, below, above, others, start, row, column):
    """Pairs of boxes that meet: the first n ``moving`` (6, n), and ``others`` from ``below`` to ``above`` (3, m).

    They go to ``row``, which counts from ``start`` on, and ``column``, by pose; returns their number.
    """
    count = 0
    for k in range(n):
        for i in range(others.shape[0]):
            j = others[i]
            meets = moving[0, k] <= above[0, j] and moving[3, k] >= below[0, j]
            meets = meets and moving[1, k] <= above[1, j] and moving[4, k] >= below[1, j]
            row[count], column[count] = start + k, j
            count += 1 if meets and moving[2, k] <= above[2, j] and moving[5, k] >= below[2, j] else 0
    return count


@inlined
def relative(A, a, T, b):
    """Rotation, by rows, and place of pose b of ``T`` as seen from pose a of ``A``."""
    x, y, z = back(A, a, T[b, 0, 3], T[b, 1, 3], T[b, 2, 3])
    return (
        A[a, 0, 0] * T[b, 0, 0] + A[a, 1, 0] * T[b, 1, 0] + A[a, 2, 0] * T[b, 2, 0],
        A[a, 0, 0] * T[b, 0, 1] + A[a, 1, 0] * T[b, 1, 1] + A[a, 2, 0] * T[b, 2, 1],
        A[a, 0, 0] * T[b, 0, 2] + A[a, 1, 0] * T[b, 1, 2] + A[a, 2, 0] * T[b, 2, 2],
        A[a, 0, 1] * T[b, 0, 0] + A[a, 1, 1] * T[b, 1, 0] + A[a, 2, 1] * T[b, 2, 0],
        A[a, 0, 1] * T[b, 0, 1] + A[a, 1, 1] * T[b, 1, 1] + A[a, 2, 1] * T[b, 2, 1],
        A[a, 0, 1] * T[b, 0, 2] + A[a, 1, 1] * T[b, 1, 2] + A[a, 2, 1] * T[b, 2, 2],
        A[a, 0, 2] * T[b, 0, 0] + A[a, 1, 2] * T[b, 1, 0] + A[a, 2, 2] * T[b, 2, 0],
        A[a, 0, 2] * T[b, 0, 1] + A[a, 1, 2] * T[b, 1, 1] + A[a, 2, 2] * T[b, 2, 1],
        A[a, 0, 2] * T[b, 0, 2] + A[a, 1, 2] * T[b, 1, 2] + A[a, 2, 2] * T[b, 2, 2],
        x,
        y,
        z,
    )


def _between(A, column, T, row, out):
    """Poses (m, 4, 4) of those ``row`` of ``T`` as seen from those ``column`` of ``A``."""
    for k in range(row.shape[0]):
        found = relative(A, column[k], T, row[k])
        for i in range(3):
            for j in range(3):
                out[k, i, j] = found[3 * i + j]
            out[k, i, 3], out[k, 3, i] = found[9 + i], 0.0
        out[k, 3, 3] = 1.0
    return 0


@inlined
def depth_behind(plane, x, y, z):
    """How deep a point lies behind a plane (4,)."""
    a, b, c, d = plane
    return -(a * x + b * y + c * z + d)


@inlined
def depth_in_round(round_, place, x, y, z):
    """How deep a point lies in a cylinder on z of ``place``: radius and half length, which is negative for a hollow."""
    radius, half = round_
    ox, oy, oz = place[3]
    u, v, w = turned_back(place, x - ox, y - oy, z - oz)
    out = math.sqrt(u * u + v * v) - radius
    return min(-out, half - abs(w)) if half >= 0.0 else out


def _stand_out(T, points, planes, rounds, places, slack, out):
    """Into out (n,): whether one of the points (k, 3), with ``T``, is out of a body by more than ``slack``."""
    for k in range(T.shape[0]):
        out[k] = 0
        for i in range(points.shape[0]):
            x, y, z = there(T, k, points[i, 0], points[i, 1], points[i, 2])
            least = math.inf
            for j in range(planes.shape[0]):
                least = min(least, depth_behind((planes[j, 0], planes[j, 1], planes[j, 2], planes[j, 3]), x, y, z))
            for j in range(rounds.shape[0]):
                least = min(least, depth_in_round((rounds[j, 0], rounds[j, 1]), frame(places, j), x, y, z))
            if least < -slack:
                out[k] = 1
                break
    return 0


@inlined
def place_among(value, marks):
    """How a number lies among six: one that equals a mark lies alike with its equals alone, and a NaN for itself."""
    place = 0
    for j in range(6):
        place += (1 if value > marks[j] else 0) + (1 if value >= marks[j] else 0)
    return place if value == value else 13


def _cells(lower, upper, width, marks, one, out):
    """How each pair of bounds, and its middle where they are closer than ``width``, lies among six ``marks``.

    Into ``one`` (14 ** 3,) the place of one pair for each way that there is.
    """
    for k in range(lower.shape[0]):
        middle = 0.5 * (lower[k] + upper[k]) if upper[k] - lower[k] <= width else math.nan
        out[k] = (14 * place_among(lower[k], marks) + place_among(upper[k], marks)) * 14 + place_among(middle, marks)
    for k in range(lower.shape[0]):
        one[out[k]] = k
    return 0


_POSES, _ROWS, _TABLE = "f8[:,:,::1]", "i8[::1]", "f8[:,::1]"
_BODY = f"{_TABLE},{_TABLE},{_POSES}"
boxes = entry(_boxes, f"i8({_POSES},{_TABLE},{_ROWS},f8,{_TABLE})")
around = entry(_around, f"i8({_TABLE},i8,{_TABLE},{_TABLE},{_ROWS})")
meet = entry(_meet, f"i8({_TABLE},i8,{_TABLE},{_TABLE},{_ROWS},i8,{_ROWS},{_ROWS})")
between = entry(_between, f"i8({_POSES},{_ROWS},{_POSES},{_ROWS},{_POSES})")
stand_out = entry(_stand_out, f"i8({_POSES},{_TABLE},{_BODY},f8,{_ROWS})")
cells = entry(_cells, f"i8(f8[::1],f8[::1],f8,f8[::1],{_ROWS},{_ROWS})")
