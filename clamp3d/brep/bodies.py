"""What a file of several bodies holds: named, placed shapes, how many were announced, and what could not be read."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clamp3d.brep.solid import BrepSolid
from clamp3d.checks import short
from clamp3d.core.mesh import Array, Mesh, make_mesh
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

    def merged(self, name: str) -> Mesh:
        """All bodies, each at its place, as one mesh in mm."""
        if len(self.bodies) == 1 and np.array_equal(self.bodies[0].T, np.eye(4)):
            return self.bodies[0].shape.mesh
        meshes = [body.shape.mesh for body in self.bodies]
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        placed = [body.shape.mesh.vertices @ body.T[:3, :3].T + body.T[:3, 3] for body in self.bodies]
        faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
        mesh = make_mesh(np.concatenate(placed), np.concatenate(faces), name=name)
        return replace(mesh, notes=(*self.notes, *mesh.notes))

    def to_plain(self) -> dict[str, Any]:
        """All of it as dicts, lists and arrays, for another process; each shape once."""
        shapes = {id(body.shape): body.shape for body in self.bodies}
        numbers = {key: k for k, key in enumerate(shapes)}
        return {
            "shapes": [_plain(shape) for shape in shapes.values()],
            "bodies": [(body.name, numbers[id(body.shape)], body.T) for body in self.bodies],
            "missing": self.missing,
            "notes": self.notes,
        }

    @classmethod
    def from_plain(cls, plain: dict[str, Any]) -> Reading:
        """From what `to_plain` gave."""
        shapes = [_shape(**shape) for shape in plain["shapes"]]
        bodies = [Body(name, shapes[k], T) for name, k, T in plain["bodies"]]
        return cls(tuple(bodies), tuple(plain["missing"]), tuple(plain["notes"]))


def _plain(shape: MeshShape) -> dict[str, Any]:
    if isinstance(shape, BrepSolid):
        return {"name": shape.name, "exact": shape.to_arrays()}
    return {"name": shape.name, "mesh": shape.mesh}


def _shape(name: str, exact: dict[str, Any] | None = None, mesh: dict[str, Any] | None = None) -> MeshShape:
    if exact is not None:
        return BrepSolid.from_arrays(name, exact)
    assert mesh is not None
    return MeshShape(Mesh(**mesh | {"notes": tuple(mesh["notes"])}), "off", name)


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
    unique = []
    counters = {name: itertools.count(1) for name in often}
    for name in bare:
        if often[name] > 1 or name in taken:
            name = next(numbered for k in counters[name] if (numbered := f"{name}_{k}") not in used)
            used.add(name)
        unique.append(name)
    return unique
