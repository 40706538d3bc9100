"""From a tree of named, placed Open CASCADE shapes to solids: several solids are several bodies, always."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.bodies import Reading
from clamp3d.files.open_cascade import explore, volume_of
from clamp3d.files.placing import Placer
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.mesh import Array


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A part of a tree: its ``name``, its place ``T`` (4, 4) in the node above, and a TopoDS_Shape or nodes ``below``.

    ``named`` holds names of single solids of the shape, by `Key`.
    """

    name: str
    T: Array
    shape: Any = None
    below: Iterable[Node] = ()
    named: Mapping[Key, str] = field(default_factory=dict)


class Key:
    """A TopoDS_Shape wherever it is placed, as a key: copies of one shape are equal."""

    def __init__(self, shape: Any) -> None:
        from OCP.TopLoc import TopLoc_Location

        self.shape = shape.Located(TopLoc_Location())

    def __hash__(self) -> int:
        return hash(self.shape)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Key) and bool(self.shape.IsSame(other.shape))


def matrix(location: Any) -> Array:
    """A TopLoc_Location as a pose (4, 4), mm."""
    move = location.Transformation()
    T = np.eye(4)
    T[:3] = [[move.Value(r, c) for c in (1, 2, 3, 4)] for r in (1, 2, 3)]
    return T


def bodies_of(roots: Iterable[Node]) -> tuple[Reading, int]:
    """All solids below ``roots`` with names and places, equal ones sharing a shape; and how many different ones.

    What is no solid is among the reading's missing. Raises InputError for too many bodies.
    """
    collector = Placer()
    shapes: dict[Key, BrepSolid | str] = {}
    loose = 0
    for node, T in _leaves(roots, np.eye(4)):
        solids = list(explore(node.shape, "SOLID"))
        for solid in solids:
            key = Key(solid)
            name = node.named.get(key) or node.name
            if key not in shapes:
                shapes[key] = _shape(key.shape, name)
            place = T @ matrix(solid.Location())
            is_rigid = abs(np.linalg.det(place[:3, :3]) - 1.0) < 1e-6
            collector.add(name, shapes[key] if is_rigid else "placed with a scale or a reflection", place)
        surfaces = sum(1 for _ in explore(node.shape, "SHELL", "SOLID"))
        surfaces += sum(1 for _ in explore(node.shape, "FACE", "SHELL"))
        if surfaces:
            collector.add(node.name, f"{'a surface' if surfaces == 1 else f'{surfaces} surfaces'}, not a solid", T)
        elif not solids:
            loose += 1
    if loose:
        holders = "1 product holds" if loose == 1 else f"{loose} products hold"
        collector.notes.append(f"{holders} curves or points only: left out")
    return collector.reading(), len(shapes)


def _leaves(nodes: Iterable[Node], above: Array) -> Iterator[tuple[Node, Array]]:
    """Nodes with a shape and their places in the world, in the order of the tree."""
    for node in nodes:
        T = above @ node.T
        if node.shape is not None:
            yield node, T
        yield from _leaves(node.below, T)


def _shape(solid: Any, name: str) -> BrepSolid | str:
    """The solid as a shape, or why it cannot be one."""
    try:
        size = volume_of(solid)
        if not abs(size) > 0.0:
            return "encloses no volume"
        return BrepSolid.of(solid if size > 0.0 else solid.Reversed(), name)
    except Clamp3dError as error:
        return str(error)
