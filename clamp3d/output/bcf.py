"""Groups of findings as BCF 2.1 (BIM Collaboration Format of buildingSMART): topics that other review tools open."""

from __future__ import annotations

import io
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from clamp3d.engine.result import CheckResult
from clamp3d.output.figures import picture
from clamp3d.output.files import whole_file
from clamp3d.output.groups import Accepted, Group, grouped
from clamp3d.output.pages import now, render
from clamp3d.output.scene_figures import finding_figure, view_of
from clamp3d.output.wording import group_text, sentence, titles

_TOPICS = 200
"""Groups that get a topic at most, the first ones: each has a picture, which takes half a second."""
_METRES = 1e-3
_VERSION = b"""<?xml version='1.0' encoding='utf-8'?>
<Version VersionId="2.1"><DetailedVersion>2.1</DetailedVersion></Version>"""


def write_bcf(result: CheckResult, path: Path, accepted: Mapping[str, Accepted]) -> None:
    """Write a topic for each group of findings: text, viewpoint, picture, and the parts by their names.

    Lengths are metres, as BCF demands. The identifier of a topic follows from that of its group, so that a review tool
    recognises it in the next file. That of an ``accepted`` group is closed. Raises InputError if the file cannot be
    written, MissingLibraryError without matplotlib.
    """
    files = {"bcf.version": _VERSION}
    for index, group in enumerate(grouped(result)[:_TOPICS]):
        topic, viewpoint = _guid(group, "topic"), _guid(group, "viewpoint")
        words = _words(result, group) | {"index": index, "topic": topic, "viewpoint": viewpoint}
        files[f"{topic}/markup.bcf"] = _xml("markup.bcf", **words, accepted=accepted.get(group.id))
        files[f"{topic}/viewpoint.bcfv"] = _xml("viewpoint.bcfv", viewpoint=viewpoint, **_camera(result, group))
        files[f"{topic}/snapshot.png"] = picture(finding_figure(result.scene, group.worst), "png")
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as package:
        for name, data in files.items():
            package.writestr(zipfile.ZipInfo(name, now().timetuple()[:6]), data, zipfile.ZIP_DEFLATED)
    with whole_file(path) as temporary:
        temporary.write_bytes(content.getvalue())


def _words(result: CheckResult, group: Group) -> dict[str, Any]:
    """What a topic says."""
    names = titles(result.scene)
    title = sentence(group.rows, names, group.a, group.b)
    return {"group": group, "title": title, "text": group_text(group, names), "made": f"{now():%Y-%m-%dT%H:%M:%SZ}"}


def _camera(result: CheckResult, group: Group) -> dict[str, Any]:
    """The parts of a group, and a camera that looks at its worst finding."""
    parts = dict.fromkeys(name for row in group.rows for name in (row.a, row.b))
    target, towards_viewer, up, size = view_of(result.scene, group.worst)
    eye = (target + 1.5 * size * towards_viewer) * _METRES
    return {"parts": parts, "eye": eye.tolist(), "direction": (-towards_viewer).tolist(), "up": up.tolist()}


def _guid(group: Group, kind: str) -> str:
    return str(uuid.uuid5(uuid.NAMESPACE_URL, f"clamp3d/{kind}/{group.id}"))


def _xml(template: str, **values: Any) -> bytes:
    """A template filled in, without control characters, which XML forbids."""
    text = "".join(c if c.isprintable() or c == "\n" else " " for c in render(template, **values))
    return text.encode("utf-8", "xmlcharrefreplace")
