"""The way by which parts come to their place, found by taking them out: straight, or with one bend.

What comes out on a way comes in on it (assembly by disassembly). A way counts as free only if the continuous test of
the bodies proves that no overlap on it is deeper than that test resolves (1e-4 mm); touching is free.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from clamp3d.clamp.dimensions import TITLES, Clamp, PartName
from clamp3d.clamp.matrix import Pair, plain
from clamp3d.clamp.parts import parts
from clamp3d.clamp.scene import CONTACT, clamp_scene
from clamp3d.clamp.section import WIRES
from clamp3d.collide.distance import Distance
from clamp3d.collide.model import ModelCache
from clamp3d.collide.moving_pair import ACCURACY, MovingPair, box_corners, first_time
from clamp3d.collide.refine import measured
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.linear import dot
from clamp3d.core.motion import Motion
from clamp3d.core.pose import Array

SPARE = 20.0
"""Free way in mm between a part that waits and what is in its way."""
DIRECTIONS: dict[str, tuple[float, float, float]] = {
    "from above": (0.0, 0.0, 1.0),
    "from below": (0.0, 0.0, -1.0),
    "from the right": (1.0, 0.0, 0.0),
    "from the left": (-1.0, 0.0, 0.0),
    "from behind": (0.0, 1.0, 0.0),
    "from the front": (0.0, -1.0, 0.0),
}
"""Where a part can come from, as unit vectors of the world: along the bolt, across the wires, along them."""
_BENDS = (0.5, 0.25, 0.75)
"""Where a way out bends, in parts of how far the parts can go before they meet something."""
_LOOKS = (0.5, 0.25, 0.125, 0.0625, 0.03125)
"""Where a way is looked at before it is proven: most ways that are blocked show it."""
_SHORTEST = 0.5
"""Shortest leg of a way with a bend, mm."""
_THRESHOLDS = Thresholds(CONTACT)

Leg = tuple[str, float]
"""Where the parts come from (`DIRECTIONS`), and how far, mm; a way out is its legs from the place."""
Poses = Mapping[PartName, Array]


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
    """Searches ways of a clamp's parts; ``cache`` keeps their models."""

    clamp: Clamp
    cache: ModelCache = field(default_factory=ModelCache)

    def __post_init__(self) -> None:
        self.models = {name: self.cache.model(solid) for name, solid in parts(self.clamp).items()}

    def find(self, pairs: Sequence[Pair], place: Poses) -> tuple[Leg, ...]:
        """The first free way out of ``place`` (world poses) for the first parts of ``pairs``; the second ones stand.

        Empty if nothing is free; `blocks` says why.
        """
        todo = list(pairs)  # what blocked one way is asked first about the next
        ways = list(self._outward(pairs, place, np.zeros(3)))
        for origin, length in ways:
            if self._free(todo, place, np.zeros(3), origin, length):
                return ((origin, length + SPARE),)
        for origin, length in ways:
            if not self._free(todo, place, np.zeros(3), origin, min(length, _SHORTEST / _BENDS[1])):
                continue
            free = length * self._first(todo, place, np.zeros(3), _out(origin, length))[0]
            for part in _BENDS:
                corner = _out(origin, part * free)
                for then, more in self._outward(pairs, place, corner):
                    if dot(_out(then), _out(origin)) == 0.0 and self._free(todo, place, corner, then, more):
                        return ((origin, part * free), (then, more + SPARE))
        return self._slide(pairs, place)

    def _slide(self, pairs: Sequence[Pair], place: Poses) -> tuple[Leg, ...]:
        """The first free way out along the wires, past all that is no wire, and then across them; empty if none is.

        Where a part leaves a wire nothing else is beside it, and the wire is as it is at the place: it has no end.
        """
        wires, here = [pair for pair in pairs if pair[1] in WIRES], np.zeros(3)
        others = [pair for pair in pairs if pair not in wires]
        if not wires or any(a in WIRES for a, _ in pairs):
            return ()
        for then, more in self._outward(wires, place, here):
            if DIRECTIONS[then][1] or not self._free(wires, place, here, then, more):
                continue
            for origin, length in self._outward(others, place, here):
                if DIRECTIONS[origin][1] and self._free(others, place, here, origin, length):
                    return ((origin, length + SPARE), (then, more + SPARE))
            break
        return ()

    def blocks(self, pairs: Sequence[Pair], place: Poses) -> tuple[Block, ...]:
        """What each straight way in meets first, the way that leads nearest to the place first."""
        ways = self._outward(pairs, place, np.zeros(3))
        found = [self.block(pairs, place, origin, length + SPARE) for origin, length in ways]
        return tuple(sorted(filter(None, found), key=lambda block: block.way - block.travel))

    def block(self, pairs: Sequence[Pair], place: Poses, origin: str, length: float) -> Block | None:
        """What meets first on the straight way of ``length`` mm to ``place``; None if it is free."""
        start = _out(origin, length)
        t, pair = self._first(pairs, place, start, -start)
        if pair is None:
            return None
        moving = self._moving(pair, place, start, -start)
        met = moving.ask(t, measured, _THRESHOLDS).moved(moving.motion.at(t, moving.start))
        return Block(origin, *pair, met.point_b, t * length, length)

    def scene(self, pairs: Sequence[Pair], place: Poses, block: Block) -> Scene:
        """The parts of ``pairs`` with the motion that ``block`` blocks, up to the place."""
        moving, start = {a for a, _ in pairs}, np.eye(4)
        start[:3, 3] = _out(block.origin, block.way)
        whole = clamp_scene(self.clamp, {name: dot(start, T) if name in moving else T for name, T in place.items()})
        shown = {name for pair in pairs for name in pair}
        motion = Motion.translate(-start[:3, 3], parts=tuple(sorted(moving)), name=f"{block.a} {block.origin}")
        return replace(
            whole,
            parts=tuple(part for part in whole.parts if part.name in shown),
            allowed=tuple(pair for pair in whole.allowed if {pair.a, pair.b} <= shown),
            motions=(motion,),
            name=f"{self.clamp.name} clamp: the step that is blocked",
        )

    def _first(self, pairs: Sequence[Pair], place: Poses, start: Array, by: Array) -> tuple[float, Pair | None]:
        """Up to which part of their way ``by`` (3,) the first parts, ``start`` off their place, overlap nothing."""
        t, met = 1.0, None
        for pair in pairs:
            if t * float(np.abs(by).max()) <= ACCURACY:  # nothing is told apart on so short a way
                break
            if self._apart(pair, place, start, t * by):
                continue
            part = first_time(self._moving(pair, place, start, t * by), 1.0, _THRESHOLDS, -ACCURACY)
            if part < 1.0:
                t, met = part * t, pair
        return t, met

    def _free(self, pairs: list[Pair], place: Poses, start: Array, origin: str, length: float) -> bool:
        """Whether nothing overlaps on a way out; what does is put first."""
        by = _out(origin, length)
        for pair in pairs:
            if self._apart(pair, place, start, by):
                continue
            moving = self._moving(pair, place, start, by)
            if (
                any(moving.ask(t, _known, _THRESHOLDS).upper < -ACCURACY for t in _LOOKS)
                or first_time(moving, 1.0, _THRESHOLDS, -ACCURACY) < 1.0
            ):
                pairs.remove(pair)
                pairs.insert(0, pair)
                return False
        return True

    def _apart(self, pair: Pair, place: Poses, start: Array, by: Array) -> bool:
        """Whether the boxes of a pair stay apart on a way."""
        (low, high), (still_low, still_high) = self.box(pair[0], place), self.box(pair[1], place)
        low, high = low + start + np.minimum(by, 0.0), high + start + np.maximum(by, 0.0)
        return bool((low > still_high).any() or (high < still_low).any())

    def _moving(self, pair: Pair, place: Poses, start: Array, by: Array) -> MovingPair:
        a, b = pair
        T = place[a].copy()
        T[:3, 3] += start
        return MovingPair(self.models[a], self.models[b], Motion.translate(by), T, place[b])

    def box(self, part: PartName, place: Poses) -> tuple[Array, Array]:
        """Corners of the box around a part."""
        points = box_corners(self.models[part], place[part])
        return points.min(axis=0), points.max(axis=0)

    def _outward(self, pairs: Sequence[Pair], place: Poses, start: Array) -> Iterator[Leg]:
        """Directions, each with how far the moving parts must go until their common box leaves that of the others.

        A wire goes on beyond what is drawn of it: nothing that it crosses in the section leaves it lengthwise.
        """
        boxes = {name: np.array(self.box(name, place)) for pair in pairs for name in pair}
        for name, _ in pairs:
            boxes[name] = np.array(self.box(name, place)) + start
        for origin, u in DIRECTIONS.items():
            k = int(np.argmax(np.abs(u)))
            across = [i for i in range(3) if i != k]

            def beside(a: Array, b: Array, across: Sequence[int] = across) -> bool:
                return any(a[0, i] >= b[1, i] or a[1, i] <= b[0, i] for i in across)

            lengthwise = [(a, b) for a, b in pairs if k == 1 and {a, b} & set(WIRES)]
            if any(not beside(boxes[a], boxes[b]) for a, b in lengthwise):
                continue
            counted = [pair for pair in pairs if pair not in lengthwise]
            length = 0.0
            if counted:
                (low, high), (still_low, still_high) = (
                    (np.min([boxes[n][0] for n in names], axis=0), np.max([boxes[n][1] for n in names], axis=0))
                    for names in map(set, zip(*counted, strict=True))
                )
                length = float(still_high[k] - low[k] if u[k] > 0.0 else high[k] - still_low[k])
            yield origin, max(length, 0.0)


def _known(found: Distance) -> bool:
    """Whether bounds say on which side of an overlap a distance is."""
    return found.upper < -ACCURACY or found.lower >= -ACCURACY


def _out(origin: str, length: float = 1.0) -> Array:
    return length * np.array(DIRECTIONS[origin])


def way_out(legs: Sequence[Leg]) -> list[Array]:
    """Where a way out leads: the offsets (3,) from the place after each of its legs."""
    return list(np.cumsum([_out(*leg) for leg in legs], axis=0))
