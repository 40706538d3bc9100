"""Initial guesses of the equilibria: the feasible distance, sampled over tilts and positions of the wires.

For each groove the curve on which the wire's centre runs when it touches is found point by point, moving the wire by
its distance until that is small (conservative advancement: no step can pass through). The two curves of a wire,
turned against each other, tell how close the splints can come with the wire at a position. The feasible distance is the
maximum over both wires and the faces; its grid-local minima are the initial guesses.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from clamp3d.clamp.section import SIZE, WIRES, D, S, Section, U
from clamp3d.geometry.pose import Array
from clamp3d.kernel.contact_model import GroovePair

_TILTS, _POSITIONS = 481, 961
_ADVANCES = 80
_LEVEL = 1e-9
"""Distances that differ by this part of the wire's radius are level: between two faces a wire rests anywhere."""
_ROUNDING = 1e-9
"""Overlap in parts of the wire's radius that is none: a wire stands beside the bolt."""
_CLEAR = 1e-3
"""Gap in parts of the wire's radius that a start leaves to what it would touch."""


def initial_guesses(section: Section) -> list[Array]:
    """Open states q (10,), each just above a local minimum of the feasible distance; the lowest first."""
    limit, lever = section.clamp.tilt_stops["the slot"], section.lever
    tilts = np.linspace(-limit, limit, _TILTS)
    lifted = section.lifted(tilts)
    faces = np.array([-section.face_gap(_tilted(section, tilt)) for tilt in tilts])  # least d without an overlap
    wires = [_Minima(section, i, tilts) for i in range(len(WIRES))]
    found: list[Array] = []

    def least(k: int, a: int, b: int) -> float:
        return float(max(faces[k], wires[0].least[a], wires[1].least[b]) + lifted[k])

    def rises(k: int, a: int, b: int, way: int) -> bool:
        """Whether the distance is larger beyond a level stretch at the tilt k, upwards (``way`` 1) or downwards."""
        here = least(k, a, b)
        while 0 <= k + way < _TILTS:
            k, a, b = k + way, wires[0].beside[way][a], wires[1].beside[way][b]
            if least(k, a, b) != here or way < 0:  # the first tilt of a level stretch stands for all
                return least(k, a, b) > here
        return True

    for k, tilt in enumerate(tilts):
        for a, b in itertools.product(*(w.at(k) for w in wires)):
            if not rises(k, a, b, -1) or not rises(k, a, b, 1):
                continue
            q = np.zeros(SIZE)
            q[D], q[S], q[U] = least(k, a, b), lever * tilt, lifted[k]
            for i, w, minimum in ((0, wires[0], a), (2, wires[1], b)):
                at = w.position[minimum]
                q[i : i + 2] = w.x[at], 0.5 * (w.over[at] + q[D] - q[U] + w.under[k, at])
            found.append(q)
    found.sort(key=lambda q: float(q[D]))
    return [opened for q in found if (opened := _open(section, q)) is not None]


class _Minima:
    """Local minima, over a wire's position, of the distance d that the wire allows, all tilts after another.

    ``position`` (v,) is the index of the wire's position at each, ``least`` (v,) the distance there, and ``beside[-1]``
    and ``beside[1]`` (v,) the minimum it slides to when the splint is tilted by one step less and one more.
    """

    def __init__(self, section: Section, i: int, tilts: Array) -> None:
        wire, bolt = WIRES[i], section.bolt_x
        up, down = section.pairs["P1", wire], section.pairs["P2", wire]
        r, (low, high) = up.cylinder.radius, section.reach(wire)
        face = section.clamp.down_splint.face_depth
        self.x = np.linspace(low, high, _POSITIONS)
        self.over = _curve(section, up, self.x, section.clamp.up_splint.thickness + 1.01 * r, -1.0)
        deep = max(abs(face - 1.01 * r), abs(-float(down.T_a_groove[2, 3]) + down.groove.radius))
        aside, c = deep * math.sin(tilts[-1]), math.cos(tilts[-1])
        u = np.linspace((low - bolt - aside) / c, (high - bolt + aside) / c, _POSITIONS)
        v = _curve(section, down, u, face - 1.01 * r, 1.0)
        self.under = np.array([_turned(u, v, tilt, bolt, self.x) for tilt in tilts])
        least = np.round((self.over - self.under) / (_LEVEL * r)) * (_LEVEL * r)
        step = downhill(least)
        row, self.position = np.nonzero(step == 0)
        key = row * _POSITIONS + self.position
        self.least = least[row, self.position]
        self.beside: dict[int, NDArray[np.intp]] = {}
        for way in (-1, 1):
            rows = np.clip(row + way, 0, len(tilts) - 1)
            # Downhill there is the next minimum on that side.
            after = np.searchsorted(key, rows * _POSITIONS + self.position, side="left")
            self.beside[way] = np.where(step[rows, self.position] < 0, after - 1, after)
        self._outside = 0 if i == 0 else _POSITIONS - 1
        self._first = np.searchsorted(row, np.arange(len(tilts) + 1))

    def at(self, k: int) -> list[int]:
        """The minima at tilt k, but for that in which the wire leaves the clamp."""
        return [m for m in range(self._first[k], self._first[k + 1]) if self.position[m] != self._outside]


def _curve(section: Section, pair: GroovePair, u: Array, start: float, sign: float) -> Array:
    """How deep (n,) a wire's centre gets into a groove at positions u (n,), from depth ``start`` in sense ``sign``."""
    T = np.tile(np.eye(4), (len(u), 1, 1))
    T[:, 0, 3], T[:, 2, 3] = u, -start
    moving = np.arange(len(u))
    for _ in range(_ADVANCES):
        way = section.model.distances(pair, T[moving])
        T[moving, 2, 3] -= sign * np.maximum(way, 0.0)
        moving = moving[way > 1e-5 * pair.cylinder.radius]
        if not len(moving):
            break
    return -T[:, 2, 3]


def _turned(u: Array, v: Array, tilt: float, bolt: float, x: Array) -> Array:
    """Depth (m,) at places x (m,) of a curve (u, v), n points by rising u, turned by a tilt about ``bolt``.

    Linear between the points; of what the turned curve has over itself the first counts, and its ends beyond them.
    """
    c, s = math.cos(tilt), math.sin(tilt)
    along = np.maximum.accumulate(bolt + u * c + v * s)
    return np.interp(x, along, v * c - u * s)


def downhill(height: Array) -> NDArray[np.int64]:
    """Whether each sample of ``height`` (t, n) slides left (-1), right (1) or nowhere (0), along its row.

    What counts is the next other height on either side, the lower one first, and none beyond the ends: a slight slope
    is a stair. Of a level stretch between higher ones the first sample stands for all.
    """
    t, n = height.shape
    number, changes = np.arange(n), height[:, 1:] != height[:, :-1]
    first = np.ones((t, 1), np.bool_)
    starts = np.maximum.accumulate(np.where(np.hstack([first, changes]), number, 0), axis=1)
    ends = np.minimum.accumulate(np.where(np.hstack([changes, first]), number, n)[:, ::-1], axis=1)[:, ::-1]
    fenced = np.pad(height, ((0, 0), (1, 1)), constant_values=np.inf)
    left = np.take_along_axis(fenced, starts, axis=1)  # of the sample before the stretch: fenced is one ahead
    right = np.take_along_axis(fenced, ends + 2, axis=1)
    slides_left = (left < height) | (starts < number)
    return np.where((right < height) & (right <= left), 1, np.where(slides_left, -1, 0))


def _tilted(section: Section, tilt: float) -> Array:
    """The state (10,) with a tilt alone."""
    q = np.zeros(SIZE)
    q[S] = section.lever * tilt
    return q


def _open(section: Section, q: Array) -> Array | None:
    """The state opened until nothing overlaps; None if that is not near."""
    r = min(section.pairs["P1", wire].cylinder.radius for wire in WIRES)
    for _ in range(30):
        lacking = float(section.gaps(q).value.min())
        if lacking >= -_ROUNDING * r:
            return q
        more = max(2.0 * -lacking, _CLEAR * r)
        q = q.copy()
        q[D] += more
        q[[1, 3]] += 0.5 * more
    return None
