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


def contact_model(method: str, clamp: Clamp, unit_angle_deg: float | None) -> ContactModel:
    """The contact model that the options name. Raises click.UsageError for options that do not go together."""
    if unit_angle_deg is not None and method not in ("chords",):
        raise click.UsageError(f"--unit-angle-deg goes with --method chords, not {method}")
    if method == "cas":
        from clamp3d.contact.cas import Cas

        return Cas()
    from clamp3d.contact.chords import Chords

    return Chords(math.radians(5.0 if unit_angle_deg is None else unit_angle_deg))
