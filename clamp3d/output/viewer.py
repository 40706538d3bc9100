"""The viewer: a clamp while it is assembled, an assembly, or a scene with its motions, in a browser or as one page.

>>> from clamp3d.clamp.assemble import assemble
>>> with view(assemble("reference"), serve=False) as viewer:  # with serve=True: open viewer.url in a browser
...     len(viewer.story["stops"])
9
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from clamp3d.checks import instance, number
from clamp3d.clamp.plain import plain
from clamp3d.clamp.result import HELD_ON_AXIS, Assembly, Waypoint
from clamp3d.engine.check import check
from clamp3d.engine.result import BAD, CheckResult, PairResult, Work
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.geometry.profile import check_mesh_error
from clamp3d.output.files import write_text
from clamp3d.output.pages import render
from clamp3d.output.palette import FORCE, VERDICT_COLOURS
from clamp3d.output.scene_report import work_text
from clamp3d.output.serving import CommandLog, MeshcatServer, PageServer, server_at
from clamp3d.output.viewer_scene import Pieces, SceneDrawing
from clamp3d.output.viewer_story import LISTED, ClampStory, Stop, Story, findings_of, findings_of_clamp
from clamp3d.output.wording import by_group, headline, meanings, severity, titles
from clamp3d.scenefile.check import opened

_CURVES = 4
"""Findings in motions whose distance curves a saved page holds; a served page asks for any."""
_UNCUT = ("P4", "P5")
"""Bolts and nuts are not cut lengthwise in drawings (ISO 128)."""
_PAUSE = 0.5
"""Seconds between two looks at a check that is running."""


class Viewer(AbstractContextManager["Viewer"]):
    """Shows a clamp or a scene from the start; `show` adds a waypoint, `show_row` a verdict, `finish` the result.

    Parameters
    ----------
    shown : Scene or ClampStory
        What to draw.
    server : PageServer or MeshcatServer, optional
        Where; without, the page is only kept for `save_html`. No browser is opened, and none is waited for.
    mesh_error : float
        Chord error of the drawn facets, mm. What is measured is not measured on them.
    overlays : dict, optional
        Convex pieces of parts to show as well, by a name: ``{name: {part: [trimesh.Trimesh, ...]}}``.

    Raises
    ------
    InputError
        For a bad mesh error.
    """

    def __init__(
        self,
        shown: Scene | ClampStory,
        server: PageServer | MeshcatServer | None = None,
        *,
        mesh_error: float = 0.01,
        overlays: Mapping[str, Pieces] | None = None,
    ) -> None:
        check_mesh_error(mesh_error)  # also where nothing is round
        self._source = shown if isinstance(shown, ClampStory) else Story(shown)
        self._server = server
        self._log = CommandLog(server if isinstance(server, MeshcatServer) else None)
        self._mesh_error, self._overlays = mesh_error, overlays or {}
        self._rows: dict[tuple[str, str], PairResult] = {}
        self._looked = -math.inf
        self._drawing = SceneDrawing(self._source, self._log, mesh_error, self._overlays)
        self.story: dict[str, Any] = {}
        """What the page shows, as data: stops with their rows (distances in mm), findings, parts; the panel as HTML."""
        self._tell(self._source.waiting, "waiting")
        if isinstance(server, PageServer):
            server.start(lambda: self._page([]), self._log, self.answer)

    @property
    def url(self) -> str | None:
        """Where to look with a browser; None if nothing is served."""
        return None if self._server is None else self._server.url

    def show(self, waypoint: Waypoint) -> None:
        """Show a waypoint of the clamp as it is reached: pass this as ``on_waypoint`` of `assemble`."""
        instance("waypoint", waypoint, Waypoint)
        if not isinstance(self._source, ClampStory):
            raise InputError("show() goes with the viewer of a clamp; a scene is shown by finish(check(scene))")
        self._drawing.show(self._source.stop(waypoint))
        self._tell(f"{waypoint.step}: {waypoint.label}", "running")

    def show_row(self, row: PairResult) -> None:
        """Show a verdict at rest as it comes: pass this as ``on_row`` of `check`."""
        self._rows[row.a, row.b] = row
        if time.monotonic() > self._looked + _PAUSE and any(row.verdict in BAD for row in self._rows.values()):
            work = Work(0, 0, len(self._rows), 0, 0, 0, 0, 0, {}, {}, {})
            so_far = CheckResult(self._source.scene, tuple(self._rows.values()), (), None, work)
            findings = findings_of(so_far, self._drawing.timeline, brief=True)
            self._tell(f"So far: {headline(so_far)}; the check is running", "running", findings)
            self._looked = time.monotonic()

    def finish(self, result: Assembly | CheckResult) -> None:
        """Show the result, and play the whole time line once."""
        instance("result", result, Assembly, CheckResult)
        drawing = self._drawing
        if isinstance(result, Assembly):
            for waypoint in result.path[len(drawing.timeline.stops) :]:
                self.show(waypoint)
            forces = [force for force in result.forces if force.feature != HELD_ON_AXIS]
            drawing.forces(forces)
            drawing.play(self._accuracy)
            worst = {finding.severity for finding in result.findings}
            state = "found" if "error" in worst else "note" if "warning" in worst else "clean"
            notes = [finding.text for finding in result.findings if finding.severity == "note"]
            findings = findings_of_clamp(result, drawing.timeline, drawing.extent(drawing.timeline.stops[-1].poses))
            words = {"assembly": result, "forces": [plain(force) for force in forces], "notes": notes}
            self._tell(result.status, state, findings, done=True, **words)
        else:
            for stop in self._source.stops(result):
                drawing.show(stop)
            drawing.play(self._accuracy)
            pairs, motions = (by_group(result, rows)[:LISTED] for rows in (result.pairs, result.motions))
            notes = [*result.scene.notes, *work_text(result.work)]
            findings = findings_of(result, drawing.timeline)
            words = {"pairs": pairs, "motions": motions, "notes": notes}
            self._tell(headline(result), severity(result), findings, done=True, **words)

    def answer(self, query: Mapping[str, str]) -> dict[str, Any]:
        """How pairs stand at a moment of the time line, as the page asks: ``time`` in s; the pair ``a``, ``b``, or all.

        Raises InputError for what is no time or no part.
        """
        if not self.story["done"]:
            raise InputError("the check is still running")
        try:
            seconds = number("time", float(query["time"]))
        except (KeyError, ValueError):
            raise InputError(f"time must be a number of seconds, got {query.get('time')!r}") from None
        stop, poses = self._drawing.timeline.at(seconds)
        pairs = [(query["a"], query.get("b", ""))] if "a" in query else stop.pairs
        return {"rows": [row.data() for row in self._source.measure(poses, pairs)]}

    def html(self) -> str:
        """The scene with its animation as one HTML page that needs neither server nor network."""
        moving = [(k, finding) for k, finding in enumerate(self.story["findings"]) if finding["moments"]]
        for k, finding in moving[:_CURVES]:
            pair = {"a": finding["a"], "b": finding["b"]}
            rows = [self.answer(pair | {"time": str(s)})["rows"][0] for s in finding["moments"]]
            self.story["curves"][str(k)] = [[row["at_least_mm"], row["at_most_mm"]] for row in rows]
        self._keep_story()
        return self._page(self._log.messages())

    def _page(self, messages: list[str]) -> str:
        return render("viewer.html", **self.story, messages=messages, **_meshcat_script())

    def save_html(self, path: str | Path) -> None:
        """Write `html` to a file. Raises InputError if it cannot be written."""
        write_text(Path(path), self.html())

    def close(self) -> None:
        """Stop serving the page; a meshcat server keeps the scene. A second call does nothing."""
        if isinstance(self._server, PageServer):
            self._server.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _keep_story(self) -> None:
        self._log.add({"type": "set_story", "path": "", "value": self.story})

    @property
    def _accuracy(self) -> str:
        """How exact the picture and its numbers are."""
        facets = f"Drawn with facets within {self._mesh_error:g} mm, those of files as they are."
        return f"{facets} {self._source.accuracy}"

    def _tell(
        self, text: str, state: str, findings: Iterable[dict[str, Any]] = (), *, done: bool = False, **more: Any
    ) -> None:
        """Set what the page beside the picture shows; ``more`` is for its panel only."""
        source, drawing = self._source, self._drawing
        stops = [_stop_data(stop, drawing) for stop in drawing.timeline.stops]
        story: dict[str, Any] = {
            "title": source.title,
            "headline": text,
            "done": done,
            "stops": stops,
            "findings": [drawing.with_margin(finding) for finding in itertools.islice(findings, LISTED)],
            "curves": {},
            "forces": more.get("forces", []),
            "paths": drawing.paths,
            "overlays": list(self._overlays),
            "uncut": None if source.anchors is None else _UNCUT,
            "facets": self._mesh_error,
            "frame": drawing.framed(),
        }
        numbered = enumerate(story["findings"])
        used = {row["verdict"] for stop in stops for row in stop["rows"]}
        words = meanings(source.scene)
        context = {
            **{"assembly": None, "pairs": (), "motions": (), "notes": ()},
            "source": source,
            "drawing": drawing,
            "state": state,
            "accuracy": self._accuracy,
            "parts": titles(source.scene),
            "force_colour": FORCE,
            "meanings": {name: words[name] for name in VERDICT_COLOURS if name in used},
            "groups": [list(members) for _, members in itertools.groupby(numbered, lambda pair: pair[1]["group"])],
        }
        self.story = story | {"panel": render("viewer.panel.html", **(story | context | more))}
        self._keep_story()


def view(
    shown: Any,
    *,
    serve: bool = True,
    url: str | None = None,
    host: str = "127.0.0.1",
    port: int | None = None,
    mesh_error: float = 0.01,
    overlays: Mapping[str, Pieces] | None = None,
) -> Viewer:
    """Show a scene, checked, with its motions, or an assembly, in a browser or as a page.

    Parameters
    ----------
    shown
        A result of `check` or `assemble`, or what `check` takes: a scene is checked first, a clamp assembled.
    serve : bool
        Serve the page at ``viewer.url`` until ``viewer.close()``.
    url : str, optional
        A running meshcat server to show the scene on: its zmq_url.
    host, port
        Where to serve: on this machine, on the first free port from 7000 on.
    mesh_error, overlays
        As for `Viewer`.

    Returns
    -------
    Viewer
        With the whole story in it: ``.url``, ``.save_html(path)``.

    Raises
    ------
    InputError
        For what cannot be read, a bad mesh error, address or port.

    Examples
    --------
    >>> from clamp3d.geometry import shapes
    >>> scene = Scene(name="two balls").add("a", shapes.cylinder(5.0, 10.0)).add("b", shapes.cylinder(4.0, 10.0))
    >>> with view(scene, serve=False) as viewer:
    ...     viewer.story["findings"][0]["verdict"]
    'contained'
    """
    result = shown if isinstance(shown, CheckResult) else opened(shown)
    if isinstance(result, Scene):
        result = check(result)
    source = ClampStory(result.clamp, result.model) if isinstance(result, Assembly) else result.scene
    server = server_at(url, host, port) if serve or url is not None else None
    try:
        viewer = Viewer(source, server, mesh_error=mesh_error, overlays=overlays)
        viewer.finish(result)
    except BaseException:
        if isinstance(server, PageServer):
            server.close()
        raise
    return viewer


def check_to_html(result: CheckResult) -> str:
    """The result as one page in 3D that needs no other file and no network."""
    return view(result, serve=False).html()


def _stop_data(stop: Stop, drawing: SceneDrawing) -> dict[str, Any]:
    low, high = drawing.extent(stop.poses)
    data = {key: getattr(stop, key) for key in ("arrive", "leave", "step", "label", "mark", "halts", "t")}
    rows = [row.data() for row in stop.rows[:LISTED]]
    return data | {"low": low.tolist(), "high": high.tolist(), "rows": rows}


def _meshcat_script() -> dict[str, str]:
    """Meshcat's viewer (with three.js) and its licence, for the page."""
    import meshcat

    folder = Path(meshcat.__file__).parent / "viewer" / "dist"
    script = (folder / "main.min.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    notices = folder / "main.min.js.LICENSE.txt"
    return {
        "meshcat": script,
        "licence": notices.read_text(encoding="utf-8").replace("--", "- -") if notices.exists() else "",
    }
