"""How a wire may be placed, as text, JSON data, and a picture of the places that the open clamp catches it from."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from clamp3d import __version__
from clamp3d.baselines.cas import Cas
from clamp3d.clamp.closing import open_start
from clamp3d.clamp.placement import Limits, Outcome, Placement
from clamp3d.clamp.plain import plain
from clamp3d.clamp.section import Section
from clamp3d.output.figures import blank, title
from clamp3d.output.section import draw_section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Distinct for colour-blind readers, and in grey: from dark to light.
COLOURS = {
    Outcome.SEATED: "#332288",
    Outcome.ON_A_LIP: "#E69F00",
    Outcome.NOT_CLAMPED: "#D5D8DC",
    Outcome.NOT_PROVEN: "#CC79A7",
}


def limits_text(limit: Limits) -> str:
    """One line: how far a wire may be turned.

    >>> limits_text(Limits("yaw", -0.01, 0.1, 0.1))
    'yaw    -0.573 to more than +5.730 deg'
    """
    low, high = (
        f"{'more than ' * (abs(value) >= limit.reach)}{math.degrees(value):+.3f}" for value in (limit.low, limit.high)
    )
    return f"{limit.turn:6s} {low} to {high} deg"


def placement_to_text(placed: Placement) -> str:
    """From where the clamp catches the wire, and how far that may lean."""
    capture, tried = placed.capture, _counts(placed)
    steps = f"steps of {np.ptp(capture.sideways) / (len(capture.sideways) - 1):.2g} mm"
    span = capture.captured
    return "\n".join(
        [
            f"clamp {placed.clamp.name}, wire {placed.wire} {_wire(placed)}: closed from {sum(tried.values())} places",
            "  (the wire's centre in the open clamp, from its place in the up splint's groove)",
            f"  {', '.join(f'{count} {label}' for label, count in tried.items())}",
            "  no column of places ends seated from every height"
            if span is None
            else f"  seated from every height: sideways {span[0]:+.1f} to {span[1]:+.1f} mm ({steps})",
            f"in the closed clamp the wire may lean, up to {placed.seat_tolerance:g} mm opening",
            *(f"  {limits_text(limit)}" for limit in placed.limits),
        ]
    )


def _wire(placed: Placement) -> str:
    wire = placed.clamp.line if placed.wire == "P6" else placed.clamp.jumper
    return f"{wire.label} ({2 * wire.radius:g} mm)"


def _counts(placed: Placement) -> dict[str, int]:
    counts = {outcome.label: placed.capture.count(outcome) for outcome in COLOURS}
    return {label: count for label, count in counts.items() if count}


def placement_to_dict(placed: Placement) -> dict[str, Any]:
    """The placement as JSON data; lengths in mm, angles in degrees."""
    capture = placed.capture
    return {
        "clamp3d": __version__,
        "clamp": placed.clamp.name,
        "wire": placed.wire,
        "sideways_mm": capture.sideways.tolist(),
        "height_mm": capture.height.tolist(),
        "outcome": [[Outcome(code).label for code in row] for row in capture.outcome.tolist()],
        "counts": _counts(placed),
        "captured_mm": capture.captured,
        "seat_tolerance_mm": placed.seat_tolerance,
        "limits": [plain(limit, low="low_deg", high="high_deg", reach="searched_deg") for limit in placed.limits],
    }


def capture_figure(placed: Placement) -> Figure:
    """The open clamp in section, with each start place of the wire's centre in the colour of what it leads to."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    clamp, capture = placed.clamp, placed.capture
    section = Section(clamp, Cas())
    poses = section.poses(open_start(section))
    seat = poses.pop(placed.wire)
    figure = blank(8.0, 7.4)
    axes = figure.add_subplot()
    draw_section(axes, clamp, poses)
    code = np.ma.masked_equal(capture.outcome, Outcome.NO_ROOM)
    colours = ListedColormap([COLOURS[outcome] for outcome in COLOURS])
    norm = BoundaryNorm(np.arange(len(COLOURS) + 1) - 0.5, len(COLOURS))
    across, down = seat.x + capture.sideways, seat.y - capture.height
    axes.pcolormesh(across, down, code, cmap=colours, norm=norm, shading="nearest", zorder=30)
    axes.plot(seat.x, seat.y, "+", color="black", ms=9, mew=1.4, zorder=40)
    for end, side in zip(capture.captured or (), ("left", "right"), strict=False):
        axes.text(seat.x + end, down.mean(), f"{end:+.1f}", color="white", ha=side, va="center", zorder=41)
    title(
        axes,
        f"where the {clamp.name} clamp catches {placed.wire}",
        f"places of the centre of {_wire(placed)} in the open clamp; +: in the up splint's groove; mm",
    )
    counts = _counts(placed)
    legend = [Patch(fc=COLOURS[o], label=f"{o.label} ({counts[o.label]})") for o in COLOURS if o.label in counts]
    figure.legend(handles=legend, loc="outside lower center", ncols=len(legend), frameon=False)
    return figure
