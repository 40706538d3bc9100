"""``clamp3d view``, and the page beside the work that ``clamp3d run --view`` shows too."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from clamp3d.baselines import contact_model
from clamp3d.clamp.dimensions import Clamp
from clamp3d.cli.options import CLEARANCE, Method, Quiet, Source, command, option
from clamp3d.cli.terminal import bar, finish, save, show
from clamp3d.engine.check import check
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError, SequenceError
from clamp3d.output.files import STDOUT
from clamp3d.output.groups import accepted_file, grouped, read_accepted

if TYPE_CHECKING:
    import trimesh

    from clamp3d.baselines.model import ContactModel
    from clamp3d.clamp.result import Assembly
    from clamp3d.engine.result import CheckResult
    from clamp3d.output.viewer import Viewer
    from clamp3d.output.viewer_story import ClampStory

_OVERLAYS = {
    "wedges": ("UNIT_ANGLE_DEG", 10.0, "wedges of {:g} deg"),
    "hulls": ("THRESHOLD_MM", 2.0, "hulls of CoACD at {:g} mm"),
}
"""Of each baseline that can be drawn: its setting, the default of that, and a title."""


class Viewing(Quiet):
    """What a viewer is to show, and where."""

    html_file: Path | None = option("Write one page with the whole animation.", "--html")
    url: str | None = option("Use a running meshcat server: the zmq_url that it printed.", metavar="ZMQ_URL")
    host: str = option("Address to serve on; 0.0.0.0 for all.", default="127.0.0.1")
    port: int | None = option("Port to serve on.  [default: first free from 7000]", type=click.IntRange(0, 65535))
    timeout: float | None = option("Stop serving after S seconds.", type=click.FloatRange(min=0.0), metavar="S")
    open_browser: bool = option("Open the page in a browser.", "--open")
    overlays: tuple[str, ...] = option(
        "Also draw a baseline's approximation of the parts: wedges (unit angle in deg) or hulls (CoACD's threshold "
        "in mm). May be given more than once.",
        "--overlay",
        multiple=True,
        metavar="NAME[=SIZE]",
    )
    draw_error: float = option("Chord error of drawn facets.", default=0.01, metavar="MM")
    clearance: float | None = CLEARANCE

    def tell(self, run: Assembly) -> None:
        """Say the result of an assembly before its page is waited on: nothing where the page is all that was asked."""

    def view_assembly(self, clamp: Clamp, model: ContactModel, settings: dict[str, Any], *, serve: bool) -> Assembly:
        """Assemble on the page, waypoint by waypoint.

        A sequence other than the paper's is assembled first: all its ways are computed before anything moves, and if
        one is blocked there is another page to show.
        """
        from clamp3d.clamp.sequence import as_published, parse_sequence
        from clamp3d.output.viewer_story import ClampStory  # meshcat, for a page alone

        finished = None
        if not as_published(parse_sequence(settings["sequence"] or clamp.sequence)):
            finished = self.assemble(clamp, model, settings)
        overlays = dict(overlay(clamp, text) for text in self.overlays)
        with self._viewer(ClampStory(clamp, model, self.clearance), serve, overlays) as viewer:
            run = finished or self.assemble(clamp, model, settings, viewer.show)
            viewer.finish(run)
            self._save(viewer)
            self.tell(run)
        return run

    def view_scene(self, scene: Scene, *, serve: bool) -> CheckResult:
        """Check a scene on the page, where somebody may be looking: each verdict goes there as it comes."""
        if self.clearance is not None:
            scene = replace(scene, clearance=self.clearance)
        with self._viewer(scene, serve) as viewer:
            with bar(self.quiet) as report:
                result = check(scene, progress=report, on_row=viewer.show_row if viewer.url is not None else None)
            viewer.finish(result)
            self._save(viewer)
        return result

    @contextlib.contextmanager
    def _viewer(
        self, shown: ClampStory | Scene, serve: bool, overlays: dict[str, Any] | None = None
    ) -> Iterator[Viewer]:
        """A viewer as the options say; its page is served on when the work is done."""
        from clamp3d.output.serving import PageServer, server_at
        from clamp3d.output.viewer import Viewer

        if self.url is not None and (self.port is not None or self.timeout is not None):
            raise click.UsageError("--port and --timeout go with a page served here, not with --url")
        is_served = serve or self.url is not None
        if self.open_browser and not is_served:
            raise click.UsageError("--open goes with a page that is served, not with --html alone")
        server = server_at(self.url, self.host, self.port) if is_served else None
        with Viewer(shown, server, mesh_error=self.draw_error, overlays=overlays) as viewer:
            if server is not None:
                show(server.url)
                if self.open_browser:
                    click.launch(server.url)
            yield viewer
            if isinstance(server, PageServer):
                with contextlib.suppress(KeyboardInterrupt):  # the usual way to end; the result decides the exit code
                    if self.timeout is None and not self.quiet:
                        click.echo("serving the page until Ctrl-C ...", err=True)
                    threading.Event().wait(self.timeout)

    def _save(self, viewer: Viewer) -> None:
        save(self.html_file, viewer.html)
        if self.html_file not in (None, STDOUT):
            show(str(self.html_file))


def overlay(clamp: Clamp, text: str) -> tuple[str, dict[str, list[trimesh.Trimesh]]]:
    """Title and pieces of an overlay: ``wedges`` or ``wedges=UNIT_ANGLE_DEG``, ``hulls`` or ``hulls=THRESHOLD_MM``.

    Raises InputError for anything else.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> title, pieces = overlay(load_clamp(), "wedges=20")
    >>> title, {name: len(p) for name, p in pieces.items()}["P3"]
    ('wedges of 20 deg', 3)
    """
    import trimesh

    from clamp3d.clamp.parts import groove_pairs, parts

    kind, _, size = text.partition("=")
    if kind not in _OVERLAYS:
        available = ", ".join(f"{name}[={unit}]" for name, (unit, *_) in _OVERLAYS.items())
        raise InputError(f"unknown overlay {text!r}; available: {available}")
    unit, value, title = _OVERLAYS[kind]
    try:
        value = float(size) if size else value
    except ValueError:
        raise InputError(f"overlay {kind}: {unit} must be a number, got {size!r}") from None
    setting: dict[str, Any] = {"unit_angle": math.radians(value)} if kind == "wedges" else {"threshold": value}
    model: Any = contact_model(kind, parts(clamp), **setting)
    solids = {a: [shape.solid for shape in model.polytopes(a).shapes] for a, _ in groove_pairs(clamp)}
    return title.format(value), {a: [trimesh.Trimesh(s.vertices, s.faces) for s in own] for a, own in solids.items()}


@command("view")
class View(Source, Method, Viewing):
    """Show INPUT in a browser: the assembly of a clamp as an animation, or a scene with its findings and motions.

    INPUT is a clamp (a built-in name or a TOML file), a scene file, or a file with parts. Prints the page's address
    and serves it until Ctrl-C (or --timeout). With --html the page is written to a file instead; with --url the scene
    goes to a meshcat server, which keeps it. Exit codes are those of check; 1 also if a clamp does not close as it
    should, or a step of the sequence is blocked: then it is shown how.
    """

    def run(self) -> None:
        """Assemble or check on the page."""
        settings, loaded = self.settings(equilibria=False), self.load()
        serve = self.html_file is None
        if not isinstance(loaded, Clamp):
            self.refuse_method()
            if self.overlays:
                raise click.UsageError("--overlay goes with a clamp, not with a scene")
            accepted = read_accepted(accepted_file(self.source))  # before the work, for it may be unreadable
            groups = grouped(self.view_scene(loaded, serve=serve))
            finish(verdicts={group.verdict for group in groups if group.id not in accepted})
            return
        try:
            run = self.view_assembly(loaded, self.model(loaded), settings, serve=serve)
        except SequenceError as error:
            show(f"not assembled: {error}")
            self.view_scene(error.scene, serve=serve)
            finish(True)
        finish(not run.passed)
