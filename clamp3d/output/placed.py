"""What goes into a file: each part with its pose, colour and material, in the order P1 to P7."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.clamp.dimensions import PARTS, PartName
from clamp3d.clamp.parts import Part, check_part_name
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array, check_pose

Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Material:
    """Name, sRGB colour (0-255) and gloss for physically based viewers."""

    name: str
    colour: Colour
    roughness: float
    metallic: float = 0.25  # low: viewers without surroundings to reflect show bare metal as black


# Chosen: no paper or clamp file names materials. Up and down splint differ a little, so that their parting is seen.
MATERIALS: dict[PartName, Material] = {
    "P1": Material("aluminium alloy, up splint", (176, 184, 194), 0.45),
    "P2": Material("aluminium alloy, down splint", (139, 151, 166), 0.45),
    "P3": Material("galvanised steel, saddle", (160, 146, 118), 0.55),
    "P4": Material("galvanised steel, bolt", (118, 116, 112), 0.5),
    "P5": Material("galvanised steel, nut", (96, 94, 90), 0.5),
    "P6": Material("aluminium conductor, line", (196, 132, 72), 0.6),
    "P7": Material("aluminium conductor, jumper", (98, 140, 108), 0.6),
}


@dataclass(frozen=True, slots=True)
class PlacedPart:
    """A part, and ``T_world_part`` (4, 4) in mm; without a pose it stays in its own frame."""

    part: Part
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
    def material(self) -> Material:
        """Colour and material of the part."""
        return MATERIALS[self.part.name]

    @property
    def T(self) -> Array:
        """The pose, the identity where there is none."""
        return np.eye(4) if self.T_world_part is None else self.T_world_part


def place(
    parts: Mapping[PartName, Part], poses: Mapping[PartName, ArrayLike] | None, names: Iterable[str] | None = None
) -> tuple[PlacedPart, ...]:
    """Pair the chosen parts (all by default) with their poses; ``poses=None`` leaves each in its own frame.

    Raises InputError for an unknown part, a part without a pose, or a pose that is not rigid.
    """
    for name in poses or ():
        check_part_name(name)
    chosen = set(PARTS if names is None else map(check_part_name, names))
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
