"""STEP files as triangles: the B-rep tessellated on the way in. Needs the extra ``step`` (cadquery-ocp-novtk)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.errors import InputError, MissingLibraryError

CHORD_ERROR = 0.02
"""Largest distance (mm) between a surface and its triangles; their corners lie on the surface."""
_ANGLE = 0.2  # rad: small fillets get facets enough to be known as round


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


def read_step(file: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) in mm and faces (m, 3) of all shapes in a STEP file.

    Raises MissingLibraryError without the extra ``step``, InputError if the file is no STEP file or has no surface.
    """
    require_open_cascade()
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    reader = STEPControl_Reader()
    if reader.ReadFile(str(file)) != IFSelect_ReturnStatus.IFSelect_RetDone or reader.TransferRoots() == 0:
        raise InputError(f"{file}: not a readable STEP file")
    shape: Any = reader.OneShape()
    BRepMesh_IncrementalMesh(shape, CHORD_ERROR, False, _ANGLE, True)
    to_face = getattr(TopoDS, "Face_s", None) or TopoDS.Face
    vertices: list[tuple[float, float, float]] = []
    faces: list[tuple[int, int, int]] = []
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        face = to_face(explorer.Current())
        explorer.Next()
        place = TopLoc_Location()
        triangles = BRep_Tool.Triangulation_s(face, place)
        if triangles is None:
            continue
        start, move = len(vertices) - 1, place.Transformation()  # OCCT counts from 1
        for i in range(1, triangles.NbNodes() + 1):
            p = triangles.Node(i).Transformed(move)
            vertices.append((p.X(), p.Y(), p.Z()))
        turned = face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED
        for i in range(1, triangles.NbTriangles() + 1):
            a, b, c = triangles.Triangle(i).Get()
            faces.append((start + a, start + c, start + b) if turned else (start + a, start + b, start + c))
    if not faces:
        raise InputError(f"{file}: no surface in the file")
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64)
