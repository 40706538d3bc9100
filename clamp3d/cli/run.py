"""``clamp3d run``, and what it computes of torque and friction on request."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from clamp3d import checks
from clamp3d.clamp.result import Assembly
from clamp3d.cli.options import JSON, ClampSource, Method, command, number, option
from clamp3d.cli.terminal import finish, save, show
from clamp3d.cli.view import Viewing
from clamp3d.errors import SequenceError
from clamp3d.output.run_report import bands_to_text, measured_to_text, run_to_text, tightening_to_text


def numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between them, as the type of an option."""
    return tuple(number(part) for part in text.split(","))


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

    def check_mechanics(self, solver: str) -> None:
        """Raise click.UsageError for options that do not go together, InputError for a distance that is not > 0."""
        if self.measured is not None:
            checks.positive("--measured", self.measured)
        if self.friction is not None and self.torque is None:
            raise click.UsageError("--friction goes with --torque")
        if self._is_asked() and solver != "exact":
            raise click.UsageError(f"--torque, --measured and --groove-friction go with --solver exact, not {solver}")

    def mechanics(self, run: Assembly) -> tuple[str, dict[str, Any]]:
        """Text and data for JSON of an assembled clamp; nothing if nothing was asked for."""
        if not self._is_asked():
            return "", {}
        if not run.clamped:
            return f"torque and friction: not computed, {run.status}", {}
        from clamp3d.clamp.friction import FrictionBand
        from clamp3d.clamp.torque import GROOVE_FRICTION, THREAD_FRICTION, coefficients, tighten

        blocks, data = list[str](), dict[str, Any]()
        groove = self.groove_friction or GROOVE_FRICTION
        if self.torque is not None:
            tight = tighten(run, self.torque, friction=self.friction or THREAD_FRICTION, groove_friction=groove)
            blocks.append(tightening_to_text(tight))
            data["torque"] = tight.to_dict()
        if self.torque is None or self.measured is not None:
            finder = FrictionBand(run.clamp)
            bands = [finder.band(mu) for mu in coefficients("groove friction", groove)]
            blocks.append(bands_to_text(bands))
            data["friction_band"] = {"bands": [band.to_dict() for band in bands]}
            if self.measured is not None:
                least = finder.friction_for(self.measured)
                blocks[-1] += "\n" + measured_to_text(finder, bands, self.measured, least)
                data["friction_band"]["measured"] = {"distance_mm": self.measured, "least_friction": least}
        return "\n" + "\n\n".join(blocks), data

    def _is_asked(self) -> bool:
        return any(getattr(self, key) is not None for key in Mechanics.__annotations__)


@command("run")
class Run(ClampSource, Method, Mechanics, Viewing):
    """Assemble CLAMP (a built-in name or a TOML file) with its wires, and print where every part ends up.

    Exit code 1 if the clamp does not close on both wires, parts meet that should not, or a step of the sequence is
    blocked: the message names what blocks it, where and when, and the page shows it.
    """

    equilibria: bool | None = option(
        "Also report the other states that closing can end in.  [default: with method cas, exact solver]",
        "--equilibria/--no-equilibria",
        default=None,
    )
    json_file: Path | None = JSON
    view: bool = option("Show the run in a browser while it goes on; prints the page's address.")

    def run(self) -> None:
        """Assemble, print and show."""
        settings = self.settings(self.equilibria)
        self.check_mechanics(settings["solver"])
        clamp = self.clamp()
        model = self.model(clamp)
        has_page = self.view or self.html_file is not None or self.url is not None
        context = click.get_current_context()
        for param in () if has_page else context.command.params:
            given = context.get_parameter_source(str(param.name)) is ParameterSource.COMMANDLINE
            if given and param.name in Viewing.__annotations__:
                raise click.UsageError(f"{param.opts[-1]} goes with a page: --view, --html or --url")
        try:
            if has_page:
                result = self.view_assembly(clamp, model, settings, serve=self.view)
            else:
                result = self.assemble(clamp, model, settings)
                self.tell(result)
        except SequenceError as error:
            data: dict[str, Any] = {
                "status": f"not assembled: {error}",
                "blocks": [block.to_dict() for block in error.blocks],
            }
            show(data["status"])
            save(self.json_file, lambda: data)
            if has_page:
                self.view_scene(error.scene, serve=self.view)
            finish(True)
        finish(not result.passed)

    def tell(self, run: Assembly) -> None:
        """Print and write the result."""
        text, data = self.mechanics(run)  # first: it may refuse a value
        show("\n".join(filter(None, [run_to_text(run), text])))
        save(self.json_file, lambda: run.to_dict() | data)
