"""The distances of many poses: a block at a time, one step for the whole block after the other.

A step is a short loop without branches over numbers that lie side by side, so the compiler takes several poses at once,
and the processor begins with the next ones before it is done with these. A step that no pose of a block needs is left
out. What the steps cannot tell for certain the single call's formula does.
"""

from __future__ import annotations

import math

from clamp3d.core.jit import inlined
from clamp3d.core.kernel_distance import across, beyond, enters, parallel, rounding, unit
from clamp3d.core.kernel_features import (
    ARC,
    corner,
    ellipse,
    end_arc_reach,
    end_arc_soon,
    end_edge,
    lip_line,
    section,
)
from clamp3d.core.kernel_flat import disc_gaps, is_beside

AT_ONCE = 128
"""Poses of a block."""

ROWS = 32
"""Numbers that are kept of a pose of the block, each kind side by side; yes is 1, no is 0."""
CX, CY, CZ, DX, DY, DZ, E2, SURE, TOP, BOTTOM, ENDS2, BEST2, AT, IN_ARC, LOW_FALLS, TOP_FALLS = range(
    0, 16 * AT_ONCE, AT_ONCE
)
EX, EY, P, LOW_V, TOP_V, LOW_REACH, TOP_REACH, PARALLEL, VALUE, QX, QY, QZ, NX, NY, NZ, BOUND = range(
    16 * AT_ONCE, ROWS * AT_ONCE, AT_ONCE
)


@inlined
def yes(condition):  # type: ignore[no-untyped-def]
    """A truth value as a number."""
    return 1.0 if condition else 0.0


@inlined
def position_and_axis(w, i):  # type: ignore[no-untyped-def]
    """Position and axis of pose i of a block."""
    return w[CX + i], w[CY + i], w[CZ + i], w[DX + i], w[DY + i], w[DZ + i]


@inlined
def better(w, i, less, d2, t, qx, qz, points):  # type: ignore[no-untyped-def]
    """Note an edge as the best so far of pose i where it is, and with ``points`` its point; end arcs note their y."""
    w[BEST2 + i] = d2 if less else w[BEST2 + i]
    w[AT + i] = t if less else w[AT + i]
    w[IN_ARC + i] = 0.0 if less else w[IN_ARC + i]
    if points:
        w[QX + i] = qx if less else w[QX + i]
        w[QZ + i] = qz if less else w[QZ + i]


@inlined
def end_point_soon(R, s, h, H, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance of an end of the axis from S, whether its nearest is the inside of the arc; whether certain."""
    gap, feature = section(x, y, R, s, h)
    end = abs(z) - H
    past = end > 0.0
    d2 = gap * gap if not past or gap > 0.0 else 0.0
    return d2 + (end * end if past else 0.0), feature == ARC and not past, past or gap >= 0.0


@inlined
def set_out(w, count, R, s, h, H, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Unit axes, and what they reach: how many poses reach the low end, the top end, both; the flats beside the arc."""
    low = high = both = wide = 0
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        dx, dy, dz, e2 = unit(dx, dy, dz, True)  # of a valid pose
        sure = not (cy - l * abs(dy) <= h and enters(R, s, h, H, l, cx, cy, cz, dx, dy, dz)[0])
        half = l * abs(dz)
        top, bottom = cz + half >= H, cz - half <= -H
        low2 = beyond(R, h, H, cx - l * dx, cy - l * dy, cz - l * dz)
        top2 = beyond(R, h, H, cx + l * dx, cy + l * dy, cz + l * dz)
        w[DX + i], w[DY + i], w[DZ + i], w[E2 + i] = dx, dy, dz, e2
        w[SURE + i], w[TOP + i], w[BOTTOM + i] = yes(sure), yes(top), yes(bottom)
        w[ENDS2 + i] = min(low2, top2) if top and bottom else math.inf
        w[BEST2 + i] = math.inf
        w[AT + i] = w[IN_ARC + i] = w[LOW_FALLS + i] = w[TOP_FALLS + i] = 0.0
        low += 1 if bottom else 0
        high += 1 if top else 0
        both += 1 if top and bottom else 0
        wide += 1 if abs(cx) + l * abs(dx) >= s and cy + l * abs(dy) >= h and (top or bottom) else 0
    return low, high, both, wide


@inlined
def axis_ends(w, count, R, s, h, H, l):  # type: ignore[no-untyped-def] # noqa: E741
    """The ends of the axes against S, where not both are far from it."""
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        d2, arc, known = end_point_soon(R, s, h, H, cx - l * dx, cy - l * dy, cz - l * dz)
        top2, top_arc, top_known = end_point_soon(R, s, h, H, cx + l * dx, cy + l * dy, cz + l * dz)
        asked = not (w[TOP + i] > 0.0 and w[BOTTOM + i] > 0.0)
        less = top2 < d2
        arc = top_arc if less else arc
        w[BEST2 + i] = (top2 if less else d2) if asked else math.inf
        w[AT + i] = l if less else -l
        w[IN_ARC + i] = yes(arc)
        w[SURE + i] = w[SURE + i] if not asked or (known and top_known) else 0.0


@inlined
def corners(w, count, s, h, ez, l, reached, falls, points):  # type: ignore[no-untyped-def] # noqa: E741
    """The corners of the end z = ez, for poses that reach it."""
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        asked = w[reached + i] > 0.0
        d2, t, first = corner(-s, h, ez, cx, cy, cz, dx, dy, dz, l)
        better(w, i, asked and d2 < w[BEST2 + i], d2, t, -s, ez, points)
        d2, t, second = corner(s, h, ez, cx, cy, cz, dx, dy, dz, l)
        better(w, i, asked and d2 < w[BEST2 + i], d2, t, s, ez, points)
        w[falls + i] = yes(first or second)


@inlined
def lips(w, count, s, h, H, l, points):  # type: ignore[no-untyped-def] # noqa: E741
    """The lips."""
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        d2, t, z = lip_line(-s, h, H, cx, cy, cz, dx, dy, dz, w[E2 + i], l, w[BEST2 + i])
        better(w, i, d2 < w[BEST2 + i], d2, t, -s, z, points)
        d2, t, z = lip_line(s, h, H, cx, cy, cz, dx, dy, dz, w[E2 + i], l, w[BEST2 + i])
        better(w, i, d2 < w[BEST2 + i], d2, t, s, z, points)


@inlined
def end_edges(w, count, s, h, ez, l, reached, points):  # type: ignore[no-untyped-def] # noqa: E741
    """The edges of the end z = ez, for poses that reach it and are not below them."""
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        d2, t, x = end_edge(ez, s, h, cx, cy, cz, dx, dy, dz, l, w[BEST2 + i])
        asked = w[reached + i] > 0.0 and cy + l * abs(dy) >= h
        better(w, i, asked and d2 < w[BEST2 + i], d2, t, x, ez, points)


@inlined
def seen_along(w, count, R, H):  # type: ignore[no-untyped-def]
    """The end arcs seen along the axes, and lower bounds on their distances: infinite where none is asked for."""
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        e2 = w[E2 + i]
        ex, ey, e, p, along = ellipse(R, cx, cy, dx, dy, e2)
        low_v, low_reach = end_arc_reach(-H, R, cz, dz, e, p, along)
        top_v, top_reach = end_arc_reach(H, R, cz, dz, e, p, along)
        low = w[LOW_FALLS + i] > 0.0 or not (abs(p) >= e2 or abs(dz * low_v) >= e2)
        top = w[TOP_FALLS + i] > 0.0 or not (abs(p) >= e2 or abs(dz * top_v) >= e2)
        w[EX + i], w[EY + i], w[P + i], w[LOW_V + i], w[TOP_V + i] = ex, ey, p, low_v, top_v
        w[LOW_REACH + i] = low_reach if w[BOTTOM + i] > 0.0 and low else math.inf
        w[TOP_REACH + i] = top_reach if w[TOP + i] > 0.0 and top else math.inf


@inlined
def end_arcs(w, count, R, s, h, H, l, nearer, points):  # type: ignore[no-untyped-def] # noqa: E741
    """Of both end arcs the ``nearer`` one by its bound, or the other."""
    asked = 0
    for i in range(count):
        low, top, best2 = w[LOW_REACH + i], w[TOP_REACH + i], w[BEST2 + i]
        least = min(low, top) if nearer else max(low, top)
        asked += 1 if least * least < best2 else 0
    if asked == 0:
        return
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        ex, ey, p, e2 = w[EX + i], w[EY + i], w[P + i], w[E2 + i]
        low, top, low_v, top_v, best2 = w[LOW_REACH + i], w[TOP_REACH + i], w[LOW_V + i], w[TOP_V + i], w[BEST2 + i]
        least = min(low, top) if nearer else max(low, top)
        at_top = top < low if nearer else not top < low
        v = top_v if at_top else low_v
        ez = H if at_top else -H
        d2, x, y, t, known = end_arc_soon(ez, R, s, h, cx, cy, cz, dx, dy, dz, e2, l, ex, ey, p, v)
        wanted = least * least < best2
        w[SURE + i] = w[SURE + i] if known or not wanted else 0.0
        better(w, i, wanted and d2 < best2, d2, t, x, ez, points)
        if points:
            w[QY + i] = y if wanted and d2 < best2 else w[QY + i]


@inlined
def values(w, count, R, r, l, flat):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distances of the best features found, as `from_outside` has them; with flat ends if they are the same."""
    for i in range(count):
        x, y = w[CX + i] + w[AT + i] * w[DX + i], w[CY + i] + w[AT + i] * w[DY + i]
        arc = w[IN_ARC + i] > 0.0
        root = math.sqrt(x * x + y * y if arc else w[BEST2 + i])
        v = (R - r) - root if arc else root - r
        same = not flat or is_beside(v, w[AT + i], l)
        w[VALUE + i] = v
        w[SURE + i] = w[SURE + i] if same and not w[ENDS2 + i] < w[BEST2 + i] else 0.0


@inlined
def witnesses(w, count, R, h, H, r, l):  # type: ignore[no-untyped-def] # noqa: E741
    """Points on the groove, normals and error bounds of what is certain, as `nearest` has them for an axis' inside.

    An axis that passes through the edge itself is left to it.
    """
    for i in range(count):
        cx, cy, cz, dx, dy, dz = position_and_axis(w, i)
        t, bound = w[AT + i], rounding(R, H, r, l, cx, cy, cz)
        nx, ny, nz = cx + t * dx - w[QX + i], cy + t * dy - w[QY + i], cz + t * dz - w[QZ + i]
        apart = nx * nx + ny * ny + nz * nz > bound * bound
        nx, ny, nz, n = across(nx, ny, nz, dx, dy, dz)
        w[NX + i], w[NY + i], w[NZ + i] = nx / n, ny / n, nz / n
        w[BOUND + i] = bound
        w[SURE + i] = w[SURE + i] if apart and n > 0.0 else 0.0


@inlined
def outside_soon(w, count, R, s, h, H, r, l, flat, points):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distances and places on the axes of a block, as `outside` has them, to the bit, and whether certain.

    It is not certain for an axis that enters S, and where the search of an end arc takes loops. ``points``: the
    witnesses too, for flat ends, of which nothing is certain but where an axis' inside is nearest to an edge.
    """
    low, high, both, wide = set_out(w, count, R, s, h, H, l)
    if points:
        for i in range(count):
            w[QY + i] = h
    if both < count:
        axis_ends(w, count, R, s, h, H, l)
    if low > 0:
        corners(w, count, s, h, -H, l, BOTTOM, LOW_FALLS, points)
    if high > 0:
        corners(w, count, s, h, H, l, TOP, TOP_FALLS, points)
    lips(w, count, s, h, H, l, points)
    if wide > 0:
        end_edges(w, count, s, h, -H, l, BOTTOM, points)
        end_edges(w, count, s, h, H, l, TOP, points)
    if low > 0 or high > 0:
        seen_along(w, count, R, H)
        end_arcs(w, count, R, s, h, H, l, True, points)
        end_arcs(w, count, R, s, h, H, l, False, points)
    values(w, count, R, r, l, flat)
    if points:
        witnesses(w, count, R, h, H, r, l)


@inlined
def parallel_soon(w, count, R, s, h, H, r, l, flat):  # type: ignore[no-untyped-def] # noqa: E741
    """The same for axes that count as parallel; the others of the block are left as they are."""
    if flat:
        for i in range(count):
            _, _, _, _, v, deep = disc_gaps(R, s, h, H, r, l, w[CX + i], w[CY + i], w[CZ + i])
            alone = w[PARALLEL + i] > 0.0
            w[VALUE + i] = v if alone else w[VALUE + i]
            w[SURE + i] = yes(not deep) if alone else w[SURE + i]
        return
    for i in range(count):
        v = parallel(R, s, h, H, r, l, w[CX + i], w[CY + i], w[CZ + i], w[DZ + i])[0]
        alone = w[PARALLEL + i] > 0.0
        w[VALUE + i] = v if alone else w[VALUE + i]
        w[SURE + i] = 1.0 if alone else w[SURE + i]
