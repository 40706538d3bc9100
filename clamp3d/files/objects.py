"""Objects of other libraries as bodies: CadQuery, build123d, Open CASCADE and trimesh, told apart by what they have.

None of these libraries is needed: who hands in an object has loaded the one that it is of.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from clamp3d.checks import shown
from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.files.cad import Node, bodies_of
from clamp3d.files.open_cascade import matrix
from clamp3d.files.placing import Placer
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array


def read_object(source: Any) -> tuple[Reading, str]:
    """The bodies of an object, in mm, and its name. Raises InputError if it is none that is known."""
    module = type(source).__module__.partition(".")[0]
    if module == "trimesh":
        return _trimesh(source)
    node = _node(source)
    if node is None:
        raise InputError(
            "source must be a path, a clamp's name, or an object of CadQuery, build123d, Open CASCADE or trimesh, "
            f"got {shown(source)}"
        )
    return bodies_of([node]), node.name


def _node(item: Any, name: str = "part") -> Node | None:
    """A tree of shapes, called ``name`` where they have none of their own; None for what is no shape."""
    if hasattr(item, "ShapeType") and hasattr(item, "Location"):  # TopoDS_Shape
        return None if item.IsNull() else Node(name, np.eye(4), item)
    if hasattr(item, "children") and hasattr(item, "loc") and hasattr(item, "obj"):  # CadQuery Assembly
        below = [*_nodes([item.obj], item.name), *_nodes(item.children)]
        return Node(item.name, matrix(item.loc.wrapped), None, below)
    if hasattr(item, "vals"):  # CadQuery Workplane
        return Node(name, np.eye(4), None, _nodes(item.vals(), name))
    label = str(getattr(item, "label", "") or name)
    try:
        is_shape = hasattr(item, "wrapped")
    except AssertionError:  # build123d, of a shape that holds nothing
        return None
    if is_shape:
        children = tuple(getattr(item, "children", ()) or ())
        if children:  # build123d: the children are placed in their parent's frame, and its shape holds them
            return Node(label, matrix(item.wrapped.Location()), None, _nodes(children))
        return None if item.wrapped is None else Node(label, np.eye(4), item.wrapped)
    part = getattr(item, "part", None)
    return None if part is None else _node(part)  # build123d BuildPart


def _nodes(items: Iterable[Any], name: str = "part") -> list[Node]:
    return [node for item in items if (node := _node(item, name)) is not None]


def _trimesh(source: Any) -> tuple[Reading, str]:
    """A trimesh.Trimesh, or the nodes of a trimesh.Scene."""
    unit = {"millimeters": 1.0, "centimeters": 10.0, "meters": 1000.0, "inches": 25.4, None: 1.0}
    if source.units not in unit:
        raise InputError(f"units must be one of {', '.join(map(str, unit))}, got {shown(source.units)}")
    placer = Placer(unit[source.units])
    if hasattr(source, "faces"):
        placer.place("part", 0, partial(_arrays, source), np.eye(4))
        return placer, "part"
    if not hasattr(source, "graph"):
        raise InputError(f"source must be a trimesh.Scene or a trimesh.Trimesh, got {type(source).__name__}")
    for name in source.graph.nodes_geometry:
        T, key = source.graph[name]
        mesh = source.geometry[key]
        if not hasattr(mesh, "faces"):
            placer.notes.append(f"{name}: {type(mesh).__name__}, left out")
            continue
        placer.place(str(name), key, partial(_arrays, mesh), np.asarray(T))
    return placer, "scene"


def _arrays(mesh: Any) -> tuple[Array, IntArray]:
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
