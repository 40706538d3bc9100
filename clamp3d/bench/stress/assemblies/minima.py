"""All local minima of a clamp's distance by `Envelope`: tilt by tilt, each wire in each of its valleys.

At every tilt of a grid the least d of a wire as a function of its place has some valleys, known exactly; a valley is
followed from tilt to tilt by letting the wire slide downhill. A state (tilt, valley, valley) that is no higher than
its neighbours on the grid is followed to the lowest tilt nearby, and counts if it then is at rest (`Envelope.falls`).
Minima closer to each other than the grid, 1/300 of the range of the tilt, may be missed; those found are good to 1e-9.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clamp3d.bench.stress.assemblies.envelope import Envelope, Wire
from clamp3d.geometry.pose import Array

_LEVELS, _POINTS = 14, 13  # the last tilts are 1e-13 rad apart
_SAME = 1e-7


_SHALLOW, _NEAR = 1.5e-4, 1.5e-2
"""In parts of the down splint's half width: 0.01 mm and 1 mm for the reference clamp."""


@dataclass(frozen=True, slots=True)
class Minimum:
    """An equilibrium: distance ``d`` in mm and ``tilt`` in rad.

    It is ``firm`` if opening the clamp by 1.5e-4 of the down splint's half width (0.01 mm for the reference clamp, less
    than the roughness of any casting) does not let it slide to a lower one within a hundred times as much. The edges of
    nearly equal grooves make pairs of minima nanometres apart, which are not. It is ``slipped`` if a wire has left the
    clamp: closing ends there too, but nobody asks for it.
    """

    d: float
    tilt: float
    firm: bool
    slipped: bool


class Valleys:
    """Where one wire slides to at each of some tilts: ``x``, ``d`` and ``bottom`` (n, k), the column it ends in."""

    def __init__(self, wire: Wire, tilts: Array) -> None:
        self.x = wire.places(tilts)
        d = wire.least(self.x, tilts)
        self.d = d = np.where(np.isnan(d), np.inf, d)
        n, k = d.shape
        column, row = np.arange(k), np.arange(n)[:, None]
        level = np.hstack([np.zeros((n, 1), bool), d[:, 1:] == d[:, :-1]])
        # The next other value to either side, beyond a level stretch.
        first = np.maximum.accumulate(np.where(level, 0, column), axis=1)
        ends = np.hstack([~level[:, 1:], np.ones((n, 1), bool)])
        last = np.minimum.accumulate(np.where(ends, column, k)[:, ::-1], axis=1)[:, ::-1]
        left = np.where(first > 0, d[row, first - 1], np.inf)
        right = np.where(last < k - 1, d[row, np.minimum(last + 1, k - 1)], np.inf)
        step = np.where(right < d, 1, np.where((left < d) | level, -1, 0))
        bottom = column + step
        while True:
            further = np.take_along_axis(bottom, bottom, 1)
            if np.array_equal(further, bottom):
                break
            bottom = further
        self.bottom = bottom

    def settle(self, rows: NDArray[np.intp], x: Array) -> NDArray[np.intp]:
        """Columns (m,) in which wires at x (m,) end at the tilts ``rows`` (m,)."""
        xs, d = self.x[rows], self.d[rows]
        j = np.clip((xs < x[:, None]).sum(1), 1, xs.shape[1] - 1)
        m = np.arange(len(rows))
        i = np.where(d[m, j] < d[m, j - 1], j, j - 1)
        return np.asarray(self.bottom[rows, i])


def minima(envelope: Envelope, count: int = 301) -> list[Minimum]:
    """Local minima, the lowest first."""
    tilts = np.linspace(-envelope.limit, envelope.limit, count)
    faces, lifted = envelope.faces(tilts), envelope.lifted(tilts)
    # Of each wire's valleys: tilt, place, and d there and where it goes to one tilt to the left and to the right.
    tables = []
    for wire in envelope.wires:
        valleys = Valleys(wire, tilts)
        rows, columns = np.nonzero(valleys.bottom == np.arange(valleys.x.shape[1]))
        x = valleys.x[rows, columns]
        sides = [np.clip(rows + side, 0, count - 1) for side in (-1, 1)]
        beside = [valleys.d[side, valleys.settle(side, x)] for side in sides]
        tables.append((x, valleys.d[rows, columns], *beside, np.searchsorted(rows, np.arange(count + 1))))
    rests: list[Minimum] = []
    for k in range(count):
        own = [range(table[4][k], table[4][k + 1]) for table in tables]
        for a, b in itertools.product(*own):
            here, left, right = (
                max(tables[0][c][a], tables[1][c][b], faces[place]) + lifted[place]
                for c, place in ((1, k), (2, max(k - 1, 0)), (3, min(k + 1, count - 1)))
            )
            if (k > 0 and left < here) or (k < count - 1 and right < here):
                continue
            q = _lowest(envelope, float(tilts[k]), float(tilts[1] - tilts[0]), tables[0][0][a], tables[1][0][b])
            d, tilt = float(q[4]), float(q[5] / envelope.lever)
            same = any(abs(d - other.d) <= _SAME and abs(tilt - other.tilt) <= 1e-5 for other in rests)
            if not same and envelope.falls(q) <= _SAME:
                firm = envelope.falls(q, _NEAR * envelope.lever, _SHALLOW * envelope.lever) <= _SAME
                slipped = bool(np.isneginf(min(tables[0][1][a], tables[1][1][b])))
                rests.append(Minimum(d, tilt, firm, slipped))
    return sorted(rests, key=lambda minimum: minimum.d)


def _lowest(envelope: Envelope, tilt: float, width: float, x6: float, x7: float) -> Array:
    """The lowest state within ``width`` rad of a tilt, its wires' valleys followed from there."""
    x, d = [float(x6), float(x7)], float("inf")
    for _ in range(_LEVELS):
        tilts = np.clip(tilt + width * np.linspace(-1.0, 1.0, _POINTS), -envelope.limit, envelope.limit)
        level = envelope.faces(tilts)
        places = np.empty((_POINTS, 2))
        for w, wire in enumerate(envelope.wires):
            valleys = Valleys(wire, tilts)
            for side in (range(_POINTS // 2, -1, -1), range(_POINTS // 2, _POINTS)):
                place = x[w]
                for k in side:
                    column = int(valleys.settle(np.array([k]), np.array([place]))[0])
                    place = places[k, w] = float(valleys.x[k, column])
                    level[k] = max(level[k], valleys.d[k, column])
        level += envelope.lifted(tilts)
        best = int(level.argmin())
        tilt, x, d = float(tilts[best]), [float(p) for p in places[best]], float(level[best])
        width /= 5.0
    return np.array([x[0], 0.0, x[1], 0.0, d, tilt * envelope.lever])
