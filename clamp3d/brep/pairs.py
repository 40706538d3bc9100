"""What Open CASCADE says of two solids: their distance, their common part, and how deep points lie in one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clamp3d.brep.faces import PLANE, surface_of
from clamp3d.brep.open_cascade import area_of, bounds_of, explore, from_bytes, moved, volume_of
from clamp3d.brep.tessellation import ANGLE, triangles_of
from clamp3d.core.mesh import Array
from clamp3d.errors import Clamp3dError

TOLERANCE = 1e-6
"""Accuracy (mm) taken for an answer by Open CASCADE, ten times its own confusion of points (1e-7)."""

_SLENDER = 400.0
"""Ratio of a common part's size to its thickness beyond which its chords go by the size: else they take seconds."""


@dataclass(frozen=True, slots=True, eq=False)
class CommonPart:
    """What two solids share: ``volume`` (mm^3), ``area`` (mm^2) and ``box`` (2, 3); nothing if the volume is 0.

    ``points`` (n, 3) lie on its border, of which triangles between them are within ``chord`` mm; ``flat`` (m, 3, 3) are
    those of its plane faces.
    """

    volume: float
    area: float
    box: Array
    points: Array
    flat: Array
    chord: float


def distance(a: bytes, b: bytes, T: Array) -> tuple[float, Array, Array]:
    """Distance (mm) of ``b`` at ``T`` (4, 4) in a's frame, and nearest points (3,); 0 where they touch or overlap.

    Raises Clamp3dError if Open CASCADE finds none.
    """
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    search = BRepExtrema_DistShapeShape(from_bytes(a), moved(from_bytes(b), T))
    if not search.IsDone() or search.NbSolution() < 1:
        raise Clamp3dError("Open CASCADE finds no distance of the two solids")
    p, q = (np.array(x.Coord()) for x in (search.PointOnShape1(1), search.PointOnShape2(1)))
    return float(search.Value()), p, q


def common(a: bytes, b: bytes, T: Array, share: float) -> CommonPart:
    """The common part of ``a`` and of ``b`` at ``T`` (4, 4).

    The chord is ``share`` of the part's thickness, volume over area, or of its size divided by `_SLENDER`.
    Raises Clamp3dError if Open CASCADE cannot make it.
    """
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    made = BRepAlgoAPI_Common(from_bytes(a), moved(from_bytes(b), T))
    if not made.IsDone():
        raise Clamp3dError("Open CASCADE cannot make the common part of the two solids")
    shape = made.Shape()
    if next(explore(shape, "SOLID"), None) is None:
        return CommonPart(0.0, 0.0, np.zeros((2, 3)), np.empty((0, 3)), np.empty((0, 3, 3)), 0.0)
    volume, area = abs(volume_of(shape)), area_of(shape)
    box = bounds_of(shape)
    chord = max(share * volume / max(area, 1e-300), share / _SLENDER * float(np.linalg.norm(box[1] - box[0])))
    BRepMesh_IncrementalMesh(shape, chord, False, ANGLE, False)
    points, flat = [np.empty((0, 3))], [np.empty((0, 3, 3))]
    for k, face in enumerate(explore(shape, "FACE")):
        P, triangles, _ = triangles_of(face, k)
        points.append(P)
        if surface_of(face)[0] == PLANE:
            flat.append(P[triangles])
    return CommonPart(volume, area, box, np.concatenate(points), np.concatenate(flat), chord)


def depths(brep: bytes, points: Array) -> Array:
    """Distance (k,) mm of points (k, 3) from the surface of a solid."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt

    shells = [*explore(from_bytes(brep), "SHELL")]
    nearest = np.full(len(points), np.inf)
    for k, point in enumerate(points.tolist()):
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
        for shell in shells:
            nearest[k] = min(nearest[k], BRepExtrema_DistShapeShape(shell, vertex).Value())
    return nearest
