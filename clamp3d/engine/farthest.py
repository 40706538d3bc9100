"""How far any point of some triangles is from a surface at most: that bounds how deep an overlap is.

Lemma: the distance from a fixed triangle is convex, so over another one it is largest at a corner; and no point is
farther from a surface than from any one of its triangles. So triangles are cut until each is above one of these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clamp3d.engine.surface import Surface
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array
from clamp3d.geometry.triangles import closest_points, edge_middles, halves

_SHARP = 1.001
"""Ratio of a bound to the greatest distance that was measured from which on it is not sharpened."""
_CLEAR = 1e-7
"""Relative to the size: so far beyond a plane nothing is on it, whatever is rounded."""
_BENT = 1.02
"""So much further than beyond such a plane pieces are moved across a surface that is open, and may be bent."""
_HAIR = 1e-9
"""Relative to the size: a piece that reaches over a border by less is not cut there."""

_CUT_FROM = 0.25
"""Where between what is sharp and the largest bound pieces are cut: all at once are too many, a few take many steps."""

End = Callable[[float, float], bool]
"""Whether a bound (mm) is sharp enough, or none can be, since each is at least the second number (mm)."""


class Pieces(NamedTuple):
    """Triangles (m, 3, 3), each off by ``errors`` (m,) mm, and how far (mm) they are from a surface.

    ``middles`` (m,): their middles, from triangle ``nearest`` (m,); ``off`` (m,): the errors of both;
    ``at_most`` (m,): any point of what they stand for, from what the surface stands for; ``is_moved`` (m,): whether
    that is the least of both bounds, not of the first alone, which is quicker.
    """

    surface: Surface
    triangles: Array
    errors: Array
    nearest: IntArray
    middles: Array
    off: Array
    at_most: Array
    is_moved: NDArray[np.bool_]

    @classmethod
    def of(cls, surface: Surface, triangles: Array, errors: Array) -> Pieces:
        """Measured, with the first bound: the distance from one triangle of the surface."""
        middles, nearest, _ = surface.nearest(triangles.mean(axis=1))
        off = errors + surface.mutual_errors[nearest]
        chosen = np.repeat(surface.vertices[surface.faces[nearest]], 3, axis=0)
        corners = triangles.reshape(-1, 3)
        above = np.linalg.norm(closest_points(chosen, corners) - corners, axis=1).reshape(-1, 3).max(axis=1)
        return cls(surface, triangles, errors, nearest, middles, off, above + off, np.zeros(len(triangles), dtype=bool))

    def moved(self, rows: IntArray) -> Pieces:
        """With the second bound of some of them: how long a move is that takes one out of the surface."""
        surface, pieces, nearest = self.surface, self.triangles[rows], self.nearest[rows]
        feet = closest_points(surface.vertices[surface.faces[nearest]], pieces.mean(axis=1))
        moves = _moves_beyond(surface, pieces, feet, surface.normals[nearest])
        length = np.linalg.norm(moves, axis=1)
        bound = length + self.errors[rows]
        kept = np.flatnonzero(bound < self.at_most[rows])
        bound[kept] += surface.errors_within(pieces[kept], length[kept])
        kept = kept[bound[kept] < self.at_most[rows[kept]]]
        if surface.has_sides:
            kept = kept[surface.is_outside(pieces[kept] + moves[kept, None])]
        else:
            kept = kept[surface.is_crossed(pieces[kept], moves[kept])]
        at_most, is_moved = self.at_most.copy(), self.is_moved.copy()
        at_most[rows[kept]], is_moved[rows] = bound[kept], True
        return self._replace(at_most=at_most, is_moved=is_moved)

    @property
    def reached(self) -> float:
        """What no bound of all of them is less than."""
        return float((self.middles + self.off).max(initial=0.0))

    def cut(self, rows: NDArray[np.bool_]) -> Pieces:
        """With some of them cut: along a border of the triangle nearest to them, or in half where all is above it."""
        new, source = self._cuts(np.flatnonzero(rows))
        both = zip(self[1:], Pieces.of(self.surface, new, self.errors[source])[1:], strict=True)
        return Pieces(self.surface, *(np.concatenate([own[~rows], added]) for own, added in both))

    def _cuts(self, rows: IntArray) -> tuple[Array, IntArray]:
        """Triangles (k, 3, 3) that pieces are cut into, and the row (k,) of the piece that each is of."""
        pieces, nearest, surface = self.triangles[rows], self.nearest[rows], self.surface
        corners = surface.vertices[surface.faces[nearest]]
        inward = np.cross(surface.normals[nearest][:, None], np.roll(corners, -1, axis=1) - corners)
        inward /= np.maximum(np.linalg.norm(inward, axis=2), 1e-300)[:, :, None]
        height = np.einsum("mbj,mbcj->mbc", inward, pieces[:, None] - corners[:, :, None])
        reach = np.minimum(height.max(axis=2), -height.min(axis=2))
        border = reach.argmax(axis=1)
        each = np.arange(len(rows))
        over = reach[each, border] > _HAIR * surface.scale
        above = pieces[~over]
        longest = np.linalg.norm(np.roll(above, -1, axis=1) - above, axis=2).argmax(axis=1)
        middles = edge_middles(above)[np.arange(len(above)), longest]
        new = [_split(pieces[over], height[each, border][over]), halves(above, longest, middles)]
        return np.concatenate(new), np.concatenate([np.tile(rows[over], 3), np.tile(rows[~over], 2)])


def farthest(every: Sequence[Pieces], end: End, cuts: int) -> float:
    """How far (mm) any point of pieces, each from its surface, is at most, sharpened until the ``end``.

    Of each those whose bounds are largest are cut until they are sharp, or ``cuts`` triangles are added.
    """
    reached = bound = max(pieces.reached for pieces in every)
    for pieces in every:
        bound = max(bound, _farthest(pieces, bound, lambda most, least: end(most, max(least, reached)), cuts))
    return bound


def _farthest(pieces: Pieces, floor: float, end: End, cuts: int) -> float:
    """The same of some of them, where what is less than ``floor`` (mm) does not matter."""
    while True:
        bound = float(pieces.at_most.max(initial=0.0))
        sharp = max(floor, float((_SHARP * pieces.middles + pieces.off).max(initial=0.0)))
        largest = pieces.at_most > sharp + _CUT_FROM * (bound - sharp)
        if not largest.any() or end(bound, pieces.reached):
            return bound
        if (fresh := largest & ~pieces.is_moved).any():
            pieces = pieces.moved(np.flatnonzero(fresh))
            continue
        cuts -= 2 * int(largest.sum())
        if cuts < 0:
            return bound
        pieces = pieces.cut(largest)


def _moves_beyond(surface: Surface, triangles: Array, feet: Array, normals: Array) -> Array:
    """Moves (m, 3) that take triangles (m, 3, 3) beyond the planes through ``feet`` (m, 3), along their normals.

    Lemma: a point is no further from a surface than it is moved to cross it, as who leaves a body does. If the surface
    is off there, so much more: of its triangles those count that are no further from the point than it is moved.
    """
    height = np.einsum("mcj,mj->mc", feet[:, None] - triangles, normals).max(axis=1)
    height = np.maximum(height, 0.0) * (1.0 if surface.has_sides else _BENT)
    return np.asarray((height + _CLEAR * max(1.0, surface.scale))[:, None] * normals)


def _split(pieces: Array, height: Array) -> Array:
    """Triangles (3 m, 3, 3): each of (m, 3, 3) cut where the height (m, 3) of its corners changes sign."""
    above = height > 0.0
    lone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)  # the corner that is alone on its side
    order = (lone[:, None] + np.arange(3)) % 3
    rows = np.arange(len(pieces))[:, None]
    (a, b, c), (h, i, j) = pieces[rows, order].transpose(1, 0, 2), height[rows, order].T
    ab = a + (h / (h - i))[:, None] * (b - a)
    ac = a + (h / (h - j))[:, None] * (c - a)
    return np.concatenate([np.stack(corners, axis=1) for corners in ((a, ab, ac), (ab, b, c), (ab, c, ac))])
