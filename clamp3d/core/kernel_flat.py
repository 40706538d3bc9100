"""Signed distance of a flat-ended cylinder from a groove.

The distance is the least value over the material's points q of the cylinder's own signed distance
``f(q) = phi(w - r, |t| - half)`` (see `kernel_edges`). Outside that is the distance of the two bodies. In an overlap it
is minus the inset: by how much radius and both ends must shrink alike for the cylinder to come free. Where nothing is
left of the cylinder before that, minus the smaller of radius and half length, minus the depth of what is left (its
axis segment; of a disc, whose radius is the larger, the middle).

f is convex. So its least value over S is on an edge of S, or at the one point of a face's plane where f is least, or,
behind the arc surface, at a point of a rim that is locally farthest from the groove's axis. The capsule holds the
cylinder: its distance is a lower bound, and the answer where its nearest axis point is square to the axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.core.jit import formula, inlined
from clamp3d.core.kernel_distance import (
    UNIT,
    Answer,
    Rate,
    inside,
    inside_rate,
    is_parallel,
    nearest,
    parallel,
    way_out,
)
from clamp3d.core.kernel_edges import Line, beside, from_axis, on_arc, on_line
from clamp3d.core.kernel_features import (
    ARC,
    CORNER_M,
    CORNER_N,
    END_ARC,
    END_EDGE_M,
    END_EDGE_N,
    END_FACE,
    FLAT_M,
    FLAT_N,
    LIP_M,
    LIP_N,
    TINY,
    Groove,
    Rod,
    beyond_end,
    clip,
    farther_root,
    in_mouth,
    is_behind_arc,
    nearer_root,
    phi,
    section,
    section_foot,
)


class Search(NamedTuple):
    """State of the search for the least f: the best point of the groove so far, and what need not be looked for.

    f is known to be below ``limit`` and not below ``least``; what reaches that ends the search. ``left`` is a lower
    bound of what a search that ended early may have left, ``eps`` the rounding of f.
    """

    f: float
    x: float
    y: float
    z: float
    feature: float
    limit: float
    least: float
    left: float
    eps: float


class RimPoint(NamedTuple):
    """A point of a rim, its distance rho from the groove's axis (-1: none), the rates of rho by radius and length."""

    rho: float
    x: float
    y: float
    z: float
    by_radius: float
    by_length: float


@inlined
def better(search: Search, f: float, x: float, y: float, z: float, feature: float) -> Search:
    """The search with a point of the groove, if it is the best so far."""
    limit = min(search.limit, f)
    if f < search.f:
        return Search(f, x, y, z, feature, limit, search.least, search.left, search.eps)
    return search


@formula
def plane_point(rod: Rod, a: float, along: float, across: float) -> tuple[float, float, float]:
    """Least f over a plane that lies ``a`` below the cylinder's middle, and where: multiples of axis and radius.

    A plane above the middle counts only if it cuts what is left last of a disc (inf otherwise): behind it f is less.

    ``along``, ``across``: parts of the axis along and across the plane's normal. The point is the middle minus the
    first times the axis, minus the second times the unit vector across the axis that leads away from the plane.
    """
    r, half = rod.r, rod.half
    if a < 0.0:
        return (-half, 0.0, a / across) if -a < (r - half) * across else (math.inf, 0.0, 0.0)
    up = 1.0 if along >= 0.0 else -1.0
    f = a - half * abs(along) - r * across
    if f >= 0.0:
        return f, up * half, r if across > 0.0 else 0.0
    inset = -f / (abs(along) + across)
    if inset <= min(r, half):
        return -inset, up * (half - inset), (r - inset) if across > 0.0 else 0.0
    if r <= half:
        return -r, a / along if along != 0.0 else 0.0, 0.0
    return -half, 0.0, a / across if across > 0.0 else 0.0


@inlined
def on_flats(groove: Groove, rod: Rod, search: Search) -> Search:
    """The search with the flat faces."""
    if rod.y < groove.h and rod.r <= rod.half:
        return search
    across = math.sqrt(rod.dx * rod.dx + rod.dz * rod.dz)
    f, along, out = plane_point(rod, rod.y - groove.h, rod.dy, across)
    x, z = rod.x - along * rod.dx, rod.z - along * rod.dz
    if across > 0.0:
        x += out * (rod.dy * rod.dx / across)
        z += out * (rod.dy * rod.dz / across)
    if f == math.inf or abs(z) > groove.H or abs(x) < groove.s:
        return search
    return better(search, f, x, groove.h, z, FLAT_N if x >= 0.0 else FLAT_M)


@formula
def on_end_face(groove: Groove, rod: Rod, up: float, search: Search) -> Search:
    """The search with the end face at the top (up = 1) or the bottom (-1)."""
    across = math.sqrt(rod.e2)
    a = up * rod.z - groove.H
    if (a < 0.0 and rod.r <= rod.half) or a - rod.half * abs(rod.dz) - rod.r * across >= search.limit:
        return search
    f, along, out = plane_point(rod, a, up * rod.dz, across)
    x, y = rod.x - along * rod.dx, rod.y - along * rod.dy
    if across > 0.0:
        x += out * up * rod.dz * rod.dx / across
        y += out * up * rod.dz * rod.dy / across
    if f == math.inf or section(groove, x, y)[0] > 0.0:
        return search
    return better(search, f, x, y, up * groove.H, END_FACE)


@formula
def rim_point(rod: Rod, up: float, is_farthest: bool, inset: float) -> RimPoint:
    """Local maximum of the distance from the groove's axis on a rim (up: 1, -1) of the cylinder less ``inset``.

    The farthest point of the rim, or the other local maximum. Seen along the groove a rim is an ellipse; its farthest
    points are found like the nearest ones of an end arc. Its minor axis is (ex, ey), the direction of the axis' part
    across the groove, of length e; the major one (-ey, ex).
    """
    none = RimPoint(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    e2, e = rod.e2, math.sqrt(rod.e2)
    ex, ey = rod.dx / e, rod.dy / e
    along, radius = up * (rod.half - inset), rod.r - inset
    x, y, z = rod.x + along * rod.dx, rod.y + along * rod.dy, rod.z + along * rod.dz
    b = abs(rod.dz)
    p = (ex * y - ey * x) / radius
    v = (ex * x + ey * y) / radius
    q, a = abs(p), abs(b * v)
    if q > TINY or a > e2:
        k = nearer_root(e2, a, q) if is_farthest else -farther_root(e2, a, q)
        if not is_farthest and k >= 0.0:
            return none
        C, S = p / k, b * v / (k + e2)
        n = 1.0 / math.sqrt(C * C + S * S)
        C *= n
        S *= n
    else:
        S = b * v / e2
        C = math.sqrt(max(0.0, 1.0 - S * S)) * (1.0 if is_farthest else -1.0)
    # The minor axis in space: across the cylinder's axis, (ex dz, ey dz, -e), with the sign that makes ex, ey rise.
    sign = 1.0 if rod.dz >= 0.0 else -1.0
    ux, uy, uz = -ey * C + ex * b * S, ex * C + ey * b * S, -e * sign * S
    x, y, z = x + radius * ux, y + radius * uy, z + radius * uz
    rho = math.sqrt(x * x + y * y)
    if rho < TINY:
        return none
    return RimPoint(rho, x, y, z, (x * ux + y * uy) / rho, up * (x * rod.dx + y * rod.dy) / rho)


@formula
def free_rim(groove: Groove, rod: Rod, up: float, is_farthest: bool, search: Search) -> tuple[RimPoint, float]:
    """The point of a rim that reaches behind the arc, shrunk until it just touches it, and by how much it is shrunk.

    Its rho is -1 if that is no candidate.
    """
    inset, most = 0.0, min(rod.r, rod.half)
    none = RimPoint(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    point = rim_point(rod, up, is_farthest, inset)
    if search.limit < 0.0 and is_farthest:  # less than the best inset frees this rim, or it goes on
        inset = -search.limit
        if inset < most:
            point = rim_point(rod, up, is_farthest, inset)
        if inset == most or point.rho <= groove.R:
            return none, inset
    last = math.inf
    for _ in range(60):
        rate = point.by_radius + point.by_length
        step = (point.rho - groove.R) / rate if rate > 0.0 else math.inf
        # Convex, so Newton's steps stay on this side of the root: what passes the bound is no candidate.
        if is_farthest and inset + step > 64.0 * search.eps - search.least:
            return none, inset
        if not inset + step < most:  # it never does: of a disc, what is left last
            if rod.r <= rod.half:
                return none, most
            point = rim_point(rod, up, is_farthest, most)
            return (point, most) if point.rho >= groove.R else (none, most)
        inset += step
        point = rim_point(rod, up, is_farthest, inset)
        size = abs(step)
        if point.rho <= 0.0 or abs(point.rho - groove.R) <= 2.0 * UNIT * groove.R:
            break
        if size <= 1e-12 * groove.R or (size <= 1e-8 * groove.R and size > 0.7 * last):
            break
        last = size
    return point, inset


@formula
def on_arc_surface(groove: Groove, rod: Rod, up: float, is_farthest: bool, search: Search) -> Search:
    """The search with the arc surface against a rim, from inside."""
    R = groove.R
    x, y = rod.x + up * rod.half * rod.dx, rod.y + up * rod.half * rod.dy
    if R - math.sqrt(x * x + y * y) - rod.r > search.limit + 4.0 * search.eps:
        return search
    point, inset = rim_point(rod, up, is_farthest, 0.0), 0.0
    if not (point.rho > 0.0 and R - point.rho <= search.limit):  # nor if a square has overflowed
        return search
    if point.rho > R:
        point, inset = free_rim(groove, rod, up, is_farthest, search)
    if point.rho <= 0.0 or abs(point.z) > groove.H:
        return search
    x, y = point.x, point.y
    if inset < min(rod.r, rod.half):
        x *= R / point.rho
        y *= R / point.rho
    if in_mouth(groove, x, y):
        return search
    f = R - point.rho
    if inset > 0.0:
        w, t = from_axis(rod, x - rod.x, y - rod.y, point.z - rod.z)
        f = beside(rod, w, t)
    return better(search, f, x, y, point.z, ARC)


@formula
def on_lip_line(groove: Groove, rod: Rod, side: float, search: Search) -> Search:
    """The search with the lip at a side (-1: M, 1: N)."""
    H, s, h = groove.H, groove.s, groove.h
    line = Line(side * s - rod.x, h - rod.y, 0.0, 0.0, 1.0, -H - rod.z, H - rod.z)
    place = on_line(rod, line, search.limit)
    if place.f > search.limit:
        return search
    z = min(max(place.p + rod.z, -H), H)
    feature = LIP_M if side < 0.0 else LIP_N
    if abs(z) == H:
        feature = CORNER_M if side < 0.0 else CORNER_N
    return better(search, place.f, side * s, h, z, feature)


@formula
def on_end_line(groove: Groove, rod: Rod, side: float, ez: float, search: Search) -> Search:
    """The search with the edge of the end z = ez at a side."""
    s, h = groove.s, groove.h
    lo, hi = (-math.inf, -s - rod.x) if side < 0.0 else (s - rod.x, math.inf)
    place = on_line(rod, Line(0.0, h - rod.y, ez - rod.z, 1.0, 0.0, lo, hi), search.limit)
    if place.f > search.limit:
        return search
    x = side * max(side * (place.p + rod.x), s)
    feature = END_EDGE_M if side < 0.0 else END_EDGE_N
    if x == side * s:
        feature = CORNER_M if side < 0.0 else CORNER_N
    return better(search, place.f, x, h, ez, feature)


@formula
def on_circle(groove: Groove, rod: Rod, ez: float, search: Search) -> Search:
    """The search with the end arc in the plane z = ez."""
    place = on_arc(groove, rod, ez, search.limit, search.eps)
    if place.f < math.inf:
        x, y = groove.R * math.sin(place.p), -groove.R * math.cos(place.p)
        w, t = from_axis(rod, x - rod.x, y - rod.y, ez - rod.z)
        search = better(search, beside(rod, w, t), x, y, ez, END_ARC)
    left = min(search.left, place.left)
    return Search(search.f, search.x, search.y, search.z, search.feature, search.limit, search.least, left, search.eps)


@formula
def best_point(groove: Groove, rod: Rod, search: Search) -> Search:
    """The point of the groove where f is least: its f is infinite if none is as low as the search's limit."""
    H = groove.H
    search = on_flats(groove, rod, search)
    search = on_end_face(groove, rod, 1.0, search)
    search = on_end_face(groove, rod, -1.0, search)
    if rod.e2 > 0.0:
        outer = 1.0 if rod.x * rod.dx + rod.y * rod.dy >= 0.0 else -1.0  # the end farther from the groove's axis
        for k in range(4):
            search = on_arc_surface(groove, rod, outer if k % 2 == 0 else -outer, k < 2, search)
    if search.f < math.inf and search.limit <= search.least:
        return search
    is_above = rod.y + rod.half * abs(rod.dy) + rod.r * math.sqrt(rod.dx * rod.dx + rod.dz * rod.dz) >= groove.h
    if search.f == math.inf or is_above or groove.h > 0.0:
        search = on_lip_line(groove, rod, -1.0, search)
        search = on_lip_line(groove, rod, 1.0, search)
    far = rod.half * abs(rod.dz) + rod.r * math.sqrt(rod.e2)
    for k in range(2):
        up = 1.0 if k == 0 else -1.0
        gap = up * rod.z - far - H
        if up * rod.z + far < H or (gap > 0.0 and gap > search.limit):
            continue
        if is_above:
            search = on_end_line(groove, rod, -1.0, up * H, search)
            search = on_end_line(groove, rod, 1.0, up * H, search)
        search = on_circle(groove, rod, up * H, search)
    return search


@inlined
def face_normal(groove: Groove, best: Search) -> Rate:
    """Normal of the face on which a point of the groove is; else zero."""
    if best.feature == ARC:
        return Rate(-best.x / groove.R, -best.y / groove.R, 0.0)
    if best.feature in (FLAT_M, FLAT_N):
        return Rate(0.0, 1.0, 0.0)
    return Rate(0.0, 0.0, (1.0 if best.z > 0.0 else -1.0) if best.feature == END_FACE else 0.0)


@inlined
def edge_direction(groove: Groove, best: Search) -> Rate:
    """Direction of the edge on which a point of the groove is; else zero."""
    if best.feature == END_ARC:
        return Rate(-best.y / groove.R, best.x / groove.R, 0.0)
    if best.feature in (END_EDGE_M, END_EDGE_N):
        return Rate(1.0, 0.0, 0.0)
    return Rate(0.0, 0.0, 1.0 if best.feature in (LIP_M, LIP_N) else 0.0)


@inlined
def mixture(u: float, side: Rate, v: float, end: Rate) -> Rate:
    """``u side + v end``."""
    return Rate(u * side.x + v * end.x, u * side.y + v * end.y, u * side.z + v * end.z)


@inlined
def shares(groove: Groove, best: Search, side: Rate, end: Rate) -> tuple[float, float]:
    """Shares of side and end in a mixture along the face's normal, or square to the edge; 0 and 0 if there is none."""
    m = face_normal(groove, best)
    u, v = max(side.x * m.x + side.y * m.y + side.z * m.z, 0.0), max(end.x * m.x + end.y * m.y + end.z * m.z, 0.0)
    if u + v == 0.0:
        m = edge_direction(groove, best)
        by_side, by_end = side.x * m.x + side.y * m.y + side.z * m.z, end.x * m.x + end.y * m.y + end.z * m.z
        if by_side * by_end < 0.0:
            u, v = abs(by_end), abs(by_side)
    return u, v


@formula
def witness(groove: Groove, rod: Rod, best: Search, bound: float) -> tuple[Rate, Rate, float]:
    """Unit normal at a point of the groove where f is least, the rate of f by a shift, the place on the axis."""
    x, y, z = best.x - rod.x, best.y - rod.y, best.z - rod.z
    w, t = from_axis(rod, x, y, z)
    f, g, e = best.f, w - rod.r, abs(t) - rod.half
    up = -1.0 if t >= 0.0 else 1.0
    to_end = Rate(up * rod.dx, up * rod.dy, up * rod.dz)  # from the point back to the end, and to the side
    to_side = to_end
    if w > TINY:
        to_side = Rate(-(x - t * rod.dx) / w, -(y - t * rod.dy) / w, -(z - t * rod.dz) / w)
    else:
        g = -math.inf
    u, v = shares(groove, best, to_side, to_end)
    is_mixed = u + v > 0.0
    on_face = best.feature in (ARC, FLAT_M, FLAT_N, END_FACE)
    if f <= 0.0:
        if not (abs(g - e) <= 64.0 * bound and is_mixed):
            u, v = (1.0, 0.0) if g >= e else (0.0, 1.0)
        rate = mixture(u / (u + v), to_side, v / (u + v), to_end)
        return to_side if g >= e else to_end, rate, t
    # Near contact the difference of nearly equal numbers has lost its digits.
    if f > 64.0 * bound or not (is_mixed and (on_face or (g > -bound and e > -bound))):
        u, v = max(g, 0.0) / f, max(e, 0.0) / f
        if f <= 64.0 * bound and (g <= -bound or e <= -bound):
            u, v = (1.0, 0.0) if g > e else (0.0, 1.0)
    n = math.sqrt(u * u + v * v)
    normal = mixture(u / n, to_side, v / n, to_end) if n > 0.0 else to_side
    return normal, normal, t


@formula
def flat_parallel(groove: Groove, rod: Rod) -> Answer:
    """Axis along z: the plane problem of a disc and the section, and the gap along z."""
    x, y, z, r, half, H = rod.x, rod.y, rod.z, rod.r, rod.half, groove.H
    gap, feature = section(groove, x, y)
    end = abs(z) - H
    bound = UNIT * (6.0 * (groove.R + abs(x) + abs(y)) + 4.0 * (H + abs(z) + half) + r)
    if gap < 0.0 and end <= max(half - r, 0.0):  # the groove goes on where nothing is left of the cylinder
        if half >= r:
            return parallel(groove, Rod(x, y, z, rod.dx, rod.dy, rod.dz, rod.e2, r, half - r))
        out = way_out(groove, x, y, z)
        return Answer(out.distance - half, out.x, out.y, out.z, out.nx, out.ny, out.nz, out.feature, 0.0, bound)
    g, e = gap - r if gap > 0.0 else -r, max(end, 0.0) - half
    if feature == ARC and gap > 0.0:
        g = (groove.R - r) - math.sqrt(x * x + y * y)
    f = phi(g, e)
    qx, qy, nx, ny = section_foot(groove, feature, x, y)
    if gap <= 0.0:
        qx, qy = x, y
    above = 1.0 if z > 0.0 else -1.0
    lo, hi = max(z - half, -H), min(z + half, H)
    qz, nz = 0.5 * (lo + hi) if lo <= hi else above * H, 0.0
    if g > 0.0 and e > 0.0:
        nx, ny, nz = nx * (g / f), ny * (g / f), above * (e / f)
        feature = beyond_end(feature)
    elif g >= e:
        if g < 0.0 and abs(qz - z) - half > g:  # the middle of the line of contact is nearer to an end
            qz = min(max(z, -H), H)
    else:
        qz = min(max(z, -H), H)
        nx, ny, nz = 0.0, 0.0, above
        if end >= 0.0:
            feature = END_FACE if gap <= 0.0 else beyond_end(feature)
    return Answer(f, qx, qy, qz, nx, ny, nz, feature, (qz - z) * math.copysign(1.0, rod.dz), bound)


@formula
def parallel_with_rate(groove: Groove, rod: Rod) -> tuple[Answer, Rate]:
    """Answer and rate for an axis along z."""
    answer = flat_parallel(groove, rod)
    rate = Rate(answer.nx, answer.ny, answer.nz)
    if rod.half < rod.r:
        if abs(answer.distance + rod.half) <= answer.bound:
            rate = Rate(0.0, 0.0, 0.0)  # nothing is left of a disc, and its middle is not in the material yet
    elif answer.distance < -rod.r:
        left = Rod(rod.x, rod.y, rod.z, 0.0, 0.0, math.copysign(1.0, rod.dz), 0.0, rod.r, rod.half - rod.r)
        rate = inside_rate(groove, left, answer.t)
    return answer, rate


@formula
def after_nothing_left(groove: Groove, rod: Rod, capsule: Answer) -> tuple[bool, Answer, Rate]:
    """Whether what is left last of the cylinder is in the material; then answer and rate."""
    bound, rate = capsule.bound, Rate(capsule.nx, capsule.ny, capsule.nz)
    if rod.half < rod.r:
        if section(groove, rod.x, rod.y)[0] > 0.0 or abs(rod.z) > groove.H:
            return False, capsule, rate
        out = way_out(groove, rod.x, rod.y, rod.z)
        distance = out.distance - rod.half
        middle = Answer(distance, out.x, out.y, out.z, out.nx, out.ny, out.nz, out.feature, 0.0, bound)
        return True, middle, Rate(out.nx, out.ny, out.nz)
    left = Rod(rod.x, rod.y, rod.z, rod.dx, rod.dy, rod.dz, rod.e2, rod.r, rod.half - rod.r)
    lo, hi = clip(groove, rod, left.half)
    if lo > hi or not (
        is_behind_arc(groove, rod.x + lo * rod.dx, rod.y + lo * rod.dy)
        or is_behind_arc(groove, rod.x + hi * rod.dx, rod.y + hi * rod.dy)
    ):
        return False, capsule, rate
    answer = inside(groove, left, lo, hi, bound)
    return True, answer, inside_rate(groove, left, answer.t)


@inlined
def is_of_capsule(rod: Rod, capsule: Answer) -> bool:
    """Whether the capsule's distance is the cylinder's: its axis point has a normal square to the axis."""
    distance, end = capsule.distance, abs(capsule.t) - rod.half
    if distance < -rod.r or (distance < 0.0 and end > distance):
        return False
    return end < 0.0 or abs(capsule.nx * rod.dx + capsule.ny * rod.dy + capsule.nz * rod.dz) <= 8.0 * UNIT


@formula
def searched(groove: Groove, rod: Rod, capsule: Answer) -> tuple[Answer, Rate]:
    """Answer and rate where the capsule's are not the cylinder's."""
    least = capsule.distance
    if capsule.distance < -rod.r:
        least = -math.inf
        is_inside, answer, rate = after_nothing_left(groove, rod, capsule)
        if is_inside:
            return answer, rate
    bound = 2.0 * capsule.bound + 4.0 * UNIT * rod.r
    eps = UNIT * (abs(rod.x) + abs(rod.y) + abs(rod.z) + rod.half + groove.H + groove.R + rod.r)
    # No more than where the capsule is nearest: what cannot be below that is not looked for.
    w, t = from_axis(rod, capsule.x - rod.x, capsule.y - rod.y, capsule.z - rod.z)
    start = beside(rod, w, t)
    best = Search(math.inf, capsule.x, capsule.y, capsule.z, capsule.feature, start + bound, least, math.inf, eps)
    best = best_point(groove, rod, best)
    left = best.left
    if best.f == math.inf:
        best = better(best, start, capsule.x, capsule.y, capsule.z, capsule.feature)
    normal, rate, t = witness(groove, rod, best, bound)
    if rod.half < rod.r and best.f + rod.half <= bound:
        rate = Rate(0.0, 0.0, 0.0)  # nothing is left of a disc, and its middle is not in the material yet
    bound += max(best.f - left, 0.0)
    answer = Answer(best.f, best.x, best.y, best.z, normal.x, normal.y, normal.z, best.feature, t, bound)
    return answer, rate


@inlined
def flat_nearest(groove: Groove, rod: Rod) -> tuple[Answer, Rate]:
    """Signed distance of a flat-ended cylinder, and its rate by a shift."""
    if is_parallel(groove, rod, max(rod.half, rod.r)):
        return parallel_with_rate(groove, rod)
    capsule = nearest(groove, rod)
    if is_of_capsule(rod, capsule):
        return capsule, Rate(capsule.nx, capsule.ny, capsule.nz)
    return searched(groove, rod, capsule)
