"""Commands are classes whose options are attributes; the options that several commands share are here."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

import click

from clamp3d.baselines import METHODS, contact_model
from clamp3d.checks import files_read, note_read
from clamp3d.cli.terminal import STDOUT_TAKEN, bar, show
from clamp3d.errors import need

if TYPE_CHECKING:
    from clamp3d.baselines.model import ContactModel
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.clamp.result import Assembly, Waypoint
    from clamp3d.engine.scene import Scene

Unit: TypeAlias = Literal["mm", "cm", "m", "in"]


def number(text: str | float) -> float:
    """A finite number, as the type of an option; ``1/3`` is one too."""
    try:
        value = float(Fraction(text)) if "/" in str(text) else float(text)
        if math.isfinite(value) and "_" not in str(text):  # 1_0 is no number outside of Python
            return value
    except (ValueError, ZeroDivisionError, OverflowError):
        pass
    raise click.BadParameter(f"must be a finite number or a fraction like 1/3, got {text!r}")


def radians(text: str | float) -> float:
    """An angle of so many degrees, as the type of an option."""
    return math.radians(number(text))


def couples(text: str, separator: str, example: str) -> list[tuple[str, str]]:
    """The two sides of each item of a list with commas, which reads like the ``example``."""
    rows = []
    for item in text.split(","):
        sides = tuple(side.strip() for side in item.split(separator))
        if len(sides) != 2 or not all(sides):
            raise click.BadParameter(f"must read like {example}, got {item!r}")
        rows.append(sides)
    return rows


def joint_values(text: str) -> dict[str, float]:
    """Values by the names of joints, as the type of an option."""
    values = couples(text, "=", "elbow=1.57,slide=20")
    names = [name for name, _ in values]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise click.BadParameter(f"must give each joint once, got {twice} {names.count(twice)} times")
    return {name: number(value) for name, value in values}


class Output(click.Path):
    """A file to write; ``-`` is stdout. Whether it can be written is checked before the work."""

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
        if self.suffixes:
            need("matplotlib", "a drawing")
        check_writable(path)
        return path


SOURCE = click.Path(readable=False)
"""What `clamp3d.load` takes as a text: the shell completes it as a file."""
INPUT_FILE = click.Path(dir_okay=False, path_type=Path)
"""A file that is read, over which nothing is written."""
PICTURE = Output((".png", ".svg", ".pdf"))
FOLDER = click.Path(file_okay=False, path_type=Path)


def option(text: str, *names: str, **settings: Any) -> Any:
    """An option with the help ``text``, as the value of the attribute that gets what is given.

    Without ``names`` it is called as the attribute. ``settings`` are those of `click.Option`; of an attribute that is
    annotated as a bool, a float, a Path or a Literal the type follows from the annotation. A default is shown.
    """

    def make(name: str, annotation: Any) -> click.Option:
        usual = _of_type(annotation) | {"show_default": "default" in settings}
        return click.Option([*(names or [f"--{name.replace('_', '-')}"]), name], help=text, **(usual | settings))

    return make


def _of_type(annotation: Any) -> dict[str, Any]:
    """What the type of an attribute says of its option."""
    if get_origin(annotation) in (Union, UnionType):
        annotation = get_args(annotation)[0]  # ``X | None``
    if get_origin(annotation) is Literal:
        return {"type": click.Choice(get_args(annotation), case_sensitive=False)}
    usual: dict[Any, dict[str, Any]] = {
        bool: {"is_flag": True},
        float: {"type": number},
        Path: {"type": Output(), "metavar": "FILE"},
    }
    return usual.get(annotation, {})


def argument(**settings: Any) -> Any:
    """A `click.Argument`, as the value of the attribute that gets what is given."""
    return lambda name, annotation: click.Argument([name], **settings)


def command(name: str) -> Callable[[type[Any]], click.Command]:
    """Decorator that makes a command of a class whose attributes, and those of its bases, are options and arguments.

    What is given is in the attributes of an instance, whose method ``run`` is called.
    """

    def decorate(kind: type[Any]) -> click.Command:
        types = get_type_hints(kind)
        keys = dict.fromkeys(key for base in kind.__mro__ for key in inspect.get_annotations(base))
        parameters: dict[str, click.Parameter] = {key: getattr(kind, key)(key, types[key]) for key in keys}

        def call(**values: Any) -> None:
            instance = kind()
            vars(instance).update(values)
            with files_read():
                note_read(_inputs(parameters, values))
                _check_outputs(parameters.values(), values)
                instance.run()

        return click.Command(name, params=[*parameters.values()], callback=call, help=inspect.getdoc(kind))

    return decorate


def _inputs(parameters: Mapping[str, click.Parameter], values: Mapping[str, Any]) -> Iterator[Path]:
    """The files that a command is given to read; of a folder those with parts."""
    from clamp3d.files.formats import FORMATS

    for name, parameter in parameters.items():
        is_argument = isinstance(parameter, click.Argument) and parameter.nargs == 1
        if values[name] and (is_argument or parameter.type is INPUT_FILE) and os.path.exists(values[name]):
            path = Path(values[name])
            yield from [f for f in path.iterdir() if f.suffix.lower() in FORMATS] if path.is_dir() else [path]


def _check_outputs(parameters: Iterable[click.Parameter], values: Mapping[str, Any]) -> None:
    """Refuse that a file is written over another one, or over one that was read."""
    from clamp3d.output.files import STDOUT, require_not_read

    written: dict[str, str] = {}
    for parameter in parameters:
        path = values[parameter.name or ""]
        if isinstance(parameter.type, Output) and path not in (None, STDOUT):
            require_not_read(path)
            other = written.setdefault(os.path.realpath(path), parameter.opts[0])
            if other != parameter.opts[0]:
                raise click.UsageError(f"{other} and {parameter.opts[0]} are one file: {path}")


def _wires(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Names of wires, for tab completion."""
    from clamp3d.clamp.conductors import catalogue

    return [name for name in catalogue() if name.lower().startswith(incomplete.lower())]


CLEARANCE = option("Gap that parts must keep.  [default: 5 for a clamp; the scene's own]", metavar="MM")
JSON = option("Write the result as JSON; - is stdout.", "--json")


class Quiet:
    """Whether progress and notes are shown."""

    quiet: bool = option("No progress and no notes on stderr.", "--quiet", "-q")

    def assemble(
        self, clamp: Clamp, model: ContactModel, settings: Mapping[str, Any], *listeners: Callable[[Waypoint], None]
    ) -> Assembly:
        """Assemble a clamp; every waypoint goes to stderr and to the ``listeners``."""
        from clamp3d.clamp.assemble import assemble

        def listen(waypoint: Waypoint) -> None:
            for listener in listeners:
                listener(waypoint)
            if not self.quiet:
                show(f"{waypoint.step:14s} {waypoint.label}", err=True)

        with bar(self.quiet) as report:
            return assemble(
                clamp,
                model,
                on_waypoint=listen,
                progress=lambda n, distance: report(f"closing: {n} positions tried, {distance:.3f} mm"),
                **settings,
            )


class ClampSource:
    """The clamp that a command is to work on."""

    source: str = argument(metavar="[CLAMP]", default="reference", required=False, type=SOURCE)
    line: str | None = option(
        "Power line: catalogue name or diameter in mm.", metavar="CONDUCTOR", shell_complete=_wires
    )
    jumper: str | None = option("Jumper: catalogue name or diameter in mm.", metavar="CONDUCTOR", shell_complete=_wires)

    def clamp(self) -> Clamp:
        """The clamp; anything else is an error."""
        from clamp3d.clamp.loader import load_clamp

        return load_clamp(self.source, line=self.line, jumper=self.jumper)


class Source(ClampSource):
    """What a command is to work on: a clamp, a scene or a file with parts."""

    source: str = argument(metavar="[INPUT]", default="reference", required=False, type=SOURCE)
    unit: Unit | None = option("Unit of a mesh file.  [default: mm; m for glTF]", "--input-unit")
    fit: Literal["off", "round"] | None = option(
        "Round surfaces of a mesh file: off: its facets are the part; round: fitted.  [default: off]"
    )
    chord: float | None = option("How far a mesh file's true surface can be from its facets.", metavar="MM")
    joints: dict[str, float] | None = option(
        "Joint values of a URDF: rad, or mm for those that slide.", type=joint_values, metavar="NAME=VALUE,..."
    )
    poses: Path | None = option(
        "Poses of a folder of meshes: CSV with name,x,y,z,qx,qy,qz,qw.", type=INPUT_FILE, metavar="CSV"
    )
    partial: bool = option("Continue if some bodies of a file cannot be read; a note says how many were read.")

    def load(self) -> Clamp | Scene:
        """A clamp, or a scene from a scene file or any file that holds bodies."""
        from clamp3d.scenefile.load import load

        loaded = load(**{key: getattr(self, key) for key in (*ClampSource.__annotations__, *Source.__annotations__)})
        context = click.get_current_context()
        _check_outputs(context.command.params, context.params)  # again: now it is known what INPUT names
        return loaded


SEQUENCE: Any = option(
    "Order of assembly in place of the clamp's own: steps of a grasped part and its followers.",
    metavar="'P1|P2P3 -> P4 ...'",
)


class Method(Quiet):
    """How grooves are measured, and how the final state is computed."""

    method: str = option(
        "How grooves are measured: as arcs, as chords in the section, or by FCL on convex wedges, on CoACD "
        "hulls, on meshes.",
        type=click.Choice(list(METHODS)),
        default="cas",
    )
    unit_angle: float | None = option(
        "Angle of a chord: chords, wedges.  [default: 5]", "--unit-angle-deg", type=radians, metavar="A"
    )
    threshold: float | None = option("Concavity that CoACD may leave: hulls.  [default: 2]", metavar="MM")
    mesh_error: float | None = option("Chord error of hulls and mesh.  [default: 0.05]", metavar="MM")
    solver: Literal["exact", "stepped", "bisection"] | None = option(
        "How the final state is computed.  [default: exact for cas and chords, bisection for the others; stepped with "
        "--step]"
    )
    sequence: str | None = SEQUENCE
    step: float | None = option("Move along the bolt, stepped solver.  [default: 1/3]", metavar="MM")
    tilt_step: float | None = option(
        "Tilt step of the stepped solver.  [default: 1]", "--tilt-step-deg", type=radians, metavar="A"
    )

    def refuse_method(self) -> None:
        """Raise click.UsageError if anything was chosen: there is no clamp to use it for."""
        if {getattr(self, key) for key in Method.__annotations__} != {"cas", None}:
            raise click.UsageError("--method, --solver and their options go with a clamp, not with a scene")

    def settings(self, equilibria: bool | None = None) -> dict[str, Any]:
        """Arguments of `assemble`, ``equilibria`` by default where they are exact.

        Raises click.UsageError for options that do not go together.
        """
        by_step = self.step is not None or self.tilt_step is not None
        if self.solver == "exact" and by_step:
            raise click.UsageError("--step and --tilt-step-deg go with --solver stepped, not exact")
        default = "stepped" if by_step else "exact" if self.method in ("cas", "chords") else "bisection"
        solver = self.solver or default
        if equilibria and solver != "exact":
            raise click.UsageError(f"--equilibria goes with --solver exact, not {solver}")
        others = self.method == "cas" and solver == "exact" if equilibria is None else equilibria
        settings = {"solver": solver, "others": others, "sequence": self.sequence}
        if by_step:
            from clamp3d.clamp.assemble import STEP, TILT_STEP  # takes long to import, and scenes are shown without it

            step, tilt_step = STEP if self.step is None else self.step, self.tilt_step
            settings["moves"] = step, TILT_STEP if tilt_step is None else tilt_step
        return settings

    def model(self, clamp: Clamp) -> ContactModel:
        """The contact model. Raises InputError for options that do not go with it."""
        from clamp3d.clamp.parts import parts

        settings: dict[str, Any] = {key: getattr(self, key) for key in ("unit_angle", "threshold", "mesh_error")}
        return contact_model(self.method, parts(clamp), progress=False if self.quiet else None, **settings)
