"""Nearest points of a mesh to rounding; inner and outer meshes hold the part; touching meshes are decided."""

import math

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from clamp3d import Scene, Verdict, check, shapes
from clamp3d.engine.mesh_distance import meshes_distance
from clamp3d.engine.model import ModelCache
from clamp3d.engine.surface import Surface, at_edges
from clamp3d.geometry.extrusion import Extrusion
from clamp3d.geometry.profile import Profile
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import make_mesh


def SHARP(found):
    return found.upper - found.lower < 1e-7


BRACKET = trimesh.creation.extrude_polygon(Polygon([(0, 0), (40, 0), (40, 5), (5, 5), (5, 30), (0, 30)]), 20)


def mesh_shape(made: trimesh.Trimesh, fit: str = "off") -> shapes.MeshShape:
    return shapes.MeshShape(make_mesh(made.vertices, made.faces), fit)


@settings(max_examples=30, deadline=None)
@given(size=st.floats(-6.0, 0.3).map(lambda e: 10.0**e), apart=st.booleans(), turn=st.floats(0.0, 6.0))
def test_gaps_and_overlaps_of_concave_meshes_are_decided(size, apart, turn):
    """A box over the inner face of an L-bracket, both of them turned: gaps and overlaps of 1e-6 to 2 mm."""
    gap = size if apart else -size
    place = translation(3.0, -7.0, 11.0) @ rotation([0.3, -1.0, 0.5], turn)
    bracket, box = mesh_shape(BRACKET), mesh_shape(trimesh.creation.box((10, 10, 10)))
    T_box = place @ translation(20.0, 10.0 + gap, 10.0)
    (row,) = check(Scene(clearance=50.0).add("bracket", bracket, place).add("box", box, T_box)).pairs
    assert row.distance.lower - 1e-8 <= gap <= row.distance.upper + 1e-8
    right = Verdict.CLEARANCE if gap > 0.01 else Verdict.CONTACT if gap >= -0.01 else Verdict.CLASH
    assert row.verdict is right or abs(abs(gap) - 0.01) < 2e-6
    cache = ModelCache()
    found = meshes_distance(cache.model(bracket), cache.model(box), np.linalg.inv(place) @ T_box, 0.5, SHARP)
    assert found.lower - 1e-8 <= gap <= found.upper + 1e-8
    assert gap < 0.0 or found.upper - found.lower < 1e-6


@settings(max_examples=15, deadline=None)
@given(size=st.floats(-6.0, -2.0).map(lambda e: 10.0**e), apart=st.booleans(), drawn=st.booleans())
def test_on_the_seam_of_a_union_gaps_and_overlaps_are_those_of_its_face(size, apart, drawn):
    """A box over the line where two blocks meet, which is no surface: 1e-6 to 1e-2 mm off them or in them."""
    gap = size if apart else -size
    left, right = (Extrusion(Profile.rectangle(20.0, 18.0, (x, 0.0)), "Z", -8.0, 0.0) for x in (-10.0, 10.0))
    floor = shapes.Solid("floor", (left, right))
    if not drawn:
        halves = [trimesh.creation.box((20, 18, 8)).apply_translation((x, 0, -4)) for x in (-10.0, 10.0)]
        floor = mesh_shape(trimesh.boolean.union(halves, engine="manifold"))
    scene = Scene(clearance=1.0).add("floor", floor).add("box", shapes.box((6, 6, 6)), translation(0.3, 1.0, 3.0 + gap))
    (row,) = check(scene).pairs
    assert row.verdict is Verdict.CONTACT or abs(size - 0.01) < 1e-8
    assert row.distance.lower - 1e-8 <= gap <= row.distance.upper + 1e-8


def test_flat_faces_of_a_part_with_a_hole_stay_exact():
    """The chords of one bolt hole say nothing against the flat faces."""
    plate = trimesh.boolean.difference(
        [trimesh.creation.box((40, 40, 10)), trimesh.creation.cylinder(6.0, 30.0, sections=24)], engine="manifold"
    )
    scene = (
        Scene().add("plate", mesh_shape(plate, "round")).add("box", shapes.box((8, 8, 8)), translation(15, 15, 9.05))
    )
    (row,) = check(scene).pairs
    assert row.verdict is Verdict.CLEAR
    scene = Scene(clearance=1.0, parts=scene.parts)
    (row,) = check(scene).pairs
    assert row.verdict is Verdict.CLEARANCE
    assert row.distance.upper - row.distance.lower < 1e-5


@settings(max_examples=40, deadline=None)
@given(wedge=st.floats(0.15, 3.0))
def test_error_at_a_knife_edge_reaches_the_true_edge(wedge):
    """A wedge whose one face bulges by 0.1 mm: the true edge is 0.1 / sin(wedge) from the edge of the mesh."""
    x = 10.0
    profile = [(0.0, 0.0), (-x, 0.0), (-x * math.cos(wedge), -x * math.sin(wedge))]
    wedge_mesh = trimesh.creation.extrude_polygon(Polygon(profile[::-1]), 5.0)
    top = np.abs(wedge_mesh.face_normals @ [0.0, 1.0, 0.0] - 1.0) < 1e-9
    error = at_edges(np.array(wedge_mesh.vertices), np.array(wedge_mesh.faces), np.where(top, 0.1, 0.0))
    # The bulged face y = 0.1 meets the flat side's plane beyond the edge.
    edge = np.array([0.1 / math.tan(wedge), 0.1, 2.5])
    surface = Surface(np.array(wedge_mesh.vertices), np.array(wedge_mesh.faces), error)
    (distance,), _, _ = surface.nearest(edge[None])
    assert distance <= error.max() + 1e-12
    assert error[~top].max() == 0.0


def test_large_convex_meshes_are_asked_as_meshes_and_their_depth_is_found():
    """A hull of so many faces takes gigabytes; the true balls overlap by 0.1 mm, their facets by up to 0.03 less."""
    ball = mesh_shape(trimesh.creation.icosphere(subdivisions=5, radius=10.0))
    cache = ModelCache()
    scene = Scene().add("a", ball).add("b", ball, translation(19.9, 0.0, 0.0))
    (row,) = check(scene, cache=cache).pairs
    assert cache.counters.built["hulls"] == 0
    assert row.verdict is Verdict.CLASH
    assert -0.100001 <= row.distance.lower <= row.distance.upper <= -0.07
    assert row.distance.upper - row.distance.lower <= 0.01
