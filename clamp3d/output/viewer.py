"""The viewer: a clamp while it is assembled, an assembly, or a scene with its motions, in a browser or as one page.

>>> from clamp3d.clamp.assemble import assemble
>>> with view(assemble("reference"), serve=False) as viewer:  # with serve=True: open viewer.url in a browser
...     len(viewer.story["stops"])
9
"""

from __future__ import annotations

import base64
import itertools
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from clamp3d import __version__
from clamp3d.baselines.model import ContactModel
from clamp3d.checks import flag, instance, text
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.forces import HELD
from clamp3d.clamp.result import Assembly, Finding, Waypoint
from clamp3d.engine.check import check
from clamp3d.engine.distance import measure
from clamp3d.engine.model import ModelCache
from clamp3d.engine.result import CheckResult, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.errors import InputError
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import MeshShape
from clamp3d.output.files import write_text
from clamp3d.output.groups import grouped
from clamp3d.output.pages import render
from clamp3d.output.palette import FORCE, VERDICT_COLOURS
from clamp3d.output.scene_report import work_text
from clamp3d.output.serving import CommandLog, MeshcatServer, PageServer
from clamp3d.output.viewer_scene import ROOT, Command, Pieces, SceneDrawing, focus
from clamp3d.output.viewer_timeline import FIRST, UNCUT, ClampStory, Row, Stop, distance_curves, scene_stops
from clamp3d.output.wording import (
    circumstances,
    distance_text,
    group_sentence,
    headline,
    meaning,
    sentence,
    severity,
    titles,
    worst_first,
)
from clamp3d.scenefile.check import opened

CLEARANCE = 5.0
"""Gap in mm from which two parts of a clamp count as clear."""
_LISTED = 500
"""Rows of a table on the page; a result's JSON has all."""
_SEVERITY = {"error": "clash", "warning": "contact"}
"""The verdict whose colour a finding of an assembly has."""
MEASURED = 40
"""Scenes of up to so many parts are measured pair by pair, larger ones only as far as their verdicts need."""

Shown: TypeAlias = Clamp | Scene | Assembly | CheckResult


class Viewer:
    """Shows a clamp or a scene at ``url`` from the start; `show` adds a waypoint, `finish` the result.

    Parameters
    ----------
    shown : Clamp, Scene, Assembly or CheckResult
        What to draw. `view` also shows the result.
    model : ContactModel, optional
        How grooves are measured; by default exactly.
    mesh_error : float
        Chord error of the drawn facets, mm. What is measured is not measured on them.
    clearance : float, optional
        Gap that counts as clear, mm; by default the scene's own, and 5 mm for a clamp.
    overlays : dict, optional
        Convex pieces of parts to show as well, by a name: ``{name: {part: [trimesh.Trimesh, ...]}}``.
    serve : bool
        Serve the page on this machine (``host``, ``port``: the first free one from 7000); else it is only kept for
        `save_html`. No browser is opened, and none is waited for.
    url : str, optional
        A running meshcat server to show the scene on: its zmq_url.

    Raises
    ------
    InputError
        For a bad mesh error, clearance, address or port.
    """

    def __init__(
        self,
        shown: Shown,
        *,
        model: ContactModel | None = None,
        mesh_error: float = 0.01,
        clearance: float | None = None,
        overlays: Mapping[str, Pieces] | None = None,
        serve: bool = True,
        url: str | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        overlays = {} if overlays is None else overlays
        instance("overlays", overlays, Mapping)
        for name, pieces in overlays.items():
            instance(f"overlay {text('name of an overlay', name)}", pieces, Mapping)
        serve = flag("serve", serve)
        self._model, self._mesh_error = model, mesh_error
        clamp = shown if isinstance(shown, Clamp) else getattr(shown, "clamp", None)
        wide = CLEARANCE if clearance is None else clearance
        self._clamp = None if clamp is None else ClampStory(clamp, model, wide)
        self._scene = self._clamp.scene if self._clamp is not None else _scene(shown, clearance)
        self._cache, self._log = ModelCache(), CommandLog()
        self._waypoints: list[Waypoint] = []
        self._story: dict[str, Any] = {}
        self._panel = ""
        self._meshcat = None if url is None else MeshcatServer(text("url", url))
        self._server: PageServer | None = None
        self._drawing = SceneDrawing(
            self._scene,
            self._send,
            mesh_error=mesh_error,
            cut_y=0.0 if self._clamp is not None else _cut(self._scene),
            uncut=UNCUT if self._clamp is not None else (),
            anchors=None if self._clamp is None else self._clamp.anchors,
            overlays=overlays,
        )
        self._set_story("waiting for the first state", state="waiting")
        if url is None and serve:
            self._server = PageServer(self.html, host=host, port=port)

    @property
    def url(self) -> str | None:
        """Where to look with a browser; None if nothing is served."""
        server = self._meshcat or self._server
        return None if server is None else server.url

    @property
    def story(self) -> dict[str, Any]:
        """What the page shows, as data: stops with their rows (distances in mm), findings, parts."""
        return self._story

    def show(self, waypoint: Waypoint) -> None:
        """Show a waypoint of the clamp as it is reached: pass this as ``on_waypoint`` of `assemble`."""
        instance("waypoint", waypoint, Waypoint)
        if self._clamp is None:
            raise InputError("show() goes with the viewer of a clamp; a scene is shown by finish(check(scene))")
        self._waypoints.append(waypoint)
        self._drawing.show(self._clamp.stop(waypoint))
        self._drawing.dimension(len(self._waypoints) - 1, "splints", *self._clamp.opening(waypoint))
        self._set_story(f"{waypoint.step}: {waypoint.label}", state="running")

    def preview(self, result: CheckResult) -> None:
        """Show the findings at rest while depths and motions are still measured."""
        instance("result", result, CheckResult)
        findings = self._scene_findings(result)
        self._set_story(f"{headline(result)}; depths and motions follow", state="running", findings=findings)

    def finish(self, result: Assembly | CheckResult) -> None:
        """Show the result, and play the whole time line once."""
        shown = self._finish_assembly(result) if isinstance(result, Assembly) else self._finish_check(result)
        self._drawing.play()
        self._set_story(**shown, done=True)

    def html(self) -> str:
        """The scene with its animation as one HTML page that needs neither server nor network."""
        return render(
            "viewer.html",
            title=self._story["title"],
            panel=self._panel,
            done=self._story["done"],
            messages=[base64.b64encode(message).decode("ascii") for message in self._log.messages()],
            **_meshcat_script(),
        )

    def save_html(self, path: str | Path) -> None:
        """Write `html` to a file. Raises InputError if it cannot be written."""
        write_text(Path(path), self.html())

    def wait(self, timeout: float | None = None) -> None:
        """Keep serving for ``timeout`` s, or until interrupted."""
        threading.Event().wait(timeout)

    def close(self) -> None:
        """Stop serving the page; a meshcat server keeps the scene. A second call does nothing."""
        if self._server is not None:
            self._server.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _send(self, command: Command) -> None:
        self._log.add(command)
        if self._meshcat is not None:
            self._meshcat.send(command)

    def _finish_assembly(self, run: Assembly) -> dict[str, Any]:
        """What the page says of an assembly."""
        for waypoint in run.path[len(self._waypoints) :]:
            self.show(waypoint)
        forces = [force for force in run.forces if force.feature != HELD]
        self._drawing.forces(len(self._waypoints) - 1, forces)
        worst = {finding.severity for finding in run.findings}
        state = "found" if "error" in worst else "note" if "warning" in worst else "clean"
        grave = [finding for finding in run.findings if finding.severity != "note"]
        return {
            "text": run.status,
            "state": state,
            "assembly": run,
            "forces": forces,
            "findings": [self._assembly_finding(k, finding) for k, finding in enumerate(grave)],
            "notes": [finding.text for finding in run.findings if finding.severity == "note"],
        }

    def _finish_check(self, result: CheckResult) -> dict[str, Any]:
        """What the page says of a checked scene."""
        instance("result", result, CheckResult)
        for stop in scene_stops(result, self._rows):
            self._drawing.show(stop)
        return {
            "text": headline(result),
            "state": severity(result),
            "findings": self._scene_findings(result),
            "curves": list(distance_curves(result, self._drawing.timeline.stops, self._rows)),
            "pairs": worst_first(result.pairs)[:_LISTED],
            "motions": worst_first(result.motions)[:_LISTED],
            "notes": [*result.scene.notes, *work_text(result.work)],
        }

    def _rows(self, scene: Scene, pairs: Sequence[tuple[str, str]]) -> list[Row]:
        """Pairs of a scene as rows, by the engine that every command uses."""
        return [Row.of(scene, *pair, d) for pair, d in measure(scene, pairs, cache=self._cache).items()]

    def _assembly_finding(self, index: int, finding: Finding) -> dict[str, Any]:
        """A finding with the place to look at: where the pair that it names is at the end, else the whole clamp."""
        number = len(self._waypoints) - 1
        stop = self._drawing.timeline.stops[number]
        row = next((row for row in stop.rows if (row.a, row.b) == (finding.a, finding.b)), None)
        data = {"a": finding.a or "", "b": finding.b or "", "verdict": _SEVERITY[finding.severity]}
        data |= {"group": str(index), "title": finding.text, "text": finding.text, "detail": ""}
        return data | self._place(number, self._drawing.extent([stop.poses]) if row is None else focus(row.distance))

    def _scene_findings(self, result: CheckResult) -> list[dict[str, Any]]:
        """The findings of a check by groups, each with the stop and the place to look at."""
        names, stops = titles(result.scene), self._drawing.timeline.stops
        meetings = {k: self._drawing.mark_meeting(k) for k, stop in enumerate(stops) if stop.halts}
        findings: list[dict[str, Any]] = []
        for group in grouped(result):
            for row in group.rows[: max(0, _LISTED - len(findings))]:
                number = self._stop_of(row)
                data = {"a": row.a, "b": row.b, "motion": row.motion, "verdict": row.verdict.value, "group": group.id}
                data |= {"title": group_sentence(group, names), "text": sentence(row, names)}
                data["detail"] = circumstances(row)
                findings.append(data | self._place(number, meetings.get(number) or focus(row.distance)))
        return findings

    def _stop_of(self, row: PairResult) -> int:
        """The stop that shows a finding: of one in a motion its first contact, else the motion's end."""
        stops = self._drawing.timeline.stops
        of_motion = [k for k, stop in enumerate(stops) if row.motion and stop.step == row.motion]
        first = [k for k in of_motion if any((r.a, r.b, r.what) == (row.a, row.b, FIRST) for r in stops[k].rows)]
        return [*first, *of_motion[-1:], 0][0]

    def _place(self, stop: int, box: tuple[Array, Array]) -> dict[str, Any]:
        margin = 0.1 * self._drawing.size
        return {"stop": stop, "low": (box[0] - margin).tolist(), "high": (box[1] + margin).tolist()}

    def _set_story(self, text: str, *, state: str, done: bool = False, **more: Any) -> None:
        """Set what the page beside the picture shows; meshcat's own page takes no notice of it."""
        scene, drawing, clamp = self._scene, self._drawing, self._clamp
        accuracy = self._accuracy()
        drawing.caption(accuracy)
        self._story = {
            "title": scene.name if clamp is None else clamp.title,
            "headline": text,
            "done": done,
            "stops": [_stop_data(stop, *drawing.extent([stop.poses])) for stop in drawing.timeline.stops],
            "findings": more.get("findings", []),
            "curves": more.get("curves", []),
            "forces": [force.to_dict() for force in more.get("forces", ())],
            "nodes": {part.name: drawing.paths(part.name) for part in scene.parts},
            "overlays": [{"name": name, "path": f"{ROOT}/overlay {name}"} for name in drawing.overlays],
            "cut": drawing.cut,
            "cut_open": clamp is not None,
            "facets": self._mesh_error,
            "frame": drawing.frame() if drawing.timeline.stops else None,
        }
        used = {row["verdict"] for stop in self._story["stops"] for row in stop["rows"]}
        context = {
            "subtitle": "" if clamp is None else clamp.subtitle,
            "scene": scene,
            "state": state,
            "accuracy": accuracy,
            "parts": titles(scene),
            "part_colours": drawing.colours,
            "colours": VERDICT_COLOURS,
            "force_colour": FORCE,
            "force_length": drawing.force_length,
            "meanings": {name: meaning(name, scene) for name in VERDICT_COLOURS if name in used},
            "version": __version__,
            "gap": distance_text,
            "degrees": math.degrees,
        }
        numbered = enumerate(self._story["findings"])
        context["groups"] = [list(members) for _, members in itertools.groupby(numbered, lambda pair: pair[1]["group"])]
        missing = {"assembly": None, "forces": (), "pairs": (), "motions": (), "notes": ()}
        self._panel = render("viewer.panel.html", **(self._story | missing | context | more))
        drawing.property(ROOT, "story", self._story | {"panel": self._panel})

    def _accuracy(self) -> str:
        """How exact the picture and its numbers are."""
        if any(isinstance(part.shape, MeshShape) for part in self._scene.parts):
            return (
                f"Files are drawn with their own facets, other parts within {self._mesh_error:g} mm of their faces. "
                "How each distance was measured stands beside it."
            )
        measured = "exactly" if self._model is None or self._model.name == "cas" else f"by {self._model.name}"
        return f"Drawn with facets within {self._mesh_error:g} mm; measured {measured}, not on the facets."


def view(shown: Any, *, serve: bool = True, **options: Any) -> Viewer:
    """Show a scene, checked, with its motions, or an assembly, in a browser or as a page.

    Parameters
    ----------
    shown
        A result of `check` or `assemble`, or what `check` takes: a scene is checked first, a clamp assembled.
    serve : bool
        Serve the page at ``viewer.url`` until ``viewer.close()``.
    **options
        As for `Viewer`.

    Returns
    -------
    Viewer
        With the whole story in it: ``.url``, ``.save_html(path)``.

    Raises
    ------
    InputError
        For what cannot be read, and as `Viewer`.

    Examples
    --------
    >>> from clamp3d.geometry import shapes
    >>> scene = Scene(name="two balls").add("a", shapes.cylinder(5.0, 10.0)).add("b", shapes.cylinder(4.0, 10.0))
    >>> with view(scene, serve=False) as viewer:
    ...     viewer.story["findings"][0]["verdict"]
    'contained'
    """
    if not isinstance(shown, CheckResult):
        shown = opened(shown)
    if isinstance(shown, Scene):
        scene = _scene(shown, options.pop("clearance", None))
        shown = check(scene, distances=len(scene.parts) <= MEASURED)
    if isinstance(shown, Assembly):
        options.setdefault("model", shown.model)
    viewer = Viewer(shown, serve=serve, **options)
    try:
        viewer.finish(shown)
    except BaseException:
        viewer.close()
        raise
    return viewer


def check_to_html(result: CheckResult) -> str:
    """The result as one page in 3D that needs no other file and no network."""
    with view(result, serve=False) as viewer:
        return viewer.html()


def _scene(shown: Any, clearance: float | None) -> Scene:
    scene: Scene = shown.scene if isinstance(shown, CheckResult) else shown
    instance("shown", scene, Scene)
    return scene if clearance is None else replace(scene, clearance=clearance)


def _cut(scene: Scene) -> float | None:
    """The height on Y of the plane that a scene is cut at: through the middle of its parts' origins."""
    ys = [float(part.T_world[1, 3]) for part in scene.parts]
    return 0.5 * (min(ys) + max(ys)) if ys else None


def _stop_data(stop: Stop, low: Array, high: Array) -> dict[str, Any]:
    keys = ("arrive", "leave", "step", "label", "mark", "halts")
    rows = [row.data() for row in stop.rows[:_LISTED]]
    return {key: getattr(stop, key) for key in keys} | {"low": low.tolist(), "high": high.tolist(), "rows": rows}


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
