"""``clamp3d sweep``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import click

from clamp3d.clamp.placement import Outcome, placement
from clamp3d.cli.options import JSON, PICTURE, ClampSource, Quiet, command, option
from clamp3d.cli.terminal import bar, finish, save, show
from clamp3d.output.figures import save_figure
from clamp3d.output.placement_report import capture_figure, placement_to_dict, placement_to_text


@command("sweep")
class Sweep(ClampSource, Quiet):
    """Map the start places from which the open CLAMP seats a wire, and how far it may lean: the accuracy for a robot.

    The clamp is closed with the wire at places all over its opening, free to move: it ends seated in the arcs, on a
    lip, or not clamped. For the lean, the wire is held at its place and turned while the splints close on it.
    """

    wire: Literal["P6", "P7"] = option("Line or jumper.", default="P6")
    steps: int = option("Start places across, a quarter as many in height.", type=click.IntRange(4, 1000), default=40)
    yaw_deg: float = option("Search the yaw up to this (about the bolt).", default=6.0, metavar="A")
    pitch_deg: float = option("Search the pitch up to this (about the cross axis).", default=3.0, metavar="A")
    seat_tolerance: float = option("Opening that counts as closed on a leaning wire.", default=0.5, metavar="MM")
    map_file: Path | None = option("Draw the map (PNG, SVG or PDF).", "--map", type=PICTURE)
    json_file: Path | None = JSON

    def run(self) -> None:
        """Search, print and draw."""
        with bar(self.quiet) as report:
            placed = placement(
                self.clamp(),
                wire=self.wire,
                columns=self.steps,
                yaw=math.radians(self.yaw_deg),
                pitch=math.radians(self.pitch_deg),
                seat_tolerance=self.seat_tolerance,
                progress=lambda done, of: report("start places", done, of),
            )
        show(placement_to_text(placed))
        save(self.json_file, lambda: placement_to_dict(placed))
        if self.map_file is not None:
            save_figure(capture_figure(placed), self.map_file)
        finish(failed=bool(placed.capture.count(Outcome.NOT_PROVEN)))
