"""3MF files as placed meshes: what the build lists, its objects and their components, by lib3mf.

An archive of a kilobyte can unpack to gigabytes, or name itself into millions of components, so both are counted
before. This runs in the process for foreign files.
"""

from __future__ import annotations

import re
import zipfile
import zlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import IO, Any
from xml.parsers import expat

import numpy as np

from clamp3d.brep.bodies import Reading
from clamp3d.brep.placing import MOST_BODIES, Placer
from clamp3d.core.mesh import Array
from clamp3d.errors import InputError, missing

try:
    import lib3mf
except ImportError:
    raise missing("lib3mf", "3MF") from None

_UNITS = {"MicroMeter": 1e-3, "MilliMeter": 1.0, "CentiMeter": 10.0, "Meter": 1000.0, "Inch": 25.4, "Foot": 304.8}
_HARMLESS = re.compile("attribute|namespace|metadata|texture|thumbnail|colou?r|propert|uuid", re.IGNORECASE)
"""What a warning of lib3mf may be about without saying that a body is lost."""
_DEEPEST = 60
_RATIO, _UNPACKED = 200, 2**28
"""An archive that unpacks to more than this many times its size, and to more than so many bytes, is refused."""


def read_3mf(path: Path, _: str | None) -> Reading:
    """The meshes of a 3MF file, each instance a body, in mm. Raises InputError if lib3mf cannot read it."""
    try:
        with zipfile.ZipFile(path) as archive:
            _check_size(archive, path)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, expat.ExpatError) as error:
        reason = getattr(error, "strerror", None) or str(error)  # a cut archive leads outside of the file: an OSError
        raise InputError(f"{path}: not a readable 3MF file ({reason})") from None
    try:
        model = lib3mf.get_wrapper().CreateModel()
        reader = model.QueryReader("3mf")
        reader.SetStrictModeActive(False)
        reader.ReadFromFile(str(path))
        warnings = {reader.GetWarning(k)[1] for k in range(reader.GetWarningCount())}
        if any("unit" in text.lower() for text in warnings):
            raise InputError(f"{path}: unit must be one of micron, millimeter, centimeter, meter, inch, foot")
        placer = Placer(_UNITS[model.GetUnit().name])
        items = model.GetBuildItems()
        while items.MoveNext():
            item = items.GetCurrent()
            T = _matrix(item.GetObjectTransform()) if item.HasObjectTransform() else np.eye(4)
            for obj, place in _meshes(item.GetObjectResource(), T):
                placer.place(obj.GetName() or path.stem, obj.GetResourceID(), partial(_arrays, obj), place)
    except lib3mf.ELib3MFException as error:
        raise InputError(f"{path}: not a readable 3MF file ({' '.join(str(error).split())})") from None
    placer.missing += sorted(f"{text} (lib3mf)" for text in warnings if not _HARMLESS.search(text))
    return placer.reading()


def _check_size(archive: zipfile.ZipFile, path: Path) -> None:
    """Raise InputError for an archive that unpacks to very much, or places too many bodies."""
    packed, unpacked = path.stat().st_size, sum(entry.file_size for entry in archive.infolist())
    if unpacked > max(_UNPACKED, _RATIO * packed):
        raise InputError(f"{path}: unpacks to {unpacked / 1e6:.0f} MB, {unpacked / packed:.0f} times its size")
    below: dict[str, list[str]] = {}
    for name in archive.namelist():
        if name.lower().endswith(".model"):
            with archive.open(name) as file:
                below |= _components(file, f"/{name}")
    counts: dict[str, int] = {}

    def count(item: str, depth: int) -> int:
        if depth > _DEEPEST:
            raise InputError(f"{path}: components more than {_DEEPEST} levels deep")
        if item not in counts:
            counts[item] = max(1, sum(count(part, depth + 1) for part in below.get(item, ())))
        return counts[item]

    if sum(count(item, 0) for key in below if key.endswith("#build") for item in below[key]) > MOST_BODIES:
        raise InputError(f"{path}: more than {MOST_BODIES} bodies")


def _components(file: IO[bytes], name: str) -> dict[str, list[str]]:
    """What each object of a model file is made of, by file and number ("/3D/a.model#7"); its build is "...#build"."""
    below: dict[str, list[str]] = {}
    current: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal current
        kind = tag.rpartition(":")[2]
        if kind in ("object", "build"):
            current = below.setdefault(f"{name}#{attributes.get('id', kind)}", [])
        elif kind in ("component", "item"):
            other = next((value for key, value in attributes.items() if key.endswith(":path")), name)
            current.append(f"{other}#{attributes.get('objectid', '')}")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.ParseFile(file)
    return below


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
