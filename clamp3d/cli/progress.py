"""Progress on stderr by rich: lines that stay, and one line that changes where stderr is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from clamp3d.errors import escaped

if TYPE_CHECKING:
    from rich.status import Status

    from clamp3d.baselines.model import ContactModel
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.clamp.result import Assembly, Waypoint


class Narrator:
    """Lines on stderr, and in ``status`` what changes: only where it is a terminal, and nothing if ``quiet``."""

    def __init__(self, quiet: bool, status: Status | None) -> None:
        self._quiet, self._status = quiet, status

    def status(self, text: str) -> None:
        """What is going on now; not shown where stderr is a file."""
        if self._status is not None:
            from rich.text import Text

            self._status.update(Text(escaped(text)))

    def waypoint(self, waypoint: Waypoint) -> None:
        """A line that stays, above the status: what a run has reached."""
        if not self._quiet:
            print(escaped(f"{waypoint.step:14s} {waypoint.label}"), file=sys.stderr)

    def position(self, tried: int, distance: float) -> None:
        """What a solver is trying."""
        self.status(f"closing: {tried} positions tried, {distance:.3f} mm")


@contextmanager
def narrator(quiet: bool) -> Iterator[Narrator]:
    """A `Narrator` on stderr for the time of the block."""
    if quiet or not sys.stderr.isatty():
        yield Narrator(quiet, None)
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield Narrator(quiet, status)


def narrated(
    clamp: Clamp,
    model: ContactModel,
    settings: dict[str, Any],
    quiet: bool,
    *listeners: Callable[[Waypoint], None],
) -> Assembly:
    """Assemble a clamp with the waypoints on stderr, and to ``listeners``."""
    from clamp3d.clamp.assemble import assemble

    with narrator(quiet) as narrate:

        def listen(waypoint: Waypoint) -> None:
            for listener in (*listeners, narrate.waypoint):
                listener(waypoint)

        return assemble(clamp, model, on_waypoint=listen, progress=narrate.position, **settings)


@contextmanager
def bar(quiet: bool) -> Iterator[Callable[[str, float, float], None]]:
    """A function ``report(stage, done, of)`` that moves a bar with the time left; silent if stderr is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda stage, done, of: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=None)
        yield lambda stage, done, of: shown.update(task, description=escape(escaped(stage)), completed=done, total=of)
