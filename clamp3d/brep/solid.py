"""A solid from CAD: its exact boundary as Open CASCADE wrote it, and triangles that know how far they are from it."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.surfaces import Faces
from clamp3d.brep.tessellate import Tessellation, tessellate
from clamp3d.core.mesh import Array, IntArray, Mesh, is_closed
from clamp3d.core.shapes import MeshShape
from clamp3d.errors import InputError, MissingLibraryError

CHORD = 0.02
"""Chord error (mm) of the triangles that a solid comes with."""


@dataclass(frozen=True, eq=False)
class BrepSolid(MeshShape):
    """One solid with exact faces; ``mesh`` is within ``error`` mm of it, which may be twice the chord asked for.

    Attributes
    ----------
    brep : bytes
        The solid in its own frame, mm, in Open CASCADE's binary format (BinTools), without triangles.
    face : ndarray (m,)
        Number of the exact face of each triangle of ``mesh``, in the order of Open CASCADE's explorer, from 0.
    errors : ndarray (m,)
        How far each triangle can be from its face, mm; ``error`` is the largest.
    surfaces : Faces
        The faces: kind, frame and sizes of their surfaces, and the triangles on them.
    """

    brep: bytes = b""
    face: IntArray = None  # type: ignore[assignment]
    errors: Array = None  # type: ignore[assignment]
    surfaces: Faces = None  # type: ignore[assignment]

    @classmethod
    def of(cls, solid: Any, name: str, *, chord: float = CHORD) -> BrepSolid:
        """From a TopoDS_Solid. Raises Clamp3dError if it has a face without triangles."""
        return cls.made(name, to_bytes(solid), tessellate(solid, chord))

    @classmethod
    def made(cls, name: str, brep: bytes, triangles: Tessellation, closed: bool | None = None) -> BrepSolid:
        """From its bytes and the triangles that were made of it; finds out if these are ``closed`` unless told."""
        mesh = _mesh(name, triangles, is_closed(triangles.faces) if closed is None else closed)
        error = float(triangles.errors.max())
        return cls(
            mesh,
            "off",
            name,
            error,
            brep=brep,
            face=triangles.face,
            errors=triangles.errors,
            surfaces=triangles.surfaces,
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """All of it as plain arrays, for another process; `from_arrays` makes it again without Open CASCADE."""
        return {
            "brep": np.frombuffer(self.brep, dtype=np.uint8),
            "vertices": self.mesh.vertices,
            "faces": self.mesh.faces,
            "face": self.face,
            "errors": self.errors,
            "closed": np.array(self.mesh.watertight),
            **self.surfaces.to_arrays(),
        }

    @classmethod
    def from_arrays(cls, name: str, arrays: Mapping[str, NDArray[Any]]) -> BrepSolid:
        """From what `to_arrays` gave."""
        faces = Faces.from_arrays(arrays)
        triangles = Tessellation(arrays["vertices"], arrays["faces"], arrays["face"], arrays["errors"], faces)
        return cls.made(name, arrays["brep"].tobytes(), triangles, bool(arrays["closed"]))

    @cached_property
    def solid(self) -> Any:
        """The TopoDS_Shape. Raises MissingLibraryError without Open CASCADE."""
        return from_bytes(self.brep)

    def bounds_at(self, T: Array) -> Array:
        """Lower and upper corner (2, 3) of the bounding box of the exact faces, placed by ``T`` (4, 4)."""
        from OCP.Bnd import Bnd_Box
        from OCP.BRepBndLib import BRepBndLib
        from OCP.gp import gp_Trsf
        from OCP.TopLoc import TopLoc_Location

        place, box = gp_Trsf(), Bnd_Box()
        place.SetValues(*T[:3].ravel().tolist())
        BRepBndLib.AddOptimal_s(self.solid.Moved(TopLoc_Location(place)), box, False, False)
        return np.array([[p.X(), p.Y(), p.Z()] for p in (box.CornerMin(), box.CornerMax())])

    def tessellated(self, chord: float) -> BrepSolid:
        """The same with triangles within ``chord`` mm, or as near as the mesher comes; itself if it is as near."""
        if self.error <= chord:
            return self
        if chord not in self._finer:
            self._finer[chord] = self._tessellated(chord)
        return self._finer[chord]

    @cached_property
    def _finer(self) -> dict[float, BrepSolid]:
        return {}

    def _tessellated(self, chord: float) -> BrepSolid:
        triangles = tessellate(self.solid, chord)
        return self if triangles.errors.max() >= self.error else self.made(self.name, self.brep, triangles)


def require_open_cascade() -> None:
    """Load Open CASCADE and keep it from printing on stdout. Raises MissingLibraryError if it is not installed."""
    try:
        import OCP  # noqa: F401
    except ImportError:
        raise MissingLibraryError("STEP needs Open CASCADE: pip install 'clamp3d[step]'") from None
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    for printer in [*messenger.Printers()]:
        messenger.RemovePrinter(printer)


def to_bytes(shape: Any) -> bytes:
    """A TopoDS_Shape in Open CASCADE's binary format, without triangles."""
    from OCP.BinTools import BinTools, BinTools_FormatVersion

    stream = io.BytesIO()
    version = BinTools_FormatVersion.BinTools_FormatVersion_VERSION_4
    BinTools.Write_s(shape, stream, False, False, version)
    return stream.getvalue()


def from_bytes(brep: bytes) -> Any:
    """The TopoDS_Shape of `to_bytes`. Raises MissingLibraryError without Open CASCADE."""
    require_open_cascade()
    from OCP.BinTools import BinTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    BinTools.Read_s(shape, io.BytesIO(brep))
    return shape


def _mesh(name: str, triangles: Tessellation, closed: bool) -> Mesh:
    V, F = triangles.vertices, triangles.faces
    if not np.isfinite(V).all():
        raise InputError(f"{name}: a vertex is not finite")
    notes = () if closed else ("the triangles of the solid do not close",)
    return Mesh(name, V, F, closed, float(np.abs(V).max()) * 2.0**-50, notes)
