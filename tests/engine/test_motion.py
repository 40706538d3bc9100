"""Motions in a scene against closed forms and dense sampling."""

import math
import re
from dataclasses import replace

import manifold3d
import numpy as np
import pytest
import trimesh

from clamp3d import InputError, Motion, Scene, Verdict, check, distance, first_contact, min_clearance, shapes
from clamp3d.engine import moving_pair
from clamp3d.engine.model import Counters, model_of
from clamp3d.engine.moving_groove import MovingInGroove
from clamp3d.geometry.profile import Arc, Profile
from clamp3d.kernel import Cylinder, SweptArc, rotation, translation
from clamp3d.output.scene_report import check_to_text
from clamp3d.output.wording import circumstances
from clamp3d.shapes import make_mesh
from tests.kinds import manifold_shape, mesh_shape


@pytest.mark.parametrize("angle", [1e-13, 1e-10, 1e-6, 2.0])
@pytest.mark.parametrize("far", [0.0, 1e4, 1e8])
def test_a_part_that_hardly_turns_arrives_too(angle, far):
    """A turn that is rounding, as of poses with twelve digits: its axis is 1e13 mm away, the goal 50 mm."""
    rng = np.random.default_rng(1)
    start = rotation(rng.normal(size=3), 1.0)
    start[:3, 3] = far * rng.normal(size=3)
    goal = rotation(rng.normal(size=3), angle) @ start
    goal[:3, 3] = start[:3, 3] + 30.0 * rng.normal(size=3)
    motion = Motion.to_pose(goal, parts="a").resolved(start)
    np.testing.assert_allclose(motion.at(1.0, start), goal, rtol=4e-16, atol=1e-11)
    middle = 0.5 * (start[:3, 3] + goal[:3, 3])
    np.testing.assert_allclose(motion.at(0.5, start)[:3, 3], middle, rtol=4e-16, atol=max(1e-11, 50.0 * angle))


def test_who_is_met_between_two_of_the_times_that_are_looked_at_and_who_is_behind():
    """On its arc of 1 m the tip is 0.12 mm further out, midway between two of 33 times, than at either."""
    tip, angle = shapes.box((0.02, 0.02, 0.02)), 10.5 / 32.0
    scene = Scene().add("tip", tip, rotation((0, 0, 1), -angle) @ translation(1000.0, 0.0, 0.0))
    scene = scene.add("ahead", tip, translation(1000.025, 0.0, 0.0)).add("behind", tip, translation(700.0, -700.0, 0.0))
    result = check(scene.with_motion(Motion.screw((0, 0, 1), 1.0, parts="tip")))
    (row,) = result.motions
    assert (row.b, row.verdict, row.t) == ("ahead", Verdict.CONTACT, pytest.approx(angle, abs=1e-4))
    assert row.distance.upper == pytest.approx(0.005, abs=1e-5)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.3, 0.0, 1.0)])
def test_a_wire_on_a_wide_arc_is_never_nearer_than_the_bound_of_its_way(axis):
    """Midway it goes along the groove, or stands on its edge; before and after the arc leads it into the groove."""
    middle, point = translation(0.2, -0.3, 0.0), np.array((0.0, -300.0, 0.0))
    turn = Motion.screw(axis, 0.8, point=point)
    pair = MovingInGroove(SweptArc(7.0, 1.2, 2000.0), Cylinder(6.0, 10.0), turn, turn.at(-0.5, middle), None)
    for half in (0.5, 0.2, 0.05):
        times = np.linspace(0.5 - half, 0.5 + half, 41)
        assert pair.between(times[0], times[-1]) <= min(pair.contact(t).distance for t in times)


def test_what_a_swept_shape_says_is_asked_no_more_where_the_speed_says_as_much():
    """Hulls of swept meshes took ten times as long as all distances of a search."""
    model = model_of(shapes.box((4, 4, 4)), Counters())
    asked = moving_pair.MovingPair(model, model, Motion.translate((9, 0, 0)), translation(0.0, 9.0, 0.0), np.eye(4))
    bounds = [asked.between(0.0, 1.0, by_speed) for by_speed in (4.9, *8 * [5.1], 4.9)]
    assert bounds[:9] == pytest.approx([5.0] * 9)
    assert bounds[9] == -np.inf


def test_a_depth_is_no_margin_of_bodies_whose_depth_is_not_measured_on_the_way():
    """Boxes of 10 and 4 mm are 6.9 mm deep in each other soon before they are concentric."""
    a, b = shapes.box((10, 10, 10)), shapes.box((4, 4, 4))
    with pytest.raises(InputError, match="margin must be >= 0"):
        first_contact(a, b, Motion.translate((-20, 0, 0)), translation(20.0, 0.0, 0.0), margin=-6.9)


def test_motions_follow_one_another():
    box, rod = shapes.box((10, 10, 10)), shapes.cylinder(1, 10)
    scene = Scene(clearance=2.0).add("box", box).add("rod", rod, translation(30, 0, 0))
    scene = scene.add("tip", rod, translation(40, 0, 0))
    up = Motion.translate((0, 20, 0), parts=("rod", "tip"), name="up")
    over = Motion.translate((-60, 0, 0), parts=("rod", "tip"), name="over")
    result = check(replace(scene, motions=(up, over)))
    assert result.motions == ()  # passes 14 mm above the box
    down = Motion.translate((0, -14.5, 0), parts="rod", name="down")
    short = replace(over, travel=np.array([-30.0, 0, 0]))
    result = check(replace(scene, motions=(up, short, down)))
    assert [(r.motion, r.a, r.b, r.verdict.value) for r in result.motions] == [("down", "rod", "box", "clash")]
    assert result.motions[0].contact_at == pytest.approx((14.0 - 0.01) / 14.5, abs=1e-4)


def test_a_part_that_a_motion_names_twice_moves_once():
    box = shapes.box((10, 10, 10))
    scene = Scene(clearance=6.0).add("still", box).add("moving", box, translation(13, 0, 0))
    go = Motion.translate((1.0, 0.0, 0.0), parts=("moving", "moving"))
    found = check(replace(scene, motions=(go, go))).motions
    assert [row.distance.value for row in found] == pytest.approx([3.0, 4.0])


@pytest.mark.parametrize("gap", [0.01, 0.0100001, 0.01 + 5e-7])
def test_what_counts_as_contact_has_a_first_time(gap):
    """A gap of the contact threshold to rounding is contact."""
    box = shapes.box((10, 10, 10))
    scene = Scene(contact=0.01).add("still", box).add("moving", box, translation(10.0 + gap, 0, 0))
    (row,) = check(replace(scene, motions=(Motion.translate((0, 5, 0), parts="moving"),))).motions
    assert (row.verdict.value, row.contact_at) == ("contact", 0.0)


def joined(*boxes):
    """A mesh of boxes (low, high) that are united."""
    return mesh_shape(trimesh.boolean.union([trimesh.creation.box(bounds=bounds) for bounds in boxes]))


@pytest.mark.parametrize("kind", ["slide", "sink", "turn", "screw"])
def test_first_contact_of_meshes_does_not_depend_on_what_slides_close_by(kind):
    """A block just above a floor meets a bead on it, a bar that turns there a post: the times are known by hand."""
    gap = 0.02
    if kind in ("slide", "sink"):  # sinking it is as near as half the gap when it arrives
        floor = joined(((-100, -30, -10), (100, 30, 0)), ((1.5, -10, -1), (3.5, 10, 1)))
        part, start = joined(((-10, -10, 0), (10, 10, 20))), translation(-20.0, 0.0, gap)
        way = Motion.translate((100.0, 0.0, -4.0 * gap if kind == "sink" else 0.0))
        truth, length = 0.115, 100.0
    else:
        floor = joined(((-60, -60, -10), (60, 60, 0)), ((20, 20, -1), (30, 30, 5)))
        part, start = joined(((-40, -2, 0), (40, 2, 3))), translation(0.0, 0.0, gap)
        way = Motion.screw((0.0, 0.0, 1.0), 1.2, travel=-0.5 * gap if kind == "screw" else 0.0)
        # The post's corner (30, 20) comes to lie on the bar's side, 2 mm from the axis.
        truth, length = (math.atan2(20, 30) - math.asin(2 / math.hypot(20, 30))) / 1.2, 1.2 * math.hypot(20, 30)
    # In frames that nothing is square to.
    A = rotation((0.3, 0.5, 0.8), 0.7)
    turned = replace(way, travel=A[:3, :3] @ way.travel, axis=A[:3, :3] @ way.axis)
    floor = replace(floor, mesh=make_mesh(floor.mesh.vertices @ A[:3, :3].T, floor.mesh.faces))
    hit = first_contact(floor, part, turned, A @ start)
    assert hit.touches
    assert 0.0 <= (truth - hit.t) * length <= 2e-4
    assert hit.evaluations < 1000


def test_a_fin_is_met_though_its_foot_is_nearer_the_axis_than_a_plate_that_screws_past():
    """The post itself is never reached: the fin's sides alone are inside the hull of what the plate's face sweeps."""
    root = np.array([(0.0, -0.5, -0.5), (0.0, 0.5, -0.5), (0.0, 0.5, 0.5), (0.0, -0.5, 0.5), (20.5, 0.0, 0.0)])
    fin = manifold3d.Manifold.hull_points(root).translate((0.0, 0.0, 30.0))
    post = manifold_shape(manifold3d.Manifold.cylinder(600.0, 17.0, 17.0, 96, True) + fin)
    plate = joined(((20, -100, -0.5), (60, 100, 0.5)))
    motion = Motion.screw((0.0, 0.0, 1.0), 0.15, travel=100.0, parts=("plate",))
    scene = Scene(Scene().add("post", post).add("plate", plate).parts, motions=(motion,))
    row = check(scene, depths=False).motions[0]
    assert row.verdict is Verdict.CLASH
    assert 0.29 < row.contact_at < 0.3


def test_evaluations_by_the_finest_meshes_of_drawn_bodies_use_more_of_a_budget(monkeypatch):
    """Of a ball on a circle within a clip 5000 of them, 80 ms each, took 400 s."""
    monkeypatch.setattr(moving_pair, "BUDGET", 100)
    clip = shapes.extrusion(Profile.of(Arc((0, 0), 9.2, -2.09, 2.09), Arc((0, 0), 7.6, 2.09, -2.09)), 18.0)
    turn, start = Motion.screw((0, 0, 1), 1.0), translation(5.0, 0.0, 0.0)
    answer = min_clearance(clip, shapes.sphere(0.97), turn, start)
    assert 4 <= answer.evaluations <= 8
    for t in (0.0, 0.3, 1.0):
        assert answer.distance.lower <= distance(clip, shapes.sphere(0.97), turn.at(t, start)).upper


def test_what_the_models_leave_open_at_the_nearest_time_is_not_searched_for_elsewhere(monkeypatch):
    """0.01 mm apart at the start, known to 0.05: no more steps tell whether they touch."""
    monkeypatch.setattr(moving_pair, "BUDGET", 300)
    mesh = trimesh.creation.icosphere(1, 10.0)
    ball = mesh_shape(mesh, error=0.05)
    motion = Motion.screw((0.3, 0.1, 1.0), 1.6, point=(0.0, 60.0, 0.0), parts=("ball",))
    start = translation(-mesh.bounds[0, 0] + 3.01, 0.0, 0.0)
    scene = Scene().add("tube", shapes.box((6.0, 20.0, 30.0))).add("ball", ball, start)
    result = check(Scene(scene.parts, motions=(motion,)), depths=False)
    row = result.motions[0]
    assert row.verdict is Verdict.UNCERTAIN
    assert row.distance.lower == pytest.approx(-0.04, abs=3e-4)
    assert row.distance.upper == pytest.approx(0.06, abs=3e-4)


def test_a_first_contact_is_not_told_later_than_it_is():
    """Within 0.01 mm after 0.12347 of the way."""
    way = Motion.translate((-10.0, 0.0, 0.0), parts=("b",))
    box = shapes.box((10.0, 10.0, 10.0))
    scene = Scene().add("a", box).add("b", box, translation(11.2447, 0.0, 0.0))
    result = check(Scene(scene.parts, motions=(way,)))
    assert result.motions[0].contact_at == pytest.approx(0.12347, abs=2e-5)
    assert "first contact at t = 0.1234," in circumstances(result.motions[0])
    told = check_to_text(result)
    assert re.search(r"  b and a clash: overlap at least \d+(\.\d+)? mm; .*first contact at t = 0\.1234,", told)
    row = next(line for line in told.splitlines() if line.startswith("  translation"))
    assert " 0.1234 " in row


def test_what_clashes_at_rest_clashes_on_its_way_however_thin_it_is():
    """A strip across a foil: no point of either is 0.01 mm deep in the other, but 0.0175 mm part them."""
    before = Scene().add("foil", shapes.box((20.0, 20.0, 0.005)))
    before = before.add("strip", shapes.box((20.0, 0.005, 0.03)), translation(0, 0, 5))
    within = before.moved({"strip": np.eye(4)})
    (row,) = check(within).pairs
    assert row.verdict.value == "clash"
    for scene, way in ((within, 0.0), (within, 1e-4), (before, -10.0)):
        (row,) = check(scene.with_motion(Motion.translate((0, 0, way), parts="strip"))).motions
        assert row.verdict.value == "clash"


@pytest.mark.parametrize("who", ["plate", "ball"])
def test_a_ball_that_a_plate_is_moved_to_is_met_as_late_as_the_plate_by_the_ball(who):
    way = np.array([100.0, 0.0, -0.015]) * (1.0 if who == "ball" else -1.0)
    scene = Scene().add("plate", shapes.box((200, 20, 10))).add("ball", shapes.sphere(4.0), translation(-50, 0, 9.02))
    (row,) = check(scene.with_motion(Motion.translate(way, parts=who))).motions
    assert row.verdict.value == "contact"
    assert row.distance.lower - 1e-9 <= 0.005 <= row.distance.upper + 1e-9
    assert row.contact_at == pytest.approx((0.02 - 0.010001) / 0.015, abs=1e-4)


def test_a_pin_that_turns_often_about_its_own_axis_keeps_its_play():
    scene = (
        Scene().add("hole", shapes.cylinder(10, 4, bore=5)).add("pin", shapes.cylinder(4.985, 4), translation(0, 0, 10))
    )
    for turns in (3, 10, 40):
        (row,) = check(scene.with_motion(Motion.screw((0, 0, 1), 2 * np.pi * turns, travel=-10, parts="pin"))).motions
        assert row.verdict.value == "clear"
        assert row.distance.lower <= 0.015 + 1e-9 <= row.distance.upper + 2e-9


@pytest.mark.parametrize(("gap", "verdict"), [(0.01005, "clear"), (0.00995, "contact")])
def test_a_least_distance_near_the_threshold_is_searched_until_the_verdict_is_certain(gap, verdict):
    scene = Scene().add("a", shapes.sphere(5.0)).add("b", shapes.sphere(3.0), translation(-20.0, 8.0 + gap, 0.0))
    (row,) = check(scene.with_motion(Motion.translate((41.3, 0.0, 0.0), parts="b"))).motions
    assert row.verdict.value == verdict
    assert row.distance.lower <= gap + 1e-9 <= row.distance.upper + 2e-9


def test_a_depth_that_is_never_reached_is_known_not_to_be():
    groove, wire = SweptArc(7.0, 1.0, 50.0), Cylinder(6.5, 80.0)
    hit = first_contact(groove, wire, Motion.screw((0, 0, 1), 0.3), translation(0, -0.52, 0), margin=-0.05)
    assert hit.touches is False


def test_a_bare_groove_meets_any_shape_in_either_order():
    groove, wire, away = SweptArc(7.0, 1.0, 50.0), Cylinder(6.5, 80.0), translation(0, 20.0, 0)
    one = first_contact(groove, wire, Motion.translate((0, -40.0, 0)), away)
    other = first_contact(wire, groove, Motion.translate((0, 40.0, 0)), translation(0, -20.0, 0))
    assert (one.touches, other.touches) == (True, True)
    assert other.t == pytest.approx(one.t, abs=1e-7)
    block = first_contact(groove, shapes.box((4.0, 4.0, 4.0)), Motion.translate((0, -40.0, 0)), away)
    latest = (20.0 + np.sqrt(49.0 - 4.0) - 2.0) / 40.0
    assert latest - 1e-4 < block.t <= latest  # by meshes of the groove


@pytest.mark.parametrize(("budget", "start"), [(5000, 20.0), (20, 20.0), (8, 20.0), (3, 12.0)])
def test_a_first_contact_that_is_not_certain_is_printed_from_when_to_when_it_may_be(monkeypatch, budget, start):
    """The last search ends before it sees a contact: one is known from the least distance."""
    monkeypatch.setattr(moving_pair, "BUDGET", budget)
    scene = Scene().add("post", shapes.cylinder(4, 60)).add("ball", shapes.sphere(3.0), translation(-start, 6.9, 5))
    result = check(scene.with_motion(Motion.translate((40, 0, 0), parts="ball", name="past")))
    (row,) = result.motions
    truth = (start - math.sqrt(7.01**2 - 6.9**2)) / 40.0
    is_sharp = budget == 5000
    assert row.contact_at - 1e-7 <= truth <= row.contact_by + 1e-6
    assert (row.contact_by - row.contact_at < 1e-6) == is_sharp
    (times,) = set(re.findall("first contact at t = (.*), deepest", check_to_text(result) + circumstances(row)))
    first, _, latest = times.partition(" to ")
    assert float(first) <= row.contact_at < float(first) + 1e-4
    assert latest == "" if is_sharp else float(latest) >= row.contact_by
