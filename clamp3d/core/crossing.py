"""Where an outline of segments and arcs crosses itself: in closed form, edge by edge."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from clamp3d.core.profile import Arc, Edge, Point

_NEAR = 1e-7
"""Edges that meet so near (mm) to an end of one of them, or at so small an angle (rad), touch and do not cross."""


def first_crossing(edges: tuple[Edge, ...]) -> tuple[int, int, Point] | None:
    """The first two edges that cross, and where (a, b) in mm; None if there are none.

    Edges that touch, run along each other or meet at an end do not cross.

    Examples
    --------
    >>> from clamp3d.core.profile import Segment
    >>> first_crossing((Segment((0.0, 0.0), (2.0, 2.0)), Segment((2.0, 0.0), (0.0, 2.0))))
    (0, 1, (1.0, 1.0))
    """
    boxes = [_box(edge) for edge in edges]
    for (i, one), (j, other) in itertools.combinations(enumerate(edges), 2):
        if any(boxes[i][k] > boxes[j][k + 2] or boxes[j][k] > boxes[i][k + 2] for k in range(2)):
            continue
        for point in _common(one, other):
            first, second = _slope(one, point), _slope(other, point)
            if first is None or second is None:
                continue
            if abs(first[0] * second[1] - first[1] * second[0]) > _NEAR:
                return i, j, point
    return None


def turning(edges: tuple[Edge, ...]) -> float:
    """Angle in rad by which an outline turns in one round: 2 pi if it does not cross itself, NaN with a cusp.

    Examples
    --------
    >>> from clamp3d.core.profile import Profile
    >>> round(turning(Profile.rectangle(2.0, 1.0).edges) / math.pi, 12)
    2.0
    """
    total = 0.0
    for i, edge in enumerate(edges):
        (a, b), (c, d) = _direction(edges[i - 1], edges[i - 1].end), _direction(edge, edge.start)
        angle = math.atan2(a * d - b * c, a * c + b * d)
        total += (edge.sweep if isinstance(edge, Arc) else 0.0) + angle
        if abs(angle) > math.pi - _NEAR:
            return math.nan
    return total


def _box(edge: Edge) -> tuple[float, float, float, float]:
    if isinstance(edge, Arc):
        (a, b), r = edge.centre, edge.radius
        return a - r, b - r, a + r, b + r
    (a, b), (c, d) = edge.start, edge.end
    return min(a, c), min(b, d), max(a, c), max(b, d)


def _direction(edge: Edge, point: Point) -> Point:
    """Unit vector along an edge at one of its points."""
    if isinstance(edge, Arc):
        turn = math.copysign(1.0, edge.sweep) / edge.radius
        return turn * (edge.centre[1] - point[1]), turn * (point[0] - edge.centre[0])
    length = math.dist(edge.start, edge.end)
    return (edge.end[0] - edge.start[0]) / length, (edge.end[1] - edge.start[1]) / length


def _slope(edge: Edge, point: Point) -> Point | None:
    """Unit vector along an edge at a point of its line or circle; None if that is not well between its ends."""
    if min(math.dist(edge.start, point), math.dist(edge.end, point)) <= _NEAR:
        return None
    along = _direction(edge, point)
    if isinstance(edge, Arc):
        angle, low = math.atan2(point[1] - edge.centre[1], point[0] - edge.centre[0]), edge.start_angle
        passed = (angle - low) % (2.0 * math.pi) if edge.sweep > 0.0 else (low - angle) % (2.0 * math.pi)
        return along if passed < abs(edge.sweep) else None
    ends = (edge.start, 1.0), (edge.end, -1.0)
    inside = all(s * ((point[0] - p[0]) * along[0] + (point[1] - p[1]) * along[1]) > 0.0 for p, s in ends)
    return along if inside else None


def _common(one: Edge, other: Edge) -> Iterator[Point]:
    """Common points of the lines or circles that two edges lie on, but of parallel lines."""
    if not isinstance(one, Arc):
        if isinstance(other, Arc):
            one, other = other, one
        else:
            (a, b), (c, d) = _direction(one, one.start), _direction(other, other.start)
            cross = a * d - b * c
            if cross != 0.0:
                x, y = other.start[0] - one.start[0], other.start[1] - one.start[1]
                t = (x * d - y * c) / cross
                yield one.start[0] + t * a, one.start[1] + t * b
            return
    (a, b), r = one.centre, one.radius
    # All that is common lies on a line: the other edge, or that through the common points of two circles.
    if isinstance(other, Arc):
        x, y = other.centre[0] - a, other.centre[1] - b
        apart = math.hypot(x, y)
        if apart == 0.0:
            return
        t, across = 0.5 * (apart + (r - other.radius) * (r + other.radius) / apart), (-y / apart, x / apart)
        foot = a + t * x / apart, b + t * y / apart
    else:
        across = _direction(other, other.start)
        t = (a - other.start[0]) * across[0] + (b - other.start[1]) * across[1]
        foot = other.start[0] + t * across[0], other.start[1] + t * across[1]
    square = r * r - math.dist(foot, (a, b)) ** 2
    if square > 0.0:
        for s in (-math.sqrt(square), math.sqrt(square)):
            yield foot[0] + s * across[0], foot[1] + s * across[1]
