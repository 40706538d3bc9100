"""What a file of several bodies holds: named, placed shapes, how many were announced, and what could not be read."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.solid import BrepSolid
from clamp3d.checks import short
from clamp3d.core.mesh import Array, Mesh
from clamp3d.core.shapes import MeshShape
from clamp3d.errors import InputError

MOST_BODIES = 20_000
"""Bodies that a file may place: a few hundred bytes can name each other into millions of them."""
_NAMED = 4


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A shape under the name that its file gives it, placed by ``T`` (4, 4); instances share one shape."""

    name: str
    shape: MeshShape
    T: Array


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """Bodies of a file.

    Attributes
    ----------
    bodies : tuple of Body
        What was read, in the file's order.
    missing : tuple of str
        Bodies that the file announces and that are not among them: name and reason.
    notes : tuple of str
        What was assumed or repaired, and what the file holds besides bodies.
    """

    bodies: tuple[Body, ...]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def announced(self) -> int:
        """How many bodies the file announces."""
        return len(self.bodies) + len(self.missing)

    def complete(self, path: str | Path, *, partial: bool = False) -> Reading:
        """Itself; with ``partial`` also if bodies are missing, which a note then says.

        Raises InputError if bodies are missing, or there is none.
        """
        listed = "; ".join(self.missing[:_NAMED]) + (
            f"; and {len(self.missing) - _NAMED} more" if len(self.missing) > _NAMED else ""
        )
        if not self.bodies:
            raise InputError(f"{short(path)}: no body in the file" + (f": {listed}" if listed else ""))
        if not self.missing:
            return self
        count = f"{len(self.bodies)} of {self.announced} bodies read; missing: {listed}"
        if not partial:
            raise InputError(f"{short(path)}: only {count} (--partial goes on with those)")
        return Reading(self.bodies, self.missing, (count, *self.notes))


def part_name(name: str) -> str:
    """A name as a part may have it: what separates names and what patterns are made of becomes a dash.

    >>> part_name(" M8 x 20, DIN 933:2 ")
    'M8-x-20-DIN-933-2'
    """
    printable = "".join(c if c.isprintable() else " " for c in name)
    return re.sub(r"[\s:,*?\[\]]+", "-", printable).strip("-") or "part"


def unique_names(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Names with which parts can be told apart: those that occur more than once are numbered, in their order.

    >>> unique_names(["nut", "plate", "nut"])
    ['nut_1', 'plate', 'nut_2']
    """
    bare = [part_name(name) for name in names]
    often = Counter(bare)
    used = set(taken) | {name for name in bare if often[name] == 1}
    found = []
    counters = {name: itertools.count(1) for name in often}
    for name in bare:
        if often[name] > 1 or name in taken:
            name = next(made for k in counters[name] if (made := f"{name}_{k}") not in used)
            used.add(name)
        found.append(name)
    return found


def save(reading: Reading, path: Path) -> None:
    """Write a reading to a file of arrays, for the process that asked for it."""
    arrays: dict[str, NDArray[Any]] = {}
    numbers: dict[int, int] = {}
    shapes = []
    for shape in (body.shape for body in reading.bodies):
        if id(shape) in numbers:
            continue
        k = numbers[id(shape)] = len(numbers)
        own = shape.to_arrays() if isinstance(shape, BrepSolid) else _arrays(shape.mesh)
        arrays |= {f"{k} {key}": value for key, value in own.items()}
        shapes.append({"name": shape.name, "exact": isinstance(shape, BrepSolid), "notes": shape.mesh.notes})
    meta = {
        "shapes": shapes,
        "bodies": [(body.name, numbers[id(body.shape)]) for body in reading.bodies],
        "missing": reading.missing,
        "notes": reading.notes,
    }
    arrays["T"] = np.array([body.T for body in reading.bodies]).reshape(-1, 4, 4)
    meta["arrays"] = [(key, value.dtype.str, value.shape) for key, value in arrays.items()]
    with path.open("wb") as out:
        out.write(json.dumps(meta).encode() + b"\n")
        for value in arrays.values():
            out.write(np.ascontiguousarray(value).tobytes())


def restore(path: Path) -> Reading:
    """A reading that `save` wrote."""
    arrays: dict[str, NDArray[Any]] = {}
    with path.open("rb") as file:
        meta = json.loads(file.readline())
        for key, kind, shape in meta["arrays"]:
            arrays[key] = np.fromfile(file, np.dtype(kind), math.prod(shape)).reshape(shape)
    places = arrays.pop("T")
    own: list[dict[str, NDArray[Any]]] = [{} for _ in meta["shapes"]]
    for key, value in arrays.items():
        number, _, name = key.partition(" ")
        own[int(number)][name] = value
    shapes = [_shape(made, given) for made, given in zip(meta["shapes"], own, strict=True)]
    bodies = [Body(name, shapes[k], T) for (name, k), T in zip(meta["bodies"], places, strict=True)]
    return Reading(tuple(bodies), tuple(meta["missing"]), tuple(meta["notes"]))


def _arrays(mesh: Mesh) -> dict[str, NDArray[Any]]:
    state = np.array([mesh.watertight, mesh.rounding])
    return {"vertices": mesh.vertices, "faces": mesh.faces, "state": state}


def _shape(made: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> MeshShape:
    if made["exact"]:
        return BrepSolid.from_arrays(made["name"], arrays)
    watertight, rounding = arrays["state"]
    mesh = Mesh(
        made["name"], arrays["vertices"], arrays["faces"], bool(watertight), float(rounding), tuple(made["notes"])
    )
    return MeshShape(mesh, "off", made["name"])
