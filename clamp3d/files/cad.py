"""From a tree of named, placed Open CASCADE shapes to solids: several solids are several bodies, always."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clamp3d.files.bodies import Component, Reading
from clamp3d.files.open_cascade import explore, matrix, occ, volume_of
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.pose import Array


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A part or an assembly in a tree.

    Attributes
    ----------
    name, instance : str
        Names of its product, and of this place of it.
    T : ndarray (4, 4)
        Its place in the node above.
    shape : TopoDS_Shape or None
        The shape of a part.
    below : iterable of Node
        What an assembly holds.
    colour : str or None
        Colour "#RRGGBB" at this place alone.
    names, colours : dict
        Names of single solids of the shape; colours of the shape, of its solids and of its faces.
    """

    name: str
    T: Array
    shape: Any = None
    below: Iterable[Node] = ()
    instance: str = ""
    colour: str | None = None
    names: Mapping[Key, str] = field(default_factory=dict)
    colours: Mapping[Key, str] = field(default_factory=dict)


class Key:
    """A TopoDS_Shape wherever it is placed, as a key: copies of one shape are equal."""

    def __init__(self, shape: Any) -> None:
        self.shape = shape.Located(occ.TopLoc_Location())

    def __hash__(self) -> int:
        return hash(self.shape)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Key) and bool(self.shape.IsSame(other.shape))


def bodies_of(roots: Iterable[Node]) -> Reading:
    """All solids below ``roots`` with names and places, equal ones sharing a shape.

    What is no solid is among the reading's missing. Raises InputError for too many bodies.
    """
    reading = Reading()
    shapes: dict[Key, BrepSolid | str] = {}
    loose = 0
    for node, component in _leaves(roots, None):
        solids = list(explore(node.shape, "SOLID"))
        for solid in solids:
            key = Key(solid)
            name = node.names.get(key) or node.name
            if key not in shapes:
                shapes[key] = _shape(key.shape, name)
            place = component.T @ matrix(solid.Location())
            is_rigid = abs(np.linalg.det(place[:3, :3]) - 1.0) < 1e-6
            own = Component(
                name,
                node.instance or name,
                place,
                component if len(solids) > 1 else component.assembly,
                node.colour or node.colours.get(key) or node.colours.get(Key(node.shape)) or component.colour,
                {k: node.colours[of] for k, of in enumerate(map(Key, explore(solid, "FACE"))) if of in node.colours},
            )
            reading.add(name, shapes[key] if is_rigid else "placed with a scale or a reflection", place, own)
        surfaces = [*explore(node.shape, "SHELL", "SOLID"), *explore(node.shape, "FACE", "SHELL")]
        if surfaces:
            reading.add(node.name, "a surface, not a solid", component.T)
        elif not solids:
            loose += 1
    if loose:
        reading.notes.append(f"products that hold curves or points only are left out: {loose}")
    return reading


def _leaves(nodes: Iterable[Node], assembly: Component | None) -> Iterator[tuple[Node, Component]]:
    """Nodes with a shape and their places in the world, in the order of the tree."""
    for node in nodes:
        T = node.T if assembly is None else assembly.T @ node.T
        colour = node.colour or (assembly.colour if assembly else None)
        component = Component(node.name, node.instance or node.name, T, assembly, colour)
        if node.shape is not None:
            yield node, component
        yield from _leaves(node.below, component)


def _shape(solid: Any, name: str) -> BrepSolid | str:
    """The solid as a shape, or why it cannot be one."""
    size = volume_of(solid)
    if not abs(size) > 0.0:
        return "encloses no volume"
    return BrepSolid.of(solid if size > 0.0 else solid.Reversed(), name)
