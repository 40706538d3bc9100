"""Compiled passes over many poses: boxes, poses between bodies, what attests the groove kernel's answers, verdicts."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from clamp3d.core.jit import entry, formula, inlined, prefetch
from clamp3d.core.kernel_distance import nearest
from clamp3d.core.kernel_flat import flat_nearest
from clamp3d.core.kernel_pose import rigid

_AHEAD = 32
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


def _boxes(T, middle, half, far, out):
    """Centre and half sizes (6, n) along the world's axes of a box at poses; the first that is not rigid, or -1.

    Nor may one lie further than ``far`` off.
    """
    for k in range(T.shape[0]):
        prefetch(T, 128 * (k + _AHEAD))
        prefetch(T, 128 * (k + _AHEAD) + 64)
        if not rigid(T, k):
            return k
        x, y, z = there(T, k, middle[0], middle[1], middle[2])
        for i in range(3):
            if not abs(T[k, i, 3]) <= far:
                return k
            out[3 + i, k] = abs(T[k, i, 0]) * half[0] + abs(T[k, i, 1]) * half[1] + abs(T[k, i, 2]) * half[2]
        out[0, k], out[1, k], out[2, k] = x, y, z
    return -1


def _meet(moving, below, above, others, row, column):
    """Pairs of boxes that meet: poses with centre and half sizes (6, n), and ``others`` from ``below`` to ``above``.

    The pairs go to ``row`` and ``column``, by pose; returns their number.
    """
    count = 0
    for k in range(moving.shape[1]):
        for i in range(others.shape[0]):
            j = others[i]
            meets = True
            for axis in range(3):
                low, high = moving[axis, k] - moving[3 + axis, k], moving[axis, k] + moving[3 + axis, k]
                meets = meets and low <= above[j, axis] and high >= below[j, axis]
            row[count], column[count] = k, j
            count += 1 if meets else 0
    return count


def _between(A, column, T, row, out):
    """Poses (m, 4, 4) of those ``row`` of ``T`` as seen from those ``column`` of ``A``."""
    for k in range(row.shape[0]):
        ahead = 128 * row[min(k + _AHEAD, row.shape[0] - 1)]
        prefetch(T, ahead)
        prefetch(T, ahead + 64)
        a, b = column[k], row[k]
        x, y, z = back(A, a, T[b, 0, 3], T[b, 1, 3], T[b, 2, 3])
        for i in range(3):
            for j in range(3):
                out[k, i, j] = A[a, 0, i] * T[b, 0, j] + A[a, 1, i] * T[b, 1, j] + A[a, 2, i] * T[b, 2, j]
            out[k, 3, i] = 0.0
        out[k, 0, 3], out[k, 1, 3], out[k, 2, 3], out[k, 3, 3] = x, y, z, 1.0
    return 0


@formula
def depth(planes, rounds, places, x, y, z):
    """How deep a point lies in a body, as `ClosedForm.depth` has it.

    ``planes`` (k, 4); ``rounds`` (m, 2): radius and half length of cylinders on z of ``places`` (m, 4, 4), hollow ones
    with a negative half length.
    """
    found = math.inf
    for k in range(planes.shape[0]):
        found = min(found, -(planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z + planes[k, 3]))
    for k in range(rounds.shape[0]):
        u, v, w = back(places, k, x, y, z)
        out = math.sqrt(u * u + v * v) - rounds[k, 0]
        if rounds[k, 1] >= 0.0:
            out = min(-out, rounds[k, 1] - abs(w))
        found = min(found, out)
    return found


@formula
def axis_in(P, c, T, k, rod):
    """Place and axis, in the frame of P[c], of a cylinder that stands at rod[0] of a body at T[k]."""
    x, y, z = there(T, k, rod[0, 0, 3], rod[0, 1, 3], rod[0, 2, 3])
    x, y, z = back(P, c, x, y, z)
    dx, dy, dz = rod[0, 0, 2], rod[0, 1, 2], rod[0, 2, 2]
    u = T[k, 0, 0] * dx + T[k, 0, 1] * dy + T[k, 0, 2] * dz
    v = T[k, 1, 0] * dx + T[k, 1, 1] * dy + T[k, 1, 2] * dz
    w = T[k, 2, 0] * dx + T[k, 2, 1] * dy + T[k, 2, 2] * dz
    return (
        x,
        y,
        z,
        P[c, 0, 0] * u + P[c, 1, 0] * v + P[c, 2, 0] * w,
        P[c, 0, 1] * u + P[c, 1, 1] * v + P[c, 2, 1] * w,
        P[c, 0, 2] * u + P[c, 1, 2] * v + P[c, 2, 2] * w,
    )


def _bore_rod(grooves, P, r, l, rod, T, planes, rounds, places, planes_b, rounds_b, places_b, member, known, pad, out):  # noqa: E741
    """Bounds, points on both bodies and normal (m, 11) of a bore and a rod, as `body.bore_rod` has them.

    ``grooves`` (c, 5) at ``P`` hold the body: radius, half angle, half length, and s and h, which are
    worked out. ``upper`` is finite where the points lie on the bodies; what they are measured to lie outside is added.
    """
    for c in range(P.shape[0]):
        grooves[c, 3], grooves[c, 4] = grooves[c, 0] * math.sin(grooves[c, 1]), -grooves[c, 0] * math.cos(grooves[c, 1])
    for k in range(T.shape[0]):
        d = math.inf
        e = px = py = pz = nx = ny = nz = 0.0
        for c in range(P.shape[0]):
            R, angle, H, s, h = grooves[c, 0], grooves[c, 1], grooves[c, 2], grooves[c, 3], grooves[c, 4]
            x, y, z, dx, dy, dz = axis_in(P, c, T, k, rod)
            new = flat_nearest(R, angle, s, h, H, r, l, x, y, z, dx, dy, dz, pad)
            if new[0] < d:
                d, e = new[0], new[9]
                px, py, pz = there(P, c, new[1], new[2], new[3])
                nx = P[c, 0, 0] * new[4] + P[c, 0, 1] * new[5] + P[c, 0, 2] * new[6]
                ny = P[c, 1, 0] * new[4] + P[c, 1, 1] * new[5] + P[c, 1, 2] * new[6]
                nz = P[c, 2, 0] * new[4] + P[c, 2, 1] * new[5] + P[c, 2, 2] * new[6]
        qx, qy, qz = px + d * nx, py + d * ny, pz + d * nz
        size = max(abs(px), abs(py), abs(pz), abs(qx), abs(qy), abs(qz))
        slack = member * (1.0 + size)
        lower = d - e if d > e else -0.5 * known
        upper = math.inf
        if d >= -e:
            x, y, z = back(T, k, qx, qy, qz)
            outside = min(depth(planes, rounds, places, px, py, pz), depth(planes_b, rounds_b, places_b, x, y, z))
            if outside >= -slack:
                upper = d + e + max(0.0, -4.0 * outside)
        else:
            for i in range(3):  # a point in both has the depth that it has in either
                u = 0.5 * i
                ax, ay, az = px + u * (qx - px), py + u * (qy - py), pz + u * (qz - pz)
                x, y, z = back(T, k, ax, ay, az)
                own, other = depth(planes, rounds, places, ax, ay, az), depth(planes_b, rounds_b, places_b, x, y, z)
                outside = min(own, other)
                if outside >= -slack:
                    upper = min(upper, min(0.0, 4.0 * max(0.0, -outside) - max(own, other)))
            lower = math.inf
            for c in range(P.shape[0]):  # by the capsule that holds the rod
                R, H, s, h = grooves[c, 0], grooves[c, 2], grooves[c, 3], grooves[c, 4]
                x, y, z, dx, dy, dz = axis_in(P, c, T, k, rod)
                round_ = nearest(R, s, h, H, r, l, x, y, z, dx, dy, dz)
                lower = min(lower, round_[0] - round_[9])
                if P.shape[0] > 1 and round_[0] <= round_[9] - r:
                    lower = -math.inf
        out[k, 0], out[k, 1] = lower, upper
        out[k, 2], out[k, 3], out[k, 4] = px, py, pz
        out[k, 5], out[k, 6], out[k, 7] = qx, qy, qz
        out[k, 8], out[k, 9], out[k, 10] = nx, ny, nz
    return 0


def _stand_out(T, points, planes, rounds, places, slack, out):
    """Into out (n,): whether one of the points (k, 3), with ``T``, is out of a body by more than ``slack``."""
    for k in range(T.shape[0]):
        out[k] = 0
        for i in range(points.shape[0]):
            x, y, z = there(T, k, points[i, 0], points[i, 1], points[i, 2])
            if depth(planes, rounds, places, x, y, z) < -slack:
                out[k] = 1
                break
    return 0


def _cells(lower, upper, width, marks, out):
    """How each pair of bounds, and its middle where they are closer than ``width``, lies among sorted ``marks``."""
    for k in range(lower.shape[0]):
        middle = math.nan
        if upper[k] - lower[k] <= width:
            middle = 0.5 * (lower[k] + upper[k])
        cell = 0
        for i in range(3):
            value = lower[k] if i == 0 else (upper[k] if i == 1 else middle)
            place = 0
            for j in range(marks.shape[0]):  # a bound that equals a mark lies alike with its equals alone
                place += (1 if value > marks[j] else 0) + (1 if value >= marks[j] else 0)
            if value != value:
                place = 2 * marks.shape[0] + 1
            cell = (2 * marks.shape[0] + 2) * cell + place
        out[k] = cell
    return 0


_POSES, _ROWS, _TABLE = "f8[:,:,::1]", "i8[::1]", "f8[:,::1]"
_BODY = f"{_TABLE},{_TABLE},{_POSES}"
boxes = entry(_boxes, f"i8({_POSES},f8[::1],f8[::1],f8,{_TABLE})")
meet = entry(_meet, f"i8({_TABLE},{_TABLE},{_TABLE},{_ROWS},{_ROWS},{_ROWS})")
between = entry(_between, f"i8({_POSES},{_ROWS},{_POSES},{_ROWS},{_POSES})")
bore_rod = entry(_bore_rod, f"i8({_TABLE},{_POSES},f8,f8,{_POSES},{_POSES},{_BODY},{_BODY},f8,f8,{_TABLE},{_TABLE})")
stand_out = entry(_stand_out, f"i8({_POSES},{_TABLE},{_BODY},f8,{_ROWS})")
cells = entry(_cells, "i8(f8[::1],f8[::1],f8,f8[::1],i8[::1])")
