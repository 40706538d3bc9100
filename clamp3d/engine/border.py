"""How far the two sides of a common part's border are from each other: that bounds an interference by Open CASCADE."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.surface import Surface
from clamp3d.files.pairs import Border
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array
from clamp3d.geometry.triangles import edge_middles, halves

_SHARP = 1.005
"""Ratio of a bound to the greatest distance that was measured from which on it is not sharpened."""
_BETWEEN = (1.0 / 3.0, 1.25)
"""Factors on what a distance is above the corners' mean, for what it is more where nobody looks: above a smooth bend,
which is next to quadratic, and above anything else, such as the tip of a cone, wherever it stands.
"""
_SMOOTH = 0.9
"""Least cosine of the angle of the triangles that are nearest to one piece above a smooth sheet."""

End = Callable[[float, float], bool]
"""Whether a bound (mm) is sharp enough, or none can be, since each is at least the second number (mm)."""


class Side(NamedTuple):
    """How far (mm) one side of a border is from the other: its corners (n,) and middles (m,) of its triangles.

    ``pieces`` are these triangles, ``other`` is the other side.
    """

    corners: Array
    middles: Array
    pieces: _Pieces
    other: _Sheets

    @classmethod
    def of(cls, own: Border, other: Border) -> Side:
        """One side of a border; neither is empty."""
        sheets = _Sheets.of(other)
        pieces = _Pieces.of(own.points[own.triangles], own.errors, sheets)
        return cls(sheets.whole.surface.distance(own.points), pieces.middles, pieces, sheets)

    @property
    def reached(self) -> float:
        """How far some corner or middle is."""
        return float(max(self.corners.max(), self.middles.max()))


def greatest_distance(sides: Sequence[Side], end: End, cuts: int) -> float:
    """How far (mm) any point of sides of a border is from the other side at most, sharpened until the ``end``.

    Of each side the farthest triangles are cut until their bounds are sharp, or ``cuts`` are added.
    """
    reached = max(side.reached for side in sides)
    # It may be so much more at the farthest middle.
    off = max(float(side.pieces.off[side.middles.argmax()]) for side in sides)
    return max(_greatest(side, reached, _SHARP * reached + off, end, cuts) for side in sides)


def _greatest(side: Side, reached: float, least: float, end: End, cuts: int) -> float:
    """The same of one side; ``least`` (mm): no bound of all is less, and ``reached`` is what is measured."""
    serves, pieces = _SHARP * reached, side.pieces
    if not end(float(pieces.at_most.max()), least):
        pieces = pieces.sharpened(side.other, serves)
    while True:
        bound = max(reached, float(pieces.at_most.max()))
        worst = pieces.at_most > np.maximum(least, pieces.middles + pieces.off + serves - reached)
        worst &= pieces.at_most >= 0.5 * (least + pieces.at_most[worst].max(initial=0.0))
        cuts -= int(worst.sum())
        if not worst.any() or cuts < 0 or end(bound, least):
            return bound
        pieces = pieces.halved(worst, side.other, serves)


class _Sheet(NamedTuple):
    """Some of a border: its ``surface``, and how far (m,) mm that is off."""

    surface: Surface
    errors: Array

    @classmethod
    def of(cls, border: Border, rows: Any) -> _Sheet:
        """The triangles ``rows`` of a border."""
        used, triangles = np.unique(border.triangles[rows], return_inverse=True)
        return cls(Surface(border.points[used], triangles.reshape(-1, 3)), border.errors[rows])


class _Sheets(NamedTuple):
    """All of one side of a border, each of its faces by itself, and which of these (m,) each triangle is of."""

    whole: _Sheet
    faces: list[_Sheet]
    face: IntArray

    @classmethod
    def of(cls, border: Border) -> _Sheets:
        """The sheets of a border."""
        numbers, face = np.unique(border.face, return_inverse=True)
        return cls(_Sheet.of(border, slice(None)), [_Sheet.of(border, border.face == k) for k in numbers], face)


class _Pieces(NamedTuple):
    """Triangles (m, 3, 3) that are off by ``errors`` (m,) mm: how far (m,) their middles are from the other side, how
    far off (m,) that is, and how far (m,) any point of them is at most.
    """

    triangles: Array
    errors: Array
    middles: Array
    off: Array
    at_most: Array

    @classmethod
    def of(cls, triangles: Array, errors: Array, other: _Sheets) -> _Pieces:
        """Bounded by their middles: no point is farther than that by more than it is away from it."""
        middles = triangles.mean(axis=1)
        away, nearest, _ = other.whole.surface.nearest(middles)
        off = errors + other.whole.errors[nearest]
        radius = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1)
        return cls(triangles, errors, away, off, away + radius + off)

    def sharpened(self, other: _Sheets, serves: float) -> _Pieces:
        """With the least of these bounds and what `_over_sheet` says, while it is above ``serves`` mm.

        Of all and of single faces: the corners of a slab are at its walls, so of both together nothing is known.
        """
        at_most = self.at_most.copy()

        def bounded_over(sheet: _Sheet, rows: IntArray) -> IntArray:
            bounds, nearest = _over_sheet(self.triangles[rows], sheet)
            at_most[rows] = np.minimum(at_most[rows], bounds + self.errors[rows])
            return nearest

        rows = np.flatnonzero(at_most > serves)
        near = other.face[bounded_over(other.whole, rows)]
        for k, sheet in enumerate(other.faces):
            is_over_some = (near == k).any(axis=1) & (near != k).any(axis=1)
            bounded_over(sheet, rows[is_over_some & (at_most[rows] > serves)])
        return self._replace(at_most=at_most)

    def halved(self, rows: NDArray[np.bool_], other: _Sheets, serves: float) -> _Pieces:
        """With some of them cut across their longest sides."""
        cut = self.triangles[rows]
        longest = np.linalg.norm(np.roll(cut, -1, axis=1) - cut, axis=2).argmax(axis=1)
        new = _Pieces.of(halves(cut, edge_middles(cut), longest), np.tile(self.errors[rows], 2), other)
        both = zip(self, new.sharpened(other, serves), strict=True)
        return _Pieces(*(np.concatenate([own[~rows], halved]) for own, halved in both))


def _over_sheet(pieces: Array, sheet: _Sheet) -> tuple[Array, IntArray]:
    """How far (m,) mm any point of triangles (m, 3, 3) is at most from a sheet, and its triangles (m, 7) near them.

    It is looked at in the corners, the middles of the sides and the middle. Above a plane the distance there is the
    mean of the corners'. By how much it is more above a bend, the ridge of a roof or the tip of a cone, so much more it
    can be between these places at most, times `_BETWEEN`.
    """
    places = np.concatenate([pieces, edge_middles(pieces), pieces.mean(axis=1, keepdims=True)], axis=1)
    away, nearest, _ = sheet.surface.nearest(places.reshape(-1, 3))
    away = (away + sheet.errors[nearest]).reshape(-1, 7, 1)
    means = np.concatenate([edge_middles(away[:, :3]), away[:, :3].mean(axis=1, keepdims=True)], axis=1)
    above = (away[:, 3:] - means).max(axis=(1, 2), initial=0.0)
    normals = sheet.surface.normals[nearest].reshape(-1, 7, 3)
    is_smooth = (normals @ normals[:, 6, :, None]).min(axis=(1, 2), initial=1.0) > _SMOOTH
    bounds = away.max(axis=(1, 2), initial=0.0) + np.where(is_smooth, *_BETWEEN) * above
    return np.asarray(bounds), nearest.reshape(-1, 7)
