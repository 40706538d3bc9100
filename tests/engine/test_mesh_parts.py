"""Meshes that are hollow, open, or of several bodies: nothing is filled, and what is not known is said to be not."""

import math
from dataclasses import replace
from itertools import combinations

import fcl
import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from clamp3d import Motion, Scene, Verdict, check, distance, shapes
from clamp3d.engine import moving_pair
from clamp3d.engine.model import ModelCache
from clamp3d.engine.open_mesh import _crossing
from clamp3d.engine.surface import Surface
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.shapes import FITS
from tests.kinds import manifold_shape, mesh_shape, row_of

PROBE = shapes.cylinder(0.5, 10.0)
CUBE = shapes.box((1.0, 1.0, 1.0))


def bar(radius, low, high):
    """A bar of 48 flats along z, one of them square to x."""
    made = manifold3d.Manifold.cylinder(high - low, radius, radius, 48)
    return made.rotate((0.0, 0.0, 180.0 / 48.0)).translate((0.0, 0.0, low))


@pytest.mark.parametrize("fit", FITS)
def test_hollows_with_a_floor_are_hollow(fit):
    """A cup, a stepped hole and a closed cavity: all triangles of floors and steps have their corners on holes."""
    cup = bar(10.0, -10.0, 10.0) - bar(6.0, 0.0, 20.0)
    stepped = bar(10.0, -10.0, 10.0) - bar(3.0, -20.0, 20.0) - bar(6.0, 0.0, 20.0)
    cavity = bar(10.0, -20.0, 20.0) - bar(6.0, -10.0, 10.0)
    for made, part, at, truth in (
        (cup, PROBE, (0.0, 0.0, 6.0), 1.0),
        (stepped, PROBE, (4.2, 0.0, 6.0), 1.0),
        (cavity, CUBE, (0.0, 0.0, 0.0), 6.0 - math.sqrt(0.5)),
    ):
        found = distance(manifold_shape(made, fit), part, translation(*at))
        least = truth - 6.0 * (1.0 - math.cos(math.pi / 48.0)) * (part is CUBE)
        assert found.lower - 1e-9 <= (truth if fit == "round" else least) <= found.upper + 1e-9
        assert found.upper - found.lower <= 0.05


def test_a_pin_in_a_tube_that_is_round():
    """Its end faces fill what is between chords and arc of the hole; that is air."""
    tube = bar(10.0, -10.0, 10.0) - bar(3.0, -20.0, 20.0)
    for x, truth in ((0.3, -0.29), (0.004, 0.006)):
        found = distance(manifold_shape(tube, "round"), shapes.cylinder(2.99, 30.0), translation(x, 0.0, 0.0))
        assert found.lower - 1e-9 <= truth <= found.upper + 1e-9
        # Of an overlap the depth of a point is known, and only the length of a way out that is verified on the meshes.
        assert found.upper - (truth if truth < 0.0 else found.lower) <= 1e-6


@pytest.mark.parametrize("fit", FITS)
def test_a_window_in_a_round_side_is_open(fit):
    """A cube before a square pocket in a bar: the nearest point is on the pocket's rim, 1 mm aside."""
    pocket = manifold3d.Manifold.cube((3.0, 3.0, 3.0), True).translate((10.0, 0.0, 0.0))
    found = distance(manifold_shape(bar(10.0, -20.0, 20.0) - pocket, fit), CUBE, translation(12.501, 0.0, 0.0))
    truth = math.hypot(12.001 - 10.0 * (math.cos(math.pi / 48.0) if fit == "off" else 1.0), 1.0)
    assert found.lower - 1e-9 <= truth <= found.upper + 1e-9


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("hollow", [False, True])
def test_what_is_stated_of_a_mesh_widens_what_its_round_surfaces_say(fit, hollow):
    """The true bar may be thicker or thinner by the error that its maker states."""
    made = bar(10.0, -20.0, 20.0) - bar(6.0, 0.0, 30.0) if hollow else bar(10.0, -20.0, 20.0)
    found = distance(manifold_shape(made, fit, error=0.5), CUBE, translation(12.5, 0.0, -10.0))
    reach = 10.0 * (math.cos(math.pi / 48.0) if fit == "off" else 1.0)
    assert found.lower - 1e-9 <= 12.0 - (reach + 0.5)
    assert found.upper + 1e-9 >= 12.0 - (reach - 0.5)
    assert np.isfinite(found.lower)


def test_what_facets_fill_beside_a_round_rim_is_air():
    """Between a chord of a hole and its arc: the block's face has a point there, the round part has none."""
    block = manifold3d.Manifold.cube((30.0, 30.0, 30.0), True) - bar(6.0, 0.0, 20.0)
    (form,) = ModelCache().model(manifold_shape(block, "round")).bodies
    depth = form.depth(np.array([(5.995, 0.0, 15.0), (6.001, 0.0, 15.0), (6.0, 0.0, 7.0), (-9.0, 8.0, 15.0)]))
    assert depth[0] < -1e-3
    assert depth[1:] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 10.0])
def test_a_pin_in_a_hole_that_leaves_through_a_slanted_face(tilt):
    """Facets beside the hole's mouth reach into its circle by the chords that they share with it."""
    roof = manifold3d.Manifold.cube((60.0, 60.0, 20.0), True).rotate((0.0, tilt, 0.0)).translate((0.0, 0.0, 20.0))
    hole = manifold3d.Manifold.cylinder(60.0, 6.0, 6.0, 48, True)
    block = manifold3d.Manifold.cube((30.0, 30.0, 30.0), True) - roof - hole
    found = distance(manifold_shape(block, "round"), shapes.cylinder(5.9, 60.0), translation(0.02, 0.0, 0.0))
    assert found.lower - 1e-9 <= 0.08 <= found.upper + 1e-9
    assert found.upper - found.lower <= 1e-6


def opened(mesh, *faces):
    return shapes.MeshShape(make_mesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0)), "off", "open")


BOX = trimesh.creation.box((10.0, 10.0, 10.0))
CUP, ROD = opened(BOX, 0), shapes.cylinder(2, 4)


@pytest.mark.parametrize("other", [shapes.box(4, 4, 4), mesh_shape(trimesh.creation.box((4, 4, 4))), ROD])
def test_of_an_open_mesh_distances_are_certain_and_its_inside_is_not_known(other):
    beside = row_of(CUP, other, translation(8, 0.5, 0.3), clearance=2.0, distances=True)
    assert beside.verdict.value == "clearance"
    assert beside.distance.lower - 1e-9 <= 1.0 <= beside.distance.upper + 1e-9
    assert row_of(CUP, other, translation(5, 0.5, 0.3)).verdict.value in ("clash", "uncertain")
    assert row_of(CUP, other, np.eye(4)).verdict.value == "uncertain"


def test_what_a_closed_part_holds_overlaps_it_however_open():
    found = row_of(opened(trimesh.creation.box((4, 4, 4)), 3), shapes.box((10, 10, 10)), np.eye(4))
    assert found.verdict.value == "clash"
    assert found.distance.upper == pytest.approx(-3.0)


@pytest.mark.parametrize("turned", [False, True])
def test_a_hole_above_what_is_inside_does_not_let_it_out(turned):
    """Nor does the side that an open surface shows: nothing says which one is out."""
    ball = trimesh.creation.icosphere(2, 20.0)
    for k in np.random.default_rng(1).choice(len(ball.faces), 12, replace=False):
        order = np.argsort(-ball.triangles_center @ ball.triangles_center[k])
        holed = trimesh.Trimesh(ball.vertices, ball.faces[order[20:], :: -1 if turned else 1], process=False)
        found = row_of(opened(holed), shapes.box((3, 3, 3)), translation(0.4, 0.3, 0.2))
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
    found, cup = row_of(CUP, shapes.box((4, 4, 4)), translation(6.0, 0.5, 0.3)), replace(CUP, error=0.1)
    assert found.verdict.value == "clash"
    loose = row_of(cup, shapes.box((4, 4, 4)), translation(6.0, 0.5, 0.3))  # what is stated of the mesh counts off
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
    (note,) = make_mesh(BOX.vertices, BOX.faces[1:]).notes
    assert note.startswith("not closed: 3 edges with one triangle, 0 with more than two, 0 with both on one side: what")
    V = np.vstack([BOX.vertices, 0.5 * (BOX.vertices[0] + BOX.vertices[1])])
    flat = make_mesh(V, np.vstack([BOX.faces, [[0, 1, len(BOX.vertices)]]]))  # along an edge, which it opens not
    assert (flat.watertight, flat.notes, len(flat.vertices)) == (True, ("1 triangles without an area left out",), 8)
    beside = [trimesh.util.concatenate([BOX, BOX.copy().apply_translation((10.0, y, 0.0))]) for y in (10.0, 0.0)]
    at_edge, welded = (make_mesh(both.vertices, both.faces) for both in beside)
    assert at_edge.watertight
    assert any("bodies that touch" in note for note in at_edge.notes)
    assert trimesh.Trimesh(welded.vertices, welded.faces).volume == pytest.approx(2000.0)


FIRST = np.array([[-5.0, -5.0, -5.0], [5.0, 5.0, 5.0]])
CAVITY = np.array([[-3.0, -3.0, -3.0], [3.0, 3.0, 3.0]])
SECOND = {
    "crossing": [[0.0, -4.0, -4.0], [10.0, 6.0, 6.0]],
    "touching": [[5.0, -3.0, -3.0], [13.0, 3.0, 3.0]],
    "touching all over": [[5.0, -5.0, -5.0], [15.0, 5.0, 5.0]],
    "inside": [[-4.5, -4.5, -4.5], [-3.5, -3.5, -3.5]],
    "apart": [[6.0, -3.0, -3.0], [9.0, 3.0, 3.0]],
}


def box_mesh(bounds, inward=False):
    mesh = trimesh.creation.box(bounds=bounds)
    if inward:
        mesh.invert()
    return mesh


def shared(*boxes):
    """Volume of the common part of boxes (2, 3)."""
    return float(np.prod(np.maximum(np.min([b[1] for b in boxes], axis=0) - np.max([b[0] for b in boxes], axis=0), 0)))


@pytest.mark.parametrize("hollow", [False, True])
@pytest.mark.parametrize("second", SECOND)
@pytest.mark.parametrize("turned", [False, True])
def test_bodies_of_one_mesh_are_one_part(second, hollow, turned):
    other = np.array(SECOND[second])
    if hollow and second == "crossing":
        other[0, 0] = 4.0  # beside the cavity
    bodies = [box_mesh(FIRST), box_mesh(other), *([box_mesh(CAVITY, inward=True)] if hollow else [])]
    whole = trimesh.util.concatenate(bodies[::-1] if turned else bodies)
    part, cache = mesh_shape(whole), ModelCache()
    if second == "touching all over":  # what lies between the two is no wall of the part
        assert not (np.abs(part.mesh.vertices[part.mesh.faces][:, :, 0] - 5.0) < 1e-9).all(axis=1).any()
    rng = np.random.default_rng(5)
    for centre in [(-1.2, 0.0, 0.0), (4.3, 0.0, 0.3), (4.0, 0.4, 0.2), *rng.uniform(-6.0, 11.0, (12, 3))]:
        probe = np.array([-0.5, 0.5])[:, None] + centre
        truth = shared(probe, FIRST) + shared(probe, other) - shared(probe, FIRST, other)
        truth -= hollow * (shared(probe, CAVITY) - shared(probe, CAVITY, other))
        row = row_of(part, CUBE, translation(*centre), distances=True, cache=cache)
        verdicts = {"contained"} if truth > 1.0 - 1e-12 else {"clash"} if truth > 0.0 else {"clear", "contact"}
        assert row.verdict.value in verdicts
        if truth > 0.0:
            low, high = row.where.volume
            assert low <= truth <= high <= truth + 1e-6


LOOP = np.array([[0, 0], [60, 0], [60, 40], [20, 40], [20, -40]], dtype=float)
HALF = 8.0
SECTION = ((-1, HALF), (1, HALF), (1, -HALF), (-1, -HALF))


def loop():
    """A square tube swept along `LOOP`, as one surface that crosses itself, and the boxes (2, 3) that it is made of."""
    way = np.diff(LOOP, axis=0) / np.linalg.norm(np.diff(LOOP, axis=0), axis=1)[:, None]
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    mitre = HALF * np.vstack([aside[:1], aside[:-1] + aside[1:], aside[-1:]])
    corners = [np.column_stack([LOOP + s * mitre, np.full(5, z)]) for s, z in SECTION]
    faces = [[0, 2, 1], [0, 3, 2], [16, 17, 18], [16, 18, 19]]
    for a, b in ((4 * k + j, 4 * k + (j + 1) % 4) for k in range(4) for j in range(4)):
        faces += [[a, b, b + 4], [a, b + 4, a + 4]]
    tube = trimesh.Trimesh(np.stack(corners, axis=1).reshape(-1, 3), faces, process=False)
    boxes = []
    for k in range(4):
        ends = np.array([LOOP[k] - HALF * (k > 0) * way[k], LOOP[k + 1] + HALF * (k < 3) * way[k]])
        wide = HALF * np.abs(aside[k])
        boxes.append(np.column_stack([[ends.min(axis=0) - wide, ends.max(axis=0) + wide], [-HALF, HALF]]))
    return mesh_shape(tube), boxes


def union(place, boxes):
    """Volume of what boxes (2, 3) cover of another, by inclusion and exclusion."""
    subsets = (some for n in range(1, len(boxes) + 1) for some in combinations(boxes, n))
    return sum((-1) ** (len(some) + 1) * shared(place, *some) for some in subsets)


@pytest.mark.parametrize("form", ["mesh", "drawn"])
def test_walls_of_a_surface_inside_of_what_it_covers_are_no_end_of_it(form):
    (part, boxes), cache = loop(), ModelCache()
    cube = box_mesh([[-0.5] * 3, [0.5] * 3])
    probe = CUBE if form == "drawn" else mesh_shape(cube)
    rng = np.random.default_rng(3)
    drawn = rng.uniform([10, -15, -8.4], [35, 15, 8.4], (40, 3))
    for centre in [(31, 0, 0), (20, 6, 0), (20, 7, 3), (20, 0, 0), *drawn]:
        place = np.array([-0.5, 0.5])[:, None] + centre
        pair = row_of(part, probe, translation(*centre), distances=True, cache=cache)
        distance, truth = pair.distance, union(place, boxes)
        if truth == 0.0:
            away = [np.linalg.norm(np.maximum(0.0, np.maximum(b[0] - place[1], place[0] - b[1]))) for b in boxes]
            assert distance.lower <= min(away) <= distance.upper <= min(away) + 1e-9
            continue
        assert pair.verdict is Verdict.CLASH
        assert "crosses itself" in distance.method
        assert 0.0 < -distance.upper <= HALF + 0.5 - abs(centre[2])


@pytest.mark.parametrize(
    "way", [(10, 10, 10), (10, 10, 0), (10, 0, 0), (10, 3, 4)], ids=["corner", "edge", "face", "part"]
)
@pytest.mark.parametrize("inward", [(), (0,), (1,), (0, 1), (0, 2), (0, 1, 2)])
def test_no_body_is_lost_that_touches_others_and_is_inside_out(way, inward):
    boxes = [np.array([[-5.0] * 3, [5.0] * 3]) + k * np.array(way) for k in range(3)]
    whole = trimesh.util.concatenate([box_mesh(box, inward=k in inward) for k, box in enumerate(boxes)])
    part, cache = mesh_shape(whole), ModelCache()
    for box in boxes:
        pair = row_of(part, CUBE, translation(*box.mean(axis=0)), cache=cache)
        assert pair.verdict is Verdict.CONTAINED
        assert pair.where.volume == pytest.approx((1.0, 1.0))


def test_a_plane_parts_a_small_part_from_one_that_it_lies_deep_in():
    """The way out, 5.5 mm over the top, is longer than the lengths that are tried one after the other."""
    whole = trimesh.util.concatenate([box_mesh(FIRST), box_mesh(SECOND["touching"])])
    part = mesh_shape(whole)
    distance = row_of(part, CUBE, np.eye(4)).distance
    assert -distance.lower == pytest.approx(5.5, abs=1e-6)
    moved = np.array([-0.5, 0.5])[:, None] - distance.lower * distance.normal
    assert union(moved, [FIRST, np.array(SECOND["touching"])]) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("kind", ["drawn", "fitted"])
def test_the_depth_and_the_volume_of_a_bar_pressed_into_a_v_are_known_closely(kind):
    """By 0.1 mm: it lies 0.0707 mm deep in both flanks, and shares a segment of its circle with each."""
    radius, length, deep = 15.0, 80.0, 0.1 / math.sqrt(2.0)
    block = manifold3d.CrossSection([[(-30, -20), (30, -20), (30, 30), (0, 0), (-30, 30)]]).extrude(length)
    vee = manifold_shape(block.translate((0.0, 0.0, -0.5 * length)))
    turn = 2.0 * math.pi * np.arange(48) / 48.0
    round_bar = manifold3d.CrossSection([radius * np.column_stack([np.cos(turn), np.sin(turn)])]).extrude(length)
    fitted = manifold_shape(round_bar.translate((0.0, 0.0, -0.5 * length)), "round")
    part = shapes.cylinder(radius, length) if kind == "drawn" else fitted
    row = row_of(vee, part, translation(0.0, radius * math.sqrt(2.0) - 0.1, 0.0))
    assert -0.1012 <= row.distance.lower <= -0.1
    assert -deep - 1e-6 <= row.distance.upper <= -deep + 0.0012
    segment = radius**2 * math.acos(1.0 - deep / radius) - (radius - deep) * math.sqrt((2.0 * radius - deep) * deep)
    low, high = row.where.volume
    assert low <= 2.0 * length * segment <= high <= 1.2 * low


def test_of_a_drawn_groove_a_point_on_its_arc_is_nearest_to_a_mesh():
    """Not one on the facets within it, which are 7e-6 mm and more away from it."""
    legs = [trimesh.creation.box((4, 4, 6)), trimesh.creation.box((2, 2, 6)).apply_translation((0, 3, 0))]
    tee = trimesh.boolean.union(legs, engine="manifold")
    block = shapes.groove_block(shapes.SweptArc(12.0, 1.2, 50.0), 40.0, 20.0)
    for T in (translation(0.0, -9.0, 0.0), translation(1.0, -8.0, 3.0)):
        found = distance(block, tee, T)
        assert np.hypot(*found.point_a[:2]) == pytest.approx(12.0, abs=1e-7)
        assert found.upper == pytest.approx(np.linalg.norm(found.point_b - found.point_a), abs=1e-7)


def test_slender_triangles_say_no_more_than_is_true():
    """A bar of 1157 flats 1150 mm long, 0.0001 mm in a plate: its triangles are 80 000 times as long as wide."""
    bar = manifold3d.Manifold.cylinder(1150.0, 2.7119, 2.7119, 1157).translate((0.0, 0.0, -575.0))
    bar = manifold_shape(bar, "off")
    plate = mesh_shape(trimesh.creation.box((40.0, 10.0, 1300.0)), "off")
    lowest = float(bar.mesh.vertices[:, 1].min())
    for aside in (0.0, 0.003, 0.01):
        overlap = distance(plate, bar, translation(aside, 5.0 - 1e-4 - lowest, 0.0))
        assert overlap.lower - 1e-7 <= -1e-4 <= overlap.upper + 1e-7


def test_what_is_beside_slender_triangles_is_not_inside_them():
    """Cubes 0.06 mm beside a bar of flats 1000 mm long and 0.03 mm wide, of which single precision knows little."""
    rng = np.random.default_rng(0)
    bar, cubes = trimesh.creation.cylinder(1.0, 1000.0, sections=200), []
    for angle, z in zip(rng.uniform(0.0, 2.0 * np.pi, 30), rng.uniform(-450.0, 450.0, 30), strict=True):
        cube = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((1.11, 0.0, z))
        cubes.append(cube.apply_transform(rotation((0, 0, 1), angle)))
    gap = distance(mesh_shape(bar, "off"), mesh_shape(trimesh.util.concatenate(cubes), "off"))
    assert 0.0599 < gap.lower <= gap.upper < 0.0602
