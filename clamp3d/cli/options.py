"""Options that several commands share."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.contact.model import ContactModel

METHODS = ("cas", "chords")

FILE = click.Path(dir_okay=False, path_type=Path)


def clamp_arguments(function: Callable[..., Any]) -> Callable[..., Any]:
    """``[CLAMP] --line --jumper``."""
    for option in (
        click.option("--jumper", metavar="CONDUCTOR", help="Jumper: catalogue name or diameter in mm."),
        click.option("--line", metavar="CONDUCTOR", help="Power line: catalogue name or diameter in mm."),
        click.argument("clamp", default="reference"),
    ):
        function = option(function)
    return function


def method_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--method --unit-angle-deg``."""
    for option in (
        click.option("--unit-angle-deg", type=float, metavar="A", help="Angle of one chord; for chords.  [default: 5]"),
        click.option(
            "--method", type=click.Choice(METHODS), default="cas", show_default=True, help="How grooves are measured."
        ),
    ):
        function = option(function)
    return function


def solver_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--solver --step --tilt-step-deg``."""
    for option in (
        click.option("--tilt-step-deg", type=float, metavar="A", help="Turn of the stepped solver.  [default: 1]"),
        click.option(
            "--step", type=float, metavar="MM", help="Move along the bolt of the stepped solver.  [default: 1/3]"
        ),
        click.option(
            "--solver", type=click.Choice(["exact", "stepped"]), help="[default: exact; stepped if a step is given]"
        ),
    ):
        function = option(function)
    return function


def solver_settings(solver: str | None, step: float | None, tilt_step_deg: float | None) -> dict[str, Any]:
    """Arguments of `assemble` that the options mean. Raises click.UsageError for options that do not go together."""
    if solver == "exact" and (step is not None or tilt_step_deg is not None):
        raise click.UsageError("--step and --tilt-step-deg go with --solver stepped, not exact")
    stepped = solver == "stepped" or step is not None or tilt_step_deg is not None
    settings: dict[str, Any] = {"solver": "stepped" if stepped else "exact"}
    if step is not None:
        settings["step"] = step
    if tilt_step_deg is not None:
        settings["tilt_step"] = math.radians(tilt_step_deg)
    return settings


def viewer_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--html --url --host --port --timeout --open --mesh-error --clearance``: what `show` needs."""
    for option in (
        CLEARANCE_OPTION,
        MESH_ERROR_OPTION,
        click.option(
            "--overlay",
            "overlays",
            multiple=True,
            metavar="NAME[=SIZE]",
            help="Also show what a baseline makes of the parts: wedges (unit angle in deg) or hulls (CoACD's threshold "
            "in mm). May be given more than once.",
        ),
        click.option("--open", "open_browser", is_flag=True, help="Open the page in a browser."),
        click.option(
            "--timeout", type=click.FloatRange(min=0.0), metavar="S", help="Stop serving after S seconds (0: at once)."
        ),
        click.option(
            "--port", type=click.IntRange(0, 65535), help="Port to serve on.  [default: first free from 7000]"
        ),
        click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve on; 0.0.0.0 for all."),
        click.option("--url", metavar="ZMQ_URL", help="Use a running meshcat server: the zmq_url that it printed."),
        click.option("--html", "html_file", type=FILE, metavar="FILE", help="Write one page with the whole animation."),
    ):
        function = option(function)
    return function


MESH_ERROR_OPTION = click.option(
    "--mesh-error", type=float, default=0.01, show_default=True, metavar="MM", help="Chord error of drawn meshes."
)
CLEARANCE_OPTION = click.option(
    "--clearance", type=float, default=5.0, show_default=True, metavar="MM", help="Gap from which parts count as clear."
)


def contact_model(method: str, clamp: Clamp, unit_angle_deg: float | None) -> ContactModel:
    """The contact model that the options name. Raises click.UsageError for options that do not go together."""
    if unit_angle_deg is not None and method not in ("chords",):
        raise click.UsageError(f"--unit-angle-deg goes with --method chords, not {method}")
    if method == "cas":
        from clamp3d.contact.cas import Cas

        return Cas()
    from clamp3d.contact.chords import Chords

    return Chords(math.radians(5.0 if unit_angle_deg is None else unit_angle_deg))
