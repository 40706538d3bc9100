"""The viewer: a run streamed to meshcat while it goes on, and kept as one page.

>>> from clamp3d.clamp.assemble import assemble
>>> from clamp3d.clamp.loader import load_clamp
>>> from clamp3d.baselines.cas import Cas
>>> clamp, model = load_clamp(), Cas()
>>> with Viewer(clamp, model) as viewer:  # open viewer.url in a browser, if you like
...     viewer.finish(assemble(clamp, model, on_waypoint=viewer.show))
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from clamp3d.baselines.model import ContactModel, check_model
from clamp3d.checks import flag, instance, text
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.clamp.verdict import CLEARANCE
from clamp3d.output.viewer_log import Command, CommandLog
from clamp3d.output.viewer_page import write_page
from clamp3d.output.viewer_scene import AssemblyScene, Overlay
from clamp3d.output.viewer_server import LocalServer, RemoteServer


class Viewer:
    """Shows a clamp at ``url`` from the start; `show` takes each waypoint of its run, `finish` the run.

    By default a server is started on this machine (``host``, ``port``: the first free one from 7000); ``url`` names
    a running meshcat server instead (its zmq_url); with ``serve=False`` nothing is served and the scene is only kept
    for `write`. ``mesh_error`` mm is the chord error of the drawn facets, ``clearance`` mm the gap that counts as
    clear, ``overlays`` convex pieces of parts by a name. No browser is opened and none is waited for.
    Raises InputError for a bad mesh error, clearance, address or port.
    """

    def __init__(
        self,
        clamp: Clamp,
        model: ContactModel,
        *,
        mesh_error: float = 0.01,
        clearance: float = CLEARANCE,
        overlays: Mapping[str, Overlay] | None = None,
        serve: bool = True,
        url: str | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        instance("clamp", clamp, Clamp)
        check_model(model)
        serve = flag("serve", serve)
        if overlays is not None:
            instance("overlays", overlays, Mapping)
            for name, overlay in overlays.items():
                instance(f"overlay {text('name of an overlay', name)}", overlay, Mapping)
        if url is not None:
            text("url", url)
        self._log = CommandLog()
        self._title = f"{clamp.name} clamp"
        self._server: LocalServer | RemoteServer | None = None
        if url is not None:
            self._server = RemoteServer(url)
        elif serve:
            self._server = LocalServer(host=host, port=port)
        try:
            self._scene = AssemblyScene(
                clamp, model, self._send, mesh_error=mesh_error, clearance=clearance, overlays=overlays
            )
        except BaseException:
            self.close()
            raise

    @property
    def url(self) -> str | None:
        """Where to look with a browser; None if nothing is served."""
        return None if self._server is None else self._server.url

    def show(self, waypoint: Waypoint) -> None:
        """Show a waypoint as it is reached: pass this as ``on_waypoint`` of `assemble`."""
        self._scene.show(waypoint)

    def finish(self, run: Assembly) -> None:
        """Show the result, and play the whole run once as an animation."""
        self._scene.finish(run)

    def write(self, path: str | Path) -> None:
        """Write the scene with its animation as one HTML page. Raises InputError if the file cannot be written."""
        write_page(Path(path), self._log, self._title)

    def wait(self, timeout: float | None = None) -> None:
        """Keep serving for ``timeout`` s, or until interrupted."""
        end = None if timeout is None else time.monotonic() + timeout
        while end is None or time.monotonic() < end:
            time.sleep(0.2 if end is None else min(0.2, max(0.0, end - time.monotonic())))

    def close(self) -> None:
        """End our own server; a foreign one keeps the scene. A second call does nothing."""
        if self._server is not None:
            self._server.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _send(self, command: Command) -> None:
        self._log.add(command)
        if self._server is not None:
            self._server.send(command)
