"""Shapes of Open CASCADE: as bytes and back, their sub-shapes, boxes and volumes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from clamp3d.errors import MissingLibraryError
from clamp3d.geometry.mesh import Array


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


@lru_cache(maxsize=512)
def from_bytes(brep: bytes) -> Any:
    """The TopoDS_Shape of `to_bytes`, one for all that ask. Raises MissingLibraryError without Open CASCADE."""
    return parse(brep)


def parse(brep: bytes) -> Any:
    """A new TopoDS_Shape of the bytes. Raises MissingLibraryError without Open CASCADE."""
    require_open_cascade()
    from OCP.BinTools import BinTools
    from OCP.TopoDS import TopoDS_Shape

    shape = TopoDS_Shape()
    BinTools.Read_s(shape, io.BytesIO(brep))
    return shape


def explore(shape: Any, kind: str, outside: str = "SHAPE") -> Iterator[Any]:
    """Sub-shapes of a ``kind`` ("SOLID", "FACE", ...), ``outside`` of those of another, in the explorer's order."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    name = kind.capitalize()
    cast = getattr(TopoDS, f"{name}_s", None) or getattr(TopoDS, name)
    walk = TopExp_Explorer(shape, *(getattr(TopAbs_ShapeEnum, f"TopAbs_{k}") for k in (kind, outside)))
    while walk.More():
        yield cast(walk.Current())
        walk.Next()


def bounds_of(shape: Any) -> Array:
    """Lower and upper corner (2, 3) of a box that holds a TopoDS_Shape, mm."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.array([box.CornerMin().Coord(), box.CornerMax().Coord()])


def volume_of(shape: Any) -> float:
    """Volume of a TopoDS_Shape, mm^3; negative if it is wound inward."""
    return _integral(shape, "VolumeProperties_s")


def area_of(shape: Any) -> float:
    """Area of the faces of a TopoDS_Shape, mm^2."""
    return _integral(shape, "SurfaceProperties_s")


def _integral(shape: Any, function: str) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    getattr(BRepGProp, function)(shape, properties)
    return float(properties.Mass())


def bounds_at(brep: bytes, T: Array) -> Array:
    """Box (2, 3) along the target's axes of a solid placed by ``T`` (4, 4), mm."""
    return bounds_of(moved(from_bytes(brep), T))


def moved(shape: Any, T: Array) -> Any:
    """A TopoDS_Shape placed by ``T`` (4, 4)."""
    return shape.Moved(location(T))


def location(T: Array) -> Any:
    """A pose (4, 4) in mm as a TopLoc_Location."""
    from OCP.gp import gp_Trsf
    from OCP.TopLoc import TopLoc_Location

    place = gp_Trsf()
    place.SetValues(*np.asarray(T)[:3].ravel().tolist())
    return TopLoc_Location(place)
