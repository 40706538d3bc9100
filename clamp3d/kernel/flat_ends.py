"""Signed distance of a flat-ended cylinder from a groove.

The distance is the least value over the material's points q of the cylinder's own signed distance
``f(q) = phi(w - r, |t| - half)`` (see `edges`). Outside that is the distance of the two bodies. In an overlap it
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

from clamp3d.kernel import features
from clamp3d.kernel.edges import Edge, cylinder_distance, from_axis, on_arc, on_line
from clamp3d.kernel.features import Groove, Rod
from clamp3d.kernel.jit import formula, inlined
from clamp3d.kernel.nearest import UNIT, Answer, inside, inside_rate, way_out
from clamp3d.kernel.vector import Vector, dot, length, minus, over, plus, times


class Search(NamedTuple):
    """State of the search for the least f: the best point of the groove so far, and what need not be looked for.

    f is known to be below ``limit`` and not below ``least``; what reaches that ends the search. ``left`` is a lower
    bound of what a search that ended early may have left, ``eps`` the rounding of f.
    """

    f: float
    point: Vector
    feature: float
    limit: float
    least: float
    left: float
    eps: float


class RimPoint(NamedTuple):
    """A point of a rim, its distance rho from the groove's axis (-1: none), the rates of rho by radius and length."""

    rho: float
    point: Vector
    by_radius: float
    by_length: float


@inlined
def better(search: Search, f: float, point: Vector, feature: float) -> Search:
    """The search with a point of the groove, if it is the best so far."""
    limit = min(search.limit, f)
    if f < search.f:
        return Search(f, point, feature, limit, search.least, search.left, search.eps)
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
    sign = 1.0 if along >= 0.0 else -1.0
    f = a - half * abs(along) - r * across
    if f >= 0.0:
        return f, sign * half, r if across > 0.0 else 0.0
    inset = -f / (abs(along) + across)
    if inset <= min(r, half):
        return -inset, sign * (half - inset), (r - inset) if across > 0.0 else 0.0
    if r <= half:
        return -r, a / along if along != 0.0 else 0.0, 0.0
    return -half, 0.0, a / across if across > 0.0 else 0.0


@formula
def on_face(groove: Groove, rod: Rod, normal: Vector, level: float, search: Search) -> Search:
    """The search with the faces in the plane of the points q whose ``normal q`` is ``level``: the flats, or an end."""
    a, along = dot(normal, rod.centre) - level, dot(normal, rod.axis)
    across = length(plus(rod.axis, -along, normal))
    if (a < 0.0 and rod.r <= rod.half) or a - rod.half * abs(along) - rod.r * across >= search.limit:
        return search
    f, t, out = plane_point(rod, a, along, across)
    q = features.axis_point(rod, -t)
    if across > 0.0:
        q = plus(plus(q, out * along / across, rod.axis), -out / across, normal)
    if f == math.inf:
        return search
    if normal.y > 0.0:
        if abs(q.z) > groove.H or abs(q.x) < groove.s:
            return search
        return better(search, f, Vector(q.x, level, q.z), features.FLAT_N if q.x >= 0.0 else features.FLAT_M)
    if features.section(groove, q.x, q.y)[0] > 0.0:
        return search
    return better(search, f, Vector(q.x, q.y, normal.z * level), features.END_FACE)


@formula
def rim_point(rod: Rod, end: float, which: float, inset: float) -> RimPoint:
    """Local maximum of the distance from the groove's axis on a rim (end: 1, -1) of the cylinder less ``inset``.

    The farthest point of the rim (``which`` 1), or the other local maximum (-1). Seen along the groove a rim is an
    ellipse; its farthest points are found like the nearest ones of an end arc. Its minor axis is (ex, ey), the
    direction of the axis' part across the groove, of length e; the major one (-ey, ex).
    """
    none = RimPoint(-1.0, rod.centre, 0.0, 0.0)
    d, e2, e = rod.axis, rod.e2, math.sqrt(rod.e2)
    ex, ey = (d.x / e, d.y / e) if e > 0.0 else (1.0, 0.0)
    radius = rod.r - inset
    middle = features.axis_point(rod, end * (rod.half - inset))
    b = abs(d.z)
    p = (ex * middle.y - ey * middle.x) / radius
    v = (ex * middle.x + ey * middle.y) / radius
    S, C = features.stationary(e2, b * v, p, which)
    if math.isnan(S):
        return none
    # The minor axis in space: across the cylinder's axis, (ex dz, ey dz, -e), with the sign that makes ex, ey rise.
    out = Vector(-ey * C + ex * b * S, ex * C + ey * b * S, -e * math.copysign(1.0, d.z) * S)
    point = plus(middle, radius, out)
    rho = math.sqrt(point.x * point.x + point.y * point.y)
    if rho < features.TINY:
        return none
    by_radius = (point.x * out.x + point.y * out.y) / rho
    return RimPoint(rho, point, by_radius, end * (point.x * d.x + point.y * d.y) / rho)


@formula
def free_rim(groove: Groove, rod: Rod, end: float, which: float) -> tuple[RimPoint, float]:
    """The point of a rim that reaches behind the arc, shrunk until it just touches it, and by how much it is shrunk.

    Its rho is -1 if that is no candidate.
    """
    inset, most = 0.0, min(rod.r, rod.half)
    none = RimPoint(-1.0, rod.centre, 0.0, 0.0)
    point = rim_point(rod, end, which, inset)
    for _ in range(60):
        rate = point.by_radius + point.by_length
        step = (point.rho - groove.R) / rate if rate > 0.0 else math.inf  # Newton's: convex, so it stays on this side
        if not inset + step < most:  # it never does: of a disc, what is left last
            if rod.r <= rod.half:
                return none, most
            point = rim_point(rod, end, which, most)
            return (point, most) if point.rho >= groove.R else (none, most)
        inset += step
        point = rim_point(rod, end, which, inset)
        if point.rho <= 0.0 or abs(point.rho - groove.R) <= 2.0 * UNIT * groove.R or abs(step) <= 1e-12 * groove.R:
            break
    return point, inset


@formula
def on_arc_surface(groove: Groove, rod: Rod, end: float, which: float, search: Search) -> Search:
    """The search with the arc surface against a rim, from inside."""
    R = groove.R
    rim, inset = rim_point(rod, end, which, 0.0), 0.0
    if not (rim.rho > 0.0 and R - rim.rho <= search.limit):  # nor if a square has overflowed
        return search
    if rim.rho > R:
        rim, inset = free_rim(groove, rod, end, which)
    if rim.rho <= 0.0 or abs(rim.point.z) > groove.H:
        return search
    scale = R / rim.rho if inset < min(rod.r, rod.half) else 1.0
    point = Vector(rim.point.x * scale, rim.point.y * scale, rim.point.z)
    if features.in_mouth(groove, point.x, point.y):
        return search
    f = R - rim.rho
    if inset > 0.0:
        f = point_distance(rod, point)
    return better(search, f, point, features.ARC)


@inlined
def point_distance(rod: Rod, point: Vector) -> float:
    """Signed distance f of a point from the cylinder."""
    w, t = from_axis(rod, minus(point, rod.centre))
    return cylinder_distance(rod, w, t)


@formula
def on_edge(
    rod: Rod, origin: Vector, direction: Vector, lo: float, hi: float, feature: float, search: Search
) -> Search:
    """The search with the edge ``origin + p direction``, lo <= p <= hi, which ends in corners.

    The origin is square to the direction, which is x or z.
    """
    middle = dot(rod.centre, direction)
    foot = minus(plus(origin, middle, direction), rod.centre)
    place = on_line(rod, Edge(foot, direction, 0.0, 0.0), lo - middle, hi - middle, search.limit)
    if place.f > search.limit:
        return search
    p = min(max(place.p + middle, lo), hi)
    if p in (lo, hi):
        feature = features.CORNER_M if feature in (features.LIP_M, features.END_EDGE_M) else features.CORNER_N
    return better(search, place.f, plus(origin, p, direction), feature)


@formula
def on_circle(groove: Groove, rod: Rod, ez: float, search: Search) -> Search:
    """The search with the end arc in the plane z = ez."""
    place = on_arc(groove, rod, ez, search.limit, search.eps)
    if place.f < math.inf:
        point = Vector(groove.R * math.sin(place.p), -groove.R * math.cos(place.p), ez)
        search = better(search, point_distance(rod, point), point, features.END_ARC)
    left = min(search.left, place.left)
    return Search(search.f, search.point, search.feature, search.limit, search.least, left, search.eps)


@formula
def best_point(groove: Groove, rod: Rod, search: Search) -> Search:
    """The point of the groove where f is least: its f is infinite if none is as low as the search's limit."""
    s, h, H = groove.s, groove.h, groove.H
    c, d = rod.centre, rod.axis
    search = on_face(groove, rod, Vector(0.0, 1.0, 0.0), h, search)
    search = on_face(groove, rod, Vector(0.0, 0.0, 1.0), H, search)
    search = on_face(groove, rod, Vector(0.0, 0.0, -1.0), H, search)
    outer = 1.0 if c.x * d.x + c.y * d.y >= 0.0 else -1.0  # the end farther from the groove's axis
    for k in range(4):
        search = on_arc_surface(groove, rod, outer if k % 2 == 0 else -outer, 1.0 if k < 2 else -1.0, search)
    if search.f < math.inf and search.limit <= search.least:
        return search
    is_above = c.y + rod.half * abs(d.y) + rod.r * math.sqrt(d.x * d.x + d.z * d.z) >= h
    along_z = Vector(0.0, 0.0, 1.0)
    search = on_edge(rod, Vector(-s, h, 0.0), along_z, -H, H, features.LIP_M, search)
    search = on_edge(rod, Vector(s, h, 0.0), along_z, -H, H, features.LIP_N, search)
    far = rod.half * abs(d.z) + rod.r * math.sqrt(rod.e2)
    for end in (1.0, -1.0):
        gap = end * c.z - far - H
        if end * c.z + far < H or (gap > 0.0 and gap > search.limit):
            continue
        if is_above:
            along_x = Vector(1.0, 0.0, 0.0)
            search = on_edge(rod, Vector(0.0, h, end * H), along_x, -math.inf, -s, features.END_EDGE_M, search)
            search = on_edge(rod, Vector(0.0, h, end * H), along_x, s, math.inf, features.END_EDGE_N, search)
        search = on_circle(groove, rod, end * H, search)
    return search


@inlined
def edge_direction(groove: Groove, best: Search) -> Vector:
    """Direction of the edge on which a point of the groove is; else zero."""
    if best.feature == features.END_ARC:
        return Vector(-best.point.y / groove.R, best.point.x / groove.R, 0.0)
    if best.feature in (features.END_EDGE_M, features.END_EDGE_N):
        return Vector(1.0, 0.0, 0.0)
    return Vector(0.0, 0.0, 1.0 if best.feature in (features.LIP_M, features.LIP_N) else 0.0)


@inlined
def shares(groove: Groove, best: Search, side: Vector, end: Vector) -> tuple[float, float]:
    """Shares of side and end in a mixture along the face's normal, or square to the edge; 0 and 0 if there is none."""
    m = features.face_normal(groove, best.feature, best.point)
    u, v = max(dot(side, m), 0.0), max(dot(end, m), 0.0)
    if u + v == 0.0:
        m = edge_direction(groove, best)
        by_side, by_end = dot(side, m), dot(end, m)
        if by_side * by_end < 0.0 and abs(by_side) + abs(by_end) > 1e-12:  # else any mixture is square to the edge
            u, v = abs(by_end), abs(by_side)
    return u, v


@formula
def witness(groove: Groove, rod: Rod, best: Search, bound: float) -> tuple[Vector, Vector, float]:
    """Unit normal at a point of the groove where f is least, the rate of f by a shift, the place on the axis."""
    point = minus(best.point, rod.centre)
    w, t = from_axis(rod, point)
    f, g, e = best.f, w - rod.r, abs(t) - rod.half
    to_end = times(-1.0 if t >= 0.0 else 1.0, rod.axis)  # from the point back to the end, and to the side
    to_side = Vector(0.0, 0.0, 0.0)
    if w > features.TINY:
        to_side = over(plus(point, -t, rod.axis), -w)
    else:
        g = -math.inf
    u, v = shares(groove, best, to_side, to_end)
    is_mixed = u + v > 0.0
    on_face = best.feature in (features.ARC, features.FLAT_M, features.FLAT_N, features.END_FACE)
    if f <= 0.0:
        if not (abs(g - e) <= 64.0 * bound and is_mixed):
            u, v = (1.0, 0.0) if g >= e else (0.0, 1.0)
        rate = plus(times(u / (u + v), to_side), v / (u + v), to_end)
        return to_side if g >= e else to_end, rate, t
    # Near contact the difference of nearly equal numbers has lost its digits.
    if f > 64.0 * bound or not (is_mixed and (on_face or (g > -bound and e > -bound))):
        u, v = max(g, 0.0) / f, max(e, 0.0) / f
        if f <= 64.0 * bound and (g <= -bound or e <= -bound):
            u, v = (1.0, 0.0) if g > e else (0.0, 1.0)
    n = math.sqrt(u * u + v * v)
    normal = plus(times(u / n, to_side), v / n, to_end) if n > 0.0 else to_side
    return normal, normal, t


@formula
def after_nothing_left(groove: Groove, rod: Rod, capsule: Answer) -> tuple[bool, Answer, Vector]:
    """Whether what is left last of the cylinder is in the material; then answer and rate."""
    bound = capsule.bound
    if rod.half < rod.r:
        if features.section(groove, rod.centre.x, rod.centre.y)[0] > 0.0 or abs(rod.centre.z) > groove.H:
            return False, capsule, capsule.normal
        out = way_out(groove, rod.centre)
        return True, Answer(out.distance - rod.half, out.point, out.normal, out.feature, 0.0, bound), out.normal
    left = Rod(rod.centre, rod.axis, rod.e2, rod.r, rod.half - rod.r)  # the capsule of what is left
    lo, hi = features.clip(groove, rod, left.half)
    low, high = features.axis_point(rod, lo), features.axis_point(rod, hi)
    if lo > hi or not (features.is_behind_arc(groove, low.x, low.y) or features.is_behind_arc(groove, high.x, high.y)):
        return False, capsule, capsule.normal
    answer = inside(groove, left, lo, hi, bound)
    return True, answer, inside_rate(groove, left, answer.t)


@inlined
def is_of_capsule(rod: Rod, capsule: Answer) -> bool:
    """Whether the capsule's distance is the cylinder's: its axis point has a normal square to the axis."""
    distance, end = capsule.distance, abs(capsule.t) - rod.half
    if distance < -rod.r or (distance < 0.0 and end > distance):
        return False
    return end < 0.0 or abs(dot(capsule.normal, rod.axis)) <= 8.0 * UNIT


@formula
def with_flat_ends(groove: Groove, rod: Rod, capsule: Answer) -> tuple[Answer, Vector]:
    """Signed distance of a flat-ended cylinder and its rate by a shift, from the answer of its capsule."""
    if is_of_capsule(rod, capsule):
        return capsule, capsule.normal
    least = capsule.distance
    if capsule.distance < -rod.r:
        least = -math.inf
        is_inside, answer, rate = after_nothing_left(groove, rod, capsule)
        if is_inside:
            return answer, rate
    bound = 2.0 * capsule.bound + 4.0 * UNIT * rod.r
    c = rod.centre
    eps = UNIT * (abs(c.x) + abs(c.y) + abs(c.z) + rod.half + groove.H + groove.R + rod.r)
    # No more than where the capsule is nearest: what cannot be below that is not looked for.
    start = point_distance(rod, capsule.point)
    best = Search(math.inf, capsule.point, capsule.feature, start + bound, least, math.inf, eps)
    best = best_point(groove, rod, best)
    left = best.left
    if best.f == math.inf:
        best = better(best, start, capsule.point, capsule.feature)
    normal, rate, t = witness(groove, rod, best, bound)
    if rod.half < rod.r and best.f + rod.half <= bound:
        rate = Vector(0.0, 0.0, 0.0)  # nothing is left of a disc, and its middle is not in the material yet
    bound += max(best.f - left, 0.0)
    return Answer(best.f, best.point, normal, best.feature, t, bound), rate
