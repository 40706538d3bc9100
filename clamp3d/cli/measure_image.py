"""``clamp3d measure-image``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import INPUT_FILE, JSON, argument, declared, number, option
from clamp3d.cli.terminal import save, show


def two_points(text: str) -> list[tuple[float, float]]:
    """Two positions in px, as the type of an option."""
    pairs = [pair.split(",") for pair in text.replace(";", " ").split()]
    if [len(pair) for pair in pairs] != [2, 2]:
        raise click.BadParameter(f"must be two positions 'X,Y X,Y' in px, got {text!r}")
    return [(number(x), number(y)) for x, y in pairs]


@declared("measure-image")
def command(
    image: Path = argument(type=INPUT_FILE),
    points: list[tuple[float, float]] = option(
        "The two end points in px from the top left.", type=two_points, required=True, metavar="'X,Y X,Y'"
    ),
    reference: list[tuple[float, float]] = option(
        "The two ends of a measured length, in px.", type=two_points, required=True, metavar="'X,Y X,Y'"
    ),
    scale: float = option("The measured length.", required=True, metavar="MM"),
    kind: str = option(
        "Square to the reference line, or straight from point to point.",
        "--measure",
        type=click.Choice(["height", "straight"]),
        default="height",
    ),
    snap: float | None = option("Move each mark to the strongest corner within PX pixels.", metavar="PX"),
    marking_error: float | None = option("Standard deviation of a mark.  [default: 4.5; 0.5 snapped]", metavar="PX"),
    calliper_error: float = option("Standard deviation of a reading.", default=0.02, metavar="MM"),
    json_file: Path | None = JSON,
) -> None:
    """Measure a distance in the photograph IMAGE by marked points and a length that was measured.

    \b
    clamp3d measure-image clamp.jpg --points "31,458 58,584" --reference "31,458 579,458" --scale 137
    """
    from dataclasses import asdict
    from typing import cast

    import numpy as np

    from clamp3d.bench.image import MARKING_ERROR, Kind, measure_image
    from clamp3d.bench.picture import check_marks, load_image, snap_marks

    marks = np.array(points + reference)
    shown = load_image(image)
    marks = check_marks(shown, marks) if snap is None else snap_marks(shown, marks, snap)
    if marking_error is None:
        marking_error = MARKING_ERROR if snap is None else 0.5
    measured = measure_image(
        marks[:2],
        marks[2:],
        scale,
        kind=cast(Kind, kind),
        marking_error=marking_error,
        calliper_error=calliper_error,
    )
    show(f"distance     {measured.distance:.3f} mm +- {measured.uncertainty:.3f} mm ({kind}; one standard deviation)")
    show(f"height       {measured.height:.3f} mm, straight {measured.straight:.3f} mm")
    show(
        f"scale        {measured.mm_per_px:.6f} mm/px, marks +- {marking_error:g} px, reading +- {calliper_error:g} mm"
    )
    show(f"marks        {', '.join(f'({x:.2f}, {y:.2f})' for x, y in marks)}")
    data = {"image": str(image), "kind": kind, "marks": marks.tolist(), **asdict(measured)}
    save(json_file, lambda: data)
