"""How far the edges of a face bulge: the closed form for circles around an axis beside samples of others."""

import math

import numpy as np
import pytest

pytest.importorskip("OCP")

from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pnt

from clamp3d.brep.borders import Curve, _sags
from clamp3d.brep.surfaces import CONE, CYLINDER, SPHERE, TORUS, from_sides

FRAME = np.array([[1.0, -2.0, 3.0], *np.eye(3)])
SIZES = {CYLINDER: (5.0, 0.0), CONE: (4.0, math.atan(0.5)), SPHERE: (math.sqrt(29.0), 0.0), TORUS: (5.0, 2.0)}
"""Surfaces that the circle of radius 5 is on, 2 above their origin."""


def sags(kind, out=0.0, aside=0.0, axis=(0.0, 0.0, 1.0)):
    """Of twelve pieces of that circle, larger, moved or tilted: what is said, and what many points of it show."""
    circle = gp_Circ(gp_Ax2(gp_Pnt(1.0 + aside, -2.0, 5.0), gp_Dir(*axis)), 5.0 + out)
    curve = BRepAdaptor_Curve(BRepBuilderAPI_MakeEdge(circle).Edge())
    t = np.linspace(0.0, 2.0 * math.pi, 13)
    ends = np.array([curve.Value(x).Coord() for x in t.tolist()])
    seen = np.zeros(12)
    for share in np.linspace(0.0, 1.0, 21):
        true = np.array([curve.Value(x).Coord() for x in ((1.0 - share) * t[:-1] + share * t[1:]).tolist()])
        seen = np.maximum(seen, from_sides(kind, FRAME, SIZES[kind], ends[:-1], ends[1:], true))
    return _sags(Curve(curve), t, ends, kind, FRAME, SIZES[kind]), seen


@pytest.mark.parametrize("kind", SIZES)
def test_a_circle_around_the_axis_is_straight_in_parameters(kind):
    assert sags(kind)[0].tolist() == [0.0] * 12
    said, seen = sags(kind, out=1e-4)
    assert (said >= seen).all()
    assert (said <= 2.0 * seen + 1e-12).all()


@pytest.mark.parametrize("kind", SIZES)
@pytest.mark.parametrize("other", [{"aside": 1e-6}, {"axis": (1e-6, 0.0, 1.0)}, {"axis": (0.6, 0.0, 0.8)}])
def test_another_circle_is_not(kind, other):
    said, seen = sags(kind, **other)
    assert seen.max() > 1e-8
    assert (said >= 0.999 * seen).all()
