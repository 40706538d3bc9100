"""Options that several commands share. Each group comes to a command as one dataclass."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from clamp3d.baselines import METHODS, contact_model
from clamp3d.cli.terminal import STDOUT_TAKEN

if TYPE_CHECKING:
    from clamp3d.baselines.model import ContactModel
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.collide.scene import Scene

Command = Callable[..., Any]
UNITS = ("mm", "cm", "m", "in")


def number(text: str | float) -> float:
    """A finite number, as the type of an option; ``1/3`` is one too."""
    try:
        found = float(Fraction(text)) if "/" in str(text) else float(text)
    except (ValueError, ZeroDivisionError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise click.BadParameter(f"must be a finite number or a fraction like 1/3, got {text!r}")
    return found


class Output(click.Path):
    """A file to write; ``-`` is stdout. That it can be written is found out before the work, not after."""

    def __init__(self, suffixes: tuple[str, ...] = ()) -> None:
        super().__init__(dir_okay=False, path_type=Path)
        self.suffixes = suffixes

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path."""
        from clamp3d.output.files import STDOUT, check_writable

        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path == STDOUT:
            if ctx is not None and ctx.meta.setdefault(STDOUT_TAKEN, param) is not param:
                self.fail("only one file can be stdout (-)", param, ctx)
        elif self.suffixes and path.suffix.lower() not in self.suffixes:
            self.fail(f"{path}: the name must end in one of {', '.join(self.suffixes)}", param, ctx)
        check_writable(path)
        return path


INPUT_FILE = click.Path(dir_okay=False, path_type=Path)
OUTPUT = Output()
PICTURE = Output((".png", ".svg", ".pdf"))
FOLDER = click.Path(file_okay=False, path_type=Path)


def collect(name: str, kind: type[Any], *options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Decorator that adds ``options`` to a command, which gets their values as one ``kind`` by the name ``name``."""
    keys = [f.name for f in fields(kind)]

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def call(**values: Any) -> Any:
            return command(**{name: kind(**{key: values.pop(key) for key in keys})}, **values)

        decorated: Command = call
        for option in reversed(options):
            decorated = option(decorated)
        return decorated

    return decorate


@dataclass(frozen=True)
class Source:
    """What a command is to work on."""

    source: str
    line: str | None
    jumper: str | None

    def load(self) -> Clamp | Scene:
        """A clamp, or a scene from a scene file, a mesh or a STEP file."""
        from clamp3d.scenefile.load import load

        return load(self.source, line=self.line, jumper=self.jumper)

    def clamp(self) -> Clamp:
        """A clamp; anything else is an error."""
        from clamp3d.clamp.loader import load_clamp

        return load_clamp(self.source, line=self.line, jumper=self.jumper)


def source_argument(metavar: str = "[INPUT]", *, required: bool = False) -> Callable[[Command], Command]:
    """``[INPUT] --line --jumper`` as ``source: Source``; without an argument it is the reference clamp."""
    return collect(
        "source",
        Source,
        click.argument("source", metavar=metavar, required=required, default=None if required else "reference"),
        click.option("--line", metavar="CONDUCTOR", help="Power line: catalogue name or diameter in mm."),
        click.option("--jumper", metavar="CONDUCTOR", help="Jumper: catalogue name or diameter in mm."),
    )


clamp_argument = source_argument("[CLAMP]")


@dataclass(frozen=True)
class Method:
    """How grooves are measured, and how the final state is found."""

    method: str
    unit_angle_deg: float | None
    threshold: float | None
    mesh_error: float | None
    solver: str | None
    step: float | None
    tilt_step_deg: float | None

    def settings(self) -> dict[str, Any]:
        """Arguments of `assemble` for the solver. Raises click.UsageError for options that do not go together."""
        by_step = self.step is not None or self.tilt_step_deg is not None
        if self.solver == "exact" and by_step:
            raise click.UsageError("--step and --tilt-step-deg go with --solver stepped, not exact")
        default = "stepped" if by_step else "exact" if self.method in ("cas", "chords") else "bisection"
        settings: dict[str, Any] = {"solver": self.solver or default}
        if self.step is not None:
            settings["step"] = self.step
        if self.tilt_step_deg is not None:
            settings["tilt_step"] = math.radians(self.tilt_step_deg)
        return settings

    def model(self, clamp: Clamp, *, quiet: bool = False) -> ContactModel:
        """The contact model. Raises click.UsageError for options that do not go together."""
        from clamp3d.clamp.parts import parts

        angle = None if self.unit_angle_deg is None else math.radians(self.unit_angle_deg)
        given = {"unit_angle": angle, "threshold": self.threshold, "mesh_error": self.mesh_error}
        for option, setting in zip(("--unit-angle-deg", "--threshold", "--mesh-error"), given, strict=True):
            takers = [name for name, settings in METHODS.items() if setting in settings]
            if given[setting] is not None and self.method not in takers:
                raise click.UsageError(f"{option} goes with --method {' or '.join(takers)}, not {self.method}")
        return contact_model(
            self.method,
            parts(clamp),
            unit_angle=angle,
            threshold=self.threshold,
            mesh_error=self.mesh_error,
            progress=False if quiet else None,
        )


method_options = collect(
    "method",
    Method,
    click.option(
        "--method",
        type=click.Choice(list(METHODS)),
        default="cas",
        show_default=True,
        help="How grooves are measured: as arcs, as chords in the section, or by FCL on convex wedges, on CoACD "
        "hulls, on meshes.",
    ),
    click.option("--unit-angle-deg", type=number, metavar="A", help="Angle of a chord: chords, wedges.  [default: 5]"),
    click.option("--threshold", type=number, metavar="MM", help="Concavity that CoACD may leave: hulls.  [default: 2]"),
    click.option("--mesh-error", type=number, metavar="MM", help="Chord error of hulls and mesh.  [default: 0.05]"),
    click.option(
        "--solver",
        type=click.Choice(["exact", "stepped", "bisection"]),
        help="[default: exact for cas and chords, bisection for the others; stepped if a step is given]",
    ),
    click.option("--step", type=number, metavar="MM", help="Move along the bolt, stepped solver.  [default: 1/3]"),
    click.option("--tilt-step-deg", type=number, metavar="A", help="Turn of the stepped solver.  [default: 1]"),
)
"""``--method`` and what goes with it, and the solver's options, as ``method: Method``."""


@dataclass(frozen=True)
class Viewing:
    """What a viewer is to show, and where."""

    html_file: Path | None
    url: str | None
    host: str
    port: int | None
    timeout: float | None
    open_browser: bool
    overlays: tuple[str, ...]
    draw_error: float
    clearance: float


CLEARANCE = click.option(
    "--clearance",
    type=number,
    default=5.0,
    show_default=True,
    metavar="MM",
    help="Gap from which parts are clear.",
)
QUIET = click.option("--quiet", "-q", is_flag=True, help="No progress.")
JSON = click.option("--json", "json_file", type=OUTPUT, metavar="FILE", help="Write the result as JSON; - is stdout.")

viewer_options = collect(
    "viewing",
    Viewing,
    click.option("--html", "html_file", type=OUTPUT, metavar="FILE", help="Write one page with the whole animation."),
    click.option("--url", metavar="ZMQ_URL", help="Use a running meshcat server: the zmq_url that it printed."),
    click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve on; 0.0.0.0 for all."),
    click.option("--port", type=click.IntRange(0, 65535), help="Port to serve on.  [default: first free from 7000]"),
    click.option("--timeout", type=click.FloatRange(min=0.0), metavar="S", help="Stop serving after S seconds."),
    click.option("--open", "open_browser", is_flag=True, help="Open the page in a browser."),
    click.option(
        "--overlay",
        "overlays",
        multiple=True,
        metavar="NAME[=SIZE]",
        help="Also show what a baseline makes of the parts: wedges (unit angle in deg) or hulls (CoACD's threshold "
        "in mm). May be given more than once.",
    ),
    click.option(
        "--draw-error", type=number, default=0.01, show_default=True, metavar="MM", help="Chord error of drawn facets."
    ),
    CLEARANCE,
)
"""``--html --url --host --port ...`` as ``viewing: Viewing``."""
