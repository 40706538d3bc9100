"""How many triangles the faces of a solid get, and how near to them these are."""

import numpy as np
import pytest

pytest.importorskip("OCP")

from assemblies import ball, box, cut, ring, rod, solid_of
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
from OCP.BRepBuilderAPI import BRepBuilderAPI_GTransform, BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_GTrsf, gp_Mat, gp_Pnt, gp_XYZ

from clamp3d.brep import facets
from clamp3d.brep.borders import BORDER
from clamp3d.brep.solid import CHORD
from clamp3d.brep.surfaces import OTHER
from clamp3d.brep.tessellate import FREE, explore, tessellate


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
