"""Compiled passes over many poses: boxes, poses between bodies, depths of points, verdicts."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from clamp3d.core.jit import entry, inlined, prefetch
from clamp3d.core.kernel_pose import rigid

AHEAD = 32
"""Poses between the one that is looked at and the one that is fetched."""


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


def _boxes(T, sizes, which, far, out):
    """Centre and half sizes (6, n) along the world's axes of boxes at poses; the first that is not rigid, or -1.

    ``sizes`` (m, 6): centre and half sizes in the bodies' own frames; ``which`` (n,) or (1,): those of each pose, or of
    all. No pose may lie further than ``far`` off; if that is infinite all poses are taken as they are.
    """
    for k in range(T.shape[0]):
        prefetch(T, 128 * (k + AHEAD))
        prefetch(T, 128 * (k + AHEAD) + 64)
        if far < math.inf and not (
            rigid(T, k) and abs(T[k, 0, 3]) <= far and abs(T[k, 1, 3]) <= far and abs(T[k, 2, 3]) <= far
        ):
            return k
        j = which[min(k, which.shape[0] - 1)]
        x, y, z = there(T, k, sizes[j, 0], sizes[j, 1], sizes[j, 2])
        for i in range(3):
            out[3 + i, k] = (
                abs(T[k, i, 0]) * sizes[j, 3] + abs(T[k, i, 1]) * sizes[j, 4] + abs(T[k, i, 2]) * sizes[j, 5]
            )
        out[0, k], out[1, k], out[2, k] = x, y, z
    return -1


def _around(moving, start, stop, below, above, others):
    """Into ``others`` the boxes from ``below`` to ``above`` (3, m) that come near poses ``start`` to ``stop``.

    ``moving`` (6, n): centre and half sizes of their boxes. Returns the number.
    """
    low_x = low_y = low_z = math.inf
    high_x = high_y = high_z = -math.inf
    for k in range(start, stop):
        low_x, high_x = min(low_x, moving[0, k] - moving[3, k]), max(high_x, moving[0, k] + moving[3, k])
        low_y, high_y = min(low_y, moving[1, k] - moving[4, k]), max(high_y, moving[1, k] + moving[4, k])
        low_z, high_z = min(low_z, moving[2, k] - moving[5, k]), max(high_z, moving[2, k] + moving[5, k])
    count = 0
    for j in range(below.shape[1]):
        meets = below[0, j] <= high_x and above[0, j] >= low_x
        meets = meets and below[1, j] <= high_y and above[1, j] >= low_y
        others[count] = j
        count += 1 if meets and below[2, j] <= high_z and above[2, j] >= low_z else 0
    return count


def _meet(moving, start, stop, below, above, others, row, column, count):
    """Pairs of boxes that meet: poses ``start`` to ``stop``, and ``others`` from ``below`` to ``above``.

    The pairs go to ``row`` and ``column`` from ``count`` on, by pose; returns where they end.
    """
    for k in range(start, stop):
        for i in range(others.shape[0]):
            j = others[i]
            meets = True
            for axis in range(3):
                low, high = moving[axis, k] - moving[3 + axis, k], moving[axis, k] + moving[3 + axis, k]
                meets = meets and low <= above[axis, j] and high >= below[axis, j]
            row[count], column[count] = k, j
            count += 1 if meets else 0
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
def depth_behind(planes, k, x, y, z):
    """How deep a point lies behind one of ``planes`` (k, 4)."""
    return -(planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z + planes[k, 3])


@inlined
def depth_in_round(rounds, places, k, x, y, z):
    """How deep a point lies in one of ``rounds`` (m, 2): radius and half length of cylinders on z of ``places``.

    Hollow ones have a negative half length.
    """
    u, v, w = back(places, k, x, y, z)
    out = math.sqrt(u * u + v * v) - rounds[k, 0]
    return min(-out, rounds[k, 1] - abs(w)) if rounds[k, 1] >= 0.0 else out


def _stand_out(T, points, planes, rounds, places, slack, out):
    """Into out (n,): whether one of the points (k, 3), with ``T``, is out of a body by more than ``slack``."""
    for k in range(T.shape[0]):
        out[k] = 0
        for i in range(points.shape[0]):
            x, y, z = there(T, k, points[i, 0], points[i, 1], points[i, 2])
            least = math.inf
            for j in range(planes.shape[0]):
                least = min(least, depth_behind(planes, j, x, y, z))
            for j in range(rounds.shape[0]):
                least = min(least, depth_in_round(rounds, places, j, x, y, z))
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
around = entry(_around, f"i8({_TABLE},i8,i8,{_TABLE},{_TABLE},{_ROWS})")
meet = entry(_meet, f"i8({_TABLE},i8,i8,{_TABLE},{_TABLE},{_ROWS},{_ROWS},{_ROWS},i8)")
between = entry(_between, f"i8({_POSES},{_ROWS},{_POSES},{_ROWS},{_POSES})")
stand_out = entry(_stand_out, f"i8({_POSES},{_TABLE},{_BODY},f8,{_ROWS})")
cells = entry(_cells, f"i8(f8[::1],f8[::1],f8,f8[::1],{_ROWS},{_ROWS})")
