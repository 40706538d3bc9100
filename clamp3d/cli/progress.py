"""Progress on stderr: lines that stay, and one line that changes where stderr is a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from clamp3d.errors import escaped

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

    from clamp3d.clamp.result import Waypoint


class Narrator:
    """Tells the user what goes on; says nothing where ``console`` is None."""

    def __init__(self, console: Console | None, status: Status | None) -> None:
        self._console, self._status = console, status

    def line(self, text: str) -> None:
        """A line that stays."""
        if self._console is not None:
            self._console.print(escaped(text), markup=False, highlight=False, soft_wrap=True)

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
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield Narrator(console, None)
        return
    with console.status("") as status:
        yield Narrator(console, status)


@contextmanager
def bar(quiet: bool) -> Iterator[Callable[[str, float, float], None]]:
    """A function ``report(stage, done, of)`` that moves a bar; it is silent if stderr is no terminal."""
    import sys

    if quiet or not sys.stderr.isatty():
        yield lambda stage, done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=None)
        yield lambda stage, done, of: shown.update(task, description=escaped(stage), completed=done, total=of)
