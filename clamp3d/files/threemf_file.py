"""3MF files as placed meshes: what the build lists, its objects and their components, by lib3mf.

This runs in the process for foreign files, whose limits are for archives that unpack to gigabytes.
"""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import lib3mf
import numpy as np

from clamp3d.errors import InputError
from clamp3d.files.bodies import MOST_BODIES, Reading
from clamp3d.files.placing import Placer
from clamp3d.geometry.pose import Array

_UNITS = {"MicroMeter": 1e-3, "MilliMeter": 1.0, "CentiMeter": 10.0, "Meter": 1000.0, "Inch": 25.4, "Foot": 304.8}
_HARMLESS = re.compile("attribute|namespace|metadata|texture|thumbnail|colou?r|propert|uuid", re.IGNORECASE)
"""What a warning of lib3mf may be about without saying that a body is lost."""


def read_3mf(path: Path, _: str | None) -> Reading:
    """The meshes of a 3MF file, each instance a body, in mm."""
    _check_count(path)
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(False)
    reader.ReadFromFile(str(path))
    warnings = {reader.GetWarning(k)[1] for k in range(reader.GetWarningCount())}
    if any("unit" in text.lower() for text in warnings):
        raise InputError("unit must be one of micron, millimeter, centimeter, meter, inch, foot")
    placer = Placer(_UNITS[model.GetUnit().name])
    items = model.GetBuildItems()
    while items.MoveNext():
        item = items.GetCurrent()
        T = _matrix(item.GetObjectTransform()) if item.HasObjectTransform() else np.eye(4)
        for obj, place in _meshes(item.GetObjectResource(), T):
            placer.place(obj.GetName() or path.stem, obj.GetResourceID(), partial(_arrays, obj), place)
    placer.missing += sorted(f"{text} (lib3mf)" for text in warnings if not _HARMLESS.search(text))
    return placer


def _check_count(path: Path) -> None:
    """Raise InputError if objects name each other into too many bodies, which would keep lib3mf busy for years."""
    with zipfile.ZipFile(path) as archive:
        texts = [archive.read(name) for name in archive.namelist() if name.endswith(".model")]
    for text in texts:
        if b"<component " not in text:
            continue
        bodies: Counter[str | None] = Counter()
        for item in ElementTree.fromstring(text).iterfind(".//{*}object"):  # each after those that it is made of
            parts = item.iterfind("{*}components/{*}component")
            bodies[item.get("id")] = sum(bodies[part.get("objectid")] for part in parts) or 1
        if max(bodies.values()) > MOST_BODIES:
            raise InputError(f"more than {MOST_BODIES} bodies")


def _meshes(obj: Any, T: Array) -> Iterator[tuple[Any, Array]]:
    """The meshes that an object is made of, with their places."""
    if obj.IsMeshObject():
        yield obj, T
        return
    for k in range(obj.GetComponentCount()):
        part = obj.GetComponent(k)
        own = _matrix(part.GetTransform()) if part.HasTransform() else np.eye(4)
        yield from _meshes(part.GetObjectResource(), T @ own)


def _matrix(transform: Any) -> Array:
    """A 3MF transform, rows of a matrix for row vectors, as a pose (4, 4)."""
    T = np.eye(4)
    T[:3] = np.array([list(row) for row in transform.Fields]).T
    return T


def _arrays(obj: Any) -> tuple[Array, Any]:
    V = np.array([list(v.Coordinates) for v in obj.GetVertices()], dtype=np.float64).reshape(-1, 3)
    F = np.array([list(t.Indices) for t in obj.GetTriangleIndices()], dtype=np.int64).reshape(-1, 3)
    return V, F
