"""All 21 pairs of parts in the section: how far apart they are, what meets how, and Table 1 against it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

from clamp3d.clamp.convex import Box, box_box, box_disk
from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp, ConnectionType, PartName
from clamp3d.core.pose import SectionPose

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


def boxes(clamp: Clamp, part: PartName, pose: SectionPose) -> tuple[Box, ...]:
    """A solid part (P1 to P5) as rectangles in the section; the bolt is its shank and its head."""
    if part == "P1":
        up = clamp.up_splint
        return (Box(pose, 0.0, up.width, 0.0, up.thickness),)
    if part == "P2":
        down = clamp.down_splint
        return (Box(pose, -down.width / 2, down.width / 2, down.face_depth, down.back_radius),)
    if part == "P3":
        saddle = clamp.saddle
        top = saddle.radius * math.cos(saddle.half_angle)
        return (Box(pose, -saddle.width / 2, saddle.width / 2, top, saddle.radius + saddle.apex_thickness),)
    if part == "P4":
        bolt = clamp.bolt
        half, half_head, end = bolt.diameter / 2, bolt.head_across_flats / 2, bolt.shank_length
        return (Box(pose, -half, half, 0.0, end), Box(pose, -half_head, half_head, end, end + bolt.head_height))
    nut = clamp.nut
    return (Box(pose, -nut.across_flats / 2, nut.across_flats / 2, 0.0, nut.height),)


def convex_gap(clamp: Clamp, poses: Mapping[PartName, SectionPose], a: PartName, b: PartName) -> float:
    """Least gap in mm of one of the `CONVEX_PAIRS`, ``a`` before ``b``.

    Between two boxes it is the separation along their axes: its sign is exact.
    """
    radius = {"P6": clamp.line.radius, "P7": clamp.jumper.radius}
    if a in radius:
        return math.hypot(poses[a].x - poses[b].x, poses[a].y - poses[b].y) - radius[a] - radius[b]
    if b in radius:
        return min(box_disk(box, poses[b], radius[b]) for box in boxes(clamp, a, poses[a]))
    return min(box_box(x, y) for x in boxes(clamp, a, poses[a]) for y in boxes(clamp, b, poses[b]))


# The bolt passes through these, and the nut sits on P1: their gaps are Table 2 and seats. P1-P2: `Section.face_gaps`.
_JOINED = {("P1", "P2"), ("P1", "P4"), ("P1", "P5"), ("P2", "P4"), ("P3", "P4")}

CONVEX_PAIRS = tuple(pair for pair in PAIRS if pair not in GEOMETRY and pair not in _JOINED)
"""Pairs that no hole, groove, seat or thread joins: both are convex in the section."""
