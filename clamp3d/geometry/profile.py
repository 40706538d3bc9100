"""Closed outlines of straight segments and circular arcs; arcs stay arcs until somebody asks for chords.

An outline runs counter-clockwise in its own right-handed plane (a, b): the material is on its left, an arc with a
positive sweep is convex (back, shank, wire), one with a negative sweep is concave (groove, saddle).
Chords have their ends *on* the arc. So a convex arc loses material and a groove or hole gains it: the chord error
always lies on the inner side of the circle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from clamp3d.checks import number
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array

Point: TypeAlias = tuple[float, float]
Side: TypeAlias = Literal["chords", "inner", "outer"]
"""Polygon of an outline: corners on its arcs, wholly inside the outline, or wholly around it."""

MIN_MESH_ERROR = 1e-6
"""Smallest chord error in mm: a circle of radius 24 then has some 11 000 chords."""

_CLOSURE = 1e-9  # mm; the ends of neighbouring edges are computed by different formulas
_TOO_NARROW = f"outline must be wider than {_CLOSURE:g} mm"
_FINE = 1e-4
"""Chord error, relative to the outline's extent, with which an outline is looked at for crossings."""


def sagitta(radius: float, angle: float) -> float:
    """Largest distance of a chord from its arc: R (1 - cos(angle / 2)), in a form that keeps the digits of small ones.

    Parameters
    ----------
    radius : float
        Radius of the arc in mm.
    angle : float
        Angle in rad that the chord spans.

    Returns
    -------
    float
        Sagitta in mm.

    Examples
    --------
    >>> round(sagitta(10.0, math.pi), 12)
    10.0
    """
    return 2.0 * radius * math.sin(0.25 * angle) ** 2


def chord_angle(radius: float, error: float) -> float:
    """Angle of the widest chord whose sagitta is at most ``error``: the inverse of `sagitta`.

    Parameters
    ----------
    radius : float
        Radius of the arc in mm.
    error : float
        Largest sagitta in mm.

    Returns
    -------
    float
        Angle in rad, at most 2 pi.

    Examples
    --------
    >>> round(sagitta(10.0, chord_angle(10.0, 0.01)), 12)
    0.01
    """
    return 4.0 * math.asin(min(1.0, math.sqrt(error / (2.0 * radius))))


def chord_count(angle: float, widest: float) -> int:
    """Least number of equal chords, none wider than ``widest``, on an arc of ``angle``.

    Parameters
    ----------
    angle, widest : float
        Angles in rad; the sign of ``angle`` does not matter. A quotient within 1e-9 of a whole number is that number.

    Returns
    -------
    int
        Number of chords, at least 1.

    Examples
    --------
    >>> chord_count(math.radians(140.0), math.radians(20.0)), chord_count(-1.0, 0.4)
    (7, 3)
    """
    return max(1, math.ceil(abs(angle) / widest - 1e-9))


def turns(corners: Array) -> Array:
    """Sines (k,) of the turns of a closed polygon at its corners (k, 2), positive to the left.

    >>> turns(np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 2.0)])).round(9).tolist()
    [0.707106781, 0.0, 1.0, 0.707106781]
    """
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return np.asarray((before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / np.maximum(size, 1e-300))


@dataclass(frozen=True, slots=True)
class Segment:
    """Straight edge of an outline.

    Attributes
    ----------
    start, end : tuple of float
        Its ends (a, b) in mm.
    """

    start: Point
    end: Point

    def support(self, da: float, db: float) -> float:
        """As `Profile.support`, of this edge alone."""
        return max(da * a + db * b for a, b in (self.start, self.end))


@dataclass(frozen=True, slots=True)
class Arc:
    """Circular edge of an outline.

    Attributes
    ----------
    centre : tuple of float
        Centre (a, b) in mm.
    radius : float
        Radius in mm.
    start_angle, end_angle : float
        Angles in rad, from a towards b. ``end_angle > start_angle`` is convex, ``end_angle < start_angle`` concave;
        they differ by 2 pi at most.
    """

    centre: Point
    radius: float
    start_angle: float
    end_angle: float

    @property
    def sweep(self) -> float:
        """Signed angle in rad: positive where the arc is convex."""
        return self.end_angle - self.start_angle

    @property
    def start(self) -> Point:
        """First point (a, b) in mm."""
        return self.at(self.start_angle)

    @property
    def end(self) -> Point:
        """Last point (a, b) in mm."""
        return self.at(self.end_angle)

    def at(self, angle: float) -> Point:
        """Point (a, b) in mm at ``angle`` rad."""
        return self.centre[0] + self.radius * math.cos(angle), self.centre[1] + self.radius * math.sin(angle)

    def support(self, da: float, db: float) -> float:
        """As `Profile.support`, of this edge alone."""
        low, high = sorted((self.start_angle, self.end_angle))
        direction = math.atan2(db, da)
        if direction + 2.0 * math.pi * math.ceil((low - direction) / (2.0 * math.pi)) <= high:
            return da * self.centre[0] + db * self.centre[1] + self.radius * math.hypot(da, db)
        return max(da * a + db * b for a, b in (self.start, self.end))

    def chord_count(self, mesh_error: float) -> int:
        """Number of equal chords that stay within ``mesh_error`` mm of the arc.

        It is even (a full circle: a multiple of four), so that the middle of a symmetric arc is a vertex and the
        bounding box of the clamp's parts does not depend on the error.
        """
        multiple = 4 if abs(self.sweep) > 2.0 * math.pi - 1e-9 else 2
        return multiple * chord_count(self.sweep / multiple, chord_angle(self.radius, check_mesh_error(mesh_error)))

    def chords(self, mesh_error: float, start: Point) -> list[Point]:
        """Corners (a, b) in mm of the arc's chords but for the last one; ``start`` is the arc's own, to the bit."""
        n = self.chord_count(mesh_error)
        return [start, *(self.at(self.start_angle + self.sweep * k / n) for k in range(1, n))]

    def tangents(self, mesh_error: float, start: Point) -> list[Point]:
        """Corners (a, b) in mm of as many tangents as `chords`, which lie on the outer side of the circle.

        A full circle has no corner on the arc. No tangent spans more than a quarter turn: half a turn has no corner.
        """
        n = max(self.chord_count(mesh_error), 4)
        step = self.sweep / n
        outer_arc = Arc(self.centre, self.radius / math.cos(0.5 * step), self.start_angle, self.end_angle)
        corners = [outer_arc.at(self.start_angle + (k + 0.5) * step) for k in range(n)]
        return corners if abs(self.sweep) > 2.0 * math.pi - 1e-9 else [start, *corners]

    def sagitta(self, chords: int) -> float:
        """Largest distance in mm of ``chords`` equal chords from the arc: their chord error."""
        return sagitta(self.radius, abs(self.sweep) / chords)

    def chord_area(self, chords: int) -> float:
        """Area in mm^2 between the arc and ``chords`` equal chords: lost where convex, gained where concave."""
        angle = abs(self.sweep) / chords
        return 0.5 * chords * self.radius**2 * (angle - math.sin(angle))


Edge: TypeAlias = Segment | Arc


@dataclass(frozen=True, slots=True)
class Profile:
    """A closed outline, counter-clockwise.

    Parameters
    ----------
    edges : tuple of Segment or Arc
        Edges in turn; each starts where the one before ends.

    Raises
    ------
    InputError
        If the edges do not join, or the outline runs clockwise or crosses itself.

    Examples
    --------
    >>> disk = Profile.circle(2.0)
    >>> math.isclose(disk.area, 4 * math.pi), disk.bounds
    (True, ((-2.0, -2.0), (2.0, 2.0)))
    """

    edges: tuple[Edge, ...]

    def __post_init__(self) -> None:
        for i, edge in enumerate(self.edges):
            before = self.edges[i - 1]
            if math.dist(before.end, edge.start) > _CLOSURE:
                raise InputError(
                    f"outline must be closed: edge {i} starts at {edge.start}, the one before ends at {before.end}"
                )
        if not self.edges or self.area <= 0.0:
            raise InputError("outline must run counter-clockwise and enclose an area > 0 mm^2")
        self._check_simple()

    def _check_simple(self) -> None:
        """Raise InputError if the outline crosses itself; it may touch itself, and run along itself.

        Where it runs round twice, or the wrong way, it must be no wider than rounding, or as arcs are off their chords.
        """
        from shapely import Polygon, unary_union
        from shapely.ops import polygonize
        from shapely.validation import explain_validity

        extent = max(np.ptp(self.bounds, axis=0))
        error = max(_FINE * extent, MIN_MESH_ERROR)
        corners = self.polygon(error)
        if len(corners) < 3:
            raise InputError(_TOO_NARROW)
        ring = Polygon(corners)
        if ring.is_valid:
            return
        narrow = ring.exterior.buffer(error if self.arcs else _CLOSURE * extent)
        for face in polygonize(unary_union(ring.exterior)):
            middle = face.representative_point()
            to_corners = np.array(corners) @ (1.0, 1.0j) - complex(middle.x, middle.y)
            turns = round(np.angle(np.roll(to_corners, -1) / to_corners).sum() / (2.0 * math.pi))
            if turns not in (0, 1) and not narrow.covers(face):
                raise InputError(f"outline must not cross itself: {explain_validity(ring).lower()}")

    @classmethod
    def of(cls, *pieces: Point | Arc) -> Profile:
        """Outline through points and arcs in turn; straight segments join them, none of length zero.

        Parameters
        ----------
        *pieces : tuple of float or Arc
            Corners (a, b) in mm, and arcs.

        Returns
        -------
        Profile
            The closed outline.

        Examples
        --------
        >>> Profile.of((0.0, 0.0), (3.0, 0.0), (0.0, 4.0)).area
        6.0
        """
        edges: list[Edge] = []
        for i, piece in enumerate(pieces):
            before = pieces[i - 1]
            start = before.end if isinstance(before, Arc) else before
            end = piece.start if isinstance(piece, Arc) else piece
            if math.dist(start, end) > _CLOSURE:
                edges.append(Segment(start, end))
            if isinstance(piece, Arc):
                edges.append(piece)
        if not edges:
            raise InputError(_TOO_NARROW)
        return cls((*edges[1:], edges[0]) if isinstance(edges[0], Segment) else tuple(edges))

    @classmethod
    def circle(cls, radius: float, centre: Point = (0.0, 0.0)) -> Profile:
        """Full circle of ``radius`` mm."""
        return cls((Arc(centre, radius, 0.0, 2.0 * math.pi),))

    @classmethod
    def rectangle(cls, width: float, height: float, centre: Point = (0.0, 0.0)) -> Profile:
        """Rectangle of ``width`` (a) and ``height`` (b) mm."""
        a, b = centre
        w, h = width / 2, height / 2
        return cls.of((a - w, b - h), (a + w, b - h), (a + w, b + h), (a - w, b + h))

    @classmethod
    def hexagon(cls, across_flats: float) -> Profile:
        """Regular hexagon about the origin, two corners on the a axis, ``across_flats`` mm along b."""
        r = across_flats / math.sqrt(3.0)
        h = across_flats / 2
        return cls.of((r, 0.0), (r / 2, h), (-r / 2, h), (-r, 0.0), (-r / 2, -h), (r / 2, -h))

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """The circular edges."""
        return tuple(edge for edge in self.edges if isinstance(edge, Arc))

    @property
    def area(self) -> float:
        """Enclosed area in mm^2, closed form: Green's theorem, 1/2 of the integral of a db - b da along the outline."""
        twice = 0.0
        for edge in self.edges:
            if isinstance(edge, Segment):
                (a0, b0), (a1, b1) = edge.start, edge.end
                twice += a0 * b1 - a1 * b0
            else:
                (a, b), R, t0, t1 = edge.centre, edge.radius, edge.start_angle, edge.end_angle
                twice += R * R * edge.sweep
                twice += R * (a * (math.sin(t1) - math.sin(t0)) - b * (math.cos(t1) - math.cos(t0)))
        return 0.5 * twice

    @property
    def bounds(self) -> tuple[Point, Point]:
        """Lower and upper corner (a, b) of the bounding box in mm, arcs taken as arcs."""
        return (-self.support(-1.0, 0.0), -self.support(0.0, -1.0)), (self.support(1.0, 0.0), self.support(0.0, 1.0))

    def support(self, da: float, db: float) -> float:
        """Support function: the largest ``da * a + db * b`` of the outline's points (a, b), exact on arcs.

        Parameters
        ----------
        da, db : float
            Direction, of any length.

        Returns
        -------
        float
            The reach in mm times the direction's length.
        """
        return max(edge.support(da, db) for edge in self.edges)

    def polygon(self, mesh_error: float, side: Side = "chords") -> Array:
        """The outline with its arcs as equal chords, whose ends lie on the arc, or as tangents.

        Parameters
        ----------
        mesh_error : float
            Largest distance in mm between an arc and its chords.
        side : {"chords", "inner", "outer"}
            "inner" takes tangents for concave arcs, "outer" for convex ones: with chords for the other kind the
            polygon lies inside the outline, or around it. Where the outline is narrow or has sharp notches it may
            cross itself.

        Returns
        -------
        ndarray of shape (n, 2)
            Vertices (a, b) in mm, counter-clockwise.

        Raises
        ------
        InputError
            If ``mesh_error`` is not a length of at least ``MIN_MESH_ERROR``.

        Examples
        --------
        >>> len(Profile.circle(2.0).polygon(0.1))
        12
        """
        check_mesh_error(mesh_error)
        points: list[Point] = []
        for i, edge in enumerate(self.edges):
            before = self.edges[i - 1]
            start = before.end if isinstance(before, Segment) else edge.start
            if isinstance(edge, Segment):
                points.append(start)
                continue
            tangents = side != "chords" and (edge.sweep > 0.0) == (side == "outer")
            points += edge.tangents(mesh_error, start) if tangents else edge.chords(mesh_error, start)
        return np.array(points)

    def chord_error(self, mesh_error: float) -> float:
        """The chord error in mm that ``polygon(mesh_error)`` has in fact; 0 without arcs."""
        return max((arc.sagitta(arc.chord_count(mesh_error)) for arc in self.arcs), default=0.0)

    def chord_areas(self, mesh_error: float) -> tuple[float, float]:
        """Area in mm^2 that ``polygon(mesh_error)`` lacks on convex arcs, and has too much on concave ones."""
        lost = sum(arc.chord_area(arc.chord_count(mesh_error)) for arc in self.arcs if arc.sweep > 0)
        gained = sum(arc.chord_area(arc.chord_count(mesh_error)) for arc in self.arcs if arc.sweep < 0)
        return lost, gained


def check_mesh_error(mesh_error: float) -> float:
    """Return a chord error in mm as a float.

    Raises
    ------
    InputError
        If it is not a finite length of at least ``MIN_MESH_ERROR``.
    """
    rule = f"be a finite length >= {MIN_MESH_ERROR:g} mm"
    value = number("mesh_error", mesh_error, rule=rule)
    if not value >= MIN_MESH_ERROR:
        raise InputError(f"mesh_error must {rule}, got {value:g}")
    return value
