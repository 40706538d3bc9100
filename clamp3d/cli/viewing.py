"""A viewer beside the work, for ``clamp3d view`` and ``clamp3d run --view``."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import click
from click.core import ParameterSource

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.clamp.sequence import as_published, parse_sequence
from clamp3d.cli.options import Viewing
from clamp3d.cli.progress import bar, narrator
from clamp3d.cli.terminal import show
from clamp3d.collide.check import check
from clamp3d.collide.result import CheckResult
from clamp3d.collide.scene import Scene
from clamp3d.errors import SequenceError
from clamp3d.output.files import STDOUT
from clamp3d.output.viewer import MEASURED, Viewer
from clamp3d.output.viewer_overlay import overlay


def run_and_view(
    clamp: Clamp,
    model: ContactModel,
    settings: dict[str, Any],
    viewing: Viewing,
    *,
    quiet: bool,
    serve: bool,
    done: Callable[[Assembly], None] = lambda run: None,
) -> Assembly:
    """Assemble with a viewer that shows every waypoint; call ``done`` with the result before the page is waited on.

    A sequence other than the paper's is assembled first: all its ways are computed before anything moves, and if one is
    blocked there is another page to show. ``serve`` starts a server, unless ``--url`` names one. Raises
    click.UsageError for options that do not go together.
    """
    overlays = dict(overlay(clamp, text) for text in viewing.overlays)
    drawn = {"model": model, "clearance": viewing.clearance, "overlays": overlays}

    def assembled(*listeners: Callable[[Waypoint], None]) -> Assembly:
        with narrator(quiet) as narrate:

            def listen(waypoint: Waypoint) -> None:
                for listener in (*listeners, narrate.waypoint):
                    listener(waypoint)

            return assemble(clamp, model, on_waypoint=listen, progress=narrate.position, **settings)

    finished = None if as_published(parse_sequence(settings.get("sequence", clamp.sequence))) else assembled()
    with _viewer(clamp, viewing, serve, quiet, **drawn) as viewer:
        run = finished or assembled(viewer.show)
        viewer.finish(run)
        _save(viewer, viewing)
        done(run)
    return run


def view_blocked(error: SequenceError, viewing: Viewing, *, quiet: bool, serve: bool) -> None:
    """Show the step that a sequence cannot do: its parts, with the motion that is blocked."""
    check_and_view(error.scene, replace(viewing, overlays=()), quiet=quiet, serve=serve)


def check_and_view(scene: Scene, viewing: Viewing, *, quiet: bool, serve: bool) -> CheckResult:
    """Check a scene with a viewer that shows it. Raises click.UsageError for options that do not go together."""
    if viewing.overlays:
        raise click.UsageError("--overlay goes with a clamp, not with a scene")
    if click.get_current_context().get_parameter_source("clearance") is ParameterSource.COMMANDLINE:
        scene = replace(scene, clearance=viewing.clearance)
    with _viewer(scene, viewing, serve, quiet) as viewer:
        with bar(quiet) as report:
            result = check(scene, distances=len(scene.parts) <= MEASURED, progress=report)
        viewer.finish(result)
        _save(viewer, viewing)
    return result


@contextlib.contextmanager
def _viewer(shown: Clamp | Scene, viewing: Viewing, serve: bool, quiet: bool, **more: Any) -> Iterator[Viewer]:
    """A viewer as the options say; its page is served on when the work is done."""
    serve = serve and viewing.url is None
    if viewing.open_browser and not serve and viewing.url is None:
        raise click.UsageError("--open goes with a page that is served, not with --html alone")
    if viewing.url is not None and (viewing.port is not None or viewing.timeout is not None):
        raise click.UsageError("--port and --timeout go with a page served here, not with --url")
    place: dict[str, Any] = {"serve": serve, "url": viewing.url, "host": viewing.host, "port": viewing.port}
    with Viewer(shown, mesh_error=viewing.draw_error, **place, **more) as viewer:
        if viewer.url is not None:
            show(viewer.url)
            if viewing.open_browser:
                click.launch(viewer.url)
        yield viewer
        if serve:
            with contextlib.suppress(KeyboardInterrupt):  # the usual way to end; the result decides the exit code
                if viewing.timeout is None and not quiet:
                    click.echo("serving the page until Ctrl-C ...", err=True)
                viewer.wait(viewing.timeout)


def _save(viewer: Viewer, viewing: Viewing) -> None:
    if viewing.html_file is not None:
        viewer.save_html(viewing.html_file)
        if viewing.html_file != STDOUT:
            show(os.fspath(viewing.html_file))
