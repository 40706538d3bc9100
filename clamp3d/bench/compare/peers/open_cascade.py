"""Open CASCADE 8: `BRepExtrema_DistShapeShape` on the true B-rep, nothing faceted; the block is loaded once.

``solid`` asks two solids and has no depth. ``axis`` asks the wire's axis, less the radius, against the block's shell
of faces: exact apart and in an overlap as long as the axis is outside the material. ``face`` knows that the groove's
face decides, and asks it alone.
"""

from __future__ import annotations

from typing import Any

from clamp3d.bench.compare.methods import Prepared, Series, ready
from clamp3d.bench.compare.scene import WIRE, block, pair
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


def _face(_: float) -> Prepared:
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    for face in explore(_block(), "FACE"):
        if BRepAdaptor_Surface(face).GetType() == GeomAbs_SurfaceType.GeomAbs_Cylinder:
            return asked(face, axis(WIRE.length), WIRE.radius, depth=True)
    raise AssertionError("the block has no round face")


_NEEDS = ("OCP", "OCP.BRepExtrema", "OCP.BRepPrimAPI")
SERIES = {
    "open-cascade": Series(
        lambda _: asked(_block(), cylinder(WIRE.radius, WIRE.length), 0.0, depth=False),
        "cadquery-ocp-novtk",
        _NEEDS,
        (None,),
    ),
    "open-cascade-axis": Series(
        lambda _: asked(_block(), axis(WIRE.length), WIRE.radius, depth=True), "cadquery-ocp-novtk", _NEEDS, (None,)
    ),
    "open-cascade-face": Series(_face, "cadquery-ocp-novtk", _NEEDS, (None,)),
}
