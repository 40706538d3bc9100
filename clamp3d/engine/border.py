"""How far the two sides of a common part's border are from each other: that bounds an interference by Open CASCADE."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.surface import Surface
from clamp3d.files.pairs import Border
from clamp3d.geometry.pose import Array
from clamp3d.geometry.triangles import edge_middles, halves

_SERVES = 1.005
"""Ratio of a bound to the greatest distance that was measured from which on it is not sharpened."""
_BETWEEN = (1.0 / 3.0, 1.25)
"""Factors on what a distance is above the corners' mean, for what it is more where nobody looks: above a smooth bend,
which is next to quadratic, and above anything else, such as the tip of a cone, wherever it stands.
"""
_SMOOTH = 0.9
"""Least cosine of the angle of the triangles that are nearest to one piece above a smooth sheet."""


class Distances(NamedTuple):
    """How far (mm) one side of a border is from the other: its corners (n,), the middles (m,) of its triangles, and any
    point ``at_most``.
    """

    corners: Array
    middles: Array
    at_most: float


def distances_across(own: Border, other: Border, cuts: int) -> Distances:
    """How far one side of a border is from the other; all is infinite where one of them is empty.

    Up to ``cuts`` triangles are added to sharpen the bound.
    """
    if not (len(own.triangles) and len(other.triangles)):
        return Distances(np.full(len(own.points), np.inf), np.full(len(own.triangles), np.inf), np.inf)
    side = _Side.of(other)
    corners = side.whole.surface.distance(own.points)
    pieces = _Pieces.of(own.points[own.triangles], own.errors, side)
    reached = max(float(corners.max()), float(pieces.middles.max()))
    return Distances(corners, pieces.middles, _at_most(pieces, side, reached, cuts))


class _Sheet(NamedTuple):
    """Some of a border: its ``surface``, and how far (m,) mm that is off."""

    surface: Surface
    errors: Array

    @classmethod
    def of(cls, border: Border, rows: Any) -> _Sheet:
        """The triangles ``rows`` of a border."""
        used, triangles = np.unique(border.triangles[rows], return_inverse=True)
        return cls(Surface(border.points[used], triangles.reshape(-1, 3)), border.errors[rows])


class _Side(NamedTuple):
    """All of one side of a border, and each of its faces by itself, those with the most triangles first."""

    whole: _Sheet
    faces: list[_Sheet]

    @classmethod
    def of(cls, border: Border) -> _Side:
        """The sheets of a border."""
        faces, number = np.unique(border.face, return_counts=True)
        order = np.argsort(-number, kind="stable")
        return cls(_Sheet.of(border, slice(None)), [_Sheet.of(border, border.face == face) for face in faces[order]])


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
    def of(cls, triangles: Array, errors: Array, side: _Side) -> _Pieces:
        """Bounded by their middles: no point is farther than that by more than it is away from it."""
        middles = triangles.mean(axis=1)
        away, nearest, _ = side.whole.surface.nearest(middles)
        off = errors + side.whole.errors[nearest]
        radius = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1)
        return cls(triangles, errors, away, off, away + radius + off)

    def sharpened(self, side: _Side, serves: float) -> _Pieces:
        """With the least of these bounds and what `_over_sheet` says, while it is above ``serves`` mm.

        Of single faces and of all: the corners of a slab are at its walls, so of both together nothing is known.
        """
        at_most, middles = self.at_most.copy(), self.triangles.mean(axis=1)
        for sheet in (*side.faces, side.whole):
            may_be_near = sheet.surface.box_gap(middles) <= 2.0 * (serves + self.off)
            rows = np.flatnonzero((at_most > serves) & may_be_near)
            at_most[rows] = np.minimum(at_most[rows], _over_sheet(self.triangles[rows], sheet) + self.errors[rows])
        return self._replace(at_most=at_most)

    def halved(self, rows: NDArray[np.bool_], side: _Side, serves: float) -> _Pieces:
        """With some of them cut across their longest sides."""
        cut = self.triangles[rows]
        longest = np.linalg.norm(np.roll(cut, -1, axis=1) - cut, axis=2).argmax(axis=1)
        new = _Pieces.of(halves(cut, edge_middles(cut), longest), np.tile(self.errors[rows], 2), side)
        both = zip(self, new.sharpened(side, serves), strict=True)
        return _Pieces(*(np.concatenate([own[~rows], other]) for own, other in both))


def _at_most(pieces: _Pieces, side: _Side, reached: float, cuts: int) -> float:
    """How far (mm) any point of pieces is from a side at most, ``reached`` mm being what some corner or middle is.

    The farthest are cut until their bounds are sharp, or ``cuts`` are made.
    """
    serves = _SERVES * reached
    pieces = pieces.sharpened(side, serves)
    least = serves + float(pieces.off[pieces.middles.argmax()])  # no bound of all is less
    while True:
        worst = pieces.at_most > np.maximum(least, pieces.middles + pieces.off + serves - reached)
        worst &= pieces.at_most >= 0.5 * (least + pieces.at_most[worst].max(initial=0.0))
        cuts -= int(worst.sum())
        if not worst.any() or cuts < 0:
            return max(reached, float(pieces.at_most.max()))
        pieces = pieces.halved(worst, side, serves)


def _over_sheet(pieces: Array, sheet: _Sheet) -> Array:
    """How far (m,) mm any point of triangles (m, 3, 3) is at most from a sheet.

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
    return np.asarray(away.max(axis=(1, 2), initial=0.0) + np.where(is_smooth, *_BETWEEN) * above)
