"""Table 2 of the paper: the bolt hole of a splint against the bolt, two rectangles in the section (Eq. 2, Fig. 4).

Section frame: x right, y down, angles counter-clockwise as seen. The rectangles' own axes: width across the bolt,
height along it. Sides and corners are seen from the bolt: "left" is the bolt's left side against the hole's left wall.

What the paper leaves open, and what holds here:

- Its inequalities put the corners of B outside the sides of A (``B_p1x < A_H1x``), so B is the hole, which tilts with
  the splint, and A the bolt. Both may be turned here; only the angle between them counts.
- It compares the hole's corners with the bolt's side lines, as if the bolt had no ends. Here the bolt's own corners
  count where the bolt ends within the hole; a bolt that is not in the hole at all does not meet it (gaps infinite).
- Its rows 2 and 3 ask for equalities of some corners and nothing of the others, so they also fit a bolt that is driven
  into the other wall. Here all the others must be clear; penetration is a row of its own, overlap.
- The row of two points on different sides is lost in print; it is contact on both sides. A bolt that fills an upright
  hole touches at four points; it counts here, as it can move to neither side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from clamp3d.checks import instance, number
from clamp3d.errors import InputError
from clamp3d.geometry.primitives import place, size

_EPS = 2.0**-52

Point: TypeAlias = tuple[float, float]


class HoleRelation(StrEnum):
    """The rows of Table 2, and overlap, which the paper leaves out."""

    NONE = "none"
    ONE_POINT = "one point"
    TWO_POINTS_ONE_SIDE = "two points on one side"
    TWO_POINTS_TWO_SIDES = "two points on different sides"
    OVERLAP = "overlap"


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle in the section (Eq. 2).

    Attributes
    ----------
    x, y : float
        Centre, mm.
    half_width, half_height : float
        Half extents across and along, > 0 mm.
    angle : float
        Orientation, rad.
    """

    x: float
    y: float
    half_width: float
    half_height: float
    angle: float = 0.0

    def __post_init__(self) -> None:
        rules = {"x": place, "y": place, "half_width": size, "half_height": size, "angle": number}
        for name, rule in rules.items():
            object.__setattr__(self, name, rule(f"rectangle {name}", getattr(self, name)))

    def point(self, u: float, v: float) -> Point:
        """Section coordinates of the rectangle's own point, ``u`` right and ``v`` down of its centre."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return self.x + u * c + v * s, self.y - u * s + v * c

    def axis(self, sign: float) -> Point:
        """Direction (x, y) of the rectangle's width axis, or its opposite for ``sign`` -1."""
        return sign * math.cos(self.angle), -sign * math.sin(self.angle)


@dataclass(frozen=True, slots=True)
class HoleContact:
    """A hole against its bolt.

    Attributes
    ----------
    relation : HoleRelation
        Row of Table 2.
    gap_left, gap_right : float
        Least signed gap on either side in mm, positive apart, taken square to the flat that is met: the bolt's side
        for a corner of the hole, the hole's wall for a corner of the bolt, or its end for one beyond it. Infinite for a
        bolt outside the hole.
    points : tuple of (float, float)
        The points (x, y) that touch.
    point, normal : (float, float)
        The hole's point where the lesser gap is (for a bolt outside the hole the middle of a wall), and the unit
        vector from hole to bolt there: the bolt's point is ``point + gap * normal``.
    tolerance : float
        The one applied, mm.
    """

    relation: HoleRelation
    gap_left: float
    gap_right: float
    points: tuple[Point, ...]
    point: Point
    normal: Point
    tolerance: float


@dataclass(frozen=True, slots=True)
class _Facing:
    """One end of the stretch that a wall and a side of the bolt share: its gap, the hole's point and the normal."""

    gap: float
    point: Point
    normal: Point


def hole_bolt(hole: Rectangle, bolt: Rectangle, *, tolerance: float) -> HoleContact:
    """Relation of a hole and the bolt in it (Table 2).

    Parameters
    ----------
    hole, bolt : Rectangle
        Turned by less than a right angle to each other.
    tolerance : float
        Gaps up to this are contact, mm, >= 0; one below the rounding of the sizes is raised to it.

    Raises
    ------
    InputError
        For values out of range.

    Examples
    --------
    >>> contact = hole_bolt(Rectangle(1.0, 0.0, 11.0, 15.0), Rectangle(0.0, 0.0, 10.0, 80.0), tolerance=1e-9)
    >>> contact.relation.value, contact.gap_left, contact.gap_right
    ('two points on one side', 0.0, 2.0)
    """
    instance("hole", hole, Rectangle)
    instance("bolt", bolt, Rectangle)
    tolerance = number("tolerance", tolerance, rule="be finite and >= 0 mm")
    turn = math.remainder(hole.angle - bolt.angle, 2.0 * math.pi)
    if not abs(turn) < 0.5 * math.pi:
        raise InputError(f"hole and bolt must be turned by less than 90 deg, got {math.degrees(turn):.4g} deg")
    if not tolerance >= 0.0:
        raise InputError(f"tolerance must be finite and >= 0 mm, got {tolerance}")
    sizes = hole.half_width + hole.half_height + bolt.half_width + bolt.half_height
    offset = abs(hole.x - bolt.x) + abs(hole.y - bolt.y)
    tolerance = max(tolerance, 4.0 * _EPS * (sizes + offset))
    sides = [_side(hole, bolt, turn, side) for side in (-1, 1)]
    gaps = [min((end.gap for end in side), default=math.inf) for side in sides]
    touching = [[end.point for end in side if abs(end.gap) <= tolerance] for side in sides]
    wall = _Facing(math.inf, hole.point(-hole.half_width, 0.0), hole.axis(1.0))
    least = min((end for side in sides for end in side), key=lambda end: end.gap, default=wall)
    if min(gaps) < -tolerance:
        relation = HoleRelation.OVERLAP
    elif touching[0] and touching[1]:
        relation = HoleRelation.TWO_POINTS_TWO_SIDES
    elif len(touching[0]) + len(touching[1]) == 2:
        relation = HoleRelation.TWO_POINTS_ONE_SIDE
    else:
        relation = HoleRelation.ONE_POINT if touching[0] or touching[1] else HoleRelation.NONE
    points = tuple(touching[0] + touching[1])
    return HoleContact(relation, gaps[0], gaps[1], points, least.point, least.normal, tolerance)


def _side(hole: Rectangle, bolt: Rectangle, turn: float, side: int) -> list[_Facing]:
    """Both ends of the stretch that wall and side share; side -1 left, +1 right.

    The gap is linear along that stretch, so its least value is at one of the two.
    """
    c, s = math.cos(turn), math.sin(turn)
    dx, dy = hole.x - bolt.x, hole.y - bolt.y
    cb, sb = math.cos(bolt.angle), math.sin(bolt.angle)
    cx, cy = dx * cb - dy * sb, dx * sb + dy * cb  # hole's centre in the bolt's own axes
    wall = [cy - side * hole.half_width * s + v * c for v in (-hole.half_height, hole.half_height)]  # rising: c > 0
    top, bottom = max(wall[0], -bolt.half_height), min(wall[1], bolt.half_height)
    if top > bottom:
        return []
    # Half widths first; W (1 - cos turn) = 2 W sin^2(turn / 2) keeps small turns exact.
    level = (hole.half_width - bolt.half_width) + side * cx - 2.0 * hole.half_width * math.sin(0.5 * turn) ** 2
    ends = []
    for height, at_corner, v in ((top, wall[0], -hole.half_height), (bottom, wall[1], hole.half_height)):
        if height == at_corner:  # the hole's corner faces the bolt's side
            ends.append(_Facing(level + side * v * s, hole.point(side * hole.half_width, v), bolt.axis(-side)))
        else:  # the bolt's corner faces the hole's wall
            along = (height - cy + side * hole.half_width * s) / c
            gap, (nx, ny) = (level + side * along * s) * c, hole.axis(-side)
            x, y = bolt.point(side * bolt.half_width, height)
            foot = (x - hole.x) * math.sin(hole.angle) + (y - hole.y) * math.cos(hole.angle)
            if gap > 0.0 and abs(foot) > hole.half_height:  # it is beyond the wall's end: that is nearest
                end = hole.point(side * hole.half_width, math.copysign(hole.half_height, foot))
                gap = math.dist(end, (x, y))
                nx, ny = (x - end[0]) / gap, (y - end[1]) / gap
            ends.append(_Facing(gap, (x - gap * nx, y - gap * ny), (nx, ny)))
    return ends
