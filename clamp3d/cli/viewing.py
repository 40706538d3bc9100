"""A viewer beside the work, for ``clamp3d view`` and ``clamp3d run --view``."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import click

from clamp3d.baselines.model import ContactModel
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly
from clamp3d.clamp.sequence import as_published, parse_sequence
from clamp3d.cli.options import Viewing
from clamp3d.cli.terminal import bar, narrated, show
from clamp3d.engine.check import check
from clamp3d.engine.result import CheckResult
from clamp3d.engine.scene import Scene
from clamp3d.output.files import STDOUT
from clamp3d.output.serving import MeshcatServer, PageServer
from clamp3d.output.viewer import Viewer
from clamp3d.output.viewer_overlay import overlay
from clamp3d.output.viewer_story import ClampStory


@dataclass(frozen=True)
class Page:
    """A viewer beside the work; ``serve`` starts a server, unless ``--url`` names one."""

    viewing: Viewing
    serve: bool

    def assemble(
        self,
        clamp: Clamp,
        model: ContactModel,
        settings: dict[str, Any],
        done: Callable[[Assembly], None] = lambda run: None,
    ) -> Assembly:
        """Assemble on the page, waypoint by waypoint; call ``done`` with the result before the page is waited on.

        A sequence other than the paper's is assembled first: all its ways are computed before anything moves, and if
        one is blocked there is another page to show.
        """
        finished = None
        if not as_published(parse_sequence(settings.get("sequence", clamp.sequence))):
            finished = narrated(clamp, model, settings, self.viewing.quiet)
        overlays = dict(overlay(clamp, text) for text in self.viewing.overlays)
        with self._viewer(ClampStory(clamp, model, self.viewing.clearance), overlays) as viewer:
            run = finished or narrated(clamp, model, settings, self.viewing.quiet, viewer.show)
            viewer.finish(run)
            self._save(viewer)
            done(run)
        return run

    def check(self, scene: Scene) -> CheckResult:
        """Check a scene on the page, where somebody may be looking: each verdict goes there as it comes."""
        if self.viewing.clearance is not None:
            scene = replace(scene, clearance=self.viewing.clearance)
        with self._viewer(scene) as viewer:
            with bar(self.viewing.quiet) as report:
                result = check(scene, progress=report, on_row=viewer.show_row if viewer.url is not None else None)
            viewer.finish(result)
            self._save(viewer)
        return result

    @contextlib.contextmanager
    def _viewer(self, shown: ClampStory | Scene, overlays: dict[str, Any] | None = None) -> Iterator[Viewer]:
        """A viewer as the options say; its page is served on when the work is done."""
        viewing = self.viewing
        serve = self.serve and viewing.url is None
        if viewing.open_browser and not serve and viewing.url is None:
            raise click.UsageError("--open goes with a page that is served, not with --html alone")
        if viewing.url is not None and (viewing.port is not None or viewing.timeout is not None):
            raise click.UsageError("--port and --timeout go with a page served here, not with --url")
        server: PageServer | MeshcatServer | None = None
        if viewing.url is not None:
            server = MeshcatServer(viewing.url)
        elif serve:
            server = PageServer(viewing.host, viewing.port)
        with Viewer(shown, server, mesh_error=viewing.draw_error, overlays=overlays) as viewer:
            if server is not None:
                show(server.url)
                if viewing.open_browser:
                    click.launch(server.url)
            yield viewer
            if serve:
                with contextlib.suppress(KeyboardInterrupt):  # the usual way to end; the result decides the exit code
                    if viewing.timeout is None and not self.viewing.quiet:
                        click.echo("serving the page until Ctrl-C ...", err=True)
                    threading.Event().wait(viewing.timeout)

    def _save(self, viewer: Viewer) -> None:
        path = self.viewing.html_file
        if path is not None:
            viewer.save_html(path)
            if path != STDOUT:
                show(os.fspath(path))
