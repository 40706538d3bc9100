"""What ``clamp3d run`` computes of torque and friction, only on request."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from clamp3d.cli.options import group, number, option

if TYPE_CHECKING:
    from clamp3d.clamp.result import Assembly


def numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between them, as the type of an option."""
    return tuple(number(part) for part in text.split(","))


@dataclass(frozen=True)
class Mechanics:
    """Torque (Nm), friction of thread and nut face, measured splint distance (mm), friction of the grooves."""

    torque: float | None = option(
        "Also report the effect of this torque at the nut: preload, contact forces, when a wire slips.", metavar="NM"
    )
    friction: tuple[float, ...] | None = option(
        "Friction of thread and nut face, with --torque.  [default: 0.1,0.14,0.2]", type=numbers, metavar="MU,..."
    )
    measured: float | None = option(
        "Also report whether friction explains this measured splint distance.", metavar="MM"
    )
    groove_friction: tuple[float, ...] | None = option(
        "Friction of the wires in their grooves, with --torque and --measured; alone: report the range of splint "
        "distances at which the clamp stays.  [default: 0.1,0.2]",
        type=numbers,
        metavar="MU,...",
    )

    def __bool__(self) -> bool:
        return any(value is not None for value in vars(self).values())

    def check(self, solver: str) -> None:
        """Raise click.UsageError for options that do not go together."""
        if self.friction is not None and self.torque is None:
            raise click.UsageError("--friction goes with --torque")
        if self and solver != "exact":
            raise click.UsageError(f"--torque, --measured and --groove-friction go with --solver exact, not {solver}")

    def answer(self, run: Assembly) -> tuple[str, dict[str, Any]]:
        """Text and data for JSON of an assembled clamp; nothing if nothing was asked for."""
        if not self:
            return "", {}
        if not run.clamped:
            return f"torque and friction: not computed, {run.status}", {}
        from clamp3d.clamp.friction import FrictionBand
        from clamp3d.clamp.torque import GROOVE_FRICTION, THREAD_FRICTION, coefficients, tighten
        from clamp3d.output.forces_report import bands_to_text, measured_to_text, tightening_to_text

        text, data = "", dict[str, Any]()
        groove = self.groove_friction or GROOVE_FRICTION
        if self.torque is not None:
            tight = tighten(run, self.torque, friction=self.friction or THREAD_FRICTION, groove_friction=groove)
            text, data["torque"] = f"\n{tightening_to_text(tight)}\n", tight.to_dict()
        if self.torque is None or self.measured is not None:
            finder = FrictionBand(run.clamp)
            bands = [finder.band(mu) for mu in coefficients("groove friction", groove)]
            text += f"\n{bands_to_text(bands)}\n"
            data["friction_band"] = {"bands": [band.to_dict() for band in bands]}
            if self.measured is not None:
                text += f"{measured_to_text(finder, bands, self.measured)}\n"
                measured = {"distance_mm": self.measured, "least_friction": finder.friction_for(self.measured)}
                data["friction_band"]["measured"] = measured
        return text.removesuffix("\n"), data


MECHANICS = group(Mechanics)
"""``--torque --friction --measured --groove-friction``."""
