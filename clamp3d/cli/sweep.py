"""``clamp3d sweep``."""

from __future__ import annotations

import math
from pathlib import Path

import click

from clamp3d.cli.options import JSON, PICTURE, Source, clamp_argument, number
from clamp3d.cli.terminal import show


@click.command("sweep")
@clamp_argument
@click.option("--wire", type=click.Choice(["P6", "P7"]), default="P6", show_default=True, help="Line or jumper.")
@click.option("--offset", type=number, default=15.0, show_default=True, metavar="MM", help="Half range across.")
@click.option("--height", type=number, metavar="MM", help="Half range along the bolt.  [default: not varied]")
@click.option("--yaw-deg", type=number, default=6.0, show_default=True, metavar="A", help="Half range about the bolt.")
@click.option(
    "--pitch-deg", type=number, default=3.0, show_default=True, metavar="A", help="Half range about the cross axis."
)
@click.option("--seat-tolerance", type=number, metavar="MM", help="Opening that counts as closed.  [default: 0.5]")
@click.option("--steps", type=click.IntRange(3, 1001), default=121, show_default=True, help="Grid points per freedom.")
@click.option(
    "--random", "count", type=click.IntRange(1, 10_000_000), metavar="N", help="Also try N random misplacements."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the random ones.")
@click.option("--map", "map_file", type=PICTURE, metavar="FILE", help="Draw the map (PNG, SVG or PDF).")
@JSON
def command(
    source: Source,
    wire: str,
    offset: float,
    height: float | None,
    yaw_deg: float,
    pitch_deg: float,
    seat_tolerance: float | None,
    steps: int,
    count: int | None,
    seed: int,
    map_file: Path | None,
    json_file: Path | None,
) -> None:
    """How far a wire may be misplaced before CLAMP no longer closes on it: the pose tolerance that a robot needs.

    The wire is held where it is while the splints close along the bolt. Closes: both touch it in their grooves with
    little opening. Touches wrongly: on a lip, or too far open. Cannot seat: on a face beside the groove.
    """
    from clamp3d.clamp.placement import FREEDOMS, SEAT_TOLERANCE, Freedom, Placement
    from clamp3d.errors import InputError
    from clamp3d.output.files import write_json
    from clamp3d.output.placement_report import draw_map, grid, planes, sweep_to_dict, sweep_to_text

    given = {"offset": offset, "height": height, "yaw": math.radians(yaw_deg), "pitch": math.radians(pitch_deg)}
    ranges: dict[Freedom, float] = {f: value for f in FREEDOMS if (value := given[f])}
    if not ranges:
        raise InputError("nothing to vary: give --offset, --height, --yaw-deg or --pitch-deg")
    if map_file is not None and len(ranges) < 2:
        raise InputError("a map needs two freedoms with a range")
    closing = Placement(
        source.clamp(),
        wire,
        seat_tolerance=SEAT_TOLERANCE if seat_tolerance is None else seat_tolerance,
    )
    tolerances = closing.tolerance(ranges, seed=seed)
    cloud = closing.cloud(ranges, count, seed=seed) if count is not None else None
    wanted = planes(ranges) if map_file is not None or json_file is not None else []
    grids = {(x, y): grid(closing, x, y, ranges, steps) for x, y in wanted}
    if json_file is not None:
        write_json(json_file, sweep_to_dict(closing, tolerances, grids, cloud))
    if map_file is not None:
        draw_map(map_file, closing, tolerances, grids, ranges)
    show(sweep_to_text(closing, tolerances, cloud))
