"""Meshes that are not closed: distances and crossings are certain, what is inside them is said to be unknown."""

from dataclasses import replace

import fcl
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from clamp3d import Motion, Scene, check, shapes
from clamp3d.engine import moving_pair
from clamp3d.engine.open_mesh import _crossing
from clamp3d.engine.surface import Surface
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.pose import translation
from tests.kinds import mesh_shape


def opened(mesh, *faces):
    return shapes.MeshShape(make_mesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0)), "off", "open")


BOX = trimesh.creation.box((10.0, 10.0, 10.0))
CUP, ROD = opened(BOX, 0), shapes.cylinder(2, 4)


def row(a, b, T, **scene):
    return check(Scene(**scene).add("a", a).add("b", b, T), distances=True).pairs[0]


@pytest.mark.parametrize("other", [shapes.box(4, 4, 4), mesh_shape(trimesh.creation.box((4, 4, 4))), ROD])
def test_of_an_open_mesh_distances_are_certain_and_its_inside_is_not_known(other):
    beside = row(CUP, other, translation(8, 0.5, 0.3), clearance=2.0)
    assert beside.verdict.value == "clearance"
    assert beside.distance.lower - 1e-9 <= 1.0 <= beside.distance.upper + 1e-9
    assert row(CUP, other, translation(5, 0.5, 0.3)).verdict.value in ("clash", "uncertain")
    assert row(CUP, other, np.eye(4)).verdict.value == "uncertain"


def test_what_a_closed_part_holds_overlaps_it_however_open():
    found = row(opened(trimesh.creation.box((4, 4, 4)), 3), shapes.box((10, 10, 10)), np.eye(4))
    assert found.verdict.value == "clash"
    assert found.distance.upper == pytest.approx(-3.0)


@pytest.mark.parametrize("turned", [False, True])
def test_a_hole_above_what_is_inside_does_not_let_it_out(turned):
    """Nor does the side that an open surface shows: nothing says which one is out."""
    ball = trimesh.creation.icosphere(2, 20.0)
    for k in np.random.default_rng(1).choice(len(ball.faces), 12, replace=False):
        order = np.argsort(-ball.triangles_center @ ball.triangles_center[k])
        holed = trimesh.Trimesh(ball.vertices, ball.faces[order[20:], :: -1 if turned else 1], process=False)
        found = row(opened(holed), shapes.box((3, 3, 3)), translation(0.4, 0.3, 0.2))
        assert found.verdict.value == "uncertain"
        assert "a closed mesh of a" in found.reason


def tube():
    """The wall of a tube of radius 10 along z from -20 to 20, without its ends."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    V = np.vstack([np.c_[10.0 * np.cos(angle), 10.0 * np.sin(angle), np.full(24, z)] for z in (-20.0, 20.0)])
    first = np.arange(24)
    after = np.roll(first, -1)
    F = np.vstack([np.c_[first, after, first + 24], np.c_[after, after + 24, first + 24]])
    return shapes.MeshShape(make_mesh(V, F), "off", "tube")


def test_what_goes_through_an_open_mesh_is_not_said_to_be_clear_on_the_way(monkeypatch):
    monkeypatch.setattr(moving_pair, "BUDGET", 300)
    scene = Scene().add("tube", tube()).add("bead", shapes.box((3, 3, 3)), translation(0.3, 0.2, -900.0))
    go = Motion.translate((0.0, 0.0, -1000.0), parts="tube")
    assert check(replace(scene, motions=(go,))).motions[0].verdict.value == "uncertain"


def test_what_goes_past_an_open_mesh_is_clear():
    scene = Scene(clearance=5.0).add("tube", tube()).add("bead", shapes.box((3, 3, 3)), translation(0.3, 0.2, 30.0))
    (found,) = check(replace(scene, motions=(Motion.translate((50.0, 0.0, -4.0), parts="bead"),))).motions
    assert found.verdict.value == "clear"
    assert 7.0 < found.distance.lower < found.distance.upper < 8.5


def test_surfaces_that_cross_are_a_clash():
    found, cup = row(CUP, shapes.box((4, 4, 4)), translation(6.0, 0.5, 0.3)), replace(CUP, error=0.1)
    assert found.verdict.value == "clash"
    loose = row(cup, shapes.box((4, 4, 4)), translation(6.0, 0.5, 0.3))  # what is stated of the mesh counts off
    assert loose.distance.upper == pytest.approx(found.distance.upper + 0.1, abs=1e-9)


@st.composite
def surfaces(draw):
    """Two surfaces of random triangles near each other, and the place of the second."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    made = []
    for _ in range(2):
        V = rng.uniform(-1.0, 1.0, (int(rng.integers(4, 12)), 3))
        F = np.array([rng.choice(len(V), 3, replace=False) for _ in range(int(rng.integers(1, 9)))])
        made.append(Surface(V, F))
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=rng).as_matrix()
    T[:3, 3] = rng.uniform(-0.5, 0.5, 3)
    return (*made, T, rng)


@given(surfaces())
def test_no_move_shorter_than_its_depth_ends_a_crossing(drawn):
    a, b, T, rng = drawn
    depth, at = _crossing(a, b, T)
    if at is None:
        return
    still = fcl.CollisionObject(a.bvh, fcl.Transform())
    for way in rng.normal(size=(20, 3)):
        t = T[:3, 3] + way / np.linalg.norm(way) * depth * 0.999
        moved = fcl.CollisionObject(b.bvh, fcl.Transform(T[:3, :3], t))
        assert fcl.collide(still, moved, fcl.CollisionRequest(), fcl.CollisionResult())


def test_what_is_mended_or_wrong_of_a_mesh_is_noted():
    assert make_mesh(BOX.vertices, BOX.faces[1:]).notes == (
        "not closed: 3 edges with one triangle, 0 with more than two, 0 with both on one side: "
        "what is inside is not known",
    )
    V = np.vstack([BOX.vertices, 0.5 * (BOX.vertices[0] + BOX.vertices[1])])
    flat = make_mesh(V, np.vstack([BOX.faces, [[0, 1, len(BOX.vertices)]]]))  # along an edge, which it opens not
    assert (flat.watertight, flat.notes, len(flat.vertices)) == (True, ("1 triangles without an area left out",), 8)
    beside = [trimesh.util.concatenate([BOX, BOX.copy().apply_translation((10.0, y, 0.0))]) for y in (10.0, 0.0)]
    at_edge, welded = (make_mesh(both.vertices, both.faces) for both in beside)
    assert at_edge.watertight
    assert any("bodies that touch" in note for note in at_edge.notes)
    assert trimesh.Trimesh(welded.vertices, welded.faces).volume == pytest.approx(2000.0)
