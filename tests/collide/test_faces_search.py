"""A search that is taken up again, and a depth found past the deepest of a few points."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import ball, box, cut, fuse, moved, ring, rod, solid_of, truth
from OCP.BRep import BRep_Builder
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.Geom import Geom_Circle, Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_CurveType, GeomAbs_Shape
from OCP.GeomConvert import GeomConvert_ApproxCurve
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pnt, gp_Vec

from clamp3d import Scene, check
from clamp3d.brep.solid import BrepSolid
from clamp3d.brep.tessellate import explore
from clamp3d.collide.answer import Distance
from clamp3d.collide.faces import FaceModel, faces_distance
from clamp3d.collide.faces_depth import faces_depth
from clamp3d.collide.faces_search import FEW, Search
from clamp3d.core.pose import translation


def model(shape):
    return FaceModel(BrepSolid.of(solid_of(shape), "solid"))


@pytest.mark.parametrize("steps", [(1, 3, 20, 2000), (FEW, 2000), (2000,)])
def test_a_search_in_steps_never_loses_what_it_knows(steps):
    a, b, T = model(ring(5, 1)), model(ball(2)), translation(0.3, -0.2, 0.4)
    search = Search(a, b, T, 0.01, 0.0, 1e-3, 2000)
    found = [search.more(step) for step in steps]
    lower, upper = [x.lower for x in found], [x.upper for x in found]
    assert lower == sorted(lower)
    assert upper == sorted(upper, reverse=True)
    assert search.done
    assert upper[-1] - lower[-1] <= 1e-3
    exact = np.hypot(5 - np.hypot(0.3, 0.2), 0.4) - 3
    assert lower[-1] - 1e-9 <= exact <= upper[-1] + 1e-9
    whole = Search(a, b, T, 0.01, 0.0, 1e-3, 2000).more(2000)
    assert max(lower[-1], whole.lower) <= min(upper[-1], whole.upper)
    assert found[-1].point_a is not None


def test_what_the_other_way_found_takes_no_points_from_the_answer():
    a, b = model(ring(5, 1)), model(ball(2))
    search = Search(a, b, np.eye(4), 0.01, 0.0, 1e-3, 2000)
    first = search.more(FEW)
    again = search.more(2000, upper=first.upper)
    assert again.point_a is not None
    assert search.more(2000, upper=again.upper - 1.0).point_a is None


def test_no_point_is_deeper_than_the_way_that_parts_them_is_long():
    a, b = model(box((0, 0, 0), (10, 10, 10))), model(rod(2, 9.9, 15))
    T = translation(5, 5, 0)
    known = faces_distance(a, b, T, contact=0.01)
    assert isinstance(known, Distance)
    assert known.upper < -0.01
    found = faces_depth(a, b, T, known)
    low, high = found.interference
    assert found.lower <= -0.1 <= found.upper
    assert found.upper - found.lower <= 1.1e-3
    assert low <= 0.1 <= high <= -found.lower + 1e-12


def halves(radius, low, high):
    """A rod whose round side is drawn as two faces."""
    circle, wire = gp_Circ(gp_Ax2(gp_Pnt(0, 0, low), gp_Dir(0, 0, 1)), radius), BRepBuilderAPI_MakeWire()
    for k in range(2):
        wire.Add(BRepBuilderAPI_MakeEdge(circle, k * np.pi, (k + 1) * np.pi).Edge())
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire.Wire()).Face(), gp_Vec(0, 0, high - low)).Shape()


def with_spline_edges(shape):
    """The solid with cubic splines, up to 3e-5 mm off, for its circles: its round faces are known that well only."""
    for edge in explore(shape, "EDGE"):
        curve = BRepAdaptor_Curve(edge)
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_Circle:
            arc = Geom_TrimmedCurve(Geom_Circle(curve.Circle()), curve.FirstParameter(), curve.LastParameter())
            near = GeomConvert_ApproxCurve(arc, 3e-5, GeomAbs_Shape.GeomAbs_C2, 20, 3).Curve()
            BRep_Builder().UpdateEdge(edge, near, 1e-4)
    return solid_of(shape)


def test_a_bound_that_stands_still_for_long_is_no_end_of_the_search():
    """A bolt that fills a bracket's hole, with its head on the bracket: all faces touch, none of them is free-form.

    For some thousand pieces the bound is half the shank's radius, and then the contact is certain.
    """
    hole = moved(halves(5, -4, 14), translation(20, 50, 0))
    bracket = with_spline_edges(solid_of(cut(box((0, 0, 0), (50, 100, 60)), box((10, -1, 10), (51, 101, 61)), hole)))
    bolt = with_spline_edges(solid_of(moved(fuse(halves(7.5, -3, 0), halves(5, 0, 34)), translation(20, 50, 0))))
    scene = Scene().add("bracket", BrepSolid.of(bracket, "bracket")).add("bolt", BrepSolid.of(bolt, "bolt"))
    assert truth(bracket, bolt).verdict() == "contact"
    found = check(scene).pairs[0]
    assert found.verdict.value == "contact"
    assert -0.01 <= found.distance.lower <= 0.0 <= found.distance.upper < 1e-4
