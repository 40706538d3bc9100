"""Compiled bounds of bores and rods at many poses: the groove kernel's answers, and what attests them.

As in `kernel_batch` a block of poses goes through one step after the other, each a short loop over numbers that lie
side by side. What the steps cannot tell for certain the single call's formula does.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from clamp3d.collide.poses_kernel import depth_behind, depth_in_round, frame, relative, turned_back
from clamp3d.core.jit import entry, inlined
from clamp3d.core.kernel_batch import (
    AT_ONCE,
    BOUND,
    CX,
    DX,
    NX,
    PARALLEL,
    QX,
    ROWS,
    SURE,
    VALUE,
    outside_soon,
    yes,
)
from clamp3d.core.kernel_distance import is_parallel, nearest
from clamp3d.core.kernel_flat import flat_nearest

WORK = (ROWS + 28) * AT_ONCE
"""Numbers that `bore_rod` works in."""
FIRST, SECOND, THIRD, PLACE, ON_A, NORMAL, ON_B, SEEN, GAP, ERROR, IN_A, IN_B = (
    (ROWS + k) * AT_ONCE for k in (*range(0, 24, 3), 24, 25, 26, 27)
)
LOWER, UPPER, WHICH = GAP, ERROR, NORMAL
"""Of a pose of the block: the rows of the second body's rotation in the first body's frame, and its place there; point
of the groove, normal and point of the rod; any point; distance and its error; how deep both bodies have a point. Of an
overlap its bounds take the place of distance and error, and its number in the block that of the normal."""


@inlined
def put(w, at, i, x, y, z):
    """Three numbers of pose i into the rows from ``at`` on."""
    w[at + i], w[at + AT_ONCE + i], w[at + 2 * AT_ONCE + i] = x, y, z


@inlined
def get(w, at, i):
    """Three numbers of pose i from the rows from ``at`` on."""
    return w[at + i], w[at + AT_ONCE + i], w[at + 2 * AT_ONCE + i]


@inlined
def out_of(w, i, x, y, z):
    """A vector of the second body in the frame of the first."""
    a, b, c = get(w, FIRST, i)
    d, e, f = get(w, SECOND, i)
    g, h, k = get(w, THIRD, i)
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + k * z


@inlined
def axis_in(w, i, at, rod):
    """Place and axis, in the frame ``at`` of the first body, of a cylinder that stands at ``rod`` of the second."""
    (_, _, u), (_, _, v), (_, _, t), (x, y, z) = rod
    x, y, z = out_of(w, i, x, y, z)
    tx, ty, tz = get(w, PLACE, i)
    ox, oy, oz = at[3]
    x, y, z = turned_back(at, x + tx - ox, y + ty - oy, z + tz - oz)
    u, v, t = out_of(w, i, u, v, t)
    u, v, t = turned_back(at, u, v, t)
    return x, y, z, u, v, t


@inlined
def poses(w, count, start, A, column, T, row):
    """The poses of a block, and no distance yet."""
    for i in range(count):
        k = start + i
        a, b, c, d, e, f, g, h, m, x, y, z = relative(A, column[k], T, row[k])
        put(w, FIRST, i, a, b, c)
        put(w, SECOND, i, d, e, f)
        put(w, THIRD, i, g, h, m)
        put(w, PLACE, i, x, y, z)
    for i in range(count):
        w[GAP + i] = math.inf
        w[ERROR + i] = 0.0
        put(w, ON_A, i, 0.0, 0.0, 0.0)
        put(w, NORMAL, i, 0.0, 0.0, 0.0)


@inlined
def kernel_answers(w, count, groove, at, r, l, rod, pad):  # noqa: E741
    """The answers of `flat_nearest` for the groove ``groove`` (5,) at ``at``: to the bit, or its own."""
    R, angle, H, s, h = groove
    for i in range(count):
        x, y, z, dx, dy, dz = axis_in(w, i, at, rod)
        w[PARALLEL + i] = yes(is_parallel(R, max(l, r), dx, dy))
        put(w, CX, i, x, y, z)
        put(w, DX, i, dx, dy, dz)
    outside_soon(w, count, R, s, h, H, r, l, True, True)
    for i in range(count):
        if not w[SURE + i] > 0.0 or w[PARALLEL + i] > 0.0:
            x, y, z, dx, dy, dz = axis_in(w, i, at, rod)
            new = flat_nearest(R, angle, s, h, H, r, l, x, y, z, dx, dy, dz, pad)
            w[VALUE + i], w[BOUND + i] = new[0], new[9]
            put(w, QX, i, new[1], new[2], new[3])
            put(w, NX, i, new[4], new[5], new[6])


@inlined
def keep_nearer(w, count, at):
    """Of the grooves so far the nearest one, its point and normal in the first body's frame."""
    (a, b, c), (d, e, f), (g, h, k), (tx, ty, tz) = at
    for i in range(count):
        less = w[VALUE + i] < w[GAP + i]
        x, y, z = get(w, QX, i)
        px, py, pz = get(w, ON_A, i)
        qx, qy, qz = a * x + b * y + c * z + tx, d * x + e * y + f * z + ty, g * x + h * y + k * z + tz
        put(w, ON_A, i, qx if less else px, qy if less else py, qz if less else pz)
    for i in range(count):
        less = w[VALUE + i] < w[GAP + i]
        x, y, z = get(w, NX, i)
        px, py, pz = get(w, NORMAL, i)
        nx, ny, nz = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + k * z
        put(w, NORMAL, i, nx if less else px, ny if less else py, nz if less else pz)
        w[ERROR + i] = w[BOUND + i] if less else w[ERROR + i]
        w[GAP + i] = w[VALUE + i] if less else w[GAP + i]


@inlined
def depths(w, count, at, found, planes, rounds, places):
    """How deep the points in the rows from ``at`` on lie in a body, as `ClosedForm.depth` has it, into ``found``."""
    for i in range(count):
        w[found + i] = math.inf
    for k in range(planes.shape[0]):
        plane = planes[k, 0], planes[k, 1], planes[k, 2], planes[k, 3]
        for i in range(count):
            x, y, z = get(w, at, i)
            w[found + i] = min(w[found + i], depth_behind(plane, x, y, z))
    for k in range(rounds.shape[0]):
        round_ = rounds[k, 0], rounds[k, 1]
        place = frame(places, k)
        for i in range(count):
            x, y, z = get(w, at, i)
            w[found + i] = min(w[found + i], depth_in_round(round_, place, x, y, z))


@inlined
def on_the_way(w, count, part):
    """The points this part of the way from the groove's point to the rod's."""
    for i in range(count):
        px, py, pz = get(w, ON_A, i)
        qx, qy, qz = get(w, ON_B, i)
        put(w, SEEN, i, px + part * (qx - px), py + part * (qy - py), pz + part * (qz - pz))


@inlined
def from_second(w, count):
    """The points in the frame of the second body."""
    for i in range(count):
        x, y, z = get(w, SEEN, i)
        tx, ty, tz = get(w, PLACE, i)
        x, y, z = x - tx, y - ty, z - tz
        a, b, c = get(w, FIRST, i)
        d, e, f = get(w, SECOND, i)
        g, h, k = get(w, THIRD, i)
        put(w, SEEN, i, a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + k * z)


@inlined
def slack(w, i, member):
    """How far out of a body its points may be measured."""
    px, py, pz = get(w, ON_A, i)
    qx, qy, qz = get(w, ON_B, i)
    return member * (1.0 + max(abs(px), abs(py), abs(pz), abs(qx), abs(qy), abs(qz)))


@inlined
def overlaps(w, count):
    """Takes the poses that overlap to the front of the block, with what is still asked of them; their number."""
    deep = 0
    for i in range(count):
        if not w[GAP + i] >= -w[ERROR + i]:
            for k in (FIRST, SECOND, THIRD, PLACE, ON_A, ON_B):
                put(w, k, deep, *get(w, k, i))
            w[WHICH + deep] = i
            deep += 1
    return deep


def _bore_rod(
    grooves, P, r, l, rod, A, column, T, row, planes, rounds, places, planes_b, rounds_b, places_b, member, known,  # noqa: E741
    clash, w, pad, out,
):  # fmt: skip
    """Bounds, and with 11 rows points on both bodies and normal (2 or 11, m) of a bore and a rod, as `body.bore_rod`.

    The bore's body stands at those ``column`` (m,) of ``A``, the rod's at those ``row`` (m,) of ``T``; points and
    normals are in the first one's frame. ``grooves`` (c, 5) at ``P`` hold that body: radius, half angle, half length,
    and s and h, which are worked out. ``upper`` is finite where the points lie on the bodies; what they are measured to
    lie outside is added. Of what overlaps by more than ``-clash`` no lower bound is looked for. ``w`` (WORK,) and
    ``pad`` (128, 5) are what it works in.
    """
    on_rod = frame(rod, 0)
    for c in range(P.shape[0]):
        grooves[c, 3], grooves[c, 4] = grooves[c, 0] * math.sin(grooves[c, 1]), -grooves[c, 0] * math.cos(grooves[c, 1])
    for start in range(0, row.shape[0], AT_ONCE):
        count = min(AT_ONCE, row.shape[0] - start)
        poses(w, count, start, A, column, T, row)
        for c in range(P.shape[0]):
            groove = grooves[c, 0], grooves[c, 1], grooves[c, 2], grooves[c, 3], grooves[c, 4]
            at = frame(P, c)
            kernel_answers(w, count, groove, at, r, l, on_rod, pad)
            keep_nearer(w, count, at)
        for i in range(count):
            px, py, pz = get(w, ON_A, i)
            nx, ny, nz = get(w, NORMAL, i)
            d = w[GAP + i]
            put(w, ON_B, i, px + d * nx, py + d * ny, pz + d * nz)
        depths(w, count, ON_A, IN_A, planes, rounds, places)
        on_the_way(w, count, 1.0)
        from_second(w, count)
        depths(w, count, SEEN, IN_B, planes_b, rounds_b, places_b)
        for i in range(count):
            d, e = w[GAP + i], w[ERROR + i]
            outside = min(w[IN_A + i], w[IN_B + i])
            out[0, start + i] = d - e if d > e else -0.5 * known
            out[1, start + i] = d + e + max(0.0, -4.0 * outside) if outside >= -slack(w, i, member) else math.inf
        for j in range(3 if out.shape[0] > 2 else 0):
            for i in range(count):
                out[2 + j, start + i] = w[ON_A + j * AT_ONCE + i]
                out[5 + j, start + i] = w[ON_B + j * AT_ONCE + i]
                out[8 + j, start + i] = w[NORMAL + j * AT_ONCE + i]
        deep = overlaps(w, count)
        for i in range(deep):
            w[LOWER + i] = w[UPPER + i] = math.inf
        for part in range(3 if deep > 0 else 0):
            on_the_way(w, deep, 0.5 * part)
            depths(w, deep, SEEN, IN_A, planes, rounds, places)
            from_second(w, deep)
            depths(w, deep, SEEN, IN_B, planes_b, rounds_b, places_b)
            for i in range(deep):  # a point in both has the depth that it has in either
                outside, most = min(w[IN_A + i], w[IN_B + i]), max(w[IN_A + i], w[IN_B + i])
                if outside >= -slack(w, i, member):
                    w[UPPER + i] = min(w[UPPER + i], min(0.0, 4.0 * max(0.0, -outside) - most))
        for i in range(deep):
            for c in range(P.shape[0] if w[UPPER + i] >= clash else 0):  # by the capsule that holds the rod
                R, H, s, h = grooves[c, 0], grooves[c, 2], grooves[c, 3], grooves[c, 4]
                x, y, z, dx, dy, dz = axis_in(w, i, frame(P, c), on_rod)
                round_ = nearest(R, s, h, H, r, l, x, y, z, dx, dy, dz)
                w[LOWER + i] = min(w[LOWER + i], round_[0] - round_[9])
                if P.shape[0] > 1 and round_[0] <= round_[9] - r:
                    w[LOWER + i] = -math.inf
            k = start + int(w[WHICH + i])
            out[0, k], out[1, k] = w[LOWER + i] if w[UPPER + i] >= clash else -math.inf, w[UPPER + i]
    return 0


_POSES, _ROWS, _TABLE = "f8[:,:,::1]", "i8[::1]", "f8[:,::1]"
_BODY = f"{_TABLE},{_TABLE},{_POSES}"
_PLACED = f"{_POSES},{_ROWS},{_POSES},{_ROWS}"
bore_rod = entry(
    _bore_rod, f"i8({_TABLE},{_POSES},f8,f8,{_POSES},{_PLACED},{_BODY},{_BODY},f8,f8,f8,f8[::1],{_TABLE},{_TABLE})"
)
