"""Parts as sets of shapes that FCL measures: what the models wedges, hulls and mesh share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from clamp3d.baselines.fcl_shapes import Shape, Wire, distance, measure
from clamp3d.baselines.model import Pieces, pose_of, poses_of
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, check_pose_array
from clamp3d.core.primitives import Cylinder
from clamp3d.core.shapes import Solid
from clamp3d.errors import InputError

_T = TypeVar("_T")


class TriangleMesh(Protocol):
    """Vertices (n, 3) mm and faces (m, 3): what `trimesh.Trimesh` and `core.mesh.Mesh` have."""

    @property
    def vertices(self) -> Any: ...  # noqa: D102

    @property
    def faces(self) -> Any: ...  # noqa: D102


PartOrMesh = Solid | TriangleMesh


class Polytopes:
    """Named shapes of one part; wires are measured against each of them.

    Depth is that of the deepest single polytope: exact for a wire that reaches into one face, and never more than
    the true way out of the union.
    """

    def __init__(self, shapes: Sequence[Shape], names: Sequence[str]) -> None:
        self.shapes = tuple(shapes)
        self.names = tuple(names)
        self._low = np.array([shape.bounds[0] for shape in shapes])
        self._high = np.array([shape.bounds[1] for shape in shapes])

    def pieces(self, wire: Wire, T_a_wire: Array) -> Pieces:
        """One gap per polytope, with the wire at a pose (4, 4) in the part's frame."""
        wire.place(check_pose_array(T_a_wire[None])[0])
        found = [measure(shape, wire) for shape in self.shapes]
        return Pieces(
            np.array([m.distance for m in found]),
            np.array([m.point_a for m in found]),
            np.array([m.normal for m in found]),
            self.names,
        )

    def distances(self, wire: Wire, T_a_wire: Array) -> Array:
        """Least signed distance (n,) at poses (n, 4, 4), the polytopes taken by the distance of their boxes.

        FCL's own broadphase answers the same and takes as long here: a wire's box covers most of a groove.
        """
        poses = check_pose_array(T_a_wire)
        # Box of the cylinder: half extents |axis| L/2 + r sqrt(1 - axis^2) per coordinate.
        axis, middle = poses[:, :3, 2], poses[:, :3, 3]
        reach = np.abs(axis) * wire.cylinder.length / 2 + wire.cylinder.radius * np.sqrt(np.maximum(0.0, 1.0 - axis**2))
        below = self._low - (middle + reach)[:, None]
        above = (middle - reach)[:, None] - self._high
        apart = np.linalg.norm(np.maximum(0.0, np.maximum(below, above)), axis=2)
        out = np.empty(len(poses))
        for i, order in enumerate(np.argsort(apart, axis=1, kind="stable")):
            wire.place(poses[i])
            least = np.inf
            for k in order:
                if apart[i, k] > max(least, 0.0):
                    break
                least = min(least, distance(self.shapes[k], wire))
            out[i] = least
        return out


class PerPart(dict[str, _T]):
    """Something made for a part when it is first asked for; the dictionary holds what was made so far.

    Raises InputError for a part that is not there.
    """

    def __init__(self, names: Iterable[str], make: Callable[[str], _T]) -> None:
        super().__init__()
        self._names, self._make = tuple(names), make

    def __missing__(self, name: str) -> _T:
        if name not in self._names:
            raise InputError(f"unknown part {name!r}; available: {', '.join(self._names)}")
        made = self[name] = self._make(name)
        return made


class PolytopeModel:
    """What wedges, hulls and meshes share: parts as `Polytopes`, made when they are first measured.

    ``parts`` answer distances; ``pieces_of`` are their pieces where those are other shapes (the facets of a mesh).
    """

    def __init__(self, parts: PerPart[Polytopes], pieces_of: PerPart[Polytopes] | None = None) -> None:
        self.parts = parts
        self._pieces_of = parts if pieces_of is None else pieces_of
        self._wires: dict[Cylinder, Wire] = {}

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every piece of part a; see `ContactModel`."""
        T_a_b = pose_of(pair, T_a_b)
        return self._pieces_of[pair.a].pieces(self._wire(pair.cylinder), dot(T_a_b, pair.T_b_cylinder))

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) for poses (n, 4, 4); see `ContactModel`."""
        T_a_b = poses_of(pair, T_a_b)
        return self.parts[pair.a].distances(self._wire(pair.cylinder), dot(T_a_b, pair.T_b_cylinder))

    def _wire(self, cylinder: Cylinder) -> Wire:
        """FCL's cylinder of this size, made once."""
        if cylinder not in self._wires:
            self._wires[cylinder] = Wire(cylinder)
        return self._wires[cylinder]


def part_mesh(part: PartOrMesh, mesh_error: float) -> TriangleMesh:
    """The mesh of a part within ``mesh_error`` mm, or the mesh itself if it is one."""
    if not isinstance(part, Solid):
        return part
    from clamp3d.core.meshing import mesh

    return cast(TriangleMesh, mesh(part, mesh_error))
