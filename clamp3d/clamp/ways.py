"""Ways by which parts come to their place, straight or with one bend, asked of `check` as motions of the clamp's scene.

They are found by taking parts out: what comes out on a way comes in on it. A group moves as one. A way ends where the
group's box is apart from the boxes of all that stands there; wires go on far beyond what is drawn of them, so no way
leads over a wire's end. It counts as free only where `check` proves that nothing overlaps by more than `RESOLUTION`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from clamp3d.clamp.dimensions import TITLES, Clamp, PartName
from clamp3d.clamp.matrix import Pair, plain
from clamp3d.clamp.parts import parts, wire_solid
from clamp3d.clamp.section import WIRES
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.check import check
from clamp3d.engine.model import ModelCache
from clamp3d.engine.result import NOT_CLEAN, PairResult
from clamp3d.engine.scene import Part, Scene
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import Solid

SPARE = 20.0
"""Free way in mm between a part that waits and what is in its way."""
RESOLUTION = 1e-3
"""Overlap in mm up to which parts on their way touch."""
DIRECTIONS: dict[str, tuple[float, float, float]] = {
    "from above": (0.0, 0.0, 1.0),
    "from below": (0.0, 0.0, -1.0),
    "from the right": (1.0, 0.0, 0.0),
    "from the left": (-1.0, 0.0, 0.0),
    "from behind": (0.0, 1.0, 0.0),
    "from the front": (0.0, -1.0, 0.0),
}
"""Where a part can come from, as unit vectors of the world: along the bolt, across the wires, along them."""
_ENDLESS = 20.0
"""How many times as long as drawn a wire is taken to be."""
_BENDS = (0.5, 0.25, 0.75)
"""Where a way out bends, in parts of how far the parts can go before they meet something."""
_LOOKS = (0.5, 0.25, 0.125, 0.0625, 0.03125)
"""Where a way is looked at before it is proven: most ways that are blocked show it."""
_SHORTEST = 0.5
"""Shortest leg of a way with a bend, mm."""
_LOOK = 0.01
"""So far behind the first contact, in mm, parts are looked at first."""

Leg = tuple[str, float]
"""Where the parts come from (`DIRECTIONS`), and how far, mm; a way out is its legs from the place."""
Poses = Mapping[PartName, Array]
Box = tuple[Array, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """What blocks a straight way in.

    Attributes
    ----------
    origin : str
        Where the parts come from, see `DIRECTIONS`.
    a, b : str
        The moving part and the one that it meets first.
    point : ndarray (3,) or None
        Where, in the world with the place of the moving part's group where it should end; mm.
    travel, way : float
        How far they have come then, and how long the way is, mm.
    """

    origin: str
    a: PartName
    b: PartName
    point: Array | None
    travel: float
    way: float

    def __str__(self) -> str:
        where = (
            "" if self.point is None else f" at X {self.point[0]:z.3f}, Y {self.point[1]:z.3f}, Z {self.point[2]:z.3f}"
        )
        return (
            f"{self.origin} {self.a} ({TITLES[self.a]}) meets {self.b} ({TITLES[self.b]}){where} after "
            f"{self.travel:.3f} of {self.way:.3f} mm (t = {self.travel / self.way:.4f})"
        )

    def to_dict(self) -> dict[str, object]:
        """Plain data for JSON."""
        return plain(self, travel="travel_mm", way="way_mm") | {"t": self.travel / self.way}


@dataclass
class Ways:
    """Searches ways of a clamp's parts; ``cache`` keeps their models.

    In every method the first parts of ``pairs`` move, the second ones stand, and ``place`` holds their world poses.
    """

    clamp: Clamp
    cache: ModelCache = field(default_factory=ModelCache)

    def __post_init__(self) -> None:
        clamp, length = self.clamp, _ENDLESS * self.clamp.wire_length
        self.drawn = parts(clamp)
        endless = {n: wire_solid(n, w.radius, length) for n, w in zip(WIRES, (clamp.line, clamp.jumper), strict=True)}
        self.solids: dict[PartName, Solid] = self.drawn | endless
        self._farthest = 0.5 * length - clamp.wire_length

    def find(self, pairs: Sequence[Pair], place: Poses) -> tuple[Leg, ...]:
        """The first free way out; empty if nothing is free, and `blocks` says why."""
        todo, here = list(pairs), np.zeros(3)  # what blocked one way is asked first about the next
        exits = list(self._exits(pairs, place, here))
        for origin, length in exits:
            if self._is_free(todo, place, here, out(origin, length)):
                return ((origin, length + SPARE),)
        for origin in DIRECTIONS:
            for first in self._bends(todo, place, origin):
                corner = out(origin, first)
                for then, length in self._exits(pairs, place, corner):
                    square = float(out(then) @ out(origin)) == 0.0
                    if square and self._is_free(todo, place, corner, out(then, length)):
                        return ((origin, first), (then, length + SPARE))
        return ()

    def blocks(self, pairs: Sequence[Pair], place: Poses) -> tuple[Block, ...]:
        """What each straight way in meets first, the way that leads nearest to the place first."""
        exits = self._exits(pairs, place, np.zeros(3))
        met = [self.block(pairs, place, origin, length + SPARE) for origin, length in exits]
        return tuple(sorted(filter(None, met), key=lambda block: block.way - block.travel))

    def block(self, pairs: Sequence[Pair], place: Poses, origin: str, length: float) -> Block | None:
        """What meets first on the straight way of ``length`` mm to ``place``; None if it is free."""
        start = out(origin, length)
        share, pair = self._first(pairs, place, start, -start)
        if pair is None:
            return None
        met = self._scene([pair], place, (1.0 - share) * start)
        row = next(iter(check(met, pairs=[pair], distances=True, depths=False, cache=self.cache).pairs))
        point = row.distance.point_b if row.a == pair[0] else row.distance.point_a
        return Block(origin, *pair, point, share * length, length)

    def scene(self, pairs: Sequence[Pair], place: Poses, block: Block) -> Scene:
        """The parts of ``pairs`` as drawn, with the motion that ``block`` blocks, up to the place."""
        start = out(block.origin, block.way)
        return replace(
            self._scene(pairs, place, start, -start, solids=self.drawn, name=f"{block.a} {block.origin}"),
            name=f"{self.clamp.name} clamp: the step that is blocked",
        )

    def box(self, part: PartName, place: Poses) -> Box:
        """Corners of the box around a part as it is drawn."""
        return _box(self.drawn[part], place[part])

    def _exits(self, pairs: Sequence[Pair], place: Poses, start: Array) -> Iterator[Leg]:
        """Directions that lead out, each with how far until the moving parts' common box leaves that of the others."""
        for origin in DIRECTIONS:
            length = self._length(pairs, place, start, origin)
            if length <= self._farthest:
                yield origin, length

    def _length(self, pairs: Sequence[Pair], place: Poses, start: Array, origin: str, *, beside: bool = False) -> float:
        """How far the moving parts, ``start`` off their place, go until their common box is past all others.

        Boxes that they pass beside do not count, unless ``beside``.
        """
        u = out(origin)
        k = int(np.argmax(np.abs(u)))
        across, length = [i for i in range(3) if i != k], 0.0
        moving = [_box(self.solids[a], place[a]) for a in {a for a, _ in pairs}]
        for name in {b for _, b in pairs}:
            low, high = (pick([box[i] for box in moving], axis=0) + start for i, pick in enumerate((np.min, np.max)))
            still_low, still_high = _box(self.solids[name], place[name])
            if beside or all(low[i] < still_high[i] and high[i] > still_low[i] for i in across):
                length = max(length, float(still_high[k] - low[k] if u[k] > 0.0 else high[k] - still_low[k]))
        return length

    def _bends(self, pairs: list[Pair], place: Poses, origin: str) -> Iterator[float]:
        """How far a first leg may go: past all that is no wire, along the wires; else a part of the free way."""
        here, standing = np.zeros(3), [pair for pair in pairs if pair[1] not in WIRES]
        if DIRECTIONS[origin][1]:
            length = self._length(standing, place, here, origin, beside=True) + SPARE
            if length <= self._farthest and self._is_free(pairs, place, here, out(origin, length)):
                yield length
            return
        reach = min(self._length(pairs, place, here, origin), self._farthest)
        if reach <= 0.0 or not self._is_free(pairs, place, here, out(origin, min(reach, _SHORTEST / _BENDS[1]))):
            return
        free = reach * self._first(pairs, place, here, out(origin, reach))[0]
        yield from (part * free for part in _BENDS)

    def _is_free(self, pairs: list[Pair], place: Poses, start: Array, by: Array) -> bool:
        """Whether nothing overlaps on a way; what does is put first."""
        for pair in pairs:
            if self._clash(pair, place, start, by) is not None:
                pairs.remove(pair)
                pairs.insert(0, pair)
                return False
        return True

    def _first(self, pairs: Sequence[Pair], place: Poses, start: Array, by: Array) -> tuple[float, Pair | None]:
        """Up to which part of their way ``by`` (3,) the moving parts, ``start`` off their place, overlap nothing."""
        share, first = 1.0, None
        for pair in pairs:
            row = self._clash(pair, place, start, share * by)
            while row is not None:
                earlier = share * self._onset(pair, place, start, share * by, row)
                is_new = share - earlier > RESOLUTION / float(np.abs(by).max())
                share, first = earlier, pair
                row = self._clash(pair, place, start, share * by) if is_new else None
        return share, first

    def _onset(self, pair: Pair, place: Poses, start: Array, by: Array, row: PairResult) -> float:
        """Where on its way ``by`` (3,) a pair begins an overlap, as a share of it: there may be an earlier one."""
        length = float(np.abs(by).max())
        # Before they touch they are apart, and at the time of their least distance they overlap.
        low, high = row.contact_at or 0.0, 1.0 if row.t is None else row.t
        middle = low + _LOOK / length
        while (high - low) * length > RESOLUTION:
            middle = middle if low < middle < high else 0.5 * (low + high)
            if self._overlap(pair, place, start + middle * by) is None:
                low = middle
            else:
                high = middle
        return low

    def _overlap(self, pair: Pair, place: Poses, offset: Array) -> PairResult | None:
        """The row of a pair that overlaps with the moving part ``offset`` (3,) off its place."""
        there = check(self._scene([pair], place, offset), pairs=[pair], depths=False, cache=self.cache)
        return None if there.clean else there.rows[0]

    def _clash(self, pair: Pair, place: Poses, start: Array, by: Array) -> PairResult | None:
        """The row of a pair that overlaps on its way, or may do so."""
        for t in _LOOKS:
            row = self._overlap(pair, place, start + t * by)
            if row is not None:
                return replace(row, t=t)
        scene = self._scene([pair], place, start, by)
        rows = check(scene, pairs=[pair], depths=False, cache=self.cache).rows
        return next((row for row in rows if row.verdict in NOT_CLEAN), None)

    def _scene(
        self,
        pairs: Sequence[Pair],
        place: Poses,
        start: Array,
        by: Array | None = None,
        *,
        solids: Mapping[PartName, Solid] | None = None,
        name: str = "way",
    ) -> Scene:
        """The parts of ``pairs``, those that move ``start`` off their place, with their motion ``by`` (3,)."""
        moving, T = sorted({a for a, _ in pairs}), np.eye(4)
        T[:3, 3] = start
        shapes = solids or self.solids
        shown = [n for n in shapes if n in {part for pair in pairs for part in pair}]
        placed = tuple(Part(n, shapes[n], T @ place[n] if n in moving else place[n]) for n in shown)
        motions = () if by is None else (Motion.translate(by, parts=tuple(moving), name=name),)
        meant = tuple(Allowed(a, b) for a, b in itertools.combinations(shown, 2))
        return Scene(placed, RESOLUTION, 0.0, meant, motions)


def _box(solid: Solid, T: Array) -> Box:
    """Corners of the box around a solid at a pose (4, 4)."""
    high = np.array([max(body.support(row) for body in solid.bodies) for row in T[:3, :3]])
    low = np.array([max(body.support(-row) for body in solid.bodies) for row in T[:3, :3]])
    return T[:3, 3] - low, T[:3, 3] + high


def out(origin: str, length: float = 1.0) -> Array:
    """The offset (3,) of parts that come from ``length`` mm away."""
    return length * np.array(DIRECTIONS[origin])


def way_out(legs: Sequence[Leg]) -> list[Array]:
    """Where a way out leads: the offsets (3,) from the place after each of its legs."""
    return list(np.cumsum([out(*leg) for leg in legs], axis=0))
