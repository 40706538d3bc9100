"""How many triangles the faces of a solid get, and how near to them these are."""

import numpy as np
import pytest

pytest.importorskip("OCP")

from assemblies import ball, box, cut, ring, rod, solid_of
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
from OCP.BRepBuilderAPI import BRepBuilderAPI_GTransform, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_GTrsf, gp_Mat, gp_Pnt, gp_Vec, gp_XYZ

from clamp3d.brep import facets
from clamp3d.brep.borders import BORDER
from clamp3d.brep.facets import FREE
from clamp3d.brep.solid import CHORD
from clamp3d.brep.surfaces import OTHER, surface_of
from clamp3d.brep.tessellate import explore, tessellate
from clamp3d.core.mesh import is_closed
from clamp3d.core.triangles import closest_points


def test_known_surfaces_take_few_triangles():
    seal = tessellate(solid_of(ring(150, 5)), 0.1)
    assert len(seal.faces) < 20_000  # 62 000 for a chord of 0.02 mm
    assert seal.errors.max() <= 0.2


def test_free_form_faces_are_within_their_own_chord():
    stretched = gp_GTrsf(gp_Mat(1.0, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.5), gp_XYZ(0.0, 0.0, 0.0))
    egg = BRepBuilderAPI_GTransform(ball(20), stretched, True).Shape()
    made = tessellate(solid_of(BRepAlgoAPI_Common(egg, box((-30, -4, -4), (-10, 4, 4))).Shape()), CHORD).surfaces
    of_egg = made.kind[made.face] == OTHER
    assert 0.0 < made.error[of_egg].max() <= FREE


@pytest.mark.parametrize("holes", [[(2, 26), (4, 24)], [(-55, -14), (-56, -4), (-34, 5), (-55, -16)]])
def test_arcs_beside_slim_triangles_are_split_too(holes):
    plate = cut(box((-75, -33, 0), (75, 33, 8)), *(rod(3.25, -1, 9, at) for at in holes))
    assert tessellate(solid_of(plate), CHORD).surfaces.sag.max() <= 2.0 * BORDER


@pytest.mark.parametrize("angle", [360.0, 200.0])
def test_triangles_of_a_turned_spline_are_as_near_as_they_say(angle, monkeypatch):
    drawn = pytest.importorskip("build123d")
    meridian = drawn.Spline((9, 0, 0), (8.5, 0, 2), (6, 0, 4), (3, 0, 4.6), (1, 0, 5))
    rest = drawn.Polyline((1, 0, 5), (1, 0, 0), (9, 0, 0))
    monkeypatch.setattr(facets, "_sampled", None)  # a closed form, no samples
    knob = drawn.revolve(drawn.make_face([meridian, rest]), drawn.Axis.Z, angle).solid().wrapped
    made, faces = tessellate(knob, CHORD).surfaces, list(explore(knob, "FACE"))
    rows = np.flatnonzero(made.kind[made.face] == OTHER)
    assert len(rows) > 100
    shares = []
    for i in rows[:: len(rows) // 40]:
        for weights in ((1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)):
            middle = gp_Pnt(*(np.array(weights) @ made.corners[i] / sum(weights)).tolist())
            vertex = BRepBuilderAPI_MakeVertex(middle).Vertex()
            shares.append(BRepExtrema_DistShapeShape(faces[made.face[i]], vertex).Value() / made.error[i])
    assert 0.2 < max(shares) <= 1.0


def sheet(n, bump, at, radius=1e6):
    """A cubic sheet of 20 x 20 mm, ``n`` x ``n`` poles on a cylinder but for one; its face, and its point there."""
    arrays = pytest.importorskip("OCP.collections")
    knots = np.linspace(0.0, 1.0, n - 2)
    full = np.concatenate([[0.0] * 3, knots, [1.0] * 3])
    mean = np.mean([full[k : k + n] for k in (1, 2, 3)], axis=0)
    poles, K, M = arrays.Array2_gp_Pnt(1, n, 1, n), arrays.Array1_double(1, n - 2), arrays.Array1_int(1, n - 2)
    for k, knot in enumerate(knots.tolist(), start=1):
        K.SetValue(k, knot)
        M.SetValue(k, 4 if k in (1, n - 2) else 1)
    for i, u in enumerate((20.0 * mean - 10.0).tolist()):
        for j, v in enumerate((20.0 * mean - 10.0).tolist()):
            r = radius + (bump if (i, j) == at else 0.0)
            poles.SetValue(i + 1, j + 1, gp_Pnt(r * np.sin(u / radius), v, r * np.cos(u / radius) - radius))
    surface = Geom_BSplineSurface(poles, K, K, M, M, 3, 3)
    top = surface.Value(float(mean[at[0]]), float(mean[at[1]]))
    return BRepBuilderAPI_MakeFace(surface, 1e-6).Face(), np.array(top.Coord())


def test_bumps_between_the_nodes_of_the_mesher_are_seen():
    face, top = sheet(40, 0.3, (13, 22))
    assert top[2] > 0.13
    made = tessellate(face, CHORD).surfaces
    off = np.linalg.norm(closest_points(made.corners, np.tile(top, (len(made.corners), 1))) - top, axis=1)
    assert (off <= made.error).any()
    assert made.error.max() < FREE


def test_a_spline_with_a_bump_is_no_cylinder():
    kind, _, _, deviation = surface_of(sheet(100, 0.3, (20, 20), 10.0)[0])  # Open CASCADE: one within 0.0007 mm
    assert kind == OTHER or deviation > 0.1


def test_edges_that_the_mesher_splits_in_two_ways_are_split_again():
    face, _ = sheet(4, 0.2, (2, 2), 100.0)
    solid = BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, -5)).Shape()
    made = tessellate(solid, 0.5)
    assert is_closed(made.faces)
