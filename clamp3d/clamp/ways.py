"""Ways by which parts come to their places, straight or with one bend: motions of a scene, asked of `check` as a whole.

They are found by taking parts out: what comes out on a way comes in on it. A group moves as one. A way ends where the
group's box is apart from the boxes of all that stands there; wires go on far beyond what is drawn of them, so no way
leads over a wire's end. It counts as free only where `check` proves that nothing overlaps by more than `RESOLUTION`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clamp3d.clamp.dimensions import PARTS, TITLES, TOUCHING, Clamp, Pair, PartName
from clamp3d.clamp.parts import parts, wire_solid
from clamp3d.clamp.plain import plain
from clamp3d.clamp.section import WIRES, D, Section
from clamp3d.clamp.sequence import Step
from clamp3d.engine.allowed import Allowed
from clamp3d.engine.check import check
from clamp3d.engine.model import ModelCache
from clamp3d.engine.result import NOT_CLEAN, PairResult
from clamp3d.engine.scene import Part, Scene
from clamp3d.errors import SequenceError
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import Solid

SPARE = 20.0
"""Free way in mm between a part that waits and what is in its way; chosen, to be seen in pictures."""
RESOLUTION = 1e-3
"""Overlap in mm up to which parts on their way touch: they slide along each other, which rounding must not block."""
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
"""How many times as long as drawn a wire is taken to be: no way is as long."""
_BENDS = (0.5, 0.25, 0.75)
"""Where a way out bends, in parts of how far the parts can go before they meet something; chosen: half-way first."""
_SAMPLES = (0.5, 0.25, 0.125, 0.0625, 0.03125)
"""Where a way is checked before all of it is: most ways that are blocked show it there."""
_SHORTEST = 0.5
"""Shortest leg of a way with a bend, mm; chosen."""
_HERE = np.zeros(3)
Offsets = Mapping[PartName, Array]
"""How far parts that wait are from where the section has them, (3,) mm of the world."""

Meetings = list[tuple[Pair, Array]]
"""Pairs of parts, each with the state (10,) in which they meet."""

Leg = tuple[str, float]
"""Where the parts come from (`DIRECTIONS`), and how far, mm; a way out is its legs from the place."""


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


class Insertion:
    """Parts that come to their places as one: the first ones of ``pairs`` move, the second ones stand.

    ``place`` holds their poses (4, 4) in the world, ``cache`` keeps their models.
    """

    def __init__(
        self, clamp: Clamp, pairs: Sequence[Pair], place: Mapping[PartName, Array], cache: ModelCache | None = None
    ) -> None:
        self.clamp, self.pairs, self.place, self.cache = clamp, pairs, place, cache or ModelCache()
        self._moving, self._standing = (tuple(sorted({pair[k] for pair in pairs})) for k in (0, 1))
        length = _ENDLESS * clamp.wire_length
        self._farthest = 0.5 * (length - 2.0 * clamp.wire_length)  # a longer way would lead over a wire's end
        wires = zip(WIRES, (clamp.line, clamp.jumper), strict=True)
        self._solids = parts(clamp) | {name: wire_solid(name, wire.radius, length) for name, wire in wires}

    def way_out(self) -> tuple[Leg, ...]:
        """The first free way; empty if there is none, and `blocks` says why."""
        bends: Iterator[tuple[Leg, ...]] = ((leg,) for leg in self._bends())
        for legs in itertools.chain([()], bends):
            corner = sum((out(*leg) for leg in legs), _HERE)
            for then, length in self._exits(corner):
                is_square = all(float(out(then) @ out(origin)) == 0.0 for origin, _ in legs)
                if is_square and self._is_free(corner, out(then, length)):
                    return (*legs, (then, length + SPARE))
        return ()

    def blocks(self) -> tuple[Block, ...]:
        """What each straight way in meets first, the way that leads nearest to the place first."""
        blocks = [self.block(origin, length + SPARE) for origin, length in self._exits(_HERE)]
        return tuple(sorted(filter(None, blocks), key=lambda block: block.way - block.travel))

    def block(self, origin: str, length: float) -> Block | None:
        """What meets first on the straight way in from ``length`` mm away; None if it is free."""
        start = out(origin, length)
        row = self._first_overlap(start, -start)
        if row is None:
            return None
        pair = [(row.a, row.b)]
        way = replace(self._scene(self._solids, start, -start), contact=TOUCHING)
        (met,) = check(way, pairs=pair, depths=False, cache=self.cache).motions
        share = met.contact_at or 0.0
        contact = self._scene(self._solids, (1.0 - share) * start)
        (there,) = check(contact, pairs=pair, distances=True, depths=False, cache=self.cache).pairs
        point = there.distance.point_b if there.a == row.a else there.distance.point_a
        return Block(origin, row.a, row.b, point, share * length, length)

    def scene(self, block: Block) -> Scene:
        """The parts as drawn, with the motion that ``block`` blocks, up to the place."""
        start = out(block.origin, block.way)
        scene = self._scene(parts(self.clamp), start, -start, name=f"{block.a} {block.origin}")
        return replace(scene, name=f"{self.clamp.name} clamp: the step that is blocked")

    def _exits(self, start: Array) -> Iterator[Leg]:
        """Directions that lead out, each with how far until the moving parts' common box leaves that of the others."""
        for origin in DIRECTIONS:
            length = self._length(start, origin, self._standing)
            if length <= self._farthest:
                yield origin, length

    def _bends(self) -> Iterator[Leg]:
        """First legs: along the wires past all that is no wire, else a part of how far the parts can go."""
        for origin, (_, along, _) in DIRECTIONS.items():
            others = [name for name in self._standing if not (along and name in WIRES)]
            length = self._length(_HERE, origin, others, beside=True) + SPARE
            if length > self._farthest:
                continue
            row = self._first_overlap(_HERE, out(origin, length))
            if along:
                yield from [(origin, length)] if row is None else []
            elif (free := length * (1.0 if row is None else row.contact_at or 0.0)) >= _SHORTEST:
                yield from ((origin, part * free) for part in _BENDS)

    def _length(self, start: Array, origin: str, standing: Sequence[PartName], *, beside: bool = False) -> float:
        """How far the moving parts, ``start`` off their place, go until their common box is past all ``standing``.

        Boxes that they pass beside do not count, unless ``beside``.
        """
        boxes, still = (
            np.array([self._solids[name].bounds_at(self.place[name]) for name in names]).reshape(-1, 2, 3)
            for names in (self._moving, standing)
        )
        low, high = boxes[:, 0].min(axis=0, initial=np.inf) + start, boxes[:, 1].max(axis=0, initial=-np.inf) + start
        k, is_up = int(np.argmax(np.abs(out(origin)))), out(origin).sum() > 0.0
        meets = np.delete((low < still[:, 1]) & (high > still[:, 0]), k, axis=1).all(axis=1)
        lengths = still[:, 1, k] - low[k] if is_up else high[k] - still[:, 0, k]
        return float(lengths[meets | beside].max(initial=0.0))

    def _is_free(self, start: Array, by: Array) -> bool:
        """Whether nothing overlaps on the way ``by`` (3,) from ``start`` (3,) off the place."""
        if not self.pairs:
            return True
        samples = (self._check(self._scene(self._solids, start + t * by)) for t in _SAMPLES)
        return not any(samples) and self._first_overlap(start, by) is None

    def _first_overlap(self, start: Array, by: Array) -> PairResult | None:
        """The row of the pair that overlaps on the way, or may do so, and is the first of those to touch."""
        rows = self._check(self._scene(self._solids, start, by))
        return min((row for row in rows if row.motion), key=lambda row: row.contact_at or 0.0, default=None)

    def _check(self, scene: Scene) -> list[PairResult]:
        """What is not clean."""
        rows = check(scene, pairs=self.pairs, depths=False, cache=self.cache).rows
        return [row for row in rows if row.verdict in NOT_CLEAN]

    def _scene(
        self, solids: Mapping[PartName, Solid], start: Array, by: Array | None = None, name: str = "way"
    ) -> Scene:
        """The parts with those that move ``start`` (3,) off their place, and their motion ``by`` (3,)."""
        present, T = {part for pair in self.pairs for part in pair}, np.eye(4)
        T[:3, 3] = start
        placed = tuple(
            Part(part, solid, T @ self.place[part] if part in self._moving else self.place[part])
            for part, solid in solids.items()
            if part in present
        )
        motions = () if by is None else (Motion.translate(by, parts=self._moving, name=name),)
        meant = tuple(Allowed(a, b) for a, b in itertools.combinations(sorted(present), 2))
        return Scene(placed, RESOLUTION, 0.0, meant, motions)


def out(origin: str, length: float = 1.0) -> Array:
    """The offset (3,) of parts that come from ``length`` mm away."""
    return length * np.array(DIRECTIONS[origin])


def corners(legs: Sequence[Leg]) -> list[Array]:
    """Where a way out leads: the offsets (3,) from the place after each of its legs."""
    return list(np.cumsum([out(*leg) for leg in legs], axis=0))


@dataclass(frozen=True)
class Closing:
    """What the solver found: the states at the start, closed by hand and at the end, and the contacts on the way."""

    start: Array
    held: Array
    end: Array
    met: Meetings

    @property
    def travel(self) -> float:
        """The way that the nut goes until it is tight, mm."""
        return float(self.start[D] - self.end[D])


class Plan:
    """The ways of all ``steps``, and where each part stands before each step.

    The ways are searched for unless they are ``published``. ``bases`` are the poses before each step and after the
    last, of parts that do not wait. Raises SequenceError for a step that no way leads to.
    """

    def __init__(
        self,
        section: Section,
        steps: Sequence[Step],
        closing: Closing,
        cache: ModelCache,
        published: list[tuple[Leg, ...]] | None = None,
    ) -> None:
        self.clamp, self.steps, self._cache, self.is_published = section.clamp, steps, cache, published is not None
        start, end = section.poses(closing.start), section.poses(closing.end)
        held = section.poses(closing.held, saddle_d=float(closing.start[D]))
        self.bases = [start]
        for step in steps:
            self.bases.append({"bring": self.bases[-1], "close": held, "tighten": end}[step.kind])
        self.legs = published or [self._way(k, closing.travel) for k in range(len(steps))]
        if not self.is_published:
            self._spread()

    def offsets(self, k: int) -> Offsets:
        """How far each part is from its place before step k: by the ways of all steps that still bring it."""
        offsets = {name: np.zeros(3) for name in PARTS}
        for step, legs in zip(self.steps[k:], self.legs[k:], strict=True):
            for name in step.parts if legs else ():
                offsets[name] = offsets[name] + corners(legs)[-1]
        return offsets

    def meeting_pairs(self, k: int) -> list[Pair]:
        """Each part that step k moves with each other part that no later step moves against it."""
        moving = sorted(self.steps[k].parts - ({"P5"} if self.steps[k].kind == "tighten" else set()))
        standing = [name for name in PARTS if name not in self.steps[k].parts]
        return [(a, b) for a in moving for b in standing if self._parting(a, b, k) is None]

    def _parting(self, a: PartName, b: PartName, k: int) -> int | None:
        """The last step after k that brings one of two parts without the other."""
        later = [j for j, step in enumerate(self.steps) if j > k and step.kind == "bring"]
        return next((j for j in reversed(later) if len(self.steps[j].parts & {a, b}) == 1), None)

    def _way(self, k: int, rise: float) -> tuple[Leg, ...]:
        """The way out of the parts that a step brings; none for a step that closes the clamp.

        ``rise`` (mm) is how far the nut draws the bolt up.
        """
        step, place = self.steps[k], {name: pose.T() for name, pose in self.bases[k].items()}
        insertion = Insertion(self.clamp, self.meeting_pairs(k), place, self._cache)
        if step.kind == "bring":
            if legs := insertion.way_out():
                return legs
            blocks = insertion.blocks()
            problem = (
                "no way to its place is free, straight or with one bend; the straight one that leads nearest is blocked"
            )
        elif step.kind == "tighten" and "P2" not in step.parts and self.bases[k] is self.bases[0]:
            for name in step.parts - {"P5"}:
                place[name][2, 3] += rise
            block = insertion.block("from below", rise)
            blocks, problem = (block,) if block else (), "the nut cannot draw the bolt up"
        else:
            return ()
        if not blocks:
            return ()
        raise SequenceError(
            f"sequence step {k + 1}, {step}: {problem}: {blocks[0]}", blocks, insertion.scene(blocks[0])
        )

    def _spread(self) -> None:
        """What waits where something comes near it before its own step waits further out on its own way."""
        for later, step in enumerate(self.steps):
            while step.kind == "bring" and (length := self._lacking(later)):
                *legs, (origin, last) = self.legs[later]
                self.legs[later] = (*legs, (origin, last + length))

    def _lacking(self, later: int) -> float:
        """How much further out the parts that a step brings must wait than they do, mm."""
        moving, direction, lengths = self.steps[later].parts, out(self.legs[later][-1][0]), [0.0]
        for k, a, b in itertools.product(range(later), moving, PARTS):
            if b not in moving and self._parting(a, b, k) == later:
                (low, high), (other_low, other_high) = own, other = self._swept(k, a), self._swept(k, b)
                if max((low - other_high).max(), (other_low - high).max()) < 0.5 * SPARE:
                    lengths.append(float((other @ direction).max() - (own @ direction).min()) + SPARE)
        return max(lengths)

    def _swept(self, k: int, name: PartName) -> Array:
        """Box (2, 3) around a part's way in step k; the bend of a way is a corner of the box around its ends."""
        solid, ways = parts(self.clamp)[name], (self.offsets(k)[name], self.offsets(k + 1)[name])
        ends = np.array([solid.bounds_at(self.bases[j][name].T()) + way for j in (k, k + 1) for way in ways])
        return np.array([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)])
