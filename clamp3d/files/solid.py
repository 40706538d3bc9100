"""A solid from CAD: its exact boundary as Open CASCADE wrote it; triangles are made when somebody asks for them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from clamp3d.files import cad_process
from clamp3d.files.faces import OTHER, Surfaces
from clamp3d.files.open_cascade import bounds_of, to_bytes
from clamp3d.files.tessellation import Tessellation
from clamp3d.geometry.mesh import IntArray, Mesh, encloses
from clamp3d.geometry.pose import Array
from clamp3d.geometry.shapes import MeshShape

CHORD = 0.02
"""Chord error (mm) of ``mesh``."""


class BrepSolid(MeshShape):
    """One solid with exact faces, which is a mesh shape to whoever asks for its ``mesh``.

    Parameters
    ----------
    name : str
        What its file calls it.
    brep : bytes
        The solid in its own frame, mm, in Open CASCADE's binary format (BinTools), without triangles.
    bounds : ndarray (2, 3)
        Lower and upper corner of a box that holds it, mm.
    """

    def __init__(self, name: str, brep: bytes, bounds: Array) -> None:
        for key, value in (("name", name), ("fit", "off")):
            object.__setattr__(self, key, value)
        self.__dict__.update(brep=brep, bounds=np.asarray(bounds, dtype=np.float64))
        self.__dict__.update(_tessellations={}, _tops={})

    brep: bytes
    bounds: Array
    _tessellations: dict[float, Tessellation]
    _tops: dict[tuple[float, ...], Array]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.brep, self.bounds)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BrepSolid) and self.brep == other.brep

    def __hash__(self) -> int:
        return hash(self.brep)

    @classmethod
    def of(cls, solid: Any, name: str) -> BrepSolid:
        """From a TopoDS_Shape, in this process."""
        return cls(name, to_bytes(solid), bounds_of(solid))

    @cached_property
    def surfaces(self) -> Surfaces:
        """The surfaces of its faces."""
        return cad_process.surfaces(self.brep)

    def tessellated(self, chord: float) -> Tessellation:
        """Triangles within about ``chord`` mm of its faces. Raises Clamp3dError if a face gets none."""
        if chord not in self._tessellations:
            make = cad_process.tessellate if chord >= CHORD else cad_process.tessellate_finely
            self._tessellations[chord] = make(self.brep, chord)
        return self._tessellations[chord]

    def tops(self, direction: Array, faces: IntArray) -> Array:
        """How high (k,) mm faces numbered (k,) reach along a unit vector (3,); infinite for splines: not certain."""
        key = (*direction.round(12).tolist(), *faces.tolist())
        if key not in self._tops:
            frame, across = np.eye(4), np.linalg.svd(direction[None])[2][1]
            frame[:3, :3] = np.cross(across, direction), across, direction
            tops, exact = np.full(len(faces), np.inf), self.surfaces.kind[faces] != OTHER
            if exact.any():
                tops[exact] = cad_process.face_bounds_at(self.brep, frame, faces[exact])[:, 1, 2]
            self._tops[key] = tops
        return self._tops[key]

    @cached_property
    def mesh(self) -> Mesh:
        """Its triangles at `CHORD`."""
        triangles = self.tessellated(CHORD)
        closed = encloses(triangles.vertices, triangles.faces)
        notes = () if closed else ("the triangles of the solid do not close",)
        rounding = float(np.abs(triangles.vertices).max()) * 2.0**-50
        return Mesh(self.name, triangles.vertices, triangles.faces, closed, rounding, notes)

    @property
    def error(self) -> float:
        """How far ``mesh`` can be from the faces, mm."""
        return float(self.tessellated(CHORD).errors.max())

    @property
    def face(self) -> IntArray:
        """Number of the exact face of each triangle of ``mesh``, in the explorer's order, from 0."""
        return self.tessellated(CHORD).face

    def bounds_at(self, T: Array) -> Array:
        """Lower and upper corner (2, 3) of the bounding box of the exact faces, placed by ``T`` (4, 4)."""
        return cad_process.bounds_at(self.brep, T)
