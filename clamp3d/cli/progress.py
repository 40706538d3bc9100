"""Progress on stderr by rich: lines that stay, and one line that changes where stderr is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from clamp3d.errors import escaped

if TYPE_CHECKING:
    from clamp3d.baselines.model import ContactModel
    from clamp3d.clamp.dimensions import Clamp
    from clamp3d.clamp.result import Assembly, Waypoint


@contextmanager
def narrator(quiet: bool) -> Iterator[Callable[[str], None]]:
    """A function that says on stderr what is going on now; silent if ``quiet``, or if stderr is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status("") as status:
        yield lambda text: status.update(Text(escaped(text)))


def narrated(
    clamp: Clamp,
    model: ContactModel,
    settings: dict[str, Any],
    quiet: bool,
    *listeners: Callable[[Waypoint], None],
) -> Assembly:
    """Assemble a clamp with the waypoints on stderr, and to ``listeners``."""
    from clamp3d.clamp.assemble import assemble

    def listen(waypoint: Waypoint) -> None:
        for listener in listeners:
            listener(waypoint)
        if not quiet:
            print(escaped(f"{waypoint.step:14s} {waypoint.label}"), file=sys.stderr)

    with narrator(quiet) as say:
        return assemble(
            clamp,
            model,
            on_waypoint=listen,
            progress=lambda tried, distance: say(f"closing: {tried} positions tried, {distance:.3f} mm"),
            **settings,
        )


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
