"""3MF files as placed meshes: what the build lists, its objects and their components (lib3mf).

This runs in a process of its own (`clamp3d.brep.apart`): an archive of a kilobyte can name itself into millions of
components.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d.brep.bodies import MOST_BODIES, Reading
from clamp3d.brep.placing import Placer
from clamp3d.core.linear import dot
from clamp3d.core.mesh import Array
from clamp3d.errors import InputError

_UNITS = {"MicroMeter": 1e-3, "MilliMeter": 1.0, "CentiMeter": 10.0, "Meter": 1000.0, "Inch": 25.4, "Foot": 304.8}
_HARMLESS = re.compile("attribute|namespace|metadata|texture|thumbnail|colou?r|propert|uuid", re.IGNORECASE)
"""What a warning of lib3mf may be about without saying that a body is lost."""
_DEEPEST = 60
_RATIO, _UNPACKED = 200, 2**28
"""An archive that unpacks to more than this many times its size, and to more than so many bytes, is refused."""


def read_3mf(path: Path) -> Reading:
    """The meshes of a 3MF file, each instance a body, in mm. Raises InputError if lib3mf cannot read it."""
    import lib3mf

    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
    except (zipfile.BadZipFile, NotImplementedError) as error:
        raise InputError(f"{path}: not a readable 3MF file ({error})") from None
    if unpacked > max(_UNPACKED, _RATIO * path.stat().st_size):
        raise InputError(
            f"{path}: unpacks to {unpacked / 1e6:.0f} MB, {unpacked / path.stat().st_size:.0f} times its size"
        )
    try:
        model = lib3mf.get_wrapper().CreateModel()
        reader = model.QueryReader("3mf")
        reader.SetStrictModeActive(False)
        reader.ReadFromFile(str(path))
        warnings = {reader.GetWarning(k)[1] for k in range(reader.GetWarningCount())}
        if any("unit" in text.lower() for text in warnings):
            raise InputError(f"{path}: unit must be one of micron, millimeter, centimeter, meter, inch, foot")
        scale = _UNITS[model.GetUnit().name]
        placer = Placer(scale)
        items: list[Any] = []
        known: dict[int, int] = {}
        listed = model.GetBuildItems()
        while listed.MoveNext():
            items.append(listed.GetCurrent())
        if sum(_count(item.GetObjectResource(), known, 0) for item in items) > MOST_BODIES:
            raise InputError(f"{path}: more than {MOST_BODIES} bodies")
        for item in items:
            T = _matrix(item.GetObjectTransform()) if item.HasObjectTransform() else np.eye(4)
            for obj, place in _meshes(item.GetObjectResource(), T):
                placer.place(obj.GetName() or path.stem, obj.GetResourceID(), partial(_arrays, obj), place)
    except lib3mf.ELib3MFException as error:
        raise InputError(f"{path}: not a readable 3MF file ({' '.join(str(error).split())})") from None
    placer.missing += sorted(f"{text} (lib3mf)" for text in warnings if not _HARMLESS.search(text))
    return placer.reading()


def _count(obj: Any, known: dict[int, int], depth: int) -> int:
    """How many meshes an object is made of, at least 1; ``known`` keeps the answers, since components can double."""
    if depth > _DEEPEST:
        raise InputError(f"components more than {_DEEPEST} levels deep")
    number = obj.GetResourceID()
    if number not in known:
        below = [] if obj.IsMeshObject() else [obj.GetComponent(k) for k in range(obj.GetComponentCount())]
        known[number] = max(1, sum(_count(part.GetObjectResource(), known, depth + 1) for part in below))
    return known[number]


def _meshes(obj: Any, T: Array) -> Iterator[tuple[Any, Array]]:
    """The meshes that an object is made of, with their places."""
    if obj.IsMeshObject():
        yield obj, T
        return
    for k in range(obj.GetComponentCount()):
        part = obj.GetComponent(k)
        own = _matrix(part.GetTransform()) if part.HasTransform() else np.eye(4)
        yield from _meshes(part.GetObjectResource(), dot(T, own))


def _matrix(transform: Any) -> Array:
    """A 3MF transform, rows of a matrix for row vectors, as a pose (4, 4)."""
    T = np.eye(4)
    T[:3] = np.array([list(row) for row in transform.Fields]).T
    return T


def _arrays(obj: Any) -> tuple[Array, Any]:
    V = np.array([list(v.Coordinates) for v in obj.GetVertices()], dtype=np.float64).reshape(-1, 3)
    F = np.array([list(t.Indices) for t in obj.GetTriangleIndices()], dtype=np.int64).reshape(-1, 3)
    return V, F
