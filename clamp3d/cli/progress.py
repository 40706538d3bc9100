"""Progress on stderr: lines that stay, and one line that changes where stderr is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from clamp3d.errors import escaped

if TYPE_CHECKING:
    from rich.status import Status

    from clamp3d.clamp.result import Waypoint


class Narrator:
    """Tells the user what goes on: lines by ``say``, and in ``status`` what changes; nothing where they are None."""

    def __init__(self, say: Callable[[str], object] | None, status: Status | None) -> None:
        self._say, self._status = say, status

    def line(self, text: str) -> None:
        """A line that stays."""
        if self._say is not None:
            self._say(escaped(text))

    def status(self, text: str) -> None:
        """What is going on now; not shown where stderr is a file."""
        if self._status is not None:
            from rich.text import Text

            self._status.update(Text(escaped(text)))

    def waypoint(self, waypoint: Waypoint) -> None:
        """What a run has reached."""
        self.line(f"{waypoint.step:14s} {waypoint.label}")

    def position(self, tried: int, distance: float) -> None:
        """What a solver is trying."""
        self.status(f"closing: {tried} positions tried, {distance:.3f} mm")


@contextmanager
def narrator(quiet: bool) -> Iterator[Narrator]:
    """A `Narrator` on stderr for the time of the block."""
    if quiet:
        yield Narrator(None, None)
        return
    if not sys.stderr.isatty():
        yield Narrator(partial(print, file=sys.stderr), None)
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("") as status:
        yield Narrator(partial(console.print, markup=False, highlight=False, soft_wrap=True), status)


@contextmanager
def bar(quiet: bool) -> Iterator[Callable[[str, float, float], None]]:
    """A function ``report(stage, done, of)`` that moves a bar; it is silent if stderr is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda stage, done, of: None
        return
    from rich import progress
    from rich.console import Console

    columns = (
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        progress.TextColumn("left:"),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=None)
        yield lambda stage, done, of: shown.update(task, description=escaped(stage), completed=done, total=of)
