"""A run with a viewer beside it, for ``clamp3d view`` and ``clamp3d run --view``."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.cli.progress import narrator
from clamp3d.errors import InputError
from clamp3d.output.files import check_folder
from clamp3d.output.viewer import Viewer
from clamp3d.output.viewer_overlay import overlay


def run_and_view(
    clamp: Clamp,
    model: ContactModel,
    settings: dict[str, Any],
    *,
    quiet: bool,
    serve: bool,
    html_file: Path | None,
    url: str | None,
    host: str,
    port: int | None,
    timeout: float | None,
    open_browser: bool,
    overlays: tuple[str, ...],
    draw_error: float,
    clearance: float,
    done: Callable[[Assembly], None] = lambda run: None,
) -> Assembly:
    """Assemble with a viewer that shows every waypoint; call ``done`` with the result before the page is waited on.

    ``serve`` starts a server, unless ``url`` names one. Raises click.UsageError for options that do not go together.
    """
    serve = serve and url is None
    if html_file is not None:
        if not html_file.absolute().parent.is_dir():
            raise InputError(f"cannot write {html_file}: there is no folder {html_file.parent}")
        check_folder(html_file.absolute().parent)
    if open_browser and not serve and url is None:
        raise click.UsageError("--open goes with a page that is served, not with --html alone")
    if url is not None and (port is not None or timeout is not None):
        raise click.UsageError("--port and --timeout go with a page served here, not with --url")

    with Viewer(
        clamp,
        model,
        mesh_error=draw_error,
        clearance=clearance,
        overlays=dict(overlay(clamp, text) for text in overlays),
        serve=serve,
        url=url,
        host=host,
        port=port,
    ) as viewer:
        if viewer.url is not None:
            click.echo(viewer.url)
            if open_browser:
                click.launch(viewer.url)

        with narrator(quiet) as tell:

            def listen(waypoint: Waypoint) -> None:
                viewer.show(waypoint)
                tell.waypoint(waypoint)

            run = assemble(clamp, model, on_waypoint=listen, progress=tell.position, **settings)
        viewer.finish(run)
        if html_file is not None:
            viewer.write(html_file)
            click.echo(os.fspath(html_file))
        done(run)
        if serve:
            with contextlib.suppress(KeyboardInterrupt):  # the usual way to end; what was found decides the exit code
                if timeout is None and not quiet:
                    click.echo("serving the page until Ctrl-C ...", err=True)
                viewer.wait(timeout)
    return run
