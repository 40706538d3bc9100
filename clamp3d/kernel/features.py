"""One formula per feature of a groove: what a point or an axis is nearest to. Compiled; used by every entry point.

Notation, in the groove's frame: material ``S = {y <= h, x^2 + y^2 >= R^2, |z| <= H}``, lips at ``(-s, h)`` (M) and
``(s, h)`` (N), where ``s = R sin(half_angle)`` and ``h = -R cos(half_angle)``; the axis is ``c + t d``, ``|d| = 1``,
``|t| <= half``.

Which features can hold the least distance of the axis from S: at an inner ``t`` the distance is stationary. Over the
inside of the arc surface it is ``R - rho(t)``, concave in t; over a flat or an end face it is linear. So neither has an
inner minimum (only a constant stretch, which reaches an end of the axis or an edge). What remains: the ends of the axis
against S, and the axis' inside against the edges (lips, end arcs, end edges) and the corners.

All numbers in the structures are floats, codes of features too: so each structure is one type to the compiler.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from clamp3d.kernel.jit import formula, inlined
from clamp3d.kernel.vector import Vector, dot, minus, plus

# Codes of the features; Feature in distance.py gives them names.
ARC, LIP_M, LIP_N, FLAT_M, FLAT_N, END_FACE, END_ARC, END_EDGE_M, END_EDGE_N, CORNER_M, CORNER_N = map(float, range(11))

CONVERGED = 1e-7
"""Last relative step of a quadratic iteration: the error left is of the order of its square."""

TINY = 1e-150
"""Below this the square of a length underflows, and with it the direction of the vector."""


class Groove(NamedTuple):
    """A groove: radius and half angle of its arc, the lips' place (s, h), half its length H."""

    R: float
    half_angle: float
    s: float
    h: float
    H: float


class Rod(NamedTuple):
    """A cylinder or capsule: its middle, unit axis d, ``e2 = dx^2 + dy^2``, radius, half the axis' length."""

    centre: Vector
    axis: Vector
    e2: float
    r: float
    half: float


class Candidate(NamedTuple):
    """A point of the groove that may be nearest: squared distance from the axis, place t there, feature, point."""

    d2: float
    t: float
    feature: float
    point: Vector


class EndCircle(NamedTuple):
    """The circle of an end arc, seen along the axis: an ellipse with the half axes R and R |dz|.

    ``z`` is its plane, (ex, ey) the direction of its minor axis, (p, v) the axis in parts of R along the major and
    the minor one, ``reach`` a lower bound on its distance from the axis.
    """

    z: float
    ex: float
    ey: float
    p: float
    v: float
    reach: float


@inlined
def groove_of(R: float, half_angle: float, H: float) -> Groove:
    """The groove of this radius, half angle and half length."""
    return Groove(R, half_angle, R * math.sin(half_angle), -R * math.cos(half_angle), H)


@inlined
def phi(g: float, e: float) -> float:
    """Signed distance from the quadrant g <= 0, e <= 0."""
    if g <= 0.0 and e <= 0.0:
        return max(g, e)
    g, e = max(g, 0.0), max(e, 0.0)
    return math.sqrt(g * g + e * e)


@inlined
def in_mouth(groove: Groove, x: float, y: float) -> bool:
    """Whether (x, y) on the arc's circle lies in the groove's mouth; of nearly full arcs the angle decides."""
    return y > groove.h or (groove.h > 0.0 and abs(x) * -groove.h + y * groove.s > 0.0)


@inlined
def is_behind_arc(groove: Groove, x: float, y: float) -> bool:
    """Whether (x, y), at most as high as the flats, is behind the arc; of nearly full arcs the angle decides."""
    return x * x + y * y >= groove.R * groove.R and (groove.h < 0.0 or abs(x) * -groove.h + y * groove.s <= 0.0)


@inlined
def section(groove: Groove, x: float, y: float) -> tuple[float, float]:
    """Signed gap of (x, y) to the groove's section, negative inside the material, and the nearest feature.

    Inside, the gap is the smaller of the depths below the flat faces and behind the arc: the lips are never nearer, in
    minor and in major arcs. In the mouth of a major arc y <= h and rho >= R exclude each other but for the rounding
    of h; there the angle decides (nearly full circles, whose mouth is wide by the root of that rounding).
    """
    R, s, h = groove.R, groove.s, groove.h
    ax = abs(x)
    rho = math.sqrt(x * x + y * y)
    within = ax * -h + y * s <= 0.0  # within the angle of the arc: rho R sin(phi - half_angle) <= 0
    if rho < R and within:
        return R - rho, ARC
    solid = y <= h and rho >= R and (within or h < 0.0)
    if solid and rho - R <= h - y:
        return R - rho, ARC
    if (y > h and ax >= s) or solid:
        return y - h, FLAT_N if x >= 0.0 else FLAT_M
    return math.sqrt((ax - s) * (ax - s) + (y - h) * (y - h)), LIP_N if x >= 0.0 else LIP_M


@inlined
def section_foot(groove: Groove, feature: float, x: float, y: float) -> tuple[float, float, float, float]:
    """Nearest point of a section feature to (x, y), and the unit normal that leads out of the material there."""
    R, h = groove.R, groove.h
    if feature == ARC:
        rho = math.sqrt(x * x + y * y)
        if rho < TINY:
            return 0.0, -R, 0.0, 1.0
        return x / rho * R, y / rho * R, -x / rho, -y / rho
    if feature in (FLAT_M, FLAT_N):
        return x, h, 0.0, 1.0
    sx = -groove.s if feature == LIP_M else groove.s
    gap = math.sqrt((x - sx) * (x - sx) + (y - h) * (y - h))
    if gap < TINY:
        return sx, h, -sx / R, -h / R
    return sx, h, (x - sx) / gap, (y - h) / gap


@inlined
def beyond_end(feature: float) -> float:
    """Feature of an end face that a section feature ends in."""
    if feature <= LIP_N:
        return END_ARC if feature < LIP_M else feature + (CORNER_M - LIP_M)
    return feature + (END_EDGE_M - FLAT_M)


@inlined
def face_normal(groove: Groove, feature: float, point: Vector) -> Vector:
    """Normal of the face on which a point of the groove is; zero for an edge."""
    if feature == ARC:
        return Vector(-point.x / groove.R, -point.y / groove.R, 0.0)
    if feature in (FLAT_M, FLAT_N):
        return Vector(0.0, 1.0, 0.0)
    return Vector(0.0, 0.0, math.copysign(1.0, point.z) if feature == END_FACE else 0.0)


@inlined
def axis_point(rod: Rod, t: float) -> Vector:
    """The point of the axis at t."""
    return plus(rod.centre, t, rod.axis)


@inlined
def on_axis_end(groove: Groove, rod: Rod, t: float, best: Candidate) -> Candidate:
    """The best so far, or the point of S that is nearest to the axis' end at t."""
    p = axis_point(rod, t)
    end = abs(p.z) - groove.H
    if end > 0.0 and end * end >= best.d2:
        return best
    gap, feature = section(groove, p.x, p.y)
    d2 = gap * gap
    # In the material by the rounding of z alone (an axis in the plane of an end face): it is on the face.
    if gap <= 0.0 and (end > 0.0 or end * end < d2):
        candidate = Candidate(end * end, t, END_FACE, Vector(p.x, p.y, math.copysign(groove.H, p.z)))
    else:
        x, y, _, _ = section_foot(groove, feature, p.x, p.y)
        z = p.z
        if end > 0.0:
            d2, z, feature = d2 + end * end, math.copysign(groove.H, z), beyond_end(feature)
        candidate = Candidate(d2, t, feature, Vector(x, y, z))
    return candidate if candidate.d2 < best.d2 else best


@inlined
def beside_line(wu: float, wv: float, du: float, dv: float, most: float) -> tuple[float, float]:
    """Squared distance of the axis from a line that it faces, and the place t there; infinite if not below ``most``.

    (wu, wv) leads from the line to the axis' middle and (du, dv) is its direction, both seen along the line.
    """
    cross = wu * dv - wv * du
    square = du * du + dv * dv
    if square <= TINY or cross * cross >= most * square:  # parallel: an end is as near; else the distance of the lines
        return math.inf, 0.0
    return cross * cross / square, -(wu * du + wv * dv) / square


@inlined
def on_lip(groove: Groove, rod: Rod, side: float, best: Candidate) -> Candidate:
    """The best so far, or the inside of the lip on a side (-1: M, 1: N) that the axis' inside faces."""
    c, d, sx = rod.centre, rod.axis, side * groove.s
    d2, t = beside_line(c.x - sx, c.y - groove.h, d.x, d.y, best.d2)
    z = c.z + t * d.z
    if d2 == math.inf or abs(t) > rod.half or abs(z) > groove.H:
        return best
    return Candidate(d2, t, LIP_M if side < 0.0 else LIP_N, Vector(sx, groove.h, z))


@inlined
def on_end_edge(groove: Groove, rod: Rod, ez: float, best: Candidate) -> Candidate:
    """The best so far, or a point of the edges {y = h, z = ez, |x| >= s} that the axis' inside faces."""
    c, d = rod.centre, rod.axis
    d2, t = beside_line(c.y - groove.h, c.z - ez, d.y, d.z, best.d2)
    x = c.x + t * d.x
    if d2 == math.inf or abs(t) > rod.half or abs(x) < groove.s:
        return best
    return Candidate(d2, t, END_EDGE_M if x < 0.0 else END_EDGE_N, Vector(x, groove.h, ez))


@inlined
def on_corner(groove: Groove, rod: Rod, side: float, ez: float, best: Candidate) -> tuple[Candidate, bool]:
    """The best so far, or a corner that the axis' inside faces; whether the distance falls into the end arc there."""
    corner = Vector(side * groove.s, groove.h, ez)
    m = minus(corner, rod.centre)
    t = dot(m, rod.axis)
    m = plus(m, -t, rod.axis)
    d2 = dot(m, m)
    falls = abs(corner.x) * m.y - side * corner.y * m.x > 0.0
    if abs(t) <= rod.half and d2 < best.d2:
        return Candidate(d2, t, CORNER_M if side < 0.0 else CORNER_N, corner), falls
    return best, falls


@inlined
def inverse_root(g: float) -> float:
    """``1 / sqrt(g)``, near 1 by its series, whose next term is below the rounding: without waiting for a root."""
    return 1.5 - 0.5 * g if abs(g - 1.0) <= 1e-8 else 1.0 / math.sqrt(g)


@inlined
def multiplier(k: float, a: float, q: float, start: float, least: float) -> float:
    """Root mu of (a / (k + mu))^2 + (q / mu)^2 = 1, from ``start`` on its side of 0, at least ``least``; NaN if none.

    1 / norm of the left side is concave in mu (a power mean of linear functions): for mu > 0 Newton's method on it is
    below the root after one step, climbs to it without passing it, and converges quadratically [Moré & Sorensen 1983].
    For mu < 0 it has a maximum, beyond which there is no root.
    """
    mu = start
    for _ in range(60):
        over = 1.0 / ((k + mu) * mu)
        u, v = mu * over, (k + mu) * over
        x2, y2 = (a * u) * (a * u), (q * v) * (q * v)
        g, slope = x2 + y2, x2 * u + y2 * v
        step = (math.sqrt(g) - 1.0) * g / slope
        mu = max(least, mu + step)
        if slope * start <= 0.0 or mu <= -k:
            return math.nan
        # What is left is at most 3/8 k^2 step^2 / (mu^2 (k + mu)): without k the left side's root is linear.
        if abs(step) * min(k, abs(mu)) <= CONVERGED * mu * mu:
            break
    return mu


@inlined
def stationary(k: float, a: float, q: float, side: float) -> tuple[float, float]:
    """Where the distance of a point from an ellipse has a local minimum: cosine and sine from its major axis.

    They are C = a / (k + mu), S = q / mu with C^2 + S^2 = 1. Only the root mu > 0 (the least distance) and the largest
    mu < 0 (a local minimum on the other side of the major axis) are minima; solving for them this way loses no digits
    where the quartic's roots run together. On the major axis within the evolute there are two mirrored minima. C is
    NaN where there is none. ``side``: 1 for the first, -1 for the other.
    """
    if abs(q) <= TINY and abs(a) <= k:
        C = a / k
        S = math.sqrt(max(0.0, 1.0 - C * C))
        return C, side * S
    if side > 0.0:
        low = max(abs(q), math.sqrt(a * a + q * q) - k)
        mu = multiplier(k, a, q, low, low)
    else:
        mu = multiplier(k, a, q, -abs(q), -k) if max(abs(a), abs(q)) < k else math.nan
    both = 1.0 / ((k + mu) * mu)
    C, S = a * (mu * both), q * ((k + mu) * both)
    g = C * C + S * S
    n = inverse_root(g)
    return C * n, S * n


@inlined
def end_circle(groove: Groove, rod: Rod, ez: float) -> EndCircle:
    """The circle of the end arc in the plane z = ez, seen along the axis."""
    R, e, c, d = groove.R, math.sqrt(rod.e2), rod.centre, rod.axis
    over = 1.0 / e
    ex, ey = d.x * over, d.y * over
    p = (c.y * ex - c.x * ey) * (1.0 / R)
    v = (-d.z * (c.x * ex + c.y * ey) - e * (ez - c.z)) * (1.0 / R)
    if d.z > 0.0:
        v = -v
    # The ellipse lies outside (for a point inside it) or inside (outside) its scaled copy through the point.
    reach = R * abs(abs(d.z) - math.sqrt(d.z * d.z * p * p + v * v))
    return EndCircle(ez, ex, ey, p, v, reach)


@inlined
def circle_point(groove: Groove, rod: Rod, circle: EndCircle, side: float) -> Candidate:
    """A local minimum of the distance from an end arc's circle, ``side`` as in `stationary`.

    It is infinite if the axis' inside does not face the arc.
    """
    C, S = stationary(rod.e2, circle.p, abs(rod.axis.z) * circle.v, side)
    q = Vector(groove.R * (S * circle.ex - C * circle.ey), groove.R * (S * circle.ey + C * circle.ex), circle.z)
    t = dot(minus(q, rod.centre), rod.axis)
    du = groove.R * (C - circle.p)
    dv = groove.R * (abs(rod.axis.z) * S - circle.v)
    is_faced = abs(t) <= rod.half and not in_mouth(groove, q.x, q.y)
    return Candidate(du * du + dv * dv if is_faced else math.inf, t, END_ARC, q)


@inlined
def on_end_arc(groove: Groove, rod: Rod, circle: EndCircle, best: Candidate) -> Candidate:
    """The best so far, or the point of an end arc that is nearest to the axis' inside.

    The distance of the axis, a point, from the ellipse at angle phi is a trigonometric polynomial of degree two in phi,
    its stationary points a quartic, of which two can be minima.
    """
    if circle.reach * circle.reach >= best.d2:
        return best
    point = circle_point(groove, rod, circle, 1.0)
    if point.d2 == math.inf and abs(circle.p) + abs(rod.axis.z * circle.v) < rod.e2:
        point = circle_point(groove, rod, circle, -1.0)
    return point if point.d2 < best.d2 else best


@inlined
def clip(groove: Groove, rod: Rod, half: float) -> tuple[float, float]:
    """Part lo <= t <= hi of the axis, |t| <= half, in the block {y <= h, |z| <= H}; lo > hi if there is none."""
    c, d = rod.centre, rod.axis
    over = 1.0 / (d.z if abs(d.z) > TINY else TINY)
    bottom, top = (-groove.H - c.z) * over, (groove.H - c.z) * over
    lo, hi = max(-half, min(bottom, top)), min(half, max(bottom, top))
    level = (groove.h - c.y) / d.y
    hi = min(hi, level) if d.y > 0.0 else hi
    lo = max(lo, level) if d.y < 0.0 else lo
    none = (d.y == 0.0 and c.y > groove.h) or (abs(d.z) <= TINY and abs(c.z) > groove.H)
    return lo, -math.inf if none else hi


@formula
def depth_of(groove: Groove, point: Vector) -> tuple[float, float]:
    """Distance of a point of S from the boundary of S, and the feature that is nearest; negative outside S."""
    gap, feature = section(groove, point.x, point.y)
    end = groove.H - abs(point.z)
    return (end, END_FACE) if end < -gap else (-gap, feature)


@formula
def arc_crossing(groove: Groove, rod: Rod, depth: float, rate: float, is_first: bool) -> float:
    """One of the two places where the axis is as deep behind the arc, rho - R, as ``depth + rate t``; NaN if none."""
    c, d = rod.centre, rod.axis
    n = groove.R + depth  # (n + rate t)^2 = (cx + dx t)^2 + (cy + dy t)^2
    A = rod.e2 - rate * rate
    B = c.x * d.x + c.y * d.y - n * rate
    C = c.x * c.x + c.y * c.y - n * n
    square = B * B - A * C
    if square < 0.0:
        return math.nan
    w = -B - math.copysign(math.sqrt(square), B)
    t = w / A if is_first else C / w
    for _ in range(2):  # the quadratic squares its terms: Newton's steps on the unsquared equation restore them
        p = axis_point(rod, t)
        rho = math.sqrt(p.x * p.x + p.y * p.y)
        slope = (p.x * d.x + p.y * d.y) / rho - rate
        if rho > 0.0 and slope != 0.0:
            t -= (rho - groove.R - (depth + rate * t)) / slope
    return t


@formula
def deeper(groove: Groove, rod: Rod, lo: float, hi: float, t: float, best: float) -> float:
    """The place t on the axis if it is one of lo <= t <= hi and deeper in S than ``best``, else that."""
    is_deeper = lo <= t <= hi and depth_of(groove, axis_point(rod, t))[0] > depth_of(groove, axis_point(rod, best))[0]
    return t if is_deeper else best


@formula
def deepest(groove: Groove, rod: Rod, lo: float, hi: float) -> float:
    """Place lo <= t <= hi of the deepest axis point in S.

    The depth is the smallest of a convex function (rho - R) and three linear ones, so its maximum is at an end, where
    two linear ones cross, or where rho - R crosses a linear one (a quadratic).
    """
    best = deeper(groove, rod, lo, hi, hi, lo)
    c, d = rod.centre, rod.axis
    # Depth of the axis' middle below the flats, the top and the bottom, and its rate along the axis.
    planes = ((groove.h - c.y, -d.y), (groove.H - c.z, -d.z), (groove.H + c.z, d.z))
    for k in range(3):
        depth, rate = planes[k]
        other, other_rate = planes[(k + 1) % 3]
        best = deeper(groove, rod, lo, hi, (depth - other) / (other_rate - rate), best)
        for root in range(2):
            best = deeper(groove, rod, lo, hi, arc_crossing(groove, rod, depth, rate, root == 0), best)
    return best
