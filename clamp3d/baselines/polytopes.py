"""Parts as sets of shapes that FCL measures: what the models wedges, hulls and mesh share, and the last of them."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence

import numpy as np

from clamp3d.baselines.fcl_shapes import Shape, Wire, bvh, distance, facets, measure
from clamp3d.baselines.model import Pieces, pose_of, poses_of
from clamp3d.checks import instance
from clamp3d.errors import InputError
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.pose import Array, check_pose
from clamp3d.geometry.shapes import Solid
from clamp3d.kernel.contact_model import GroovePair


class Polytopes:
    """Named shapes of one part; wires are measured against each of them.

    Depth is that of the deepest single polytope: exact for a wire that reaches into one face, and never more than
    the true way out of the union.
    """

    def __init__(self, shapes: Sequence[Shape], names: Sequence[str]) -> None:
        self.shapes = tuple(shapes)
        self.names = tuple(names)
        self._low, self._high = np.array([shape.solid.bounds for shape in shapes]).swapaxes(0, 1)

    def pieces(self, wire: Wire, T_a_wire: Array) -> Pieces:
        """One gap per polytope, with the wire at a pose (4, 4) in the part's frame."""
        wire.place(check_pose(T_a_wire))
        measured = [measure(shape, wire) for shape in self.shapes]
        distance, point, normal = (
            np.array([getattr(m, key) for m in measured]) for key in ("distance", "point", "normal")
        )
        return Pieces(distance, point, normal, self.names)

    def distances(self, wire: Wire, T_a_wire: Array) -> Array:
        """Least signed distance (n,) at poses (n, 4, 4), the polytopes taken by the distance of their boxes.

        FCL's own broadphase answers the same and takes as long here: a wire's box covers most of a groove.
        """
        poses = T_a_wire
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


class PolytopeModel:
    """What wedges, hulls and meshes share: parts as `Polytopes`, each cut when it is first measured.

    Parameters
    ----------
    parts : mapping of str to Solid
        Grooved parts by name, mm.
    """

    is_meshed = True
    """Whether a part is meshed to be cut."""

    def __init__(self, parts: Mapping[str, Solid]) -> None:
        instance("parts", parts, Mapping)
        self._parts = parts
        self._cut: dict[str, Polytopes] = {}
        self._wire = functools.cache(Wire)

    @property
    def meshes_built(self) -> int:
        """How many parts had to be meshed so far."""
        return len(self._cut) if self.is_meshed else 0

    def cut(self, name: str, part: Solid) -> Polytopes:
        """The polytopes of a part; each model has its own."""
        raise NotImplementedError

    def polytopes(self, name: str) -> Polytopes:
        """The polytopes that answer distances. Raises InputError for a part that is not there."""
        if name not in self._parts:
            raise InputError(f"unknown part {name!r}; available: {', '.join(self._parts)}")
        if name not in self._cut:
            self._cut[name] = self.cut(name, self._parts[name])
        return self._cut[name]

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every piece of part a; see `ContactModel`."""
        T_a_b = pose_of(pair, T_a_b)
        return self.polytopes(pair.a).pieces(self._wire(pair.cylinder), T_a_b @ pair.T_b_cylinder)

    def distances(self, pair: GroovePair, T_a_b: Array) -> Array:
        """Signed distances (n,) for poses (n, 4, 4); see `ContactModel`."""
        T_a_b = poses_of(pair, T_a_b)
        return self.polytopes(pair.a).distances(self._wire(pair.cylinder), T_a_b @ pair.T_b_cylinder)


class Meshes(PolytopeModel):
    """The parts' meshes as they are, measured by FCL; any pose.

    The groove is too tight by the mesh's chord error. A mesh is a surface: depth comes from thinner cores of the wire
    and ends where the thinnest crosses the surface too. A wire inside the wall is seen (`fcl_shapes.measure`), but not
    by ``pieces``, the gaps to every flat face.

    Parameters
    ----------
    parts : mapping of str to Solid
        Grooved parts by name, mm. A part is meshed when it is first measured.
    mesh_error : float
        Chord error in mm of the meshes.
    """

    name = "mesh"
    limits = ("surface only", "no depth beyond 0.9 of the wire's radius", "groove too tight by the mesh's chord error")

    def __init__(self, parts: Mapping[str, Solid], mesh_error: float = 0.05) -> None:
        super().__init__(parts)
        self.mesh_error = mesh_error
        self._facets: dict[str, Polytopes] = {}

    def cut(self, name: str, part: Solid) -> Polytopes:
        """See `PolytopeModel`."""
        return Polytopes([bvh(mesh(part, self.mesh_error), name)], ["surface"])

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        """Gaps to every flat face of part a; see `ContactModel`."""
        T_a_b = pose_of(pair, T_a_b)
        if pair.a not in self._facets:
            shapes = facets(self.polytopes(pair.a).shapes[0])
            self._facets[pair.a] = Polytopes(shapes, [f"facet {i + 1}" for i in range(len(shapes))])
        return self._facets[pair.a].pieces(self._wire(pair.cylinder), T_a_b @ pair.T_b_cylinder)
