"""Options that several commands share."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from clamp3d.baselines import METHODS

if TYPE_CHECKING:
    from clamp3d.baselines.model import ContactModel
    from clamp3d.clamp.dimensions import Clamp


FILE = click.Path(dir_okay=False, path_type=Path)


class _Output(click.Path):
    """A file to write: that it can be written is found out before the work, not after."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        from clamp3d.output.files import check_writable

        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        check_writable(path)
        return path


OUTPUT = _Output(dir_okay=False, path_type=Path)
"""A file to write; `FILE` is one that is read."""


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
    """``--method`` and what goes with each of them; `contact_model` takes the values by name."""
    for option in (
        click.option("--mesh-error", type=float, metavar="MM", help="Chord error of hulls and mesh.  [default: 0.05]"),
        click.option(
            "--threshold", type=float, metavar="MM", help="Concavity that CoACD may leave: hulls.  [default: 2]"
        ),
        click.option(
            "--unit-angle-deg", type=float, metavar="A", help="Angle of a chord: chords, wedges.  [default: 5]"
        ),
        click.option(
            "--method",
            type=click.Choice(list(METHODS)),
            default="cas",
            show_default=True,
            help="How grooves are measured: as arcs, as chords in the section, or by FCL on convex wedges, on CoACD "
            "hulls, on meshes.",
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
            "--solver",
            type=click.Choice(["exact", "stepped", "bisection"]),
            help="[default: exact for cas and chords, bisection for the others; stepped if a step is given]",
        ),
    ):
        function = option(function)
    return function


def solver_settings(method: str, solver: str | None, step: float | None, tilt_step_deg: float | None) -> dict[str, Any]:
    """Arguments of `assemble` that the options mean. Raises click.UsageError for options that do not go together."""
    if solver == "exact" and (step is not None or tilt_step_deg is not None):
        raise click.UsageError("--step and --tilt-step-deg go with --solver stepped, not exact")
    if solver is None:
        by_step = step is not None or tilt_step_deg is not None
        solver = "stepped" if by_step else "exact" if method in ("cas", "chords") else "bisection"
    settings: dict[str, Any] = {"solver": solver}
    if step is not None:
        settings["step"] = step
    if tilt_step_deg is not None:
        settings["tilt_step"] = math.radians(tilt_step_deg)
    return settings


def viewer_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """``--html --url --host --port --timeout --open --overlay --draw-error --clearance``: what a viewer needs."""
    for option in (
        CLEARANCE_OPTION,
        DRAW_ERROR_OPTION,
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
        click.option(
            "--html", "html_file", type=OUTPUT, metavar="FILE", help="Write one page with the whole animation."
        ),
    ):
        function = option(function)
    return function


DRAW_ERROR_OPTION = click.option(
    "--draw-error", type=float, default=0.01, show_default=True, metavar="MM", help="Chord error of drawn facets."
)
CLEARANCE_OPTION = click.option(
    "--clearance", type=float, default=5.0, show_default=True, metavar="MM", help="Gap from which parts count as clear."
)


def contact_model(
    method: str,
    clamp: Clamp,
    *,
    unit_angle_deg: float | None = None,
    threshold: float | None = None,
    mesh_error: float | None = None,
    quiet: bool = False,
) -> ContactModel:
    """The contact model that the options name. Raises click.UsageError for options that do not go together."""
    from clamp3d.baselines import contact_model as make
    from clamp3d.clamp.parts import parts

    options = {"--unit-angle-deg": unit_angle_deg, "--threshold": threshold, "--mesh-error": mesh_error}
    for option, setting in zip(options, ("unit_angle", "threshold", "mesh_error"), strict=True):
        methods = [name for name, settings in METHODS.items() if setting in settings]
        if options[option] is not None and method not in methods:
            raise click.UsageError(f"{option} goes with --method {' or '.join(methods)}, not {method}")
    return make(
        method,
        parts(clamp),
        unit_angle=None if unit_angle_deg is None else math.radians(unit_angle_deg),
        threshold=threshold,
        mesh_error=mesh_error,
        progress=False if quiet else None,
    )
