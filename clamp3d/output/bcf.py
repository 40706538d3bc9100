"""Groups of findings as BCF 2.1 (BIM Collaboration Format of buildingSMART): topics that other review tools open."""

from __future__ import annotations

import io
import uuid
import zipfile
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

from clamp3d.engine.result import CheckResult
from clamp3d.geometry.pose import Array
from clamp3d.output.figures import picture
from clamp3d.output.files import whole_file
from clamp3d.output.groups import Group, grouped
from clamp3d.output.pages import now
from clamp3d.output.scene_figures import finding_figure, view_of
from clamp3d.output.wording import group_text, sentence, titles

_TOPICS = 200
"""Groups that get a topic at most, the first ones: each has a picture, which takes half a second."""
_METRES = 1e-3
_SYSTEM = "clamp3d"


def write_bcf(result: CheckResult, path: Path) -> None:
    """Write a topic for each group of findings: text, viewpoint, picture, and the parts by their names.

    Lengths are metres, as BCF demands. The identifier of a topic follows from that of its group, so that a review tool
    recognises it in the next file. Raises InputError if the file cannot be written, MissingLibraryError without
    matplotlib.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as package:

        def add(name: str, data: bytes) -> None:
            entry = zipfile.ZipInfo(name, now().timetuple()[:6])
            package.writestr(entry, data, zipfile.ZIP_DEFLATED)

        add("bcf.version", _xml(_element("Version", _element("DetailedVersion", "2.1"), VersionId="2.1")))
        for index, group in enumerate(grouped(result)[:_TOPICS]):
            guid = _guid(group, "topic")
            add(f"{guid}/markup.bcf", _xml(_markup(result, group, index)))
            add(f"{guid}/viewpoint.bcfv", _xml(_viewpoint(result, group)))
            add(f"{guid}/snapshot.png", picture(finding_figure(result.scene, group.worst), "png"))
    with whole_file(path) as temporary:
        temporary.write_bytes(content.getvalue())


def _markup(result: CheckResult, group: Group, index: int) -> Element:
    """The topic in words, and the names of its files."""
    names = titles(result.scene)
    pairs = ", ".join(f"{row.a} and {row.b}" for row in group.rows)
    topic = _element(
        "Topic",
        _element("Title", sentence(group.rows, names, group.a, group.b)),
        _element("Index", str(index)),
        _element("Labels", group.id),
        _element("CreationDate", f"{now():%Y-%m-%dT%H:%M:%SZ}"),
        _element("CreationAuthor", _SYSTEM),
        _element("Description", f"{group_text(group, names)}\n{pairs}"),
        Guid=_guid(group, "topic"),
        TopicType=group.verdict.value,
        TopicStatus="Open",
    )
    files = _element("Viewpoint", "viewpoint.bcfv"), _element("Snapshot", "snapshot.png")
    return _element("Markup", topic, _element("Viewpoints", *files, Guid=_guid(group, "viewpoint")))


def _viewpoint(result: CheckResult, group: Group) -> Element:
    """The parts of the group selected, and a camera that looks at its worst finding."""
    parts = dict.fromkeys(name for row in group.rows for name in (row.a, row.b))
    selected = (
        _element("Component", _element("OriginatingSystem", _SYSTEM), _element("AuthoringToolId", name))
        for name in parts
    )
    components = _element("Selection", *selected), _element("Visibility", DefaultVisibility="true")
    target, towards_viewer, up, size = view_of(result.scene, group.worst)
    camera = _element(
        "PerspectiveCamera",
        _vector("CameraViewPoint", (target + 1.5 * size * towards_viewer) * _METRES),
        _vector("CameraDirection", -towards_viewer),
        _vector("CameraUpVector", up),
        _element("FieldOfView", "45"),
    )
    guid = _guid(group, "viewpoint")
    return _element("VisualizationInfo", _element("Components", *components), camera, Guid=guid)


def _vector(name: str, value: Array) -> Element:
    return _element(name, *(_element(axis, repr(number)) for axis, number in zip("XYZ", value.tolist(), strict=True)))


def _element(tag: str, *content: Element | str, **attributes: str) -> Element:
    """An element with its children or its text, without control characters, which XML forbids."""
    element = Element(tag, attributes)
    for item in content:
        if isinstance(item, str):
            element.text = "".join(c if c.isprintable() or c == "\n" else " " for c in item)
        else:
            element.append(item)
    return element


def _guid(group: Group, kind: str) -> str:
    return str(uuid.uuid5(uuid.NAMESPACE_URL, f"clamp3d/{kind}/{group.id}"))


def _xml(root: Element) -> bytes:
    data: Any = tostring(root, encoding="utf-8", xml_declaration=True)
    return bytes(data)
