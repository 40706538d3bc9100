"""What a file of several bodies holds: named, placed shapes, how many were announced, and what could not be read."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from clamp3d.checks import short
from clamp3d.errors import InputError
from clamp3d.geometry.mesh import Array, Mesh, make_mesh
from clamp3d.geometry.shapes import MeshShape, Shape

_NAMED = 4


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """A node of a file's product tree: a part or an assembly of parts, at one of its places.

    Attributes
    ----------
    name, instance : str
        Names of the product, and of this place of it.
    T : ndarray (4, 4)
        Its pose in the world of the file, mm.
    assembly : Component or None
        The assembly that holds it.
    colour : str or None
        Colour "#RRGGBB" that the file states for it, or for what holds it.
    face_colours : dict
        Colours of single faces by their number in the explorer's order, from 0.
    """

    name: str
    instance: str
    T: Array
    assembly: Component | None = None
    colour: str | None = None
    face_colours: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A shape under the name that its file gives it, placed by ``T`` (4, 4); instances share one shape.

    ``component`` is its place in the product tree, where the file has one.
    """

    name: str
    shape: Shape
    T: Array
    component: Component | None = None

    @property
    def mesh(self) -> Mesh:
        """The triangles of a shape that is not drawn."""
        assert isinstance(self.shape, MeshShape)
        return self.shape.mesh


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
    joined : tuple of (str, str) or None
        Of a robot: names of the links that a joint connects; bodies of one name are one link.
    """

    bodies: tuple[Body, ...]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    joined: tuple[tuple[str, str], ...] | None = None

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
        count = f"{len(self.bodies)} of {len(self.bodies) + len(self.missing)} bodies read; missing: {listed}"
        if not partial:
            raise InputError(f"{short(path)}: only {count} (--partial goes on with those)")
        return replace(self, notes=(count, *self.notes))

    def merged(self, name: str) -> Mesh:
        """All bodies, each at its place, as one mesh in mm."""
        if len(self.bodies) == 1 and np.array_equal(self.bodies[0].T, np.eye(4)):
            return self.bodies[0].mesh
        starts = np.cumsum([0, *(len(body.mesh.vertices) for body in self.bodies)])
        placed = [body.mesh.vertices @ body.T[:3, :3].T + body.T[:3, 3] for body in self.bodies]
        faces = [body.mesh.faces + start for body, start in zip(self.bodies, starts, strict=False)]
        mesh = make_mesh(np.concatenate(placed), np.concatenate(faces), name=name)
        return replace(mesh, notes=(*self.notes, *mesh.notes))


def part_name(name: str) -> str:
    """A name as a part may have it: what separates names and what patterns are made of becomes a dash.

    >>> part_name(" M8 x 20, DIN 933:2 ")
    'M8-x-20-DIN-933-2'
    """
    printable = "".join(c if c.isprintable() else " " for c in name)
    return re.sub(r"[\s:,*?\[\]]+", "-", printable).strip("-") or "part"


def unique_names(names: Iterable[str]) -> list[str]:
    """Names with which parts can be told apart: those that occur more than once are numbered, in their order.

    >>> unique_names(["nut", "plate", "nut"])
    ['nut_1', 'plate', 'nut_2']
    """
    bare = [part_name(name) for name in names]
    often = Counter(bare)
    used = {name for name in bare if often[name] == 1}
    unique = []
    counters = {name: itertools.count(1) for name in often}
    for name in bare:
        if often[name] > 1:
            name = next(numbered for k in counters[name] if (numbered := f"{name}_{k}") not in used)
            used.add(name)
        unique.append(name)
    return unique
