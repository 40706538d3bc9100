"""What commands say to the terminal and to the shell: text on stdout, exit codes, progress on stderr by rich."""

from __future__ import annotations

import io
import os
import shlex
import signal
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import click

from clamp3d.errors import escaped


class ExitCode(IntEnum):
    """Exit codes of the commands."""

    CLEAN = 0
    FINDING = 1
    BAD_INPUT = 2
    UNDECIDED = 3
    FAILED = 4
    INTERRUPTED = 130


def show(text: str, *, err: bool = False) -> None:
    """Print ``text`` for people: on stdout, or on stderr if ``err`` or if a FILE option took stdout (``-``).

    Control characters, which names in files may hold, are printed as escape sequences.
    """
    context = click.get_current_context(silent=True)
    taken = context is not None and STDOUT_TAKEN in context.meta
    with suppress(BrokenPipeError):  # `| head`: the exit code is the verdict's all the same
        click.echo(escaped(text, keep="\n"), err=err or taken)


def command_line() -> str:
    """The command that was called, for what is written about its result."""
    return shlex.join(["clamp3d", *sys.argv[1:]])


def save(path: Path | None, make: Callable[[], dict[str, Any] | str]) -> None:
    """Write what ``make`` gives to a file, if there is to be one: a text as it is, anything else as JSON."""
    if path is None:
        return
    from clamp3d.output.files import json_text, write_text

    content = make()
    with suppress(BrokenPipeError):
        write_text(path, content if isinstance(content, str) else json_text(content))


def finish(finding: bool = False, *, failed: bool = False, verdicts: Collection[str] = ()) -> None:
    """End the command with the exit code of its verdict: what is certain counts most, then what failed.

    ``verdicts`` of a scene count as what they say.
    """
    from clamp3d.engine.result import BAD
    from clamp3d.engine.verdict import Verdict

    if finding or any(verdict in verdicts for verdict in BAD):
        raise click.exceptions.Exit(ExitCode.FINDING)
    if failed or Verdict.FAILED in verdicts:
        raise click.exceptions.Exit(ExitCode.FAILED)
    if Verdict.UNCERTAIN in verdicts:
        raise click.exceptions.Exit(ExitCode.UNDECIDED)


STDOUT_TAKEN = "clamp3d.stdout"
"""Key of the context's ``meta`` under which the option stands that writes its file to stdout."""


def end_on_signals() -> None:
    """Let a process that is ended by a signal (SIGTERM, SIGHUP) remove its temporary files and its workers before."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # nohup ignores SIGHUP
            signal.signal(number, _end)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: FrameType | None) -> NoReturn:
    """End at once while a module is imported, since some libraries ignore what is raised then; workers end too."""
    is_interrupt = number == signal.SIGINT
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            if is_interrupt:
                print("clamp3d: interrupted", file=sys.stderr, flush=True)
            os._exit(128 + number)
        frame = frame.f_back
    raise KeyboardInterrupt if is_interrupt else SystemExit(128 + number)


def prepare_streams() -> None:
    """Letters that a terminal lacks become escape sequences; a stream that the caller has closed takes anything."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # libraries ask it whether it is a terminal
            setattr(sys, name, io.TextIOWrapper(io.FileIO(os.devnull, "w"), encoding="utf-8"))
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def bar(quiet: bool) -> Iterator[Callable[..., None]]:
    """A function ``report(stage, done=0.0, of=None)``, which says on stderr what is going on and how long it takes.

    Without ``of`` that is not known. Silent if ``quiet``, or if stderr is no terminal.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda stage, done=0.0, of=None: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=None)
        yield lambda stage, done=0.0, of=None: shown.update(
            task, description=escape(escaped(stage)), completed=done, total=of
        )
