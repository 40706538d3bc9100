"""The command line: parse, call, print. Data on stdout, progress and messages on stderr.

Exit codes: 0 clean, 1 a finding (clash, not clamped, blocked), 2 bad input, 3 undecided (a verdict that is not
certain), 4 failed inside (a fault of the program, or a solver that could not prove its answer), 130 interrupted.
"""

from __future__ import annotations

import errno
import gc
import importlib
import os
import sys
import traceback
import warnings
from contextlib import suppress

import click

import clamp3d
from clamp3d.cli.terminal import ExitCode, end_on_signals, prepare_streams, show
from clamp3d.errors import EXTRAS, Clamp3dError, NotClampedError, SequenceError, SolverError, missing, one_line
from clamp3d.output.pages import now

# Name -> (module and class, one line for the list of commands). A module is loaded when its command is called.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("run.Run", "Assemble a clamp and print where every part ends up."),
    "view": ("view.View", "Show the assembly in a browser, or write it as one page."),
    "report": ("report.Report", "Write a report for an assembly reviewer."),
    "reproduce": ("bench.Reproduce", "Print Tables 1-5 of the paper beside this program's values."),
    "compare": ("bench.Compare", "Measure every contact method: accuracy against speed."),
    "stress": ("bench.Stress", "Count the errors of every contact method on hard cases with known answers."),
    "measure-image": ("bench.MeasureImage", "Measure a distance in a photograph by marked points."),
    "fit": ("fit.Fit", "Find round grooves, cylinders and holes in a mesh."),
    "export": ("export.Export", "Write the parts as files for CAD review."),
    "check": ("check.Check", "Check which parts of a scene clash, touch or keep their clearance."),
    "accept": ("check.Accept", "Accept findings of check, with a reason."),
    "sweep": ("sweep.Sweep", "Map the start places that seat a wire, and how far it may lean."),
    "tolerance": ("tolerance.Tolerance", "Sensitivity to each dimension, and a Monte Carlo over tolerances."),
    "conductors": ("conductors.Conductors", "List the conductor catalogue."),
}


class _LazyGroup(click.Group):
    """A group that knows its commands by name and loads only the one that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            if os.path.exists(cmd_name):
                raise click.UsageError(f"{cmd_name} is no command; to check it: clamp3d check {cmd_name}", ctx)
            raise click.exceptions.NoSuchCommand(cmd_name, possibilities=COMMANDS, ctx=ctx)
        module, _, function = COMMANDS[cmd_name][0].partition(".")
        command: click.Command = getattr(importlib.import_module(f"clamp3d.cli.{module}"), function)
        return command

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

    Tab completion of commands, options, files and wires: eval "$(_CLAMP3D_COMPLETE=bash_source clamp3d)", or
    zsh_source, fish_source.
    """
    if context.invoked_subcommand is None:
        show(context.get_help())


def main() -> None:
    """Entry point: one line for every fault, never a traceback; CLAMP3D_DEBUG=1 shows it."""
    prepare_streams()
    end_on_signals()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # more threads only cost time to start
    gc.set_threshold(100_000)  # what libraries load is no garbage: to look for some among it is a sixth of a short run
    try:
        _check_environment()
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: show(f"warning: {one_line(str(message))}", err=True)
            status = group.main(prog_name="clamp3d", standalone_mode=False)
    except (KeyboardInterrupt, click.Abort):
        print("clamp3d: interrupted", file=sys.stderr)
        status = ExitCode.INTERRUPTED
    except Exception as error:
        if os.environ.get("CLAMP3D_DEBUG"):
            traceback.print_exc()
        message, status = _explained(error)
        _complain(message)
    sys.exit(_flushed(int(status) if isinstance(status, int) else ExitCode.CLEAN))


def _flushed(status: int) -> int:
    """The exit code when what is still in the buffers is written: a full disk is bad input, unless worse is known."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            is_reported = isinstance(error, BrokenPipeError) or status in (ExitCode.BAD_INPUT, ExitCode.FAILED)
            if stream is sys.stdout and not is_reported:
                _complain(f"cannot write to stdout: {error.strerror}")
                status = ExitCode.BAD_INPUT
            with suppress(OSError):  # what is left in the buffer would be tried once more at exit
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return status


def _explained(error: Exception) -> tuple[str, ExitCode]:
    """An error in one line, and its exit code."""
    if isinstance(error, ModuleNotFoundError) and (library := str(error.name).partition(".")[0]) in EXTRAS:
        error = missing(library, "this")
    match error:
        case click.ClickException():
            context = getattr(error, "ctx", None)
            hint = "" if context is None else f" (see {context.command_path} --help)"
            return error.format_message().replace("\n", " ") + hint, ExitCode.BAD_INPUT
        case NotClampedError() | SequenceError():
            return str(error), ExitCode.FINDING
        case SolverError():
            return str(error), ExitCode.FAILED
        case Clamp3dError():
            return str(error), ExitCode.BAD_INPUT
        case OSError(errno=errno.ENOSPC | errno.EFBIG, filename=None):
            return f"cannot write to stdout: {error.strerror}", ExitCode.BAD_INPUT
        case OSError():
            return f"{error.filename or 'stdout'}: {error.strerror}", ExitCode.BAD_INPUT
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "clamp3d" in f.filename]
    where = f" at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}" if frames else ""
    message = f"inside clamp3d: {type(error).__name__}: {error}{where}; CLAMP3D_DEBUG=1 shows the traceback"
    return message, ExitCode.FAILED


def _complain(message: str) -> None:
    with suppress(OSError):  # a full disk: the exit code is still right
        print(f"clamp3d: error: {one_line(message)}", file=sys.stderr)


def _check_environment() -> None:
    """Libraries read it when they are imported (numpy.f2py does), and end with errors of their own."""
    if os.environ.get("SOURCE_DATE_EPOCH") == "":
        del os.environ["SOURCE_DATE_EPOCH"]
    now()
