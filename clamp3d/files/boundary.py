"""The surface of a solid by Open CASCADE: how far a point is from it, and on which side."""

from __future__ import annotations

from enum import Enum, auto
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from clamp3d.errors import Clamp3dError
from clamp3d.files.open_cascade import TOLERANCE, bounds_of, explore, occ
from clamp3d.geometry.pose import Array

_BEYOND = 0.05
"""How far (mm) beyond a surface it is asked for the side once more, at most: walls and slots are mostly wider."""

_AROUND_POLE = 0.1
"""Of a solid's size: how far from a pole of its faces Open CASCADE's nearest points were seen to be off, and more."""
_BESIDE_FOOT = 0.01
"""Of a spline's range of parameters: how far beside a foot a nearer one is looked for first."""


class Side(Enum):
    """On which side of a solid's surface a point lies."""

    INSIDE = auto()
    OUTSIDE = auto()
    UNKNOWN = auto()


class Foot(NamedTuple):
    """The point (3,) of a surface that is nearest to another one, and its distance (mm).

    ``normal`` (3,) points out of the solid; None where the foot is on an edge or a corner.
    """

    distance: float
    point: Array
    normal: Array | None


class Boundary:
    """The shells of a solid, a TopoDS_Shape, loaded once for many points."""

    def __init__(self, solid: Any) -> None:
        self._solid = solid
        self._searches = []
        for shell in explore(solid, "SHELL"):
            search = occ.BRepExtrema_DistShapeShape()
            search.LoadS1(shell)
            self._searches.append(search)

    def foot(self, point: Array) -> Foot:
        """What of the surface is nearest to a point (3,). Raises Clamp3dError if Open CASCADE finds nothing."""
        vertex = occ.BRepBuilderAPI_MakeVertex(occ.gp_Pnt(*point.tolist())).Vertex()
        for search in self._searches:
            search.LoadS2(vertex)
            if not search.Perform() or search.NbSolution() < 1:
                raise Clamp3dError("Open CASCADE finds no distance of a point from the solid")
        nearest = min(self._searches, key=lambda search: search.Value())
        in_face = occ.BRepExtrema_SupportType.BRepExtrema_IsInFace
        every = range(1, nearest.NbSolution() + 1)
        k = next((k for k in every if nearest.SupportTypeShape1(k) == in_face), 0)
        foot = Foot(float(nearest.Value()), np.array(nearest.PointOnShape1(k or 1).Coord()), None)
        return self._in_face(foot, point, nearest, k) if k else foot

    def _in_face(self, foot: Foot, point: Array, search: Any, number: int) -> Foot:
        """The foot of a point (3,) that a solution is, with its normal; polished near a pole of a spline."""
        face, uv = next(explore(search.SupportOnShape1(number), "FACE")), np.array(search.ParOnFaceS1(number))
        surface = occ.BRepAdaptor_Surface(face)
        if surface.GetType() == occ.GeomAbs_SurfaceType.GeomAbs_BSplineSurface and self.is_near_pole(foot.point):
            nearer = _nearest_parameters(surface, uv, point)
            place = np.array(surface.Value(*nearer.tolist()).Coord())
            if (distance := float(np.linalg.norm(place - point))) < foot.distance:
                foot, uv = Foot(distance, place, None), nearer
        middle, normal = occ.gp_Pnt(), occ.gp_Vec()
        occ.BRepGProp_Face(face).Normal(*uv.tolist(), middle, normal)
        size = normal.Magnitude()
        return foot._replace(normal=np.array(normal.Coord()) / size) if size > 1e-9 else foot

    def is_near_pole(self, point: Array) -> bool:
        """Whether a point (3,) is near one where all parameters of a face meet: it has a degenerate edge there."""
        return bool((np.linalg.norm(self._poles - point, axis=1) <= _AROUND_POLE * self._size).any())

    @cached_property
    def _poles(self) -> Array:
        edges = (edge for edge in explore(self._solid, "EDGE") if occ.BRep_Tool.Degenerated_s(edge))
        ends = [occ.BRep_Tool.Pnt_s(next(explore(edge, "VERTEX"))).Coord() for edge in edges]
        return np.array(ends).reshape(-1, 3)

    @cached_property
    def _size(self) -> float:
        return float(np.linalg.norm(np.ptp(bounds_of(self._solid, quick=True), axis=0)))

    def side(self, point: Array) -> tuple[Side, Foot]:
        """On which side a point (3,) lies, and its foot.

        Lemma: nothing of the surface is between a point and its foot, so where that is in a face the side follows from
        its normal. On edges the classifier decides. Near splines that is wrong now and then: what is beyond the foot is
        on the other side, and if both are said to be on one side, the side is unknown.
        """
        foot = self.foot(point)
        if foot.normal is not None:
            return (Side.OUTSIDE if float((point - foot.point) @ foot.normal) >= 0.0 else Side.INSIDE), foot
        beyond = foot.point + min(1.0, _BEYOND / max(foot.distance, TOLERANCE)) * (foot.point - point)
        side = Side.OUTSIDE if self._is_outside(point) else Side.INSIDE
        return (Side.UNKNOWN if self._is_outside(beyond) is (side is Side.OUTSIDE) else side), foot

    def _is_outside(self, point: Array) -> bool:
        self._classifier.Perform(occ.gp_Pnt(*point.tolist()), TOLERANCE)
        return bool(self._classifier.State() == occ.TopAbs_State.TopAbs_OUT)

    @cached_property
    def _classifier(self) -> Any:
        return occ.BRepClass3d_SolidClassifier(self._solid)


def _nearest_parameters(surface: Any, uv: Array, point: Array) -> Array:
    """Parameters (2,) of what of a BRepAdaptor_Surface is nearest to a point (3,), near ``uv`` (2,).

    Near a pole those that Open CASCADE finds are off by up to a hundredth.
    """
    from scipy.optimize import minimize

    def distance(at: Array) -> float:
        return float(np.linalg.norm(np.array(surface.Value(*at.tolist()).Coord()) - point))

    spans = np.array([[getattr(surface, f"{end}{along}Parameter")() for end in ("First", "Last")] for along in "UV"])
    steps = _BESIDE_FOOT * (spans[:, 1] - spans[:, 0])
    steps[uv + steps > spans[:, 1]] *= -1.0
    how = {"initial_simplex": [uv, uv + steps * (1.0, 0.0), uv + steps * (0.0, 1.0)], "xatol": 1e-9, "fatol": 1e-13}
    return np.asarray(minimize(distance, uv, method="Nelder-Mead", bounds=spans, options=how).x)
