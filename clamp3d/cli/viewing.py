"""A run with a viewer beside it, for ``clamp3d view`` and ``clamp3d run --view``."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from typing import Any

import click

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.cli.options import Viewing
from clamp3d.cli.progress import narrator
from clamp3d.cli.terminal import show
from clamp3d.output.viewer import Viewer
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

    ``serve`` starts a server, unless ``--url`` names one. Raises click.UsageError for options that do not go together.
    """
    serve = serve and viewing.url is None
    if viewing.open_browser and not serve and viewing.url is None:
        raise click.UsageError("--open goes with a page that is served, not with --html alone")
    if viewing.url is not None and (viewing.port is not None or viewing.timeout is not None):
        raise click.UsageError("--port and --timeout go with a page served here, not with --url")

    with Viewer(
        clamp,
        model,
        mesh_error=viewing.draw_error,
        clearance=viewing.clearance,
        overlays=dict(overlay(clamp, text) for text in viewing.overlays),
        serve=serve,
        url=viewing.url,
        host=viewing.host,
        port=viewing.port,
    ) as viewer:
        if viewer.url is not None:
            show(viewer.url)
            if viewing.open_browser:
                click.launch(viewer.url)

        with narrator(quiet) as tell:

            def listen(waypoint: Waypoint) -> None:
                viewer.show(waypoint)
                tell.waypoint(waypoint)

            run = assemble(clamp, model, on_waypoint=listen, progress=tell.position, **settings)
        viewer.finish(run)
        if viewing.html_file is not None:
            viewer.write(viewing.html_file)
            show(os.fspath(viewing.html_file))
        done(run)
        if serve:
            with contextlib.suppress(KeyboardInterrupt):  # the usual way to end; what was found decides the exit code
                if viewing.timeout is None and not quiet:
                    click.echo("serving the page until Ctrl-C ...", err=True)
                viewer.wait(viewing.timeout)
    return run
