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
from clamp3d.core.primitives import arc_angle, place, size
from clamp3d.errors import InputError

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
    arc_radius, half_angle, circle_radius, x, y, tolerance = _checked(
        arc_radius, half_angle, circle_radius, x, y, tolerance
    )
    m_x, m_y = -arc_radius * math.sin(half_angle), -arc_radius * math.cos(half_angle)
    distance_m, distance_n = math.hypot(x - m_x, y - m_y), math.hypot(x + m_x, y - m_y)
    points: tuple[tuple[float, float], ...]
    if _in_span(x, y, half_angle):
        from_centre = math.hypot(x, y)
        if from_centre > arc_radius:
            gap = (from_centre - arc_radius) - circle_radius
        else:  # radii first: their difference is the small number that matters
            gap = (arc_radius - circle_radius) - from_centre
        coaxial = from_centre <= _EPS * _EPS * arc_radius  # direction lost; the quotient would overflow
        scale = 0.0 if coaxial else arc_radius / from_centre
        point = (0.0, -arc_radius) if coaxial else (x * scale, y * scale)
        feature, points = ArcFeature.ARC, (point,)
        if math.hypot(abs(point[0]) + m_x, point[1] - m_y) <= tolerance:
            feature = ArcFeature.M if x < 0.0 else ArcFeature.N
    else:
        gap = min(distance_m, distance_n) - circle_radius
        if abs(distance_m - distance_n) <= tolerance:
            feature, points = ArcFeature.BOTH_ENDS, ((m_x, m_y), (-m_x, m_y))
        elif distance_m < distance_n:
            feature, points = ArcFeature.M, ((m_x, m_y),)
        else:
            feature, points = ArcFeature.N, ((-m_x, m_y),)
    relation = classify_arc_circle(gap, arc_radius, half_angle, circle_radius, x, y, tolerance=tolerance)
    return ArcContact(relation, gap, feature, points, tolerance)


def classify_arc_circle(
    gap: float, arc_radius: float, half_angle: float, circle_radius: float, x: float, y: float, *, tolerance: float
) -> ArcRelation:
    """Column of Table 3 for a ``gap`` (mm) that is already known, also that of a solid groove.

    The other parameters, and errors, are those of `arc_circle`.
    """
    arc_radius, half_angle, circle_radius, x, y, tolerance = _checked(
        arc_radius, half_angle, circle_radius, x, y, tolerance
    )
    checked_gap = real(gap)
    if checked_gap is None or math.isnan(checked_gap):
        raise InputError(f"gap must be a number, got {shown(gap)}")
    gap = checked_gap
    if gap < -tolerance:
        return ArcRelation.INTERSECT
    chord_x, chord_y = arc_radius * math.sin(half_angle), -arc_radius * math.cos(half_angle)
    if gap <= tolerance:
        if _in_span(x, y, half_angle):
            exterior = math.hypot(x, y) > arc_radius
        else:  # Fig. 6: the side of the line RM on which the centre lies, RM being the tangent in M (or N)
            outward = (abs(x) - chord_x) * math.sin(half_angle) - (y - chord_y) * math.cos(half_angle)
            exterior = outward >= -tolerance
        return ArcRelation.EXTERIOR_CONTACT if exterior else ArcRelation.INTERIOR_CONTACT
    in_region = y <= chord_y and math.hypot(x, y) <= arc_radius
    through_chord = y >= chord_y and abs(x) <= chord_x and y - chord_y <= circle_radius
    return ArcRelation.INSIDE if in_region or through_chord else ArcRelation.OUTSIDE


def _in_span(x: float, y: float, half_angle: float) -> bool:
    """Whether the centre's direction meets the arc. Folded to [0, pi] about -y, so no angle wraps."""
    return math.atan2(abs(x), 0.0 - y) <= half_angle  # 0.0 - y, not -y: atan2(0, -0.0) is pi


def check_tolerance(tolerance: float, *radii: float) -> float:
    """The largest gap (mm) that counts as contact. Raises InputError unless it is >= 0 and less than all ``radii``."""
    tolerance = number("tolerance", tolerance, rule="be >= 0 mm and less than both radii")
    if not 0.0 <= tolerance < min(radii):
        raise InputError(f"tolerance must be >= 0 mm and less than both radii, got {tolerance}")
    return tolerance


def _checked(
    arc_radius: float, half_angle: float, circle_radius: float, x: float, y: float, tolerance: float
) -> tuple[float, float, float, float, float, float]:
    """All six as floats, with the tolerance to apply. Raises InputError naming the value that breaks its rule."""
    arc_radius, circle_radius = size("arc_radius", arc_radius), size("circle_radius", circle_radius)
    half_angle = arc_angle("half_angle", half_angle)
    x, y = place("circle centre x", x), place("circle centre y", y)
    tolerance = check_tolerance(tolerance, arc_radius, circle_radius)
    tolerance = max(tolerance, 4.0 * _EPS * (arc_radius + circle_radius + abs(x) + abs(y)))
    return arc_radius, half_angle, circle_radius, x, y, tolerance
