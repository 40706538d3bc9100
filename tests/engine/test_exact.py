"""Two solids from CAD by Open CASCADE: the bounds of an interference hold what a formula says."""

import gc
import itertools
import weakref
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")


from clamp3d import check
from clamp3d.engine import cad_pair, moving_pair
from clamp3d.engine import depth as depth_module
from clamp3d.engine import model as model_module
from clamp3d.engine import near_faces as near_faces_module
from clamp3d.engine.answer import Distance
from clamp3d.engine.cad_pair import CadPair
from clamp3d.engine.depth import penetration
from clamp3d.engine.exact import SHARES, _measured, attested_overlap, exact_distance, exact_overlap, exact_probe
from clamp3d.engine.farthest import Pieces, farthest
from clamp3d.engine.judge import judge, kind_of_overlap
from clamp3d.engine.mesh_distance import surfaces_meet
from clamp3d.engine.model import CAD_CHORDS, Counters, model_of
from clamp3d.engine.near_faces import near_faces
from clamp3d.engine.refine import refine
from clamp3d.engine.surface import Surface, tree_distance
from clamp3d.engine.verdict import Thresholds
from clamp3d.engine.where import Locator
from clamp3d.errors import Clamp3dError
from clamp3d.files import cad_process, pairs
from clamp3d.files.open_cascade import explore, from_bytes, occ, to_bytes
from clamp3d.files.open_cascade import moved as occ_moved
from clamp3d.files.pairs import CommonPart, Nearest
from clamp3d.files.solid import BrepSolid
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import to_target
from clamp3d.geometry.shapes import sphere
from tests.cad import ball, block, common_volume, cone, cut, first_solid, moved, ring, rod, shift, turn
from tests.kinds import cad_model, cad_scene
from tests.public.placed_pairs import placed_pair, random_pose

FAMILIES = ("balls", "ball_on_plate", "ball_in_ring", "rods_crossed", "pin_off_centre", "box_on_its_corner")


def models(family, gap, seed=3, splines=0.0):
    """The two solids of a placed pair, in one frame, with a share of ``splines``."""
    pair = placed_pair(family, np.random.default_rng(seed), gap, splines=splines)
    return models_of(pair.a, pair.b)


def models_of(*solids):
    return [cad_model(solid) for solid in solids]


def test_a_mesh_that_is_fine_on_some_faces_is_made_once_and_goes_with_its_solid(monkeypatch):
    monkeypatch.setattr(model_module, "QUICK_TRIANGLES", 0)
    (solid,) = models_of(rod(3.0, 0.0, 8.0))
    mesh, coarser = (solid.outer_near(np.array([0]), chord) for chord in (0.01, 0.05))
    assert len(mesh.faces) > len(coarser.faces)
    for chord, made in ((0.05, coarser), (0.01, mesh)):
        assert solid.outer_near(np.array([0]), chord) is made
    assert solid.counters.built["meshes"] == 2
    left = weakref.ref(coarser)
    del mesh, coarser, made, solid
    gc.collect()
    assert left() is None


@pytest.mark.parametrize("family", FAMILIES)
def test_an_interference_is_within_its_bounds_however_coarse_the_border_is(family):
    a, b = models(family, -0.06)
    assert exact_probe(a, b, np.eye(4)).upper >= -0.06  # no point of coarse meshes attests more
    for share, width in ((0.5, np.inf), (0.04, 0.02)):
        distance = exact_overlap(a, b, np.eye(4), share)
        assert distance.lower <= -0.06 <= distance.upper <= distance.lower + width


@pytest.mark.parametrize("family", ["taper_in_hub", "ring_in_groove"])
def test_the_interference_of_a_part_too_thick_for_its_seat_is_bounded_besides_its_way_out(family, monkeypatch):
    """By meshes where Open CASCADE finds no common part, as is the volume; their sections are not asked here."""
    a, b = models(family, -0.04)
    monkeypatch.setattr(depth_module, "coaxial_distance", lambda *_: None)
    volume = cad_process.common(a.shape.brep, b.shape.brep, np.eye(4)).volume
    for found in (True, False):
        if not found:
            monkeypatch.setattr(cad_process, "common", lambda *_: CommonPart(0.0, 0.0, np.zeros((2, 3))))
        for thorough, most in ((False, 3.0), (True, 2.0)):
            low, high = Locator(a, b, np.eye(4), np.eye(4), thorough=thorough).overlap.volume
            assert low <= volume <= high < most * low
        distance = penetration(a, b, np.eye(4), Distance(-np.inf, -0.02))
        least, most = distance.interference
        assert 0.035 < least <= 0.04 <= most  # points attest it exactly, also where no common part is found
        assert -distance.lower > 0.5
        assert ("CASCADE" in distance.method) is found
        assert most < (0.05 if found else 0.06 if family == "taper_in_hub" else np.inf)


def test_where_no_meshes_overlap_the_depth_is_that_of_a_point_and_no_way_out_is_known(monkeypatch):
    a, b = models("ball_on_plate", -0.02)
    monkeypatch.setattr(depth_module, "_overlapping_meshes", lambda *_: iter(()))
    distance = penetration(a, b, np.eye(4), Distance(-0.05, -0.01))
    assert (distance.lower, distance.upper, distance.interference) == (-np.inf, -0.01, (0.01, 0.05))


@pytest.mark.parametrize("family", ["cones_side_by_side", "ball_in_cone"])
def test_where_every_distance_is_measured_depths_of_oblique_contacts_are_tighter(family):
    pair = placed_pair(family, np.random.default_rng(3), -0.04, splines=0.0)
    scene = cad_scene(pair.a, pair.b)
    (usual,), (thorough,) = (check(scene, distances=measured).pairs for measured in (False, True))
    loose, tight = usual.distance, thorough.distance
    assert loose.lower - 1e-6 <= tight.lower <= -0.04 <= tight.upper <= loose.upper + 1e-6
    assert tight.upper - tight.lower < 0.9 * (loose.upper - loose.lower)


def test_a_shared_volume_holds_where_open_cascade_integrates_badly():
    """A tube squeezed to free-form faces, whose volume Open CASCADE integrates 1 % too large."""
    squeeze = occ.gp_GTrsf()
    squeeze.SetValue(1, 1, 1.7)
    squeeze.SetValue(2, 2, 0.6)
    tube = cut(rod(10.0, 0.0, 6.0), rod(7.0, -5.0, 11.0, 1.0))
    tube = occ.BRepBuilderAPI_GTransform(tube, squeeze, True).Shape()
    (row,) = check(cad_scene(block((-50, -50, -50), (50, 50, 50)), tube)).pairs
    low, high = row.where.volume
    assert low <= 1.7 * 0.6 * np.pi * (10.0**2 - 7.0**2) * 6.0 <= high <= 1.02 * low


@pytest.mark.parametrize("gap", [-8.0, -0.5])
def test_a_deep_overlap_is_measured_on_coarse_meshes(gap):
    a, b = models_of(ball(12.0), moved(ball(12.0), shift(24.0 + gap)))
    penetration(a, b, np.eye(4), refine(a, b, np.eye(4), Distance(), lambda d: d.upper < 0.0))
    assert a.counters.built["meshes"] == b.counters.built["meshes"] == 2


@pytest.mark.parametrize("gap", [-0.03, -0.7])
@pytest.mark.parametrize("family", ["balls", "ball_on_plate", "rods_crossed", "box_on_its_corner"])
def test_a_depth_is_that_of_the_formula_and_its_translation_parts_the_solids(family, gap):
    pair = placed_pair(family, np.random.default_rng(4), gap, splines=0.0)
    a, b = models_of(pair.a, pair.b)
    distance = penetration(a, b, np.eye(4), Distance(-np.inf, -0.01))
    assert distance.lower - 2e-6 <= gap <= distance.upper + 2e-6
    assert distance.upper - distance.lower <= 0.01 * -gap
    way = (1e-5 - distance.lower) * distance.normal
    assert common_volume(pair.a, moved(pair.b, shift(*way))) == 0.0


@cache
def drum():
    """A ring of radius 30 with 40 holes along z, up to z = 20."""
    solid = cut(rod(30.0, 0.0, 20.0), rod(20.0, -1.0, 21.0))
    for turned in np.arange(40) * np.pi / 20 + 0.05:
        solid = cut(solid, rod(1.0, -1.0, 21.0, 25.0 * np.cos(turned), 25.0 * np.sin(turned)))
    return solid


@pytest.mark.parametrize("angle", np.radians([0.0, 2.0, 4.0, 6.0, 8.0]))
def test_the_faces_that_are_near_tell_the_distance_of_the_solids(angle):
    """By its coarse triangles the ring seems nearer to the roof, 0.33 mm above it, than to the wall, 0.3 mm beside."""
    hook = cut(block((-10, -10, -5), (45, 10, 40)), block((-40, -40, -6), (30.3, 40, 20.33)))
    a, b = models_of(moved(drum(), turn((0, 0, 1), angle)), hook)
    near = near_faces(a.face_meshes, b.face_meshes, np.eye(4))
    assert len(near[0]) < 0.7 * len(a.face_meshes.numbers)
    distance = exact_distance(a, b, np.eye(4))
    assert distance.lower - 1e-9 <= 0.3 <= distance.upper + 1e-9


@pytest.mark.parametrize("limit", [0.1, 4.0])
def test_the_faces_that_are_near_another_solid_are_those_whose_triangles_are(limit):
    """A rod with a groove beside a drum, wherever both are."""
    drummed, grooved = models_of(drum(), cut(rod(4.0, -30.0, 30.0), ring(4.0, 1.0)))
    T = random_pose(np.random.default_rng(2))
    a, b = drummed.face_meshes, grooved.face_meshes
    at_b = T @ shift(34.05, 0.0, 8.0) @ turn((0, 1, 0), 0.2)
    for one, other, pose in ((a, b, np.linalg.inv(T) @ at_b), (b, a, np.linalg.inv(at_b) @ T)):
        expected = [k for k in one.numbers if tree_distance(one.tree(k), other.surface.bvh, pose) <= limit]
        assert one.near(other, pose, limit).tolist() == expected
        assert len(expected) < len(one.numbers)
    assert len(a.near(b, np.linalg.inv(T) @ at_b, 4.0)) > 1


def test_the_faces_that_are_near_tell_the_distance_where_triangles_meet(monkeypatch):
    monkeypatch.setattr(near_faces_module, "_FEW", 0)
    ring = cut(rod(40.0, 0.0, 20.0), rod(30.02, -1.0, 21.0))
    a, b = models_of(drum(), moved(ring, turn((0, 0, 1), 0.03)))
    assert surfaces_meet(*(model.face_meshes.surface for model in (a, b)), np.eye(4))
    near = near_faces(a.face_meshes, b.face_meshes, np.eye(4))
    assert len(near[0]) < 0.7 * len(a.face_meshes.numbers)
    distance = exact_distance(a, b, np.eye(4))
    assert distance.lower - 1e-9 <= 0.02 <= distance.upper + 1e-9


def test_solids_that_a_point_shows_to_touch_are_asked_for_no_distance(monkeypatch):
    """The drum stands in a ring that has its radius."""
    ring = cut(rod(40.0, -5.0, 25.0), rod(30.0, -6.0, 26.0))
    a, b = models_of(drum(), ring)
    monkeypatch.setattr(cad_pair, "exact_distance", lambda *_: pytest.fail("is asked"))
    answers = [*CadPair(a, b, np.eye(4), lambda _: False)._nearest()]
    assert [answer.upper <= 1e-6 for _, answer in answers] == [True]


def test_a_wire_between_a_solid_and_its_triangles_is_inside_it(monkeypatch):
    monkeypatch.setattr(near_faces_module, "_FEW", 0)
    (a,), hidden = models_of(drum()), 0
    for angle in np.radians(np.arange(0.0, 10.0)):
        (b,) = models_of(rod(0.01, 5.0, 15.0, 29.97 * np.cos(angle), 29.97 * np.sin(angle)))
        hidden += tree_distance(*(model.face_meshes.surface.bvh for model in (a, b)), np.eye(4)) > 0.0
        assert exact_distance(a, b, np.eye(4)).upper <= 1e-6
        assert exact_distance(b, a, np.eye(4)).upper <= 1e-6
    assert hidden


@pytest.mark.parametrize(("more", "is_least"), [(0.1, True), (0.0, False)])
def test_a_gap_that_is_not_the_least_shortens_no_way(more, is_least, monkeypatch):
    measure = cad_process.distance

    def measured(*pair):
        nearest = measure(*pair)
        return nearest._replace(distance=nearest.distance + more, is_least=is_least)

    monkeypatch.setattr(cad_process, "distance", measured)
    distance = penetration(*models("balls", -0.3), np.eye(4), Distance(-np.inf, -0.01))
    assert -0.4 <= distance.lower <= -0.3 <= distance.upper


def test_what_facets_cut_off_a_pin_counts_in_the_bound_by_meshes(monkeypatch):
    """A square hole meets a round pin at four lines, which lie between two corners of its facets."""
    monkeypatch.setattr(cad_process, "common", lambda *_: CommonPart(0.0, 0.0, np.zeros((2, 3))))
    plate = cut(block((-20, -20, -5), (20, 20, 5)), block((-8, -8, -6), (8, 8, 6)))
    a, b = models_of(plate, rod(8.04, -9, 9))
    for angle in (0.01, 0.03, 0.05):
        least, most = penetration(a, b, turn((0, 0, 1), angle), Distance()).interference
        assert least <= 0.04 <= most < 0.06


def test_a_solid_of_planes_and_cylinders_has_a_closed_form_without_an_error():
    """Its flat faces are off their triangles only along the hole, which is measured for itself."""
    plate = cut(block((-20, -20, -5), (20, 20, 5)), rod(8.0, -6, 6))
    for other, gap in ((block((5, 5, 5.02), (9, 9, 9)), 0.02), (rod(7.9, -9, 9), 0.1)):
        distance = refine(*models_of(plate, other), np.eye(4), Distance(), lambda d: d.lower > 0.0, cad_forms=True)
        assert distance.level == "features"
        assert distance.lower == pytest.approx(gap, abs=1e-9)


def test_where_open_cascade_misses_a_common_part_or_some_of_it_nothing_is_known(monkeypatch):
    ball, cone = models("ball_in_cone", -0.005)  # it does miss this one in some poses
    shared = cad_process.common(ball.shape.brep, cone.shape.brep, np.eye(4), 0.04)
    for part, attested in ((CommonPart(0.0, 0.0, np.zeros((2, 3))), 0.0), (shared, 0.02)):
        for name in ("common", "quick_common"):
            monkeypatch.setattr(cad_process, name, lambda *_, part=part: part)
        for quick in (True, False):
            assert exact_overlap(ball, cone, np.eye(4), 0.04, quick=quick, attested=attested).lower == -np.inf
    assert exact_overlap(ball, cone, np.eye(4), 0.04, attested=0.004).lower <= -0.005


@pytest.mark.parametrize("splines", [False, True])
def test_what_is_measured_does_not_depend_on_meshes_that_were_made_before(splines):
    """A cube's corner 0.009 mm above the end of a rod, beyond the polygon that its triangles make of the end."""
    cube = moved(block((0, 0, 0), (8, 8, 8)), shift(19.995, 0.0, 0.009) @ turn((1, -1, 0), np.arccos(3.0**-0.5)))
    for angle in (0.198, 0.287, 0.376, 1.0):
        end = moved(rod(20.0, -10.0, 0.0), turn((0, 0, 1), angle))
        if splines:
            end = occ.BRepBuilderAPI_NurbsConvert(end, True).Shape()
        (row,) = check(cad_scene(end, cube)).pairs
        assert row.verdict.value == "contact"
        assert row.distance.lower <= 0.009 <= row.distance.upper <= 0.00901


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("family", ["balls", "ball_on_plate", "rods_crossed"])
def test_no_point_of_a_border_is_deeper_than_the_other_side_of_it_is_far(family, order):
    a, b = models(family, -0.06)[::order]
    T = random_pose(np.random.default_rng(1))
    turned = to_bytes(moved(from_bytes(b.shape.brep), np.linalg.inv(T)))
    part = cad_process.common(a.shape.brep, turned, T, 0.5)
    for model, border in zip((a, b), part.borders, strict=True):
        middles = border.points[border.triangles].mean(axis=1)[::9]
        assert np.abs(cad_process.depths(model.shape.brep, middles)).max() <= border.errors.max()
    # The depth of one in the other.
    for model, border, other in zip((b, a), part.borders, part.borders[::-1], strict=True):
        at_most = farthest([_measured(border, other)], lambda *_: False, 1000)
        middles = border.points[border.triangles].mean(axis=1)[::9]
        assert np.abs(cad_process.depths(model.shape.brep, middles)).max() <= at_most


@pytest.mark.parametrize(("share", "most"), [(0.04, 0.012), (0.015, 0.0085), (0.004, 0.007)])
def test_between_the_corners_of_its_triangles_a_border_may_be_deepest(share, most):
    """The overlap of two plates drilled alike: on the border of every face both plates end, by the walls of a hole."""
    a, b = models("plates_drilled_alike", -0.006)
    for T in (np.eye(4), random_pose(np.random.default_rng(1))):
        turned = cad_model(moved(from_bytes(b.shape.brep), np.linalg.inv(T)))
        distance = exact_overlap(a, turned, T, share)
        assert -most <= distance.lower <= -0.006 <= distance.upper <= -0.00599


@pytest.mark.parametrize("share", [0.5, 0.04, 0.004])
def test_a_wedge_between_walls_is_deepest_where_no_triangle_has_its_middle(share):
    """The overlap of two blocks with the same walls, one with a sloping underside: 0.01 mm by one wall."""
    below = moved(block((-50, -50, -50), (50, 50, 0)), shift(0.0, 0.0, 4.998) @ turn((0, 1, 0), np.arctan(0.0004)))
    a, b = models_of(block((0, 0, 0), (20, 20, 5)), cut(block((0, 0, 0), (20, 20, 15)), below))
    distance = exact_overlap(a, b, np.eye(4), share)
    assert -0.0101 <= distance.lower <= -0.01 / 1.0004


@pytest.mark.parametrize("share", [0.04, 0.015, 0.004])
def test_a_sheet_across_a_rod_is_deepest_in_its_middle(share):
    """As deep as the rod is thick to its axis, where no corner of the border need be."""
    a, b = models_of(rod(3.0, -10.0, 10.0), block((-9, -9, 0), (9, 9, 1)))
    assert -3.03 <= exact_overlap(a, b, np.eye(4), share).lower <= -3.0


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize(("radius", "depth"), [(1.5, 0.45), (0.7, 0.45), (2.0, 0.009)])
def test_a_small_pin_under_a_large_sheet_counts(radius, depth, share):
    """Under the pin of a plate the sheet is as deep as the plate's flat side is far, whose round border has a sag."""
    plate = occ.BRepAlgoAPI_Fuse(block((-105, -105, -10), (105, 105, 0)), rod(radius, -5.0, 10.0, 7.3, 4.1)).Shape()
    a, b = models_of(plate, block((-100, -100, -depth), (100, 100, depth)))
    distance = exact_overlap(a, b, np.eye(4), share)
    assert distance.lower <= -np.hypot(radius, depth) + 1e-9
    assert distance.lower >= -1.06 * np.hypot(radius, depth)


def test_the_border_of_a_common_part_may_go_over_into_a_fillet():
    """A shaft in a bore with rounded ends, off its axis: the triangles along it end over the fillets."""
    bushing = cut(rod(8.0, 0.0, 6.0), rod(4.0, -1.0, 7.0))
    rounding = occ.BRepFilletAPI_MakeFillet(bushing)
    for edge in explore(bushing, "EDGE"):
        curve = occ.BRepAdaptor_Curve(edge)
        if curve.GetType() == occ.GeomAbs_CurveType.GeomAbs_Circle and curve.Circle().Radius() < 5.0:
            rounding.Add(0.3, edge)
    a, b = models_of(rounding.Shape(), rod(4.0, -10.0, 16.0, 0.0094))
    distance = exact_overlap(a, b, np.eye(4), 0.004)
    assert -0.0098 <= distance.lower <= -0.0094 <= distance.upper <= -0.0093


@pytest.mark.parametrize("family", ["hexagon_in_bore", "screw_in_plate"])
def test_a_bound_of_an_interference_is_no_sharper_than_what_is_to_be_decided(family):
    a, b = models(family, -0.0085, seed=5)
    for share, most in itertools.product(SHARES[1:], (0.02, 0.0097)):
        distance = exact_overlap(a, b, np.eye(4), share, end=lambda bounds, _, m=most: bounds.lower >= -m)
        assert -most <= distance.lower <= -0.0085 <= distance.upper


def test_samples_that_cannot_decide_an_interference_are_given_up_but_for_the_finest(monkeypatch):
    a, b = models("hexagon_in_bore", -0.0101, seed=5)
    cuts, cut_further = [], Pieces.cut

    def counted(*given):
        cuts.append(1)
        return cut_further(*given)

    monkeypatch.setattr(Pieces, "cut", counted)
    answers = []
    pair = CadPair(a, b, np.eye(4), lambda d: d.lower >= -0.01)
    pair._attested = 0.0101
    for _, answer in pair._common_part(quick=True):
        answers.append((len(cuts), answer.lower))
    assert [n for n, _ in answers[:2]] == [0, 0] < [answers[2][0]]
    assert -0.0107 < answers[2][1] <= -0.0101


def test_a_face_of_a_common_part_without_triangles_leaves_the_others_as_they_are(monkeypatch):
    a, b = (to_bytes(solid) for solid in (block((0, 0, 0), (10, 10, 10)), block((1, 2, 9), (8, 7, 20))))
    whole = pairs.common(a, b, np.eye(4), 0.04)
    sample, faces = pairs._samples, []

    def without_the_first(*given):
        faces.append(given)
        return [x[:0] for x in sample(*given)] if len(faces) == 1 else sample(*given)

    monkeypatch.setattr(pairs, "_samples", without_the_first)
    borders = pairs.common(a, b, np.eye(4), 0.04).borders
    assert len(faces) == 6
    lost = sum(len(border.triangles) for border in whole.borders) - sum(len(border.triangles) for border in borders)
    assert 0 < lost == len(sample(*faces[0])[0])


def test_a_corner_beside_its_faces_does_not_cut_their_triangles_for_ever():
    """Parts that were fitted together have corners that lie 0.1 mm beside their faces, within a tolerance."""
    low, high = block((0, 0, 0), (10, 10, 10)), block((5, 5, 5), (15, 15, 15))
    for vertex in explore(low, "VERTEX"):
        if min(occ.BRep_Tool.Pnt_s(vertex).Coord()) > 9.0:
            occ.BRep_Builder().UpdateVertex(vertex, occ.gp_Pnt(10.1, 10.1, 10.1), 0.2)
    part = pairs.common(to_bytes(low), to_bytes(high), np.eye(4), 0.04)
    assert part.volume == pytest.approx(125.0)
    for border in part.borders:
        assert len(border.triangles) < 10_000
        assert border.points.max() <= 10.0 + 1e-9
        assert border.errors.max() <= 1e-9


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_what_a_mesh_leaves_out_of_a_face_is_not_overlooked(lost, monkeypatch):
    """As Open CASCADE does of slender plane faces: with finer edges it may not, else corners are all that is known."""
    a, b = (to_bytes(solid) for solid in (block((0, 0, 0), (10, 10, 10)), block((1, 2, 9), (8, 7, 20))))
    meshed, calls = pairs.triangles_of, []

    def without_a_triangle(face, number):
        points, triangles, uv = meshed(face, number)
        calls.append(number)
        return points, triangles[1:] if number == 2 and calls.count(2) <= lost else triangles, uv

    monkeypatch.setattr(pairs, "triangles_of", without_a_triangle)
    part = pairs.common(a, b, np.eye(4), 0.04)
    if lost == 3:
        monkeypatch.setattr(cad_process, "common", lambda *_: part)
        solids = (model_of(BrepSolid("part", brep, np.zeros((2, 3))), Counters()) for brep in (a, b))
        overlap = exact_overlap(*solids, np.eye(4), 0.04)
        assert overlap.lower == -np.inf
        assert overlap.upper == pytest.approx(-1.0, abs=2e-6)
        return
    for border, area in zip(part.borders, (7 * 5, 7 * 5 + 2 * (7 + 5)), strict=True):
        corners = border.points[border.triangles]
        doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert doubled.sum() / 2 == pytest.approx(area)


def test_a_solid_that_touches_itself_along_an_edge_is_measured_by_its_meshes():
    """Two blocks in one shell, with four faces at one edge; it counts as closed, as meshes from files do."""
    builder, shell = occ.BRep_Builder(), occ.TopoDS_Shell()
    builder.MakeShell(shell)
    for shape in (block((0, 0, 0), (4, 4, 4)), block((4, 4, 0), (8, 8, 4))):
        for face in explore(shape, "FACE"):
            builder.Add(shell, face)
    touching = occ.BRepBuilderAPI_MakeSolid(shell).Solid()
    (row,) = check(cad_scene(touching, block((1, 1, 3.95), (7, 7, 6)))).pairs
    assert "FCL" in row.distance.method
    assert row.distance.lower == pytest.approx(-0.05, abs=1e-5)
    assert row.distance.upper == pytest.approx(-0.05, abs=1e-5)


def test_fine_triangles_that_do_not_close_are_not_taken(monkeypatch):
    tessellate = cad_process.tessellate_finely

    def without_a_triangle(brep, chord):
        mesh = tessellate(brep, chord)
        return replace(mesh, faces=mesh.faces[1:], face=mesh.face[1:], errors=mesh.errors[1:])

    monkeypatch.setattr(cad_process, "tessellate_finely", without_a_triangle)
    a, b = models("rods_crossed", -0.06)
    with pytest.raises(Clamp3dError, match="the triangles of solid do not close"):
        a.outer(CAD_CHORDS[-1])
    distance = refine(a, b, np.eye(4), Distance(), lambda d: d.upper - d.lower < 0.01)
    assert distance.lower <= -0.06 <= distance.upper


def test_a_common_part_beside_the_solids_widens_the_bounds(monkeypatch):
    a, b = models("boxes_face_to_face", -0.06)
    part = cad_process.common(a.shape.brep, b.shape.brep, np.eye(4), 0.04)
    sides = tuple(replace(side, points=side.points + 500.0) for side in part.borders)
    moved = replace(part, borders=sides)
    monkeypatch.setattr(cad_process, "common", lambda *_: moved)
    distance = exact_overlap(a, b, np.eye(4), 0.04)
    assert distance.lower <= -400.0  # nothing is known of it
    assert distance.upper >= 0.0


def test_points_that_refute_a_missing_common_part_say_how_deep_it_is(monkeypatch):
    a, b = models("ball_in_ring", -0.012)
    monkeypatch.setattr(cad_process, "quick_common", lambda *_: CommonPart(0.0, 0.0, np.zeros((2, 3))))
    assert -0.012 <= exact_overlap(a, b, np.eye(4), 0.04, quick=True).upper < -1e-4


def test_a_point_a_little_beside_one_solid_attests_as_much_less():
    for beside, overlap in ((0.0, 1e-4), (1.5e-6, 1e-4 - 1.5e-6), (3e-6, -np.inf)):  # the last not even that they touch
        found = attested_overlap(np.zeros((1, 3)), np.array([[-beside], [1e-4]]))
        assert found.upper == pytest.approx(1e-6 - overlap, abs=1e-12)


@pytest.mark.parametrize(("off", "verdict"), [(0.006, "duplicate"), (0.015, "contained")])
def test_solids_from_cad_that_all_but_fill_each_other(off, verdict):
    """Two balls about one point: of the larger one a skin of ``off`` mm is outside the other, coarse meshes or not."""
    for a, b in itertools.permutations(models_of(ball(1.0), ball(1.0 + off))):
        assert kind_of_overlap(a, b, np.eye(4), 0.01).value == verdict


@pytest.mark.parametrize(("out", "verdict"), [(0.009, "contained"), (0.012, "clash")])
@pytest.mark.parametrize(
    "make", [lambda: block((-50, -50, -50), (50, 50, 40)), lambda: ball(40.0), lambda: rod(30.0, -40.0, 40.0)]
)
def test_how_much_of_a_large_solid_stands_out_of_another_says_whether_that_holds_it(make, out, verdict):
    """Not how much of its volume: of a large part that is little."""
    a, b = models_of(make(), block((-100, -100, -200), (100, 100, 40 - out)))
    assert kind_of_overlap(a, b, np.eye(4), 0.01).value == verdict
    assert kind_of_overlap(b, a, np.eye(4), 0.01).value == verdict


def test_a_ball_of_splines_is_the_duplicate_of_the_ball():
    a, b = models_of(ball(40.0), occ.BRepBuilderAPI_NurbsConvert(ball(40.0), True).Shape())
    assert kind_of_overlap(a, b, np.eye(4), 0.01).value == "duplicate"


def test_a_common_part_leaves_the_solids_as_they_were():
    """Open CASCADE widens the tolerances of what it is given, and makes coarse triangles of that."""
    ball, cone = (model.shape.brep for model in models("ball_in_cone", -0.005))
    before = [len(cad_process.tessellate(brep, 0.0025).faces) for brep in (ball, cone)]
    cad_process.common(ball, cone, np.eye(4))
    assert [len(cad_process.tessellate(brep, 0.0025).faces) for brep in (ball, cone)] == before


@pytest.mark.parametrize("known", [True, False])
def test_a_ball_is_as_far_as_its_centre_less_its_radius(known, monkeypatch):
    """Of two whole spheres in one of some fifty places Open CASCADE finds another distance, 0.01 to 0.5 mm larger."""
    if not known:
        monkeypatch.setattr(pairs, "_ball", lambda _: None)
    rng, missed = np.random.default_rng(8), 0
    for _ in range(150):
        gap, radii = rng.uniform(1e-3, 0.1), rng.uniform(0.3, 8.0, 2)
        turned = [random_pose(rng), random_pose(rng)]
        place = rng.normal(size=3)
        turned[0][:3, 3], turned[1][:3, 3] = 0.0, (radii.sum() + gap) * place / np.linalg.norm(place)
        a, b = (BrepSolid.of(moved(ball(r), T), "ball").brep for r, T in zip(radii, turned, strict=True))
        nearest = pairs.distance(a, b, np.eye(4))
        missed += not nearest.is_least
        if nearest.is_least:
            assert nearest.distance == pytest.approx(gap, abs=1e-6)
        assert np.linalg.norm(nearest.q - nearest.p) == pytest.approx(nearest.distance, abs=1e-9)
        assert np.linalg.norm(nearest.p) == pytest.approx(radii[0], abs=1e-6)
    assert missed <= (0 if known else 12)


@pytest.mark.parametrize("splines", [0.0, 1.0])
@pytest.mark.parametrize("family", ["balls", "ball_on_plate", "ball_in_socket", "ball_in_cone", "ball_in_ring"])
def test_the_overlap_of_a_ball_is_its_radius_less_the_distance_of_its_centre(family, splines):
    # Open CASCADE takes seconds where a ball is concentric with a socket of splines.
    count = 1 if family == "ball_in_socket" and splines else 4
    for seed, gap in ((1, -0.0098), (2, -1e-4), (3, 0.0), (4, 0.03))[:count]:
        a, b = models(family, gap, seed, splines)
        distance = exact_distance(a, b, np.eye(4))
        assert distance.lower <= gap <= distance.upper
        assert distance.upper - distance.lower == pytest.approx(2e-6, abs=1e-12)


@pytest.mark.parametrize("pole", [1.0, -1.0])
@pytest.mark.parametrize("splines", [False, True])
def test_near_the_pole_of_a_sphere_a_point_is_as_deep_as_the_formula_says(splines, pole):
    """There Open CASCADE's nearest point is up to 1 % of the radius beside, and its distance too large."""
    solid = occ.BRepBuilderAPI_NurbsConvert(ball(5.0), True).Shape() if splines else ball(5.0)
    brep, rng = to_bytes(first_solid(solid)), np.random.default_rng(4)
    aside = rng.normal(size=(60, 2)) * 10.0 ** rng.uniform(-6, -1, (60, 1))
    away = 10.0 ** rng.uniform(-6, -1, 60) * rng.choice([-1.0, 1.0], 60)
    points = np.column_stack([aside, np.full(60, pole)])
    points *= ((5.0 - away) / np.linalg.norm(points, axis=1))[:, None]
    assert cad_process.depths(brep, points) == pytest.approx(away, abs=1e-9)


def test_a_dome_is_as_far_from_a_plate_as_its_centre_less_its_radius():
    """Its pole is nearly the nearest point: Open CASCADE's distance is up to 0.02 mm too large."""
    rng = np.random.default_rng(2)
    fused = occ.ShapeUpgrade_UnifySameDomain(occ.BRepAlgoAPI_Fuse(rod(8.0, 0.0, 16.0), ball(8.0)).Shape())
    fused.Build()
    dome = first_solid(fused.Shape())
    assert len([*explore(dome, "FACE")]) == 3
    for tilt in 10.0 ** rng.uniform(-5, -1, 10):
        gap, axis = float(10.0 ** rng.uniform(-4, -1)), [*rng.normal(size=2), 0.0]
        plate = block((-30, -30, -20), (30, 30, -8.0 - gap))
        for a, b in itertools.permutations(models_of(plate, moved(dome, turn(axis, tilt)))):
            distance = exact_distance(a, b, np.eye(4))
            assert distance.lower <= gap <= distance.upper
            assert distance.upper - distance.lower == pytest.approx(2e-6, abs=1e-12)


@pytest.mark.parametrize("splines", [False, True])
def test_an_ellipsoid_is_as_far_from_a_plate_as_its_support_says(splines):
    ends = occ.gp_Pnt(0, 0, -6), occ.gp_Pnt(0, 0, 6)
    arc = occ.gp_Elips(occ.gp_Ax2(occ.gp_Pnt(), occ.gp_Dir(0, 1, 0), occ.gp_Dir(0, 0, 1)), 6.0, 4.0)
    edges = (occ.BRepBuilderAPI_MakeEdge(arc, *ends).Edge(), occ.BRepBuilderAPI_MakeEdge(*ends[::-1]).Edge())
    outline = occ.BRepBuilderAPI_MakeFace(occ.BRepBuilderAPI_MakeWire(*edges).Wire()).Face()
    solid = occ.BRepPrimAPI_MakeRevol(outline, occ.gp_Ax1(occ.gp_Pnt(), occ.gp_Dir(0, 0, 1))).Shape()
    solid = occ.BRepBuilderAPI_NurbsConvert(solid, True).Shape() if splines else solid
    rng = np.random.default_rng(5)
    for tilt in 10.0 ** rng.uniform(-5, -1, 5):
        gap, T = float(10.0 ** rng.uniform(-4, -1)), turn([*rng.normal(size=2), 0.0], tilt)
        lowest = np.linalg.norm(np.array([4.0, 4.0, 6.0]) * T[2, :3])
        a, b = models_of(block((-30, -30, -20), (30, 30, -lowest - gap)), moved(solid, T))
        distance = exact_distance(a, b, np.eye(4))
        assert distance.lower <= gap <= distance.upper
        assert distance.upper - distance.lower == pytest.approx(2e-6, abs=1e-12)


def test_a_distance_that_a_point_in_both_solids_contradicts_is_not_believed(monkeypatch):
    """Open CASCADE says so of a thread in a tube now and then."""
    lying = Nearest(0.02, np.zeros(3), np.array([0.0, 0.0, 0.02]))
    monkeypatch.setattr(cad_process, "distance", lambda *_: lying)
    a, b = models("rods_crossed", -0.006)
    verdict, distance = judge(a, b, np.eye(4), Distance(), Thresholds(), None)
    assert verdict.value == "contact"
    assert distance.lower <= -0.006 <= distance.upper


@pytest.mark.parametrize("gap", [0.004, -0.3])
def test_of_splines_no_distance_is_believed_that_meshes_contradict(gap, monkeypatch):
    """Of a wavy face Open CASCADE may find a gap between two parts that is not the least, and does not say so."""
    measure = cad_process.distance

    def another(*pair):
        nearest = measure(*pair)
        return nearest._replace(distance=nearest.distance + 0.02, is_least=True)

    monkeypatch.setattr(cad_process, "distance", another)
    a, b = models("spline_under_plate", gap)
    verdict, distance = judge(a, b, np.eye(4), Distance(), Thresholds(), None)
    assert verdict.value == ("contact" if gap > 0.0 else "clash")
    assert distance.lower <= gap <= distance.upper
    if gap < 0.0:
        depth = penetration(a, b, np.eye(4), distance)
        assert depth.lower <= gap <= depth.upper


def test_splines_without_triangles_that_close_are_measured_by_open_cascade_alone():
    a, b = models("spline_under_plate", 0.05)
    for model in (a, b):
        model.__dict__["chords"] = ()
    verdict, distance = judge(a, b, np.eye(4), Distance(), Thresholds(), None)
    assert verdict.value == "clear"
    assert distance.lower <= 0.05 <= distance.upper


def test_corners_of_triangles_that_do_not_close_attest_an_overlap_without_a_common_part(monkeypatch):
    a, b = models_of(block((-5, -5, -5), (5, 5, 5)), block((-3, -3, 4.95), (3, 3, 9)))
    for name in ("common", "quick_common"):
        monkeypatch.setattr(cad_process, name, lambda *_: CommonPart(0.0, 0.0, np.zeros((2, 3))))
    for model in (a, b):
        model.__dict__["chords"] = ()
    verdict, distance = judge(a, b, np.eye(4), Distance(), Thresholds(), None)
    assert verdict.value == "clash"
    assert distance.upper == pytest.approx(-0.05, abs=2e-6)


@pytest.mark.parametrize("has_common_part", [True, False])
def test_a_shallow_lens_has_its_volume_within_the_bounds_and_its_rim_in_the_box(has_common_part, monkeypatch):
    if not has_common_part:
        monkeypatch.setattr(cad_process, "common", lambda *_: CommonPart(0.0, 0.0, np.zeros((2, 3))))
    radius, depth = 50.0, 0.05
    half = depth / 2
    volume, rim = 2.0 * np.pi * half**2 * (3.0 * radius - half) / 3.0, np.sqrt(2.0 * radius * half - half**2)
    solids = models_of(ball(radius), ball(radius, 2.0 * radius - depth))
    drawn = [model_of(sphere(radius), Counters())] * 2
    places = np.eye(4), shift(z=2.0 * radius - depth)
    for (a, b), T in zip((solids, drawn), places, strict=True):
        overlap = Locator(a, b, np.eye(4), T).overlap
        if overlap is None:  # the facets of the spheres do not meet
            assert a is drawn[0]
            continue
        assert overlap.volume[0] <= volume <= overlap.volume[1]
        assert (overlap.box[0, :2] <= -rim).all()
        assert (overlap.box[1, :2] >= rim).all()


def test_the_point_of_an_overlap_lies_in_both_parts():
    outer, inner = cut(rod(43.2, -20, 20), rod(43.0, -21, 21)), cut(rod(43.014, -25, 25), rod(42.5, -26, 26))
    (row,) = check(cad_scene(outer, inner, turn((0, 0, 1), 0.02))).pairs
    assert row.verdict.value == "clash"
    assert 43.0 - 1e-5 <= np.hypot(*row.where.point[:2]) <= 43.014 + 1e-5


@pytest.mark.parametrize("splines", [False, True])
def test_what_fills_a_void_is_not_contained(splines):
    block_with_void = cut(block((-20, -20, -20), (20, 20, 20)), block((-7, -7, -7), (7, 7, 7)))
    filler = block((-7.05, -7.05, -7.05), (7.05, 7.05, 7.05))
    if splines:
        filler = occ.BRepBuilderAPI_NurbsConvert(filler, True).Shape()
    a, b = models_of(block_with_void, filler)
    assert kind_of_overlap(a, b, np.eye(4), 0.01).value == "clash"
    assert kind_of_overlap(b, a, np.eye(4), 0.01).value == "clash"


@pytest.mark.parametrize(("void", "verdict", "meshes"), [(0.0, "contained", 1), (0.1, "clash", 2)])
def test_coarse_meshes_tell_what_is_deep_inside_but_not_that_it_fills_a_small_void(void, verdict, meshes):
    outer = block((-20, -20, -20), (20, 20, 20))
    a, b = models_of(cut(outer, ball(void)) if void else outer, ball(2.0))
    assert kind_of_overlap(a, b, np.eye(4), 0.01).value == verdict
    assert b.counters.built["meshes"] == meshes


def test_coarse_meshes_do_not_tell_whether_a_part_is_inside_that_bulges_out_of_its_facets():
    """Into a slot of the other that the facet itself is clear of."""
    pin = rod(30.0, -8.0, 16.0)
    (model,) = models_of(pin)
    facets = model.outer(model.chords[0])
    x, y, _ = facets.normals[np.abs(facets.normals[:, 2]) < 0.1][0]
    assert (facets.vertices[facets.faces] @ (x, y, 0.0)).min(axis=1).max() < 29.97
    slot = moved(block((29.98, -0.1, -1.0), (31.0, 0.1, 1.0)), turn((0, 0, 1), np.arctan2(y, x)))
    a, b = models_of(cut(block((-40, -40, -20), (40, 40, 20)), slot), pin)
    assert kind_of_overlap(a, b, np.eye(4), 0.001).value == "clash"


def test_of_a_ball_whose_centre_is_inside_the_depth_is_not_told_by_its_radius():
    for z in (-1.0, 0.0):  # 1 mm below a face of a block, and on it
        a, b = models_of(ball(2.0, z), block((-9, -9, -9), (9, 9, 0)))
        assert exact_distance(a, b, np.eye(4)).lower == exact_distance(b, a, np.eye(4)).lower == -np.inf


def test_only_a_whole_ball_counts_as_one():
    both = occ.BRepAlgoAPI_Fuse(ball(5.0), ball(5.0, 4.0)).Shape()
    half = occ.BRepBuilderAPI_MakeFace(occ.gp_Sphere(occ.gp_Ax3(), 5.0), 0.0, np.pi, -np.pi / 2, np.pi / 2).Face()
    builder, open_shell = occ.BRep_Builder(), occ.TopoDS_Shell()
    builder.MakeShell(open_shell)
    builder.Add(open_shell, half)
    for solid in (first_solid(both), occ.BRepBuilderAPI_MakeSolid(open_shell).Solid(), block((0, 0, 0), (1, 1, 1))):
        assert pairs._ball(to_bytes(solid)) is None
    assert pairs._ball(to_bytes(ball(5.0, 4.0)))[1] == pytest.approx(5.0, abs=1e-12)


def test_a_distance_that_is_not_the_least_bounds_from_above_alone(monkeypatch):
    a, b = models("boxes_face_to_face", 0.03)
    nearest = pairs.Nearest(0.03, np.zeros(3), np.array([0.0, 0.0, 0.03]))
    for is_least, lower in ((True, 0.03 - 1e-6), (False, -np.inf)):
        monkeypatch.setattr(cad_process, "distance", lambda *_, x=is_least: nearest._replace(is_least=x))
        distance = exact_distance(a, b, np.eye(4))
        assert (distance.lower, distance.upper) == (lower, pytest.approx(0.03 + 1e-6))


@pytest.mark.parametrize("width", [0.03, 0.04])
def test_a_ball_in_material_beside_a_narrow_slot_is_no_ball_outside(width):
    """Just beyond the nearest wall, on the other side of the slot, is material too."""
    slotted = cut(block((-9, -9, -9), (9, 9, 9)), block((3, -9, -9), (3 + width, 9, 5)))
    for radius, x in ((1.0, 0.0), (0.5, 2.4), (2.0, 2.0)):
        a, b = (BrepSolid.of(solid, "a").brep for solid in (moved(ball(radius), shift(x)), first_solid(slotted)))
        assert pairs.distance(a, b, np.eye(4)).distance == pairs.distance(b, a, np.eye(4)).distance == 0.0


@pytest.mark.parametrize("splines", [0.0, 1.0])
@pytest.mark.parametrize("family", ["pin_in_hole", "tube_in_tube", "nut_on_plate", "boxes_face_to_face"])
def test_that_faces_coincide_is_proven_without_a_common_part(family, splines):
    a, b = models(family, 0.0, splines=splines)
    verdict, distance = judge(a, b, np.eye(4), Distance(level="boxes"), Thresholds(), None)
    by = {"pin_in_hole": "sections", "tube_in_tube": "sections", "nut_on_plate": "exact"}.get(family, "meshes")
    assert (verdict.value, distance.level) == ("contact", by)
    assert -0.01 <= distance.lower <= 0.0 <= distance.upper <= 0.01
    assert a.counters.queries["exact"] == (2 if by == "exact" else 0)


def test_a_corner_that_is_wrongly_taken_for_inside_is_no_contact():
    """Open CASCADE says that these two plates of splines, 0.0003 mm apart, touch: a corner is in the other, it says."""
    rng = np.random.default_rng(56)
    pair, T = placed_pair("plates_drilled_alike", rng, 3e-4, splines=1.0), random_pose(rng)
    a, b = (to_bytes(first_solid(occ_moved(solid, T))) for solid in (pair.a, pair.b))
    for first, second in ((a, b), (b, a)):
        nearest = pairs.distance(first, second, np.eye(4))
        assert nearest.distance == pytest.approx(3e-4, abs=1e-6)
        assert nearest.is_least


def test_where_one_of_two_solids_may_be_in_the_other_the_distance_of_their_faces_is_no_bound_from_below(monkeypatch):
    inner, outer = (to_bytes(block((-x, -x, -x), (x, x, x))) for x in (1.0, 5.0))
    assert pairs.distance(inner, outer, np.eye(4)).distance == 0.0
    wrong = pairs.Nearest(0.0, np.array([9.0, 0.0, 0.0]), np.array([9.0, 0.0, 0.0]))
    nearest = pairs._confirmed(wrong, from_bytes(inner), from_bytes(outer))
    assert (nearest.distance, nearest.is_least) == (4.0, False)


@pytest.mark.parametrize("family", ["ball_in_cone", "ball_in_socket"])
def test_the_distance_of_a_ball_tells_a_small_overlap_which_no_common_part_does(family):
    a, b = models(family, -3.6e-4)
    verdict, distance = judge(a, b, np.eye(4), Distance(level="boxes"), Thresholds(), None)
    assert verdict.value == "contact"
    assert (distance.lower, distance.upper) == pytest.approx((-3.6e-4, -3.6e-4), abs=2e-6)


@pytest.mark.parametrize("state", ["TopAbs_IN", "TopAbs_ON"])
def test_no_depth_where_both_sides_of_an_edge_are_said_to_be_inside(state, monkeypatch):
    """Open CASCADE says so of some points beside splines; what it says of the other side shows it."""

    class Wrong:
        def __init__(self, _):
            self.State = lambda: getattr(occ.TopAbs_State, state)

        def Perform(self, *_):
            pass

    angle = BrepSolid.of(cut(block((-5, -5, -5), (5, 5, 5)), block((0, 0, -6), (6, 6, 6))), "angle").brep
    at_edge = to_bytes(moved(ball(1.0), shift(-1.0, -1.0)))
    at_edges, in_faces = np.array([[-1.0, -1.0, 0.0], [8.0, -9.0, 0.0]]), np.array([[2.0, -1.0, 0.0], [2.0, 1.0, 0.0]])
    for is_wrong in (True, False):
        with monkeypatch.context() as patch:
            if is_wrong:
                patch.setattr(occ, "BRepClass3d_SolidClassifier", Wrong, raising=False)
            assert pairs.depths(angle, at_edges) == pytest.approx([-(2.0**0.5) if is_wrong else 2.0**0.5, -5.0])
            assert pairs.depths(angle, in_faces) == pytest.approx([1.0, -1.0])
            assert not pairs.distance(at_edge, angle, np.eye(4)).is_signed


def test_depths_beside_a_narrow_slot_and_of_a_point_as_near_to_an_edge_as_to_a_face():
    slotted = to_bytes(first_solid(cut(block((-5, -5, -5), (5, 5, 5)), block((0, 0, -6), (0.2, 6, 6)))))
    notched = to_bytes(first_solid(cut(block((-9, -9, -9), (9, 1, 9)), block((0.6, -10, -10), (10, -0.8, 10)))))
    assert pairs.depths(slotted, np.array([[-1.0, -1.0, 0.0]])) == pytest.approx([2.0**0.5])
    assert pairs.depths(notched, np.zeros((1, 3))) == pytest.approx([1.0])


@pytest.mark.parametrize("shape", [cut(ball(8.0), ball(5.0)), ring(8.0, 2.0), *(cone(r, 5 - r, 0, 7) for r in (5, 2))])
@pytest.mark.parametrize("turned", [False, True])
def test_depths_of_points_are_those_from_a_fine_mesh(shape, turned):
    """Inside by its winding numbers; Open CASCADE tells it by the normal at the nearest point."""
    rng = np.random.default_rng(2)
    T = random_pose(rng) if turned else np.eye(4)
    points = rng.uniform(-9.0, 9.0, (40, 3))
    solid = BrepSolid.of(moved(shape, T), "solid")
    found = pairs.depths(solid.brep, to_target(T, points))
    mesh = BrepSolid.of(shape, "solid").tessellated(0.01)
    surface = Surface(mesh.vertices, mesh.faces)
    true = np.where(surface.contains(points), 1.0, -1.0) * surface.distance(points)
    np.testing.assert_allclose(found, true, atol=0.02)


def test_a_search_that_needs_common_parts_ends_after_fewer_times(monkeypatch):
    """A bar that slides along the inner edge of an angle touches it all the way; each time counts for fifty."""
    monkeypatch.setattr(moving_pair, "BUDGET", 500)
    angle = cut(block((-5, -5, -5), (5, 5, 5)), block((0, 0, -6), (6, 6, 6)))
    bar, still = models_of(block((0, 0, -1), (2, 2, 1)), angle)
    pair = moving_pair.MovingPair(bar, still, Motion.translate((0.0, 0.0, 4.0)), np.eye(4), np.eye(4))
    least, _ = pair.least_distance(Thresholds())
    assert pair.evaluations == 10
    assert least.lower < -0.01 < -1e-6 <= least.upper <= 1e-6  # nothing is known of the times between


def test_a_ball_that_falls_through_a_ring_touches_it_when_its_centre_tells():
    """Between steps Open CASCADE's tolerance is all that can be known, and fine meshes of the ring take too long."""
    scene = cad_scene(ring(20.0, 8.0), ball(0.5), shift(20.0, 0.0, 20.0))
    (row,) = check(scene.with_motion(Motion.translate((0.0, 0.0, -40.0), parts="b"))).motions
    assert row.verdict.value == "clash"
    latest = (20.0 - 8.0 - 0.5 - 0.010001) / 40.0
    assert latest - 1e-6 < row.contact_at <= latest


def test_a_search_asks_no_more_of_open_cascade_than_its_tolerance():
    still, falling = models_of(ring(20.0, 8.0), ball(0.5))
    way = Motion.translate((0.0, 0.0, -40.0))
    pair = moving_pair.MovingPair(falling, still, way, shift(20.0, 0.0, 20.0), np.eye(4))
    first = pair.first_time(0.010001)
    assert first.t == pytest.approx((20.0 - 8.0 - 0.5 - 0.010001) / 40.0, abs=1e-6)
    assert (first.by - first.t) * 40.0 <= 1e-6  # one and the same, as far as a search goes
    assert falling.counters.queries["exact"] < 2 * pair.evaluations
