"""Assembly sequence in the paper's notation: ``P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4`` (its Section 2).

A step takes its parts, as one body, from where they wait to their places in the open clamp, as it hangs on the line. A
part that moves again was put together with others beside the line, and goes on with them. Two steps close the clamp:
P2 alone, once it is in place, rises to the wires by hand; P5 (the nut), once it and the bolt are in place, draws what
follows it up: P5|P3P4, or P5|P2P3P4 if P2 has not been closed. Where they are not written, the paper's two are added.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

from clamp3d.checks import choice
from clamp3d.clamp.dimensions import PARTS, TITLES, PartName
from clamp3d.errors import InputError

Kind = Literal["bring", "close", "tighten"]


@dataclass(frozen=True, slots=True)
class Step:
    """One motion: ``part`` is grasped, ``followers`` move with it; ``name`` tells it from others that read the same."""

    part: PartName
    followers: tuple[PartName, ...]
    kind: Kind = "bring"
    name: str = ""

    @property
    def parts(self) -> frozenset[PartName]:
        """All that moves."""
        return frozenset((self.part, *self.followers))

    def __str__(self) -> str:
        return self.part + ("|" + "".join(self.followers) if self.followers else "")


_MOST = 30  # steps: each that is not published costs seconds of search, and seven parts need about as many


def parse_sequence(text: str) -> tuple[Step, ...]:
    """Steps of a sequence; arrows are ``->`` or the paper's own sign.

    Raises InputError naming the step that cannot be read, an unknown or repeated part, a part that is never brought,
    or a step after which its part has no way to go.

    >>> [(str(step), step.kind) for step in parse_sequence("P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4")]
    [('P1|P2P3P4P5', 'bring'), ('P7', 'bring'), ('P2', 'close'), ('P5|P3P4', 'tighten')]
    >>> [step.name for step in parse_sequence("P1 -> P7 -> P2 -> P3|P4 -> P5")]
    ['P1', 'P7', 'P2 (step 3)', 'P3|P4', 'P5', 'P2 (step 6)', 'P5|P3P4']
    """
    steps: list[Step] = []
    brought: set[PartName] = set()
    ended: set[PartName] = set()
    for number, step in enumerate(_read(text), 1):
        again = step.parts <= brought
        if step.parts & ended:
            name = min(step.parts & ended)
            raise InputError(
                f"sequence step {number}, {step}: {name} ({TITLES[name]}) is closed already and moves no more"
            )
        if again and step.parts == {"P2"}:
            step = replace(step, kind="close")
        elif again and step.part == "P5" and step.parts - {"P2"} == {"P3", "P4", "P5"}:
            step = replace(step, kind="tighten")
        ended |= step.parts if step.kind != "bring" else set()
        brought |= step.parts
        steps.append(step)
    missing = [name for name in PARTS if name not in brought and name != "P6"]
    if missing:
        raise InputError(f"sequence must bring every part but P6; missing {', '.join(missing)} in {text!r}")
    if "P5" not in ended:
        steps += [] if "P2" in ended else [Step("P2", (), "close")]
        steps.append(Step("P5", ("P3", "P4"), "tighten"))
    read = [str(step) for step in steps]
    return tuple(
        replace(step, name=name if read.count(name) == 1 else f"{name} (step {number})")
        for number, (step, name) in enumerate(zip(steps, read, strict=True), 1)
    )


def as_published(steps: tuple[Step, ...]) -> bool:
    """Whether these are the paper's own steps, whose motions are the published ones."""
    published = parse_sequence("P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4")
    return [(step.part, step.parts) for step in steps] == [(step.part, step.parts) for step in published]


def _read(text: str) -> list[Step]:
    steps = []
    items = re.split(r"->|→|\\rightarrow", text)
    if len(items) > _MOST:
        raise InputError(f"sequence must have at most {_MOST} steps, got {len(items)}")
    for number, item in enumerate(items, 1):
        compact = re.sub(r"\s+", "", item)
        if not re.fullmatch(r"P\d+(\|(P\d+)+)?", compact):
            raise InputError(
                f"sequence step {number} must read like P1|P2P3 (grasped part, then followers), got {item!r}"
            )
        names = re.findall(r"P\d+", compact)
        for name in names:
            choice(f"part of sequence step {number}", name, [part for part in PARTS if part != "P6"])
            if names.count(name) > 1:
                raise InputError(f"sequence step {number}: {name} is named twice")
        steps.append(Step(names[0], tuple(names[1:])))
    return steps
