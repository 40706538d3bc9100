"""``clamp3d sweep``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.options import CLAMP, JSON, PICTURE, ClampSource, declared, group, option
from clamp3d.cli.terminal import save, show
from clamp3d.errors import InputError

if TYPE_CHECKING:
    from clamp3d.clamp.placement import Freedom


@dataclass(frozen=True)
class Ranges:
    """How far a wire is misplaced in each of its freedoms, either way."""

    offset: float = option("Half range across.", default=15.0, metavar="MM")
    height: float | None = option("Half range along the bolt.  [default: not varied]", metavar="MM")
    yaw_deg: float = option("Half range about the bolt.", default=6.0, metavar="A")
    pitch_deg: float = option("Half range about the cross axis.", default=3.0, metavar="A")

    def by_freedom(self) -> dict[Freedom, float]:
        """Those that are not 0, mm and rad. Raises InputError if all are."""
        given: dict[Freedom, float | None] = {
            "offset": self.offset,
            "height": self.height,
            "yaw": math.radians(self.yaw_deg),
            "pitch": math.radians(self.pitch_deg),
        }
        ranges = {freedom: value for freedom, value in given.items() if value}
        if not ranges:
            raise InputError("nothing to vary: give --offset, --height, --yaw-deg or --pitch-deg")
        return ranges


@declared("sweep")
def command(
    source: ClampSource = CLAMP,
    wire: str = option("Line or jumper.", type=click.Choice(["P6", "P7"]), default="P6"),
    ranges: Ranges = group(Ranges),
    seat_tolerance: float | None = option("Opening that counts as closed.  [default: 0.5]", metavar="MM"),
    steps: int = option("Grid points per freedom.", type=click.IntRange(3, 1001), default=121),
    count: int | None = option(
        "Also try N random misplacements.", "--random", type=click.IntRange(1, 10_000_000), metavar="N"
    ),
    seed: int = option("Seed of the random ones.", type=int, default=0),
    map_file: Path | None = option("Draw the map (PNG, SVG or PDF).", "--map", type=PICTURE),
    json_file: Path | None = JSON,
) -> None:
    """How far a wire may be misplaced before CLAMP no longer closes on it: the pose tolerance that a robot needs.

    The wire is held where it is while the splints close along the bolt. Closes: both touch it in their grooves with
    little opening. Touches wrongly: on a lip, or too far open. Cannot seat: on a face beside the groove.
    """
    from clamp3d.clamp.placement import SEAT_TOLERANCE, Placement
    from clamp3d.output.placement_report import draw_map, grid, planes, sweep_to_dict, sweep_to_text

    varied = ranges.by_freedom()
    if map_file is not None and len(varied) < 2:
        raise InputError("a map needs two freedoms with a range")
    closing = Placement(
        source.clamp(),
        wire,
        seat_tolerance=SEAT_TOLERANCE if seat_tolerance is None else seat_tolerance,
    )
    tolerances = closing.tolerance(varied, seed=seed)
    cloud = closing.cloud(varied, count, seed=seed) if count is not None else None
    mapped = planes(varied) if map_file is not None or json_file is not None else []
    grids = {(x, y): grid(closing, x, y, varied, steps) for x, y in mapped}
    show(sweep_to_text(closing, tolerances, cloud))
    save(json_file, lambda: sweep_to_dict(closing, tolerances, grids, cloud))
    if map_file is not None:
        draw_map(map_file, closing, tolerances, grids, varied)
