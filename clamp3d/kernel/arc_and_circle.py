"""Table 3 of the paper: an arc against a small circle, both in one plane (Eq. 3-7, end points by Fig. 6).

Frame of the arc: centre at the origin, deepest point at -y, end points M (x < 0) and N (x > 0), so that the arc spans
``+-half_angle`` about -y; minor and major arcs alike. The arc is a curve here, as in the paper; the circle is a disk.

What the paper leaves open, and what holds here:

- Eq. 3 calls a circle inside if it has a point in common with the region between arc and chord MN, which an
  intersecting one has too. So intersection and contact (Eq. 5-7) are decided first; Eq. 3 and 4 then split the rest:
  a circle that reaches through the chord without touching the arc is inside.
- Eq. 7 with ``|r_o - r_MN|`` also fits a larger circle that holds the arc in itself. There other points of the arc are
  nearer than r_o: that is an intersection. A circle that is not small can touch at M and N only.
- "Only one cross point": a thick circle resting on M and N at once is a contact; both points are given.
- The point R of Fig. 6 belongs to both of its arcs; it counts as exterior. The construction at N is the mirror image.
- A coaxial circle of the arc's own radius touches all of it: interior contact, its point the deepest one.
- Equality is ``|gap| <= tolerance``, the caller's. A tolerance below the rounding of the sizes is raised to it: a finer
  question has no answer in float64.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from clamp3d.checks import number, real, shown
from clamp3d.errors import InputError
from clamp3d.geometry.primitives import arc_angle, place, size

_EPS = 2.0**-52


class ArcRelation(StrEnum):
    """The five columns of Table 3; ``UNCERTAIN`` in 3D alone, where rounding hides which of its neighbours holds."""

    INSIDE = "inside"
    OUTSIDE = "outside"
    INTERSECT = "intersect"
    EXTERIOR_CONTACT = "exterior contact"
    INTERIOR_CONTACT = "interior contact"
    UNCERTAIN = "uncertain"


class ArcFeature(StrEnum):
    """The part of the arc that is nearest to the circle."""

    ARC = "arc"
    M = "M"
    N = "N"
    BOTH_ENDS = "M and N"


@dataclass(frozen=True, slots=True)
class ArcContact:
    """An arc against a circle.

    Attributes
    ----------
    relation : ArcRelation
        Column of Table 3.
    gap : float
        Distance from the circle's centre to the arc, less the circle's radius; mm.
    feature : ArcFeature
        The part of the arc that is nearest.
    points : tuple of (float, float)
        Nearest points (x, y) of the arc: one, or M and N if ``feature`` is both.
    tolerance : float
        The one applied, mm.
    """

    relation: ArcRelation
    gap: float
    feature: ArcFeature
    points: tuple[tuple[float, float], ...]
    tolerance: float


def arc_circle(
    arc_radius: float, half_angle: float, circle_radius: float, x: float, y: float, *, tolerance: float
) -> ArcContact:
    """Relation of an arc and a circle (Table 3).

    Parameters
    ----------
    arc_radius, half_angle : float
        The arc, mm and rad; 0 < half_angle < pi.
    circle_radius, x, y : float
        The circle and its centre, mm.
    tolerance : float
        Gaps up to this are contact, mm; >= 0 and less than both radii.

    Raises
    ------
    InputError
        For values out of range.

    Examples
    --------
    >>> import math
    >>> arc_circle(7.0, math.radians(60), 6.935, 0.0, -0.065, tolerance=1e-9).relation.value
    'interior contact'
    >>> arc_circle(7.0, math.radians(100), 6.935, 0.0, 0.0, tolerance=1e-9).gap
    0.06500000000000039
    """
    pair = _Pair(arc_radius, half_angle, circle_radius, x, y, tolerance)
    R, r, x, y = pair.arc_radius, pair.circle_radius, pair.x, pair.y
    s, h = pair.chord
    from_m, from_n = math.hypot(x + s, y - h), math.hypot(x - s, y - h)
    points: tuple[tuple[float, float], ...]
    if pair.is_in_span:
        from_centre = math.hypot(x, y)
        # Inside radii first: their difference is the small number that matters.
        gap = (from_centre - R) - r if from_centre > R else (R - r) - from_centre
        coaxial = from_centre <= _EPS * _EPS * R  # direction lost; the quotient would overflow
        point = (0.0, -R) if coaxial else (x * (R / from_centre), y * (R / from_centre))
        feature, points = ArcFeature.ARC, (point,)
        if math.hypot(abs(point[0]) - s, point[1] - h) <= pair.tolerance:
            feature = ArcFeature.M if x < 0.0 else ArcFeature.N
    else:
        gap = min(from_m, from_n) - r
        if abs(from_m - from_n) <= pair.tolerance:
            feature, points = ArcFeature.BOTH_ENDS, ((-s, h), (s, h))
        elif from_m < from_n:
            feature, points = ArcFeature.M, ((-s, h),)
        else:
            feature, points = ArcFeature.N, ((s, h),)
    return ArcContact(pair.relation(gap), gap, feature, points, pair.tolerance)


def classify_arc_circle(
    gap: float, arc_radius: float, half_angle: float, circle_radius: float, x: float, y: float, *, tolerance: float
) -> ArcRelation:
    """Column of Table 3 for a ``gap`` (mm) that is already known, also that of a solid groove.

    The other parameters, and errors, are those of `arc_circle`.
    """
    pair = _Pair(arc_radius, half_angle, circle_radius, x, y, tolerance)
    checked_gap = real(gap)
    if checked_gap is None or math.isnan(checked_gap):
        raise InputError(f"gap must be a number, got {shown(gap)}")
    return pair.relation(checked_gap)


def check_tolerance(tolerance: float, *radii: float) -> float:
    """The largest gap (mm) that counts as contact. Raises InputError unless it is >= 0 and less than all ``radii``."""
    tolerance = number("tolerance", tolerance, rule="be >= 0 mm and less than both radii")
    if not 0.0 <= tolerance < min(radii):
        raise InputError(f"tolerance must be >= 0 mm and less than both radii, got {tolerance}")
    return tolerance


@dataclass(slots=True)
class _Pair:
    """An arc and a circle as `arc_circle` takes them. Raises InputError naming the value that breaks its rule."""

    arc_radius: float
    half_angle: float
    circle_radius: float
    x: float
    y: float
    tolerance: float

    def __post_init__(self) -> None:
        self.arc_radius = size("arc_radius", self.arc_radius)
        self.circle_radius = size("circle_radius", self.circle_radius)
        self.half_angle = arc_angle("half_angle", self.half_angle)
        self.x, self.y = place("circle centre x", self.x), place("circle centre y", self.y)
        rounding = 4.0 * _EPS * (self.arc_radius + self.circle_radius + abs(self.x) + abs(self.y))
        self.tolerance = max(check_tolerance(self.tolerance, self.arc_radius, self.circle_radius), rounding)

    @property
    def chord(self) -> tuple[float, float]:
        """The end N of the arc; M is its mirror image."""
        return self.arc_radius * math.sin(self.half_angle), -self.arc_radius * math.cos(self.half_angle)

    @property
    def is_in_span(self) -> bool:
        """Whether the centre's direction meets the arc. Folded to [0, pi] about -y, so no angle wraps."""
        return math.atan2(abs(self.x), 0.0 - self.y) <= self.half_angle  # 0.0 - y, not -y: atan2(0, -0.0) is pi

    def relation(self, gap: float) -> ArcRelation:
        """Column of Table 3 for a gap, mm."""
        if gap < -self.tolerance:
            return ArcRelation.INTERSECT
        s, h = self.chord
        from_centre = math.hypot(self.x, self.y)
        if gap <= self.tolerance:
            if self.is_in_span:
                exterior = from_centre > self.arc_radius
            else:  # Fig. 6: the side of the line RM on which the centre lies, RM being the tangent in M (or N)
                outward = (abs(self.x) - s) * math.sin(self.half_angle) - (self.y - h) * math.cos(self.half_angle)
                exterior = outward >= -self.tolerance
            return ArcRelation.EXTERIOR_CONTACT if exterior else ArcRelation.INTERIOR_CONTACT
        in_region = self.y <= h and from_centre <= self.arc_radius
        through_chord = self.y >= h and abs(self.x) <= s and self.y - h <= self.circle_radius
        return ArcRelation.INSIDE if in_region or through_chord else ArcRelation.OUTSIDE
