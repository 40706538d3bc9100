"""A clamp and its run as a meshcat scene: parts, grooves by verdict, contacts, gaps, labels, and the animation.

The tree, all of it in mm under ``/clamp3d``: ``whole`` and ``cutaway`` hold the parts (one of the two is seen),
``contacts`` and ``gaps`` a group for each waypoint, ``labels`` the names, ``overlay ...`` convex pieces of a baseline.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from clamp3d.baselines.model import ContactModel
from clamp3d.checks import number
from clamp3d.clamp.contacts import CONTACT, measure_pairs
from clamp3d.clamp.dimensions import PARTS, TITLES, Clamp, PartName
from clamp3d.clamp.parts import parts
from clamp3d.clamp.result import Assembly, Contact, Waypoint
from clamp3d.clamp.section import Section
from clamp3d.clamp.verdict import CLEARANCE, verdict
from clamp3d.core.meshing import mesh
from clamp3d.core.pose import Array, SectionPose
from clamp3d.output import viewer_objects as draw
from clamp3d.output.pair_rows import beside_part
from clamp3d.output.palette import INK, PART_COLOURS, VERDICT_COLOURS, darker
from clamp3d.output.section import edge_openings, part_anchor, section_extent
from clamp3d.output.viewer_cut import cut_open, groove_surface
from clamp3d.output.viewer_log import Command, Send
from clamp3d.output.viewer_motion import Timeline

ROOT = "/clamp3d"
_UNIT = 0.01
"""Viewer units a mm: meshcat's camera and lights are made for scenes of a few units."""
_FIELD_OF_VIEW = 25.0  # deg
_TREES = ("whole", "cutaway")
_OVERLAY_COLOURS = ("#4477AA", "#EE6677", "#228833", "#CCBB44", "#66CCEE", "#AA3377")  # Tol's bright scheme


class ConvexPiece(Protocol):
    """A convex piece of a baseline: ``vertices`` (n, 3) mm in its part's frame, ``faces`` (m, 3) triangles."""

    @property
    def vertices(self) -> Array: ...  # noqa: D102

    @property
    def faces(self) -> NDArray[Any]: ...  # noqa: D102


Overlay = Mapping[PartName, Sequence[ConvexPiece]]


class AssemblyScene:
    """Sends a clamp to ``send`` at once, each waypoint of its run when told, and the animation at the end.

    ``mesh_error`` mm is the chord error of what is drawn; what is measured is measured by ``model``. ``clearance``
    mm parts clear from clearance.
    """

    def __init__(
        self,
        clamp: Clamp,
        model: ContactModel,
        send: Send,
        *,
        mesh_error: float = 0.01,
        clearance: float = CLEARANCE,
        overlays: Mapping[str, Overlay] | None = None,
    ) -> None:
        clearance = number("clearance", clearance)
        verdict(0.0, contact=CONTACT, clearance=clearance)  # a bad one is told now, not during the run
        self.clamp = clamp
        self.mesh_error = mesh_error
        self.clearance = clearance
        self._bodies = parts(clamp)
        self._section = Section(clamp, model)
        self._send = send
        self._overlays = dict(overlays or {})
        self._timeline = Timeline(clamp, {name: self._followers(name) for name in PARTS})
        self._shown: dict[str, str] = {}  # groove's path -> verdict that is seen
        self._made: set[str] = set()
        self._stage()
        self._send_parts()
        for name, pieces in self._overlays.items():
            self._send_overlay(name, pieces)
        self._tell("waiting for the run")

    def show(self, waypoint: Waypoint) -> None:
        """Move the parts to ``waypoint`` and show what touches there and how far the rest is apart."""
        pairs = measure_pairs(self._section, waypoint.poses, CONTACT)
        contacts = [c for c in pairs if self.clamp.connection(c.a, c.b) or c.distance <= CONTACT]
        verdicts = {f"{c.a}-{c.b}": self._verdict(c) for c in contacts}
        if not self._timeline.stops:
            self._frame([waypoint.poses])
        number = self._timeline.add(waypoint, self._rows(contacts, waypoint), verdicts)
        for path, T in self._timeline.poses(number).items():
            self._transform(path, T)
        for group in ("contacts", "gaps"):
            if number > 0:
                self._visible(f"{ROOT}/{group}/{self._timeline.name(number - 1)}", False)
        self._send_contacts(f"{ROOT}/contacts/{self._timeline.name(number)}", contacts)
        self._send_gaps(f"{ROOT}/gaps/{self._timeline.name(number)}", contacts, waypoint)
        self._colour_grooves(verdicts)
        self._tell(f"{waypoint.step}: {waypoint.label}")

    def finish(self, run: Assembly) -> None:
        """Rewind to the first waypoint and play the whole run once."""
        if not self._timeline.stops:
            return
        self._frame([stop.waypoint.poses for stop in self._timeline.stops])
        # The state at rest is the animation's first, so that it does not matter which of the two a page reads first.
        for path, T in self._timeline.poses(0).items():
            self._transform(path, T)
        for index in range(len(self._timeline.stops)):
            for group in ("contacts", "gaps"):
                self._visible(f"{ROOT}/{group}/{self._timeline.name(index)}", index == 0)
        self._colour_grooves(self._timeline.stops[0].verdicts)
        self._tell(run.status, run)
        self._send(self._timeline.animation(ROOT, self._made))

    def _stage(self) -> None:
        """Light background, softer light, no grid."""
        self._send({"type": "delete", "path": ROOT})
        for key, colour in (("top_color", [0.93, 0.95, 0.97]), ("bottom_color", [1.0, 1.0, 1.0])):
            self._property("/Background", key, colour)
        self._visible("/Grid", False)
        self._visible("/Axes", False)
        for light, intensity in (("AmbientLight", 0.5), ("FillLight", 0.25)):
            self._property(f"/Lights/{light}/<object>", "intensity", intensity)

    def _frame(self, states: Sequence[Mapping[PartName, SectionPose]]) -> None:
        """The camera in front of all ``states``, a little from above and from the right."""
        boxes = [section_extent(self.clamp, poses) for poses in states]
        (left, right), (top, bottom) = ((min(b[i][0] for b in boxes), max(b[i][1] for b in boxes)) for i in (0, 1))
        # The height counts: a window is wide, and what waits beside the clamp may stand at its edge.
        reach = 0.5 * max(bottom - top, (right - left) / 1.6) * _UNIT
        distance = 1.18 * reach / math.tan(math.radians(_FIELD_OF_VIEW / 2)) + 0.5 * self.clamp.up_splint.length * _UNIT
        eye = distance * np.array([0.2, 0.24, 1.0]) / np.linalg.norm([0.2, 0.24, 1.0])
        camera = "/Cameras/default/rotated/<object>"  # its axes: right, up, towards the viewer
        self._property(camera, "fov", _FIELD_OF_VIEW)
        self._property(camera, "zoom", 1.0)
        self._property(camera, "position", eye.tolist())
        middle = np.array([0.5 * (left + right), 0.0, -0.5 * (top + bottom) - 0.05 * (bottom - top)])
        T = np.diag([_UNIT, _UNIT, _UNIT, 1.0])
        T[:3, 3] = -_UNIT * middle
        self._transform(ROOT, T)
        below = np.array([middle[0], 0.0, -bottom - 0.04 * (bottom - top)])
        self._object(f"{ROOT}/caption", draw.label(self._accuracy(), "#FFFFFF", below, size=0.8))

    def _accuracy(self) -> str:
        model = self._section.model
        return f"drawn with facets within {self.mesh_error:g} mm; measured by {model.name}, not on the facets"

    def _followers(self, part: PartName) -> list[str]:
        """The nodes of the scene that move with a part."""
        trees = [f"{ROOT}/{tree}/{part} {TITLES[part]}" for tree in _TREES]
        return [
            *trees,
            f"{ROOT}/labels/{part}",
            *(f"{ROOT}/overlay {o}/{part}" for o, p in self._overlays.items() if part in p),
        ]

    def _send_parts(self) -> None:
        clamp, error = self.clamp, self.mesh_error
        self._visible(f"{ROOT}/whole", False)
        for name, part in self._bodies.items():
            colour, edge = PART_COLOURS[name], darker(PART_COLOURS[name], 0.4)
            whole = mesh(part, error)
            path = f"{ROOT}/whole/{name} {TITLES[name]}"
            self._object(f"{path}/solid", draw.solid(whole, colour))
            self._object(f"{path}/edges", draw.edges(whole, edge))
            path = f"{ROOT}/cutaway/{name} {TITLES[name]}"
            if name in ("P4", "P5"):  # bolts and nuts are not cut lengthwise in drawings (ISO 128)
                self._object(f"{path}/solid", draw.solid(whole, colour))
                self._object(f"{path}/edges", draw.edges(whole, edge))
            else:
                half, cap = cut_open(whole)
                self._object(f"{path}/solid", draw.solid(half, colour))
                self._object(f"{path}/cut", draw.facets(cap.vertices, cap.faces, colour, lit=False))
                self._object(f"{path}/edges", draw.edges(half, edge))
            u, v = part_anchor(clamp, name)
            self._object(f"{ROOT}/labels/{name}", draw.label(name, colour, (u, 0.0, -v), size=0.85))

    def _send_overlay(self, name: str, overlay: Overlay) -> None:
        import trimesh

        path = f"{ROOT}/overlay {name}"
        self._visible(path, False)
        for part, pieces in overlay.items():
            meshes = [trimesh.Trimesh(piece.vertices, piece.faces) for piece in pieces]
            for i, colour in enumerate(_OVERLAY_COLOURS):  # neighbours differ; a part may have hundreds of pieces
                some = meshes[i :: len(_OVERLAY_COLOURS)]
                if some:
                    joined = draw.joined(some)
                    solid = draw.facets(joined.vertices, joined.faces, colour, opacity=0.35)
                    self._object(f"{path}/{part}/pieces {i + 1}", solid)
                    self._object(f"{path}/{part}/edges {i + 1}", draw.edges(joined, darker(colour, 0.6)))

    def _send_contacts(self, path: str, contacts: Sequence[Contact]) -> None:
        self._visible(path, True)
        for c in contacts:
            if c.distance > CONTACT:
                continue
            colour = VERDICT_COLOURS[self._verdict(c)]
            T = np.eye(4)
            T[:3, 3] = c.point
            where = f"{path}/{c.a}-{c.b}"
            self._object(f"{where}/point", draw.dot(0.011 * self.clamp.up_splint.width, colour))
            self._transform(f"{where}/point", T)
            if c.type != 1:
                length = 0.11 * self.clamp.up_splint.width
                self._object(f"{where}/normal", draw.arrow(c.point, c.normal, length, darker(colour, 0.55)))

    def _send_gaps(self, path: str, contacts: Sequence[Contact], waypoint: Waypoint) -> None:
        self._visible(path, True)
        for c in contacts:
            if c.relation == "none" and c.feature == "box":  # its normal is not that of the nearest points
                continue
            if abs(c.distance) <= CONTACT or beside_part(c, self._bodies[c.a], waypoint.poses[c.a]):
                continue
            self._gap(f"{path}/{c.a}-{c.b}", c.point, c.point + c.distance * c.normal, c.distance, self._verdict(c))
        opening = edge_openings(self.clamp, waypoint.poses)[0]
        corner = waypoint.poses["P1"].point(0.0, self.clamp.up_splint.thickness)
        top = np.array([corner[0], 0.0, -corner[1]])
        self._gap(f"{path}/splints", top, top - [0.0, 0.0, opening], opening, None)

    def _gap(self, path: str, a: Array, b: Array, value: float, found: str | None) -> None:
        """A line from ``a`` to ``b`` and its value beside it, so that the value does not hide a small gap."""
        colour = INK if found is None else darker(VERDICT_COLOURS[found], 0.7)
        width, middle = self.clamp.up_splint.width, 0.5 * (a + b)
        upright = abs(b[2] - a[2]) >= abs(b[0] - a[0])
        beside = middle + ([-0.15 * width, 0.0, 0.0] if upright else [-0.15 * width, 0.0, 0.1 * width])
        self._object(f"{path}/line", draw.segments(np.array([a, b, middle, beside]), colour, on_top=True))
        text = f"{'splints ' if found is None else ''}{value:.3f} mm"
        self._object(f"{path}/value", draw.label(text, "#FFFFFF", beside, size=0.7))

    def _colour_grooves(self, verdicts: Mapping[str, str]) -> None:
        for (a, b), pair in self._section.pairs.items():
            found = verdicts.get(f"{a}-{b}") or verdicts.get(f"{b}-{a}") or "clear"
            for tree in _TREES:
                path = f"{ROOT}/{tree}/{a} {TITLES[a]}/groove {b}"
                if self._shown.get(path) == found:
                    continue
                if path in self._shown:
                    self._visible(f"{path}/{self._shown[path]}", False)
                self._shown[path] = found
                if f"{path}/{found}" not in self._made:
                    self._made.add(f"{path}/{found}")
                    strip = groove_surface(pair.groove, pair.T_a_groove, self.mesh_error, half=tree == "cutaway")
                    self._object(f"{path}/{found}", draw.facets(*strip, VERDICT_COLOURS[found]))
                self._visible(f"{path}/{found}", True)

    def _verdict(self, c: Contact) -> str:
        return verdict(c.distance, contact=CONTACT, clearance=self.clearance)

    def _rows(self, contacts: Sequence[Contact], waypoint: Waypoint) -> list[dict[str, str]]:
        """The contacts of a waypoint for the page's list, the arc contacts first."""
        rows = []
        for c in sorted(contacts, key=lambda c: (c.type != 3, c.a, c.b)):
            gap = 0.0 if abs(c.distance) <= CONTACT else c.distance
            beside = beside_part(c, self._bodies[c.a], waypoint.poses[c.a])
            rows.append(
                {
                    "pair": f"{c.a}\N{EN DASH}{c.b}",
                    "what": "beside the groove" if beside else c.relation if c.relation != "none" else c.feature,
                    "gap": "" if c.type == 1 else f"{'over ' if beside else ''}{gap:.3f} mm",
                    "verdict": self._verdict(c),
                }
            )
        return rows

    def _tell(self, status: str, run: Assembly | None = None) -> None:
        """What the page beside the picture shows; meshcat's own page takes no notice of it."""
        clamp = self.clamp
        facts = [] if run is None else run_facts(run)
        self._property(
            ROOT,
            "userData",
            {
                "title": f"{clamp.name} clamp",
                "wires": f"line {clamp.line.label}, jumper {clamp.jumper.label}",
                "status": status,
                "facts": facts,
                "accuracy": self._accuracy(),
                "limits": list(self._section.model.limits),
                "parts": [{"name": n, "title": TITLES[n], "colour": PART_COLOURS[n]} for n in PARTS],
                "verdicts": [
                    {"name": name, "colour": VERDICT_COLOURS[name], "meaning": meaning}
                    for name, meaning in (
                        ("clash", "parts overlap"),
                        ("contact", "parts touch"),
                        ("clearance", f"gap up to {self.clearance:g} mm"),
                        ("clear", f"gap over {self.clearance:g} mm"),
                    )
                ],
                "overlays": [{"name": name, "path": f"{ROOT}/overlay {name}"} for name in self._overlays],
                "sequence": clamp.sequence,
                "stops": self._timeline.data(),
                "done": run is not None,
            },
        )

    def _object(self, path: str, what: Command) -> None:
        self._send({"type": "set_object", "path": path, "object": what})

    def _transform(self, path: str, T: Array) -> None:
        self._send({"type": "set_transform", "path": path, "matrix": T.T.ravel().tolist()})

    def _property(self, path: str, key: str, value: object) -> None:
        self._send({"type": "set_property", "path": path, "property": key, "value": value})

    def _visible(self, path: str, on: bool) -> None:
        self._property(path, "visible", on)


def run_facts(run: Assembly) -> list[str]:
    """The run in a few short lines."""
    return [
        f"method {run.method}, {run.solver}",
        f"distance between splints {run.distance:.3f} mm",
        f"tilt of the down splint {abs(math.degrees(run.tilt)):.2f}\N{DEGREE SIGN}",
        f"nut turned {run.turns:.2f} times from open",
    ]
