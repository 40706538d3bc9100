"""How many triangles the faces of a solid get, and how near to them these are."""

import pytest

pytest.importorskip("OCP")

from assemblies import ball, box, cut, ring, rod, solid_of
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
from OCP.BRepBuilderAPI import BRepBuilderAPI_GTransform
from OCP.gp import gp_GTrsf, gp_Mat, gp_XYZ

from clamp3d.brep.borders import BORDER
from clamp3d.brep.solid import CHORD
from clamp3d.brep.surfaces import OTHER
from clamp3d.brep.tessellate import FREE, tessellate


def test_known_surfaces_take_few_triangles():
    seal = tessellate(solid_of(ring(150, 5)), CHORD)
    assert len(seal.faces) < 20_000  # 62 000 for a chord of 0.02 mm
    assert seal.errors.max() <= 2.0 * CHORD


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
