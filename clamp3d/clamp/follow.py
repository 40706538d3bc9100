"""A sequence that is not the paper's own: its ways are found, the parts wait clear of each other, all is played."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from clamp3d.clamp.dimensions import PARTS, PartName
from clamp3d.clamp.matrix import PAIRS, Pair
from clamp3d.clamp.scene import CONTACT
from clamp3d.clamp.section import D, Section
from clamp3d.clamp.sequence import Step
from clamp3d.clamp.steps import Closing, Log, close_splints, tighten_nut
from clamp3d.clamp.ways import DIRECTIONS, SPARE, Leg, Ways, way_out
from clamp3d.errors import SequenceError, SolverError
from clamp3d.geometry.pose import Array

SCREW: Pair = ("P4", "P5")
Offsets = dict[PartName, Array]
_ROUNDS = 1000


def follow(section: Section, steps: Sequence[Step], closing: Closing, log: Log) -> float:
    """Play ``steps``; returns the way that the nut has gone when it is tight, mm.

    Raises SequenceError for a step that no way leads to.
    """
    plan = _Plan(section, steps, closing, log)
    log.aside, travel = plan.offsets(0), 0.0
    log.reach(steps[0].name, "parts apart", plan.bases[0])
    for k, step in enumerate(steps):
        if step.kind == "bring":
            _bring(section, plan, k, log)
            continue
        if step.kind == "close":
            met = [(pair, q) for pair, q in closing.by_hand if not any(log.aside[name].any() for name in pair)]
            close_splints(section, closing.start, closing.held, met, step.name, log)
            continue
        drawn = closing
        if "P2" in step.parts:  # the saddle goes with it
            for pair, q in [*closing.by_hand, *closing.taken]:
                log.reach(step.name, f"down splint touches {pair[1]}", section.poses(q))
                log.touch(q, step.name, pair, float(closing.start[D] - q[D]))
            drawn = replace(closing, held=closing.end, taken=[])
        travel = tighten_nut(section, drawn, step.name, log)
    return travel


def _bring(section: Section, plan: _Plan, k: int, log: Log) -> None:
    """The parts of a step come in on their way; they end where they touch, if they do."""
    step, legs, base, before = plan.steps[k], plan.legs[k], plan.bases[k], log.aside
    end = plan.offsets(k + 1)
    origin, length = legs[0]
    corners = [(way_out(legs[:1])[0], f"{step.part} before its place, {legs[1][0]}")] if legs[1:] else []
    engaged = base["P5"].y + section.clamp.nut.height - base["P4"].y
    if _meet_screw(step, plan.together(k)) and DIRECTIONS[origin][2] and 0.0 < engaged < length:
        corners.append((way_out([(origin, engaged)])[0], "nut on the bolt's end"))
    for corner, label in corners:
        log.aside = before | {name: end[name] + corner for name in step.parts}
        log.reach(step.name, label, base)
    log.aside = end
    log.reach(step.name, f"{step.part} in place, {origin}", base)
    near = [pair for pair in PAIRS if len(step.parts.intersection(pair)) == 1 and pair in plan.together(k)]
    log.measure(base, step.name, near, sum(length for _, length in legs), within=CONTACT)


def _meet_screw(step: Step, together: set[Pair]) -> bool:
    return len(step.parts.intersection(SCREW)) == 1 and SCREW in together


class _Plan:
    """The ways of all steps, and where each part stands before each step."""

    def __init__(self, section: Section, steps: Sequence[Step], closing: Closing, log: Log) -> None:
        self.steps, self._ways = steps, Ways(section.clamp, log.cache)
        start = section.poses(closing.start)
        held = section.poses(closing.held, saddle_d=float(closing.start[D]))
        self.bases = [start]
        for step in steps:
            kinds = {"bring": self.bases[-1], "close": held, "tighten": section.poses(closing.end)}
            self.bases.append(kinds[step.kind])
        self.legs: list[tuple[Leg, ...]] = [()] * len(steps)
        rise = float(closing.start[D] - closing.end[D])
        for k in range(len(steps)):
            self._search(k, rise)
        self._spread()

    def offsets(self, k: int) -> Offsets:
        """How far each part is from its place before step k: by the ways of all steps that still bring it."""
        found = {name: np.zeros(3) for name in PARTS}
        for step, legs in zip(self.steps[k:], self.legs[k:], strict=True):
            for name in step.parts if legs else ():
                found[name] = found[name] + way_out(legs)[-1]
        return found

    def together(self, k: int) -> set[Pair]:
        """Ordered pairs that no later step than k moves against each other."""
        return {(a, b) for a in PARTS for b in PARTS if a != b and self._last(a, b, k) is None}

    def _last(self, a: PartName, b: PartName, k: int) -> int | None:
        """The last step after k that brings one of two parts without the other."""
        later = [j for j in range(k + 1, len(self.steps)) if self.steps[j].kind == "bring"]
        return next((j for j in reversed(later) if len(self.steps[j].parts & {a, b}) == 1), None)

    def _search(self, k: int, rise: float) -> None:
        step = self.steps[k]
        together = self.together(k)
        place = {name: pose.T() for name, pose in self.bases[k].items()}
        moving = sorted(step.parts - {"P5"} if step.kind == "tighten" else step.parts)
        pairs = [(a, b) for a in moving for b in PARTS if b not in step.parts and (a, b) in together]
        if step.kind == "bring":
            self.legs[k] = self._ways.find(pairs, place)
            if not self.legs[k]:
                blocks = self._ways.blocks(pairs, place)
                raise SequenceError(
                    f"sequence step {k + 1}, {step}: no way to its place is free, straight or with one bend; "
                    f"the straight one that leads nearest is blocked: {blocks[0]}",
                    blocks,
                    self._ways.scene(pairs, place, blocks[0]),
                )
        elif step.kind == "tighten" and "P2" not in step.parts and self.bases[k] is self.bases[0]:
            for name in moving:
                place[name][2, 3] += rise
            block = self._ways.block(pairs, place, "from below", rise)
            if block is not None:
                raise SequenceError(
                    f"sequence step {k + 1}, {step}: the nut cannot draw the bolt up: {block}",
                    (block,),
                    self._ways.scene(pairs, place, block),
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
            for a in PARTS:
                for b in PARTS:
                    last = self._last(a, b, k)
                    moves = a < b if step.kind != "bring" else a in step.parts and b not in step.parts
                    if last is None or not moves:
                        continue
                    (low, high), (other_low, other_high) = boxes[a], boxes[b]
                    if max((low - other_high).max(), (other_low - high).max()) >= 0.5 * SPARE:
                        continue
                    origin = self.legs[last][-1][0]
                    axis, sign = int(np.argmax(np.abs(DIRECTIONS[origin]))), sum(DIRECTIONS[origin])
                    # whichever of the two that step brings goes further out
                    out = sign if b in self.steps[last].parts else -sign
                    yield (
                        last,
                        float(high[axis] - other_low[axis] if out > 0.0 else other_high[axis] - low[axis]) + SPARE,
                    )

    def _swept(self, k: int) -> dict[PartName, tuple[Array, Array]]:
        """Boxes around the parts' ways in step k; the bend of a way is a corner of the box around its ends."""
        before, after = self.offsets(k), self.offsets(k + 1)
        found = {}
        for name in PARTS:
            ways = [before[name], after[name]]
            boxes = [self._ways.box(name, {name: self.bases[j][name].T()}) for j in (k, k + 1)]
            low = np.min([box[0] + way for box in boxes for way in ways], axis=0)
            high = np.max([box[1] + way for box in boxes for way in ways], axis=0)
            found[name] = low, high
        return found
