"""3MF files as placed meshes: what the build lists, its objects and their components, by lib3mf.

This runs in the process for foreign files, whose limits are for archives that unpack to gigabytes.
"""

from __future__ import annotations

import re
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xml.parsers import expat

import lib3mf
import numpy as np

from clamp3d.checks import choice, shown
from clamp3d.errors import InputError
from clamp3d.files.bodies import MOST_BODIES, Reading
from clamp3d.files.placing import Placer
from clamp3d.geometry.pose import Array

_UNITS = {"MicroMeter": 1e-3, "MilliMeter": 1.0, "CentiMeter": 10.0, "Meter": 1000.0, "Inch": 25.4, "Foot": 304.8}
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02 "
_PLACING = {
    "model": ("unit", "requiredextensions", "recommendedextensions"),
    "item": ("objectid", "transform", "partnumber", "printable"),  # the last one is of slicers
    "component": ("objectid", "transform"),
}
"""Attributes of the elements that say where bodies are, and how large; slicers give more of them to others."""
_NUMBERS = re.compile(r"\s*([-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?(\s+|$))*", re.ASCII)
_HARMLESS = re.compile("attribute|namespace|metadata|texture|thumbnail|colou?r|propert|uuid", re.IGNORECASE)
"""What a warning of lib3mf may be about without saying that a body is lost."""


def read_3mf(path: Path, _: str | None) -> Reading:
    """The meshes of a 3MF file, each instance a body, in mm."""
    _check_text(path)
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(False)
    reader.ReadFromFile(str(path))
    warnings = {reader.GetWarning(k)[1] for k in range(reader.GetWarningCount())}
    if any("unit" in text.lower() for text in warnings):
        raise InputError("unit must be one of micron, millimeter, centimeter, meter, inch, foot")
    if "Invalid Element in namespace." in warnings:
        raise InputError("the file is damaged: an element in it is unknown to 3MF, or in the wrong place")
    placer = Placer(_UNITS[model.GetUnit().name])
    items = model.GetBuildItems()
    while items.MoveNext():
        item = items.GetCurrent()
        T = _matrix(item.GetObjectTransform()) if item.HasObjectTransform() else np.eye(4)
        for obj, place in _meshes(item.GetObjectResource(), T):
            placer.place(obj.GetName() or path.stem, obj.GetResourceID(), partial(_arrays, obj), place)
    placer.missing += sorted(f"{text} (lib3mf)" for text in warnings if not _HARMLESS.search(text))
    return placer


def _check_text(path: Path) -> None:
    """Raise InputError for what lib3mf would read otherwise than it is written, or for years.

    That is numbers with more behind them, units and places under other names, and objects that name each other into too
    many bodies.
    """
    with zipfile.ZipFile(path) as archive:
        for part in archive.namelist():
            if part.endswith(".model"):
                parser = expat.ParserCreate(namespace_separator=" ")
                parser.StartElementHandler = _check_of_elements()
                with archive.open(part) as file:
                    parser.ParseFile(file)


def _check_of_elements() -> Callable[[str, dict[str, str]], None]:
    """A function that is told the elements of a model in their order, and raises InputError."""
    bodies: Counter[str | None] = Counter()
    whole = None  # the object whose components follow, each after those that it is made of

    def check(tag: str, attributes: dict[str, str]) -> None:
        nonlocal whole
        name = tag.removeprefix(_CORE)
        if name == "vertex":
            numbers = " ".join(attributes.get(key, "") for key in ("x", "y", "z"))
        elif name in _PLACING:
            numbers = attributes.get("transform", "")
            for key in attributes:
                if " " not in key:  # of the format itself
                    choice(f"attribute of {name}", key, _PLACING[name])
        elif name == "object":
            whole = attributes.get("id")
            return
        else:
            return
        if not _NUMBERS.fullmatch(numbers):
            raise InputError(f"the file is damaged: {name} must have numbers, got {shown(numbers)}")
        if name == "component":
            bodies[whole] += max(1, bodies[attributes.get("objectid")])
            if bodies[whole] > MOST_BODIES:
                raise InputError(f"more than {MOST_BODIES} bodies")

    return check


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
    if obj.BeamLattice().GetBeamCount():
        raise InputError("its beams are not read; export them as triangles")
    V = np.array([list(v.Coordinates) for v in obj.GetVertices()], dtype=np.float64).reshape(-1, 3)
    F = np.array([list(t.Indices) for t in obj.GetTriangleIndices()], dtype=np.int64).reshape(-1, 3)
    return V, F
