"""Open CASCADE 8: `BRepExtrema_DistShapeShape` on the true B-rep, nothing faceted; the block is loaded once.

The block consists of the faces that the wire can come near, as for the other libraries: a solid has more faces, and is
first tested for corners of the other shape inside it. Neither `Extrema_ExtFlag_MIN` nor `Extrema_ExtAlgo_Tree` is
quicker. The cylinder has no depth. ``axis`` measures the wire's axis, less the radius: exact apart, and in an overlap
as long as the axis is outside the material. ``face`` uses that the groove's face decides, and that the axis is nearest
to it at one of its ends: `GeomAPI_ExtremaCurveCurve` measures their two arcs, without topology.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.scene import BLOCK, GROOVE, PAIR, WIRE
from clamp3d.files.open_cascade import explore, location
from clamp3d.geometry.pose import Array, inverse
from clamp3d.output.step import solid


def distance_less(part: Any, wire: Any, radius: float, *, depth: bool) -> Prepared:
    """The distance of a shape at any pose from another one, less ``radius`` mm."""
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    extrema = BRepExtrema_DistShapeShape()
    extrema.LoadS1(part)

    def one(T: Array) -> float:
        extrema.LoadS2(wire.Moved(location(T)))
        extrema.Perform()
        return float(extrema.Value()) - radius

    return ready(one, 1, depth=depth)


def axis(length: float) -> Any:
    """A wire's axis."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.gp import gp_Pnt

    half = 0.5 * length
    return BRepBuilderAPI_MakeEdge(gp_Pnt(0.0, 0.0, -half), gp_Pnt(0.0, 0.0, half)).Edge()


def cylinder(radius: float, length: float) -> Any:
    """A wire with flat ends."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    axes = gp_Ax2(gp_Pnt(0.0, 0.0, -0.5 * length), gp_Dir(0.0, 0.0, 1.0))
    return BRepPrimAPI_MakeCylinder(axes, radius, length).Shape()


def _near() -> Any:
    """The faces of the groove and beside its mouth."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    def near(face: Any) -> bool:
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() == GeomAbs_SurfaceType.GeomAbs_Cylinder:
            return True
        plane = surface.Plane()
        return abs(plane.Axis().Direction().Y()) > 0.5 and bool(plane.Location().Y() > -GROOVE.radius)

    placed = solid(BLOCK).Moved(location(inverse(PAIR.T_a_groove)))
    return together(filter(near, explore(placed, "FACE")))


def _arcs(_: float) -> Prepared:
    from OCP.Geom import Geom_Circle, Geom_Line
    from OCP.GeomAPI import GeomAPI_ExtremaCurveCurve
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    ahead, ends = gp_Dir(0.0, 0.0, 1.0), (-0.5 * GROOVE.length, 0.5 * GROOVE.length)
    circles = [Geom_Circle(gp_Ax2(gp_Pnt(0.0, 0.0, z), ahead, gp_Dir(1.0, 0.0, 0.0)), GROOVE.radius) for z in ends]
    line, half = Geom_Line(gp_Pnt(0.0, 0.0, 0.0), ahead), 0.5 * WIRE.length
    limits = -half, half, 1.5 * math.pi - GROOVE.half_angle, 1.5 * math.pi + GROOVE.half_angle

    def lowest(circle: Any) -> float:  # a new object each time: after ``Init`` it returns the last answer
        return float(GeomAPI_ExtremaCurveCurve(line, circle, *limits).TotalLowerDistance())

    def one(T: Array) -> float:
        line.SetLocation(gp_Pnt(*T[:3, 3].tolist()))
        line.SetDirection(gp_Dir(*T[:3, 2].tolist()))
        return min(lowest(circles[0]), lowest(circles[1])) - WIRE.radius

    return ready(one, 1, depth=True)


def together(shapes: Iterable[Any]) -> Any:
    """Shapes as one."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


def _series(make: Callable[[float], Prepared]) -> Series:
    needs = ("OCP", "OCP.BRepExtrema", "OCP.BRepPrimAPI", "OCP.GeomAPI")
    return Series(make, "cadquery-ocp-novtk", needs, (None,))


SERIES = {
    "open-cascade": _series(
        lambda _: distance_less(
            _near(), together(explore(cylinder(WIRE.radius, WIRE.length), "FACE")), 0.0, depth=False
        )
    ),
    "open-cascade-axis": _series(lambda _: distance_less(_near(), axis(WIRE.length), WIRE.radius, depth=True)),
    "open-cascade-face": _series(_arcs),
}
