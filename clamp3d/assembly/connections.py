"""All 21 pairs of parts in the section: how far apart they are, what meets how, and Table 1 against it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp, ConnectionType, PartName
from clamp3d.contact.convex import Box, box_box, box_disk
from clamp3d.geometry.pose import SectionPose

TYPES: dict[ConnectionType, str] = {
    0: "no connection",
    1: "screw joint",
    2: "convex object collision",
    3: "concave arc surface collision",
}
"""Eq. 1 of the paper."""

GEOMETRY: dict[tuple[PartName, PartName], ConnectionType] = {
    ("P1", "P6"): 3,
    ("P1", "P7"): 3,
    ("P2", "P6"): 3,
    ("P2", "P7"): 3,
    ("P2", "P3"): 3,
    ("P4", "P5"): 1,
}
"""What a meeting of two parts is by their shapes; every other pair is convex (2)."""

PAIRS: tuple[tuple[PartName, PartName], ...] = tuple(itertools.combinations(PARTS, 2))


@dataclass(frozen=True, slots=True)
class Undeclared:
    """A pair that met in the run although the connection matrix says otherwise; ``where`` names the step."""

    a: PartName
    b: PartName
    declared: ConnectionType
    met_as: ConnectionType
    where: str

    def __str__(self) -> str:
        return (
            f"{self.a}-{self.b} ({TITLES[self.a]}, {TITLES[self.b]}) declared {self.declared} ({TYPES[self.declared]}) "
            f"but met as {self.met_as} ({TYPES[self.met_as]}) in {self.where}"
        )


def boxes(clamp: Clamp, poses: Mapping[PartName, SectionPose]) -> dict[PartName, tuple[Box, ...]]:
    """The solid parts as rectangles in the section; the bolt is its shank and its head."""
    up, down, saddle, bolt, nut = clamp.up_splint, clamp.down_splint, clamp.saddle, clamp.bolt, clamp.nut
    saddle_top = (saddle.radius**2 - (saddle.width / 2) ** 2) ** 0.5
    saddle_bottom = saddle.radius + saddle.apex_thickness
    half_nut, half_head = nut.across_flats / 2, bolt.head_across_flats / 2
    return {
        "P1": (Box(poses["P1"], 0.0, up.width, 0.0, up.thickness),),
        "P2": (Box(poses["P2"], -down.width / 2, down.width / 2, down.face_depth, down.back_radius),),
        "P3": (Box(poses["P3"], -saddle.width / 2, saddle.width / 2, saddle_top, saddle_bottom),),
        "P4": (
            Box(poses["P4"], -bolt.diameter / 2, bolt.diameter / 2, 0.0, bolt.shank_length),
            Box(poses["P4"], -half_head, half_head, bolt.shank_length, bolt.shank_length + bolt.head_height),
        ),
        "P5": (Box(poses["P5"], -half_nut, half_nut, 0.0, nut.height),),
    }


def convex_gaps(clamp: Clamp, poses: Mapping[PartName, SectionPose]) -> dict[tuple[PartName, PartName], float]:
    """Least gap in mm of every pair that no hole, groove, seat or thread joins.

    Between two boxes it is the separation along their axes: its sign is exact.
    """
    solid = boxes(clamp, poses)
    radius = {"P6": clamp.line.radius, "P7": clamp.jumper.radius}
    gaps = {}
    for a, b in PAIRS:
        if (a, b) in GEOMETRY or (a, b) in _JOINED:
            continue
        if a in radius:
            apart = ((poses[a].x - poses[b].x) ** 2 + (poses[a].y - poses[b].y) ** 2) ** 0.5
            gaps[a, b] = apart - radius[a] - radius[b]
        elif b in radius:
            gaps[a, b] = min(box_disk(box, poses[b], radius[b]) for box in solid[a])
        else:
            gaps[a, b] = min(box_box(x, y) for x in solid[a] for y in solid[b])
    return gaps


# The bolt passes through these, and the nut sits on P1: their gaps are Table 2 and seats. P1-P2: `Section.face_gaps`.
_JOINED = {("P1", "P2"), ("P1", "P4"), ("P1", "P5"), ("P2", "P4"), ("P3", "P4")}
