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
from clamp3d.geometry.mesh import Mesh, appended, make_mesh
from clamp3d.geometry.pose import Array, to_target
from clamp3d.geometry.shapes import MeshShape, Shape

MOST_BODIES = 20_000
"""Bodies that a file may place: a few hundred bytes can name each other into millions of them."""
_NAMED = 4
"""Missing bodies that a message names."""


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


@dataclass(eq=False)
class Reading:
    """What was read of a file.

    Attributes
    ----------
    bodies : list of Body
        In the file's order.
    missing : list of str
        Bodies that the file announces and that are not among them: name and reason.
    notes : list of str
        What was assumed or repaired, and what the file holds besides bodies.
    joined : list of (str, str) or None
        Of a robot: names of the links that a joint connects; bodies of one name are one link.
    files : set of str
        Files that the file names and that were read for it.
    """

    bodies: list[Body] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    joined: list[tuple[str, str]] | None = None
    files: set[str] = field(default_factory=set)

    def add(self, name: str, shape: Shape | str, T: Array, component: Component | None = None) -> None:
        """One more body at ``T`` (4, 4), or why it has no shape. Raises InputError for too many bodies."""
        if len(self.bodies) + len(self.missing) >= MOST_BODIES:
            raise InputError(f"more than {MOST_BODIES} bodies")
        if isinstance(shape, str):
            self.missing.append(f"{name} ({shape})")
        else:
            self.bodies.append(Body(name, shape, T, component))

    def complete(self, path: str | Path, *, partial: bool = False) -> Reading:
        """Itself; with ``partial`` also if bodies are missing, which a note then says.

        Raises InputError if bodies are missing, or there is none.
        """
        more = len(self.missing) - _NAMED
        listed = "; ".join([*self.missing[:_NAMED], *([f"and {more} more"] if more > 0 else [])])
        if not self.bodies:
            raise InputError(f"{short(path)}: no body in the file" + (f": {listed}" if listed else ""))
        if self.missing:
            count = f"{len(self.bodies)} of {len(self.bodies) + len(self.missing)} bodies read; missing: {listed}"
            if not partial:
                raise InputError(f"{short(path)}: only {count} (--partial goes on with those)")
            self.notes.insert(0, count)
        return self

    def merged(self, name: str) -> Mesh:
        """All bodies, each at its place, as one mesh in mm."""
        if len(self.bodies) == 1 and np.array_equal(self.bodies[0].T, np.eye(4)):
            return self.bodies[0].mesh
        placed = [to_target(body.T, body.mesh.vertices) for body in self.bodies]
        mesh = make_mesh(*appended(placed, [body.mesh.faces for body in self.bodies]), name=name)
        return replace(mesh, notes=(*self.notes, *mesh.notes))


def part_name(name: str) -> str:
    """A name as a part may have it: what separates names and what patterns are made of becomes a dash.

    >>> part_name(" M8 x 20, DIN 933:2 ")
    'M8-x-20-DIN-933-2'
    """
    return re.sub(r"[\s:,*?\[\]]+", "-", printable(name)).strip("-") or "part"


def printable(text: str) -> str:
    r"""A text that every file can hold: control characters and halves of characters become spaces.

    >>> printable("a\x0bb\ud800")
    'a b '
    """
    return "".join(c if c.isprintable() else " " for c in text)


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
