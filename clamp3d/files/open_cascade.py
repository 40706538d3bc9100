"""Shapes of Open CASCADE: as bytes and back, their sub-shapes, boxes and volumes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from clamp3d.errors import MissingLibraryError
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array

TOLERANCE = 1e-6
"""Accuracy (mm) taken for an answer by Open CASCADE, ten times its own confusion of points (1e-7)."""
_WIDENED = 2e-7
"""Open CASCADE's larger box (mm) of a flat face is larger by its confusion of points; rounded up."""
_ADAPTIVE = 1e-6
"""Relative accuracy (1) that an adaptive integration is asked for."""


class _OpenCascade:
    """The classes of Open CASCADE as attributes; the first that is asked for loads it."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        module = getattr(require_open_cascade(), name.partition("_")[0])  # gp_Pnt is in the module gp
        setattr(self, name, getattr(module, name))
        return vars(self)[name]


occ: Any = _OpenCascade()
"""`occ.gp_Pnt` and all others. Raises MissingLibraryError if Open CASCADE is not installed."""


def require_open_cascade() -> Any:
    """Open CASCADE, kept from printing on stdout. Raises MissingLibraryError if it is not installed."""
    try:
        import OCP
    except ImportError:
        raise MissingLibraryError("STEP needs Open CASCADE: pip install 'clamp3d[step]'") from None
    messenger = OCP.Message.Message.DefaultMessenger_s()
    for printer in [*messenger.Printers()]:
        messenger.RemovePrinter(printer)
    return OCP


def to_bytes(shape: Any) -> bytes:
    """A TopoDS_Shape in Open CASCADE's binary format, without triangles."""
    stream = io.BytesIO()
    version = occ.BinTools_FormatVersion.BinTools_FormatVersion_VERSION_4
    occ.BinTools.Write_s(shape, stream, False, False, version)
    return stream.getvalue()


def parse(brep: bytes) -> Any:
    """A new TopoDS_Shape of the bytes. Raises MissingLibraryError without Open CASCADE."""
    shape = occ.TopoDS_Shape()
    occ.BinTools.Read_s(shape, io.BytesIO(brep))
    return shape


from_bytes = lru_cache(maxsize=512)(parse)
"""The TopoDS_Shape of `to_bytes`, one for all that ask. Raises MissingLibraryError without Open CASCADE."""


def explore(shape: Any, kind: str, outside: str = "SHAPE") -> Iterator[Any]:
    """Sub-shapes of a ``kind`` ("SOLID", "FACE", ...), ``outside`` of those of another, in the explorer's order."""
    name = kind.capitalize()
    cast = getattr(occ.TopoDS, f"{name}_s", None) or getattr(occ.TopoDS, name)
    walk = occ.TopExp_Explorer(shape, *(getattr(occ.TopAbs_ShapeEnum, f"TopAbs_{k}") for k in (kind, outside)))
    while walk.More():
        yield cast(walk.Current())
        walk.Next()


def faces_of(shape: Any, numbers: IntArray | None = None) -> Any:
    """The faces, or those with these numbers (k,) in the explorer's order, as one TopoDS_Shape without an inside."""
    faces, builder, kept = list(explore(shape, "FACE")), occ.BRep_Builder(), occ.TopoDS_Compound()
    builder.MakeCompound(kept)
    for number in range(len(faces)) if numbers is None else numbers.tolist():
        builder.Add(kept, faces[number])
    return kept


def corners_of(shape: Any) -> Array:
    """The corners (k, 3) of a TopoDS_Shape, mm."""
    return np.array([occ.BRep_Tool.Pnt_s(corner).Coord() for corner in explore(shape, "VERTEX")]).reshape(-1, 3)


def bounds_of(shape: Any, *, quick: bool = False) -> Array:
    """Lower and upper corner (2, 3) of a box that holds the faces of a TopoDS_Shape, mm; a larger one if ``quick``.

    Open CASCADE takes long for close boxes of splines: faces are asked for theirs that may reach further than others.
    """
    if quick:
        return _box(shape, "Add_s", False)
    corners = corners_of(shape)
    if not len(corners):
        return _box(shape, "AddOptimal_s", False, False)
    bounds, outward = np.array([corners.min(axis=0), corners.max(axis=0)]), np.array([[-1.0], [1.0]])
    faces = [(bounds_of(face, quick=True), face) for face in explore(shape, "FACE")]
    for wide, face in sorted(faces, key=lambda pair: -(outward * (pair[0] - bounds)).max()):
        if (outward * (wide - bounds) > _WIDENED).any():
            bounds = outward * np.maximum(outward * bounds, outward * _box(face, "AddOptimal_s", False, False))
    return bounds


def _box(shape: Any, function: str, *how: bool) -> Array:
    box = occ.Bnd_Box()
    getattr(occ.BRepBndLib, function)(shape, box, *how)
    return np.array([box.CornerMin().Coord(), box.CornerMax().Coord()])


def volume_of(shape: Any) -> float:
    """Volume of a TopoDS_Shape, mm^3; negative if it is wound inward."""
    return _integral(shape, "VolumeProperties_s")


def volumes_of(shape: Any) -> tuple[float, float]:
    """Volume of a TopoDS_Shape (mm^3, at least 0) by two integrations, the smaller first.

    Either can be off by several percent on free-form and swept faces, and neither says when: if they differ, the volume
    lies between them in all cases seen.
    """
    low, high = sorted((abs(volume_of(shape)), abs(_integral(shape, "VolumeProperties_s", _ADAPTIVE))))
    return low, high


def area_of(shape: Any, *, adaptive: bool = False) -> float:
    """Area of the faces of a TopoDS_Shape, mm^2; within splines it can be 1e-4 off, unless it is ``adaptive``."""
    return _integral(shape, "SurfaceProperties_s", *[_ADAPTIVE] * adaptive)


def _integral(shape: Any, function: str, *accuracy: float) -> float:
    properties = occ.GProp_GProps()
    getattr(occ.BRepGProp, function)(shape, properties, *accuracy)
    return float(properties.Mass())


def bounds_at(brep: bytes, T: Array) -> Array:
    """Box (2, 3) along the target's axes of a solid placed by ``T`` (4, 4), mm."""
    return bounds_of(moved(from_bytes(brep), T))


def face_bounds_at(brep: bytes, T: Array, numbers: IntArray) -> Array:
    """Boxes (k, 2, 3) along the target's axes of the faces numbered (k,) of a solid placed by ``T`` (4, 4), mm."""
    faces = [*explore(moved(from_bytes(brep), T), "FACE")]
    return np.array([bounds_of(faces[k]) for k in numbers.tolist()]).reshape(-1, 2, 3)


def moved(shape: Any, T: Array) -> Any:
    """A TopoDS_Shape placed by ``T`` (4, 4)."""
    return shape.Moved(location(T))


def matrix(location: Any) -> Array:
    """A TopLoc_Location as a pose (4, 4), mm."""
    move = location.Transformation()
    T = np.eye(4)
    T[:3] = [[move.Value(r, c) for c in (1, 2, 3, 4)] for r in (1, 2, 3)]
    return T


def location(T: Array) -> Any:
    """A pose (4, 4) in mm as a TopLoc_Location."""
    place = occ.gp_Trsf()
    place.SetValues(*np.asarray(T)[:3].ravel().tolist())
    return occ.TopLoc_Location(place)
