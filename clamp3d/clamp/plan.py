"""The plan of a sequence that is not the paper's own: ways of its steps, and where parts wait clear of each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from clamp3d.clamp.contact import Poses
from clamp3d.clamp.dimensions import PARTS, Clamp, PartName
from clamp3d.clamp.matrix import Pair
from clamp3d.clamp.parts import parts
from clamp3d.clamp.path import Offsets
from clamp3d.clamp.sequence import Step
from clamp3d.clamp.ways import DIRECTIONS, SPARE, Insertion, Leg, corners
from clamp3d.engine.model import ModelCache
from clamp3d.errors import SequenceError, SolverError
from clamp3d.geometry.pose import Array

_ROUNDS = 1000


class Plan:
    """The ways of all ``steps``, and where each part stands before each step.

    ``bases`` are the poses before each step and after the last, of parts that do not wait; ``rise`` (mm) is how far the
    nut draws the bolt up. Raises SequenceError for a step that no way leads to.
    """

    def __init__(
        self, clamp: Clamp, steps: Sequence[Step], bases: Sequence[Poses], rise: float, cache: ModelCache
    ) -> None:
        self.clamp, self.steps, self.bases, self._cache = clamp, steps, bases, cache
        self.legs = [self._way(k, rise) for k in range(len(steps))]
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
        """The way out of the parts that a step brings; none for a step that closes the clamp."""
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
        """Move what waits out of the way of what moves before it: it waits further out on its own way."""
        for _ in range(_ROUNDS):
            conflict = next(self._conflicts(), None)
            if conflict is None:
                return
            step, length = conflict
            *legs, (origin, last) = self.legs[step]
            self.legs[step] = (*legs, (origin, last + length))
        raise SolverError(f"no places found where the parts of {' -> '.join(map(str, self.steps))} can wait apart")

    def _conflicts(self) -> Iterator[tuple[int, float]]:
        """Steps that must bring their parts from further away, and by how much, mm."""
        for k, step in enumerate(self.steps):
            boxes = self._swept(k)
            for a, b in itertools.permutations(PARTS, 2):
                later = self._parting(a, b, k)
                moves = a < b if step.kind != "bring" else a in step.parts and b not in step.parts
                if later is None or not moves:
                    continue
                (low, high), (other_low, other_high) = boxes[a], boxes[b]
                if max((low - other_high).max(), (other_low - high).max()) >= 0.5 * SPARE:
                    continue
                direction = np.array(DIRECTIONS[self.legs[later][-1][0]])
                axis = int(np.argmax(np.abs(direction)))
                # Whichever of the two that step brings goes further out.
                is_up = (direction.sum() > 0.0) == (b in self.steps[later].parts)
                yield later, float(high[axis] - other_low[axis] if is_up else other_high[axis] - low[axis]) + SPARE

    def _swept(self, k: int) -> dict[PartName, Array]:
        """Boxes (2, 3) around the parts' ways in step k; the bend of a way is a corner of the box around its ends."""
        before, after = self.offsets(k), self.offsets(k + 1)
        swept = {}
        for name in PARTS:
            ends = np.array([self._boxes[j][name] + way[name] for j in (k, k + 1) for way in (before, after)])
            swept[name] = np.array([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)])
        return swept

    @cached_property
    def _boxes(self) -> list[dict[PartName, Array]]:
        """The box (2, 3) around each part at each of the bases."""
        solids = parts(self.clamp)
        return [{name: solids[name].bounds_at(pose.T()) for name, pose in base.items()} for base in self.bases]
