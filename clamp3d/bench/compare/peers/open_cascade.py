"""Open CASCADE 8: `BRepExtrema_DistShapeShape` on the true B-rep, nothing faceted; the block is loaded once.

Of the block it is given the faces that the wire can come near, as the others are: a solid has more of them, and is
asked first whether it holds a corner of the other. Neither `Extrema_ExtFlag_MIN` nor `Extrema_ExtAlgo_Tree` is quicker.
The cylinder has no depth. ``axis`` asks the wire's axis, less the radius: exact apart and in an overlap as long as the
axis is outside the material. ``face`` knows that the groove's face decides, and that the axis is nearest to it at one
of its ends: it asks their two arcs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.scene import GROOVE, WIRE, block, pair
from clamp3d.brep.tessellate import explore
from clamp3d.core.pose import Array, inverse
from clamp3d.output.step import location, solid


def asked(part: Any, wire: Any, radius: float, *, depth: bool) -> Prepared:
    """The distance of a shape at any pose from another one, less ``radius`` mm."""
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    extrema = BRepExtrema_DistShapeShape()
    extrema.LoadS1(part)

    def one(T: Array) -> float:
        extrema.LoadS2(wire.Moved(location(T)))
        extrema.Perform()
        return float(extrema.Value()) - radius

    return ready(one, 1, depth=depth)


def _block() -> Any:
    return solid(block()).Moved(location(inverse(pair().T_a_groove)))


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


def _near() -> list[Any]:
    """The faces of the groove and beside its mouth, the groove's first."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    round_, flat = [], []
    for face in explore(_block(), "FACE"):
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() == GeomAbs_SurfaceType.GeomAbs_Cylinder:
            round_.append(face)
        elif abs(surface.Plane().Axis().Direction().Y()) > 0.5 and surface.Plane().Location().Y() > -GROOVE.radius:
            flat.append(face)
    return round_ + flat


def _arcs() -> list[Any]:
    """The groove's two arcs."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_CurveType

    edges = explore(_near()[0], "EDGE")
    return [edge for edge in edges if BRepAdaptor_Curve(edge).GetType() == GeomAbs_CurveType.GeomAbs_Circle]


def _together(shapes: Iterable[Any]) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, made = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(made)
    for shape in shapes:
        builder.Add(made, shape)
    return made


def _series(block: Callable[[], list[Any]], wire: Callable[[], Any], radius: float, *, depth: bool) -> Series:
    needs = ("OCP", "OCP.BRepExtrema", "OCP.BRepPrimAPI")
    return Series(
        lambda _: asked(_together(block()), wire(), radius, depth=depth), "cadquery-ocp-novtk", needs, (None,)
    )


SERIES = {
    "open-cascade": _series(
        _near, lambda: _together(explore(cylinder(WIRE.radius, WIRE.length), "FACE")), 0.0, depth=False
    ),
    "open-cascade-axis": _series(_near, lambda: axis(WIRE.length), WIRE.radius, depth=True),
    "open-cascade-face": _series(_arcs, lambda: axis(WIRE.length), WIRE.radius, depth=True),
}
