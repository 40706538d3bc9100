"""Assembly sequence in the paper's notation: ``P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4`` (its Section 2)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from clamp3d.checks import choice
from clamp3d.clamp.dimensions import PARTS, PartName
from clamp3d.errors import InputError


@dataclass(frozen=True, slots=True)
class Step:
    """One motion: ``part`` is grasped, ``followers`` move with it."""

    part: PartName
    followers: tuple[PartName, ...]

    def __str__(self) -> str:
        return self.part + ("|" + "".join(self.followers) if self.followers else "")


_NEEDED = "P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4"
"""What closes a clamp of this kind: the splints are over the wires before they close, and closed before the nut
pulls."""


def parse_sequence(text: str) -> tuple[Step, ...]:
    """Steps of a sequence; arrows are ``->`` or the paper's own sign.

    Raises InputError naming the step that cannot be read, an unknown or repeated part, or a step that does not close
    a clamp.

    >>> [str(step) for step in parse_sequence("P1|P2P3P4P5 -> P7 -> P2 -> P5|P3P4")]
    ['P1|P2P3P4P5', 'P7', 'P2', 'P5|P3P4']
    """
    steps, needed = _steps(text), _steps(_NEEDED)
    for step, due in zip(steps, needed, strict=False):
        if step.part != due.part or set(step.followers) != set(due.followers):
            raise InputError(f"sequence must move {_NEEDED}: got {step} where {due} is due")
    if len(steps) != len(needed):
        raise InputError(f"sequence must have the {len(needed)} steps {_NEEDED}, got {len(steps)}")
    return steps


def _steps(text: str) -> tuple[Step, ...]:
    steps = []
    for number, item in enumerate(re.split(r"->|→|\\rightarrow", text), 1):
        compact = re.sub(r"\s+", "", item)
        if not re.fullmatch(r"P\d+(\|(P\d+)+)?", compact):
            raise InputError(
                f"sequence step {number} must read like P1|P2P3 (grasped part, then followers), got {item!r}"
            )
        names = re.findall(r"P\d+", compact)
        for name in names:
            choice(f"part of sequence step {number}", name, PARTS)
            if names.count(name) > 1:
                raise InputError(f"sequence step {number}: {name} is named twice")
        steps.append(Step(names[0], tuple(names[1:])))
    return tuple(steps)
