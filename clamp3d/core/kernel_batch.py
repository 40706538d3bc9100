"""The distance of many poses: the common case without branches, so that the compiler does several poses at a time."""

from __future__ import annotations

import math

from clamp3d.core.jit import inlined
from clamp3d.core.kernel_distance import beyond, enters, unit
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

AT_ONCE = 64
"""Poses of a block."""


@inlined
def end_point_soon(R, s, h, H, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance of an end of the axis from S, whether its nearest is the inside of the arc; whether certain."""
    gap, feature = section(x, y, R, s, h)
    end = abs(z) - H
    past = end > 0.0
    d2 = gap * gap if not past or gap > 0.0 else 0.0
    return d2 + (end * end if past else 0.0), feature == ARC and not past, past or gap >= 0.0


@inlined
def outside_soon(R, s, h, H, r, l, cx, cy, cz, dx, dy, dz):  # type: ignore[no-untyped-def] # noqa: E741
    """Signed distance and place on the axis as `outside` has them, to the bit, and whether that is certain.

    All features are computed and the least is selected. It is not certain for an axis that enters S, and where the
    search of an end arc takes loops.
    """
    dx, dy, dz, e2 = unit(dx, dy, dz, True)  # of a valid pose
    sure = not (cy - l * abs(dy) <= h and enters(R, s, h, H, l, cx, cy, cz, dx, dy, dz)[0])
    half = l * abs(dz)
    top, bottom = cz + half >= H, cz - half <= -H
    through = top and bottom
    x, y, z = cx - l * dx, cy - l * dy, cz - l * dz
    low2 = beyond(R, h, H, x, y, z)
    best2, arc, known = end_point_soon(R, s, h, H, x, y, z)
    x, y, z = cx + l * dx, cy + l * dy, cz + l * dz
    top2 = beyond(R, h, H, x, y, z)
    d2, d2_arc, d2_known = end_point_soon(R, s, h, H, x, y, z)
    sure = sure and (through or (known and d2_known))
    less = d2 < best2
    best2, bt, arc = d2 if less else best2, l if less else -l, d2_arc if less else arc
    best2 = math.inf if through else best2
    low_falls = top_falls = False
    for i in range(4):
        sx, ez = s if i % 2 else -s, H if i > 1 else -H
        d2, t, falls = corner(sx, h, ez, cx, cy, cz, dx, dy, dz, l)
        less = (top if i > 1 else bottom) and d2 < best2
        best2, bt, arc = d2 if less else best2, t if less else bt, arc and not less
        low_falls = low_falls or (falls and i < 2)
        top_falls = top_falls or (falls and i > 1)
    for i in range(2):
        d2, t, _ = lip_line(s if i else -s, h, H, cx, cy, cz, dx, dy, dz, e2, l, best2)
        less = d2 < best2
        best2, bt, arc = d2 if less else best2, t if less else bt, arc and not less
    above = cy + l * abs(dy) >= h
    for i in range(2):
        d2, t, _ = end_edge(H if i else -H, s, h, cx, cy, cz, dx, dy, dz, l, best2)
        less = (top if i else bottom) and above and d2 < best2
        best2, bt, arc = d2 if less else best2, t if less else bt, arc and not less
    ex, ey, e, p, along = ellipse(R, cx, cy, dx, dy, e2)
    low_v, low_reach = end_arc_reach(-H, R, cz, dz, e, p, along)
    top_v, top_reach = end_arc_reach(H, R, cz, dz, e, p, along)
    top_first = top and (not bottom or top_reach < low_reach)
    for i in range(2):
        at_top = top_first if i == 0 else not top_first
        least = top_reach if at_top else low_reach
        v = top_v if at_top else low_v
        ez = H if at_top else -H
        asked = (top if at_top else bottom) and least * least < best2
        asked = asked and ((top_falls if at_top else low_falls) or not (abs(p) >= e2 or abs(dz * v) >= e2))
        d2, t, known = end_arc_soon(ez, R, s, h, cx, cy, cz, dx, dy, dz, e2, l, ex, ey, p, v)
        sure = sure and (known or not asked)
        less = asked and d2 < best2
        best2, bt, arc = d2 if less else best2, t if less else bt, arc and not less
    sure = sure and not (through and min(low2, top2) < best2)
    x, y = cx + bt * dx, cy + bt * dy
    root = math.sqrt(x * x + y * y if arc else best2)
    return (R - r) - root if arc else root - r, bt, sure
