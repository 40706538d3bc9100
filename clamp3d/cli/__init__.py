"""The command line: parse, call, print. Data on stdout, progress and messages on stderr.

Exit codes: 0 clean, 1 a finding (clash, not clamped, blocked), 2 bad input, 3 undecided (a verdict that is not
certain), 4 failed inside (a fault of the program, or a solver that could not prove its answer), 130 interrupted.
"""

from __future__ import annotations

import atexit
import errno
import gc
import importlib
import os
import sys
import threading
import traceback
import warnings
from contextlib import suppress

import click

import clamp3d
from clamp3d.cli.terminal import ExitCode, end_on_signals, show, tolerate_closed_pipes
from clamp3d.core.child import own_process
from clamp3d.errors import EXTRAS, Clamp3dError, NotClampedError, SequenceError, SolverError, missing, one_line

# Name -> (module, one line for the list of commands). A command's module is loaded when it is called.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("clamp3d.cli.run", "Assemble a clamp and print where every part ends up."),
    "view": ("clamp3d.cli.view", "Show the assembly in a browser, or write it as one page."),
    "report": ("clamp3d.cli.report", "Write a report for an assembly reviewer."),
    "reproduce": ("clamp3d.cli.reproduce", "Print Tables 1-5 of the paper beside this program's values."),
    "compare": ("clamp3d.cli.compare", "Measure every contact method: accuracy against speed."),
    "stress": ("clamp3d.cli.stress", "Put families of hard cases to every contact method."),
    "measure-image": ("clamp3d.cli.measure_image", "Measure a distance in a photograph by marked points."),
    "fit": ("clamp3d.cli.fit", "Find round grooves, cylinders and holes in a mesh."),
    "export": ("clamp3d.cli.export", "Write the parts as files for CAD review."),
    "check": ("clamp3d.cli.check", "Check which parts of a scene clash, touch or keep their clearance."),
    "sweep": ("clamp3d.cli.sweep", "Map how far a wire may be misplaced before a clamp no longer closes on it."),
    "tolerance": ("clamp3d.cli.tolerance", "Sensitivity to each dimension, and a Monte Carlo over tolerances."),
    "verify": ("clamp3d.cli.verify", "Compute a result again and compare every value."),
    "conductors": ("clamp3d.cli.conductors", "List the conductor catalogue."),
}


class _LazyGroup(click.Group):
    """A group that knows its commands by name and loads only the one that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(COMMANDS[cmd_name][0]).command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            raise click.UsageError(f"unknown command {name!r}; available: {', '.join(COMMANDS)}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


@click.group(
    cls=_LazyGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(clamp3d.__version__, prog_name="clamp3d")
@click.pass_context
def group(context: click.Context) -> None:
    """Exact assembly checker for parts with round grooves.

    \b
    clamp3d run                             assemble the built-in reference clamp
    clamp3d run --line LJ-500 --jumper 16   other wires: by catalogue name or diameter in mm
    clamp3d run my-clamp.toml --json out.json
    clamp3d view                            watch it in a browser
    clamp3d check assembly.step             which parts clash, touch, keep their clearance
    """
    if context.invoked_subcommand is None:
        show(context.get_help())


def main() -> None:
    """Entry point: one line for every fault, never a traceback; CLAMP3D_DEBUG=1 shows it."""
    tolerate_closed_pipes()
    end_on_signals()
    own_process()
    gc.set_threshold(100_000)  # a command is short, and what its libraries load is no garbage: 4 % of a run
    try:
        _check_environment()
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: show(f"warning: {one_line(str(message))}", err=True)
            status = group.main(prog_name="clamp3d", standalone_mode=False)
    except click.ClickException as error:
        where = getattr(error, "ctx", None)
        hint = f" (see {where.command_path} --help)" if where is not None else ""
        status = _fail(error.format_message().replace("\n", " ") + hint, ExitCode.BAD_INPUT)
    except (KeyboardInterrupt, click.Abort):
        print("clamp3d: interrupted", file=sys.stderr)
        status = ExitCode.INTERRUPTED
    except Exception as error:
        if os.environ.get("CLAMP3D_DEBUG"):
            traceback.print_exc()
        if isinstance(error, ModuleNotFoundError) and (library := str(error.name).partition(".")[0]) in EXTRAS:
            error = missing(library, "this")
        if isinstance(error, (NotClampedError, SequenceError)):
            status = _fail(str(error), ExitCode.FINDING)
        elif isinstance(error, SolverError):
            status = _fail(str(error), ExitCode.FAILED)
        elif isinstance(error, OSError) and error.filename is not None:
            from clamp3d.checks import short

            status = _fail(f"{short(error.filename)}: {error.strerror}", ExitCode.BAD_INPUT)
        elif isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EFBIG):
            status = _fail(f"cannot write to stdout: {error.strerror}", ExitCode.BAD_INPUT)
        elif isinstance(error, (Clamp3dError, OSError)):
            status = _fail(str(error), ExitCode.BAD_INPUT)
        else:
            status = _fail(f"inside clamp3d: {_place(error)}; CLAMP3D_DEBUG=1 shows the traceback", ExitCode.FAILED)
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError as error:  # a full disk: what is left in the buffer would be tried once more at exit
            if stream is sys.stdout and status not in (ExitCode.BAD_INPUT, ExitCode.FAILED):
                status = _fail(f"cannot write to stdout: {error.strerror}", ExitCode.BAD_INPUT)
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(int(status) if isinstance(status, int) else 0)


def program() -> None:
    """The whole process: `main`, then its end. To free what the system takes back anyway is 6 % of a check."""
    try:
        main()
    except SystemExit as told:
        if threading.active_count() > 1 or not isinstance(told.code, int):
            raise
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(told.code)


def _check_environment() -> None:
    """Libraries read it when they are imported (numpy.f2py does), and end with errors of their own."""
    if os.environ.get("SOURCE_DATE_EPOCH") == "":
        del os.environ["SOURCE_DATE_EPOCH"]
    elif "SOURCE_DATE_EPOCH" in os.environ:
        from clamp3d.output.pages import now

        now()


def _place(error: Exception) -> str:
    """Type and message of an unexpected error, and the line of this package that it came through last."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "clamp3d" in f.filename]
    where = f" at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}: {error}{where}"


def _fail(message: str, code: ExitCode) -> ExitCode:
    with suppress(OSError):  # a full disk: the code still tells
        print(f"clamp3d: error: {one_line(message)}", file=sys.stderr)
    return code
