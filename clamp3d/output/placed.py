"""What goes into a file: each part with its name, pose and colour, in the order P1 to P7."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance, items
from clamp3d.clamp.dimensions import PARTS, PartName
from clamp3d.clamp.parts import check_part_name
from clamp3d.core.pose import Array, check_pose
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError
from clamp3d.output.palette import PART_COLOURS


@dataclass(frozen=True, slots=True)
class PlacedPart:
    """A part, and ``T_world_part`` (4, 4) in mm; without a pose it stays in its own frame."""

    part: Solid
    T_world_part: Array | None

    @property
    def label(self) -> str:
        """Name and title as files show it, e.g. ``P1 up splint``."""
        return f"{self.part.name} {self.part.title}"

    @property
    def stem(self) -> str:
        """The label as part of a file name."""
        return self.label.replace(" ", "-")

    @property
    def colour(self) -> tuple[int, int, int]:
        """Colour of the part in sRGB, 0 to 255."""
        text = PART_COLOURS[self.part.name]
        return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)

    @property
    def T(self) -> Array:
        """The pose, the identity where there is none."""
        return np.eye(4) if self.T_world_part is None else self.T_world_part


def place(
    parts: Mapping[PartName, Solid], poses: Mapping[PartName, ArrayLike] | None, names: Iterable[str] | None = None
) -> tuple[PlacedPart, ...]:
    """Pair the chosen parts (all by default) with their poses; ``poses=None`` leaves each in its own frame.

    Raises InputError for an unknown part, a part without a pose, or a pose that is not rigid.
    """
    if poses is not None:
        instance("poses", poses, Mapping)
    for name in poses or ():
        check_part_name(name)
    chosen = set(PARTS if names is None else map(check_part_name, items("names", names, "part names")))
    if not chosen:
        raise InputError(f"parts must name at least one of {', '.join(PARTS)}")
    missing = [name for name in PARTS if poses is not None and name in chosen and name not in poses]
    if missing:
        raise InputError(f"poses must hold every exported part, missing: {', '.join(missing)}")
    return tuple(
        PlacedPart(parts[name], None if poses is None else check_pose(poses[name], f"pose of {name}"))
        for name in PARTS
        if name in chosen
    )
