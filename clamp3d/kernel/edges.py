"""Least signed distance of a flat-ended cylinder's points along an edge of a groove: a line, or an end arc.

A cylinder with flat ends is convex, so its signed distance ``f(q) = phi(w - r, |t| - half)`` is a convex function of
the point q: w is q's distance from the axis, t its place along it, phi the signed distance from a quadrant. Outside f
is the distance, inside it is minus the depth. Along a line it has one minimum. Along an arc it may have several:
stretches of the arc are halved until each is proven to hold nothing lower, or exactly one minimum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from clamp3d.kernel.features import Groove, Rod, phi
from clamp3d.kernel.jit import formula, inlined
from clamp3d.kernel.vector import Vector, cross, dot, length, plus

STRETCHES = 400
"""Stretches of an arc that are looked at; then the search ends with a wider bound, which it tells."""

# What `root` solves, with w and t as above, g = w - r, e = |t| - half:
RIM, SIDE, RIDGE, MIDDLE = map(float, range(4))  # numba would compile `root` once for each integer
"""The least distance from the rim, from the axis; where g = e; where t = 0."""


class Edge(NamedTuple):
    """A line ``foot + p direction``, or the arc of radius R about ``foot``, p from its deepest point; of a line R is 0.

    The foot is given from the axis' point at ``off``: of a line the cylinder's middle, of an arc the one next to it.
    """

    foot: Vector
    direction: Vector
    R: float
    off: float


class Course(NamedTuple):
    """w and t at a point of an edge, with their first and second rates along it."""

    w: float
    t: float
    w1: float
    t1: float
    w2: float
    t2: float


class Stretch(NamedTuple):
    """What bounds f on a stretch of an arc about a point: ranges of g and e, and the largest rates of w.

    ``by``, ``bend`` and ``third`` bound the first three derivatives of w by the angle, ``tilt`` all those of t.
    """

    half: float
    g: float
    e: float
    g_low: float
    e_low: float
    g_high: float
    e_high: float
    by: float
    bend: float
    third: float
    tilt: float


class Place(NamedTuple):
    """Least f on an edge, where it is, and a lower bound of f where the search ended early (else infinite)."""

    f: float
    p: float
    left: float


@inlined
def cylinder_distance(rod: Rod, w: float, t: float) -> float:
    """Signed distance f of a point from the cylinder by its distance from the axis and its place along it."""
    return phi(w - rod.r, abs(t) - rod.half)


@inlined
def from_axis(rod: Rod, point: Vector) -> tuple[float, float]:
    """Distance of a point, given from the cylinder's middle, from its axis, and its place along it."""
    t = dot(point, rod.axis)
    return length(plus(point, -t, rod.axis)), t


@formula
def course_at(edge: Edge, rod: Rod, p: float) -> Course:
    """w and t at a place of an edge; on the axis w has no rates, and 0 stands for them."""
    point, first, second, square = plus(edge.foot, p, edge.direction), edge.direction, Vector(0.0, 0.0, 0.0), 1.0
    if edge.R > 0.0:
        sine, cosine, square = edge.R * math.sin(p), edge.R * math.cos(p), edge.R * edge.R
        first, second = Vector(cosine, sine, 0.0), Vector(-sine, cosine, 0.0)
        point = plus(edge.foot, 1.0, Vector(sine, -cosine, 0.0))
    t, t1, t2 = dot(point, rod.axis), dot(first, rod.axis), dot(second, rod.axis)
    across = plus(point, -t, rod.axis)
    w = length(across)
    if w == 0.0:
        return Course(0.0, t + edge.off, 0.0, t1, 0.0, t2)
    w1 = dot(across, first) / w
    return Course(w, t + edge.off, w1, t1, (square - t1 * t1 + dot(across, second) - w1 * w1) / w, t2)


@inlined
def equation(kind: float, rod: Rod, course: Course, side: float) -> tuple[float, float]:
    """Left side of what `root` solves and its slope; ``side`` is the sign of t."""
    w1, w2, e1, e2 = course.w1, course.w2, side * course.t1, side * course.t2
    g, e = course.w - rod.r, side * course.t - rod.half
    if kind == RIM:
        bend = (w1 * w1 + g * w2 if g > 0.0 else 0.0) + (e1 * e1 + e * e2 if e > 0.0 else 0.0)
        return max(g, 0.0) * w1 + max(e, 0.0) * e1, bend
    if kind == SIDE:
        return w1, w2
    if kind == RIDGE:
        return g - e, w1 - e1
    return course.t, course.t1


@formula
def root(edge: Edge, rod: Rod, kind: float, lo: float, hi: float, start: float) -> float:
    """Root of a monotone function on lo <= p <= hi, or the end beyond which it lies: Newton's steps, else halving."""
    size = 1.0 if edge.R > 0.0 else length(edge.foot)  # of the angles or lengths that p is reckoned from
    p = start
    side = 1.0 if course_at(edge, rod, p).t >= 0.0 else -1.0
    for k in range(60):
        value, slope = equation(kind, rod, course_at(edge, rod, p), side)
        if value == 0.0:
            break
        if (value > 0.0) == (kind < RIDGE or slope > 0.0):
            hi = p
        else:
            lo = p
        if k == 0:  # the end that it leads to is tried first: often the root is beyond it
            end = lo if hi == p else hi
            if (equation(kind, rod, course_at(edge, rod, end), side)[0] > 0.0) == (value > 0.0):
                return end
        step = value / slope if slope != 0.0 else math.inf
        if abs(step) <= 1e-16 * (abs(p) + size):
            break
        new = p - step
        if not lo < new < hi:
            new = 0.5 * (lo + hi)
        if new == p:
            break
        p = new
    return p


@inlined
def improved(best: Place, edge: Edge, rod: Rod, p: float) -> Place:
    """The best so far, or a place of an edge."""
    course = course_at(edge, rod, p)
    f = cylinder_distance(rod, course.w, course.t)
    return Place(f, p, best.left) if f < best.f else best


@formula
def on_line(rod: Rod, line: Edge, lowest: float, highest: float, limit: float) -> Place:
    """Least f on a line, lowest <= p <= highest, whose foot is square to it.

    What cannot be below ``limit`` is not looked for: then the value is infinite.
    Between the point nearest to the axis and the one nearest to the middle plane w and |t| go opposite ways.
    """
    along, normal = dot(line.direction, rod.axis), cross(line.direction, rod.axis)
    t0, across2 = dot(line.foot, rod.axis), dot(normal, normal)
    b = min(max(-t0 / along, lowest), highest) if along != 0.0 else math.inf
    a = min(max(along * t0 / across2, lowest), highest) if across2 > 0.0 else b
    b = a if along == 0.0 else b
    at_a, at_b = course_at(line, rod, a), course_at(line, rod, b)
    ga, ea = at_a.w - rod.r, abs(at_a.t) - rod.half
    gb, eb = at_b.w - rod.r, abs(at_b.t) - rod.half
    if ea <= min(ga, 0.0) or a == b:
        return Place(phi(ga, ea), a, math.inf)
    if phi(ga, eb) > limit:
        return Place(math.inf, a, math.inf)
    if gb <= min(eb, 0.0):
        return Place(eb, b, math.inf)
    best = Place(phi(ga, ea), a, math.inf) if phi(ga, ea) <= phi(gb, eb) else Place(phi(gb, eb), b, math.inf)
    lo, hi, middle = min(a, b), max(a, b), 0.5 * (a + b)
    if ga <= ea and gb >= eb:  # where side and end are equally far, which is the least inside
        p = root(line, rod, RIDGE, lo, hi, middle)
        best = improved(best, line, rod, p)
        if best.f <= 0.0:
            return best
    # The rim from outside: from just beyond the end on, where it begins to pull against the side.
    side = 1.0 if course_at(line, rod, middle).t >= 0.0 else -1.0
    near = (side * rod.half * (1.0 + 1e-6) - t0) / along if along != 0.0 else middle
    start = near if lo < near < hi else middle
    p = root(line, rod, RIM, lo, hi, start)
    return improved(best, line, rod, p)


@inlined
def fall(slope: float, bend: float, third: float, reach: float) -> float:
    """By how much a function with this slope, second and largest third derivative falls within ``reach`` at most."""
    a = abs(slope)
    drop = third * reach * reach * reach / 6.0
    if bend > 0.0 and a < bend * reach:
        return drop + 0.5 * a * a / bend
    return drop + a * reach - 0.5 * bend * reach * reach


@inlined
def stretch_about(arc: Edge, rod: Rod, course: Course, half: float) -> Stretch:
    """The ranges on a stretch of an arc that reaches ``half`` rad to both sides."""
    tilt = arc.R * math.sqrt(rod.e2)
    # Largest derivatives of w^2 by the angle; t is at most ``tilt`` from off.
    slope = 2.0 * arc.R * math.sqrt(arc.foot.x * arc.foot.x + arc.foot.y * arc.foot.y)
    first, second, third = slope + tilt * tilt, slope + 2.0 * tilt * tilt, slope + 4.0 * tilt * tilt
    g, e = course.w - rod.r, abs(course.t) - rod.half
    low = max(math.sqrt(max(course.w * course.w - first * half, 0.0)), course.w - arc.R * half)  # the least w
    by = arc.R if low <= 0.0 else min(arc.R, 0.5 * first / low)
    bend = (0.5 * second + by * by) / low if low > 0.0 else math.inf
    third = (0.5 * third + 3.0 * by * bend) / low if low > 0.0 else math.inf
    g_low, e_low = max(g - by * half, -rod.r), max(e - tilt * half, -rod.half)
    return Stretch(half, g, e, g_low, e_low, g + by * half, e + tilt * half, by, bend, third, tilt)


@inlined
def bound_by_mixture(stretch: Stretch, course: Course, f: float) -> float:
    """Lower bound of f on a stretch.

    Lemma: f is at least g, at least e, and at least every mixture ``u g + v e`` with u^2 + v^2 = 1 (outside) or
    u + v = 1, u and v not negative. Each of these is at least its Taylor polynomial less the largest remainder.
    """
    s, side = stretch, 1.0 if course.t >= 0.0 else -1.0
    w1, w2, e1, e2 = course.w1, course.w2, side * course.t1, side * course.t2
    bound = max(s.g - fall(w1, w2, s.third, s.half), s.e - fall(e1, e2, s.tilt, s.half))
    if f > 0.0:
        u, v = max(s.g, 0.0) / f, max(s.e, 0.0) / f
    elif (w1 > 0.0) != (e1 > 0.0):
        u, v = e1 / (e1 - w1), w1 / (w1 - e1)
    else:
        return bound
    drop = fall(u * w1 + v * e1, u * w2 + v * e2, u * s.third + v * s.tilt, s.half)
    return max(bound, u * s.g + v * s.e - drop)


@inlined
def one_minimum(stretch: Stretch, course: Course, rim_third: float) -> tuple[float, float]:
    """What to solve for the one minimum of a stretch (-1: not known), and the slope if f is monotone (else 0)."""
    s, side = stretch, 1.0 if course.t >= 0.0 else -1.0
    w1, w2, e1, e2 = course.w1, course.w2, side * course.t1, side * course.t2
    if s.g_low > 0.0 and s.e_low > 0.0:  # all of it beyond the rim
        slope = s.g * w1 + s.e * e1
        bend = w1 * w1 + s.g * w2 + e1 * e1 + s.e * e2
        if rim_third * s.half < bend:
            return RIM, 0.0
        return -1.0, slope if abs(slope) > (abs(bend) + 0.5 * rim_third * s.half) * s.half else 0.0
    if s.e_high <= min(s.g_low, 0.0):  # all of it beside the side
        if w2 > s.third * s.half:
            return SIDE, 0.0
        return -1.0, w1 if abs(w1) > s.bend * s.half else 0.0
    is_split = abs(course.t) <= s.tilt * s.half  # the sign of t may change
    if not is_split and abs(w1) > s.bend * s.half and abs(e1) > s.tilt * s.half:
        return (-1.0, w1) if (w1 > 0.0) == (e1 > 0.0) else (RIDGE, 0.0)
    return -1.0, 0.0


@inlined
def end_arc_of(groove: Groove, rod: Rod, ez: float) -> Edge:
    """The arc of the end in the plane z = ez."""
    out = Vector(-rod.centre.x, -rod.centre.y, ez - rod.centre.z)
    off = dot(out, rod.axis)
    return Edge(plus(out, -off, rod.axis), Vector(0.0, 0.0, 0.0), groove.R, off)


@formula
def settled(
    arc: Edge, rod: Rod, middle: float, course: Course, stretch: Stretch, best: Place, eps: float
) -> tuple[Place, float]:
    """The best so far or that of a stretch, and a lower bound of what may be lower in it (infinite if nothing is)."""
    s = stretch
    f = phi(s.g, s.e)
    bound = bound_by_mixture(s, course, f)
    if bound >= best.f - eps:
        return best, math.inf
    lo, hi = middle - s.half, middle + s.half
    if f < 0.0 and abs(course.t) <= s.tilt * s.half < abs(course.t1):
        best = improved(best, arc, rod, root(arc, rod, MIDDLE, lo, hi, middle))
    # Third derivative of half the squared distance from the rim; that of the cylinder's middle bounds it too.
    rim_third = 3.0 * s.by * s.bend + s.g_high * s.third + 3.0 * s.tilt * s.tilt + s.e_high * s.tilt
    from_middle = arc.R * math.sqrt(rod.centre.x * rod.centre.x + rod.centre.y * rod.centre.y)
    rim_third = min(rim_third, from_middle + rod.r * s.third + rod.half * s.tilt)
    kind, slope = one_minimum(s, course, rim_third)
    if slope != 0.0:
        return improved(best, arc, rod, lo if slope > 0.0 else hi), math.inf
    if kind < 0.0:
        return best, bound
    angle = root(arc, rod, kind, lo, hi, middle)
    end = course_at(arc, rod, angle)
    if kind == RIDGE and cylinder_distance(rod, end.w, end.t) > 0.0:
        return best, bound
    return improved(best, arc, rod, angle), math.inf


@formula
def on_arc(groove: Groove, rod: Rod, ez: float, limit: float, eps: float) -> Place:
    """Least f on the end arc z = ez, and its angle from the deepest point; infinite if none is below ``limit``."""
    arc = end_arc_of(groove, rod, ez)
    best = Place(limit, math.nan, math.inf)
    middles, halves = np.empty(64), np.empty(64)  # of the stretches that are left
    top = 4
    for i in range(top):
        halves[i] = groove.half_angle / top
        middles[i] = halves[i] * (2.0 * i + 1.0 - top)
    looked = 0
    while top > 0:
        top -= 1
        looked += 1
        middle, half = middles[top], halves[top]
        course = course_at(arc, rod, middle)
        f = cylinder_distance(rod, course.w, course.t)
        if f < best.f:
            best = Place(f, middle, best.left)
        stretch = stretch_about(arc, rod, course, half)
        bound = max(f - groove.R * half, phi(stretch.g_low, stretch.e_low))
        if bound >= best.f - eps:
            continue
        if stretch.bend < math.inf:
            best, mixed = settled(arc, rod, middle, course, stretch, best, eps)
            if mixed == math.inf:
                continue
            bound = max(bound, mixed)
        if looked >= STRETCHES or half <= 1e-13:
            best = Place(best.f, best.p, min(best.left, bound))
            continue
        half *= 0.5
        # The end that it falls to is looked at first.
        e1 = course.t1 if course.t >= 0.0 else -course.t1
        slope = stretch.g * course.w1 + stretch.e * e1 if f > 0.0 else (course.w1 if stretch.g > stretch.e else e1)
        ahead = half if slope > 0.0 else -half
        middles[top], middles[top + 1] = middle + ahead, middle - ahead
        halves[top], halves[top + 1] = half, half
        top += 2
    return best if not math.isnan(best.p) else Place(math.inf, 0.0, best.left)
