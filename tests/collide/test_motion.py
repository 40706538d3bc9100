"""Motions in a scene against closed forms and dense sampling."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from clamp3d.collide.check import check
from clamp3d.collide.model import ModelCache
from clamp3d.collide.motions import first_contact, min_clearance
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
from clamp3d.core import shapes
from clamp3d.core.distance import signed_distances
from clamp3d.core.mesh import make_mesh
from clamp3d.core.motion import Motion
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.core.shapes import MeshShape
from clamp3d.errors import InputError
from clamp3d.output.scene_report import check_to_text
from clamp3d.output.wording import finding_text

GROOVE = SweptArc(7.0, math.radians(60.0), 50.0)
BLOCK = shapes.groove_block(GROOVE, 40.0, 20.0)
WIRE = shapes.cylinder(6.935, 80.0)


def move(standing, moving, start, motion, cache=None, **settings):
    scene = Scene(**settings).add("still", standing).add("moving", moving, start)
    return check(replace(scene, motions=(motion,)), cache=cache).motions


def test_wire_into_the_groove_and_too_far():
    row = move(BLOCK, WIRE, translation(0, 30, 0), Motion.translate((0, -30, 0), parts="moving"))[0]
    assert row.verdict.value == "clear"
    assert row.t == pytest.approx(1.0)
    assert row.distance.lower <= 0.065 <= row.distance.upper + 1e-9
    assert row.distance.upper - row.distance.lower < 0.003
    row = move(BLOCK, WIRE, translation(0, 30, 0), Motion.translate((0, -31, 0), parts="moving"))[0]
    assert row.verdict.value == "clash"
    # Contact begins where the gap is down to the threshold of 0.01 mm.
    assert row.contact_at == pytest.approx((30.0 + 0.055) / 31.0, abs=1e-5)


@pytest.mark.parametrize(("aside", "verdict"), [(0.0, "clash"), (53.0, "clear"), (52.005, "contact")])
def test_a_thin_plate_is_not_stepped_over(aside, verdict):
    plate, pin = shapes.box((100, 100, 1)), shapes.cylinder(2, 5)
    row = move(plate, pin, translation(aside, 0, 500), Motion.translate((0, 0, -1000), parts="moving"))[0]
    assert row.verdict.value == verdict
    if verdict != "clash":
        assert row.distance.lower - 1e-6 <= aside - 52.0 <= row.distance.upper + 1e-6


def test_pin_sliding_in_its_bore_keeps_its_clearance():
    tube, pin = shapes.cylinder(9, 40, bore=5.1), shapes.cylinder(5, 60)
    row = move(tube, pin, translation(0, 0, 120), Motion.translate((0, 0, -240), parts="moving"), clearance=0.05)[0]
    assert row.verdict.value == "clear"
    assert row.distance.lower <= 0.1 <= row.distance.upper + 1e-9
    assert row.distance.upper - row.distance.lower < 0.005


def test_turning_wire_against_dense_sampling():
    start = translation(0, 1.5, 0)
    motion = Motion.screw((1, 0, 0), parts="moving", angle=math.radians(12.0), travel=2.0)
    wire = shapes.cylinder(5.0, 80.0)
    row = move(BLOCK, wire, start, motion)[0]
    instants = np.linspace(0, 1, 20001)
    poses = np.array([motion.at(t) @ start for t in instants])
    gaps = signed_distances(GROOVE, Cylinder(5.0, 80.0), poses)
    assert row.distance.upper <= gaps.min() + 1e-3 or row.verdict.value == "clash"
    if row.contact_at is not None:
        first = instants[np.argmax(gaps <= 0.01)]
        assert row.contact_at == pytest.approx(first, abs=1e-3)


def test_screw_to_a_pose_arrives_there():
    rng = np.random.default_rng(0)
    for _ in range(20):
        start, goal = (rotation(rng.normal(size=3), rng.uniform(0, 3)) for _ in range(2))
        start[:3, 3], goal[:3, 3] = rng.normal(size=3) * 50, rng.normal(size=3) * 50
        motion = Motion.to_pose(goal, parts="a").resolved(start)
        np.testing.assert_allclose(motion.at(1.0) @ start, goal, atol=1e-9)
        half = motion.at(0.5)
        np.testing.assert_allclose(half @ half, motion.at(1.0), atol=1e-9)  # one and the same screw


@pytest.mark.parametrize("angle", [1e-13, 2e-12, 1e-10, 1e-8, 1e-6])
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


def test_a_turn_about_an_axis_far_away_costs_a_groove_no_accuracy():
    groove, wire, start = SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0), translation(-1.0, -1.0, 0.0)
    goals = [rotation((0.1, 0.2, 1.0), angle) for angle in (0.0, 1e-10)]
    for goal in goals:
        goal[:3, 3] = 3.0, 0.5, 0.0
    straight, turned = (min_clearance(groove, wire, Motion.to_pose(goal), start) for goal in goals)
    assert turned.resolution == pytest.approx(straight.resolution)
    assert turned.distance.upper == pytest.approx(straight.distance.upper, abs=1e-8)


def test_a_depth_is_no_margin_of_bodies_whose_depth_is_not_measured_on_the_way():
    """Boxes of 10 and 4 mm are 6.9 mm deep in each other soon before they are concentric."""
    a, b = shapes.box((10, 10, 10)), shapes.box((4, 4, 4))
    with pytest.raises(InputError, match="margin must be >= 0"):
        first_contact(a, b, Motion.translate((-20, 0, 0)), translation(20.0, 0.0, 0.0), margin=-6.9)


def test_motions_follow_one_another():
    box, rod = shapes.box((10, 10, 10)), shapes.cylinder(1, 10)
    scene = (
        Scene(clearance=2.0)
        .add("box", box)
        .add("rod", rod, translation(30, 0, 0))
        .add("tip", rod, translation(40, 0, 0))
    )
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
    (row,) = move(box, box, translation(10.0 + gap, 0, 0), Motion.translate((0, 5, 0), parts="moving"), contact=0.01)
    assert (row.verdict.value, row.contact_at) == ("contact", 0.0)


def test_distance_along_a_way_is_bounded_for_polyhedra():
    # A box turning past another one: its corner comes nearest at 45 degrees.
    still, turning = shapes.box((10, 10, 10)), shapes.box((10, 10, 30))
    gap = 0.3
    start = translation(5 + 5 * math.sqrt(2) + gap, 0, 0)
    motion = Motion.screw((0, 0, 1), parts="moving", angle=math.pi / 2, point=start[:3, 3])
    row = move(still, turning, start, motion, clearance=0.25)[0]
    assert row.verdict.value == "clear"
    assert row.distance.lower <= gap <= row.distance.upper + 1e-9
    assert row.t == pytest.approx(0.5, abs=0.02)
    assert inverse(motion.at(0.5)).shape == (4, 4)


def test_no_instant_is_below_the_least_distance():
    rng = np.random.default_rng(4)
    pool = [
        BLOCK,
        shapes.cylinder(5, 40),
        shapes.cylinder(8, 12, bore=4.2),
        shapes.box((30, 12, 18)),
        shapes.box((30, 25, 6), holes=[shapes.Hole(4.0, (3.0, 2.0))]),
    ]
    seen, cache = set(), ModelCache()
    for _ in range(16):
        still, moving = (pool[k] for k in rng.integers(len(pool), size=2))
        start = rotation(rng.normal(size=3), rng.uniform(0, 6))
        start[:3, 3] = rng.normal(size=3) * 18
        motion = Motion.screw(
            rng.normal(size=3),
            rng.choice([0.0, 0.3, 2.0]),
            parts="moving",
            point=rng.normal(size=3) * 10,
            travel=rng.normal() * 20,
        )
        rows = move(still, moving, start, motion, cache, clearance=1.0)
        scene = Scene(clearance=1.0).add("still", still).add("moving", moving, start)
        instants = np.linspace(0, 1, 40)
        moved = {t: scene.moved({"moving": motion.at(t, start)}) for t in instants}
        found = {t: check(one, depths=False, cache=cache).pairs for t, one in moved.items()}
        verdicts = {one.verdict.value for pairs in found.values() for one in pairs}
        if not rows:
            assert verdicts <= {"clear"}
            continue
        row = rows[0]
        seen.add(row.verdict.value)
        assert all(row.distance.lower <= one.distance.upper + 1e-6 for pairs in found.values() for one in pairs)
        if verdicts & {"clash", "contained"}:
            assert row.verdict.value == "clash"
            assert row.distance.lower == -math.inf  # told is what it is at t, at another instant they may be deeper
            (there,) = check(scene.moved({"moving": motion.at(row.t, start)}), cache=cache).pairs
            assert there.distance.upper == pytest.approx(row.distance.upper, rel=0.05, abs=0.01)
            first = next(t for t, pairs in found.items() if pairs and pairs[0].distance.upper < -0.01)
            assert row.contact_at <= first + 1e-9
        elif "clearance" in verdicts:
            assert row.verdict.value != "clear"
    assert seen >= {"clash", "clear"}


def test_first_contact_is_never_late_where_a_part_slides_close_by():
    """A block 0.02 mm above a floor, on its way to a bead: by hand it touches the bead at t = 0.115."""
    floor, block, bead = shapes.box((200, 60, 10)), shapes.box((20, 20, 20)), shapes.box((2, 20, 1))
    scene = Scene().add("floor", floor).add("bead", bead, translation(2.5, 0.0, 5.5))
    scene = scene.add("block", block, translation(-20.0, 0.0, 15.02))
    moved = replace(scene, motions=(Motion.translate((100.0, 0.0, 0.0), parts=("block",), name="slide"),))
    (row,) = [row for row in check(moved).motions if "bead" in (row.a, row.b)]
    assert row.verdict is Verdict.CLASH
    assert row.contact_at == pytest.approx(0.115, abs=2e-4)
    assert row.contact_at <= 0.115


def joined(*boxes):
    """A mesh of boxes (low, high) that are united."""
    made = trimesh.boolean.union([trimesh.creation.box(bounds=bounds) for bounds in boxes], engine="manifold")
    return MeshShape(make_mesh(made.vertices, made.faces), "off")


@pytest.mark.parametrize("gap", [0.02])
@pytest.mark.parametrize("kind", ["slide", "sink", "turn", "screw"])
def test_first_contact_of_meshes_does_not_depend_on_what_slides_close_by(kind, gap):
    """A block just above a floor meets a bead on it, a bar that turns there a post: the times are known by hand."""
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
    V = floor.mesh.vertices @ A[:3, :3].T
    floor = MeshShape(make_mesh(V, floor.mesh.faces), "off")
    hit = first_contact(floor, part, turned, A @ start)
    assert hit.touches
    assert 0.0 <= (truth - hit.t) * length <= 2e-4
    assert hit.evaluations < 1000


def test_a_fin_is_met_though_its_foot_is_nearer_the_axis_than_a_plate_that_screws_past():
    """The post itself is never reached: the fin's sides alone are inside the hull of what the plate's face sweeps."""
    import manifold3d

    root = np.array([(0.0, -0.5, -0.5), (0.0, 0.5, -0.5), (0.0, 0.5, 0.5), (0.0, -0.5, 0.5), (20.5, 0.0, 0.0)])
    fin = manifold3d.Manifold.hull_points(root).translate((0.0, 0.0, 30.0))
    made = (manifold3d.Manifold.cylinder(600.0, 17.0, 17.0, 96, True) + fin).to_mesh64()
    post = MeshShape(make_mesh(made.vert_properties, made.tri_verts), "off")
    plate = joined(((20, -100, -0.5), (60, 100, 0.5)))
    motion = Motion.screw((0.0, 0.0, 1.0), 0.15, travel=100.0, parts=("plate",))
    scene = Scene(Scene().add("post", post).add("plate", plate).parts, motions=(motion,))
    row = check(scene, depths=False).motions[0]
    assert row.verdict is Verdict.CLASH
    assert 0.29 < row.contact_at < 0.3


def test_what_the_models_leave_open_at_the_nearest_time_is_not_searched_for_elsewhere():
    """0.01 mm apart at the start, known to 0.05: no more steps tell whether they touch."""
    mesh = trimesh.creation.icosphere(2, 10.0)
    ball = MeshShape(make_mesh(mesh.vertices, mesh.faces), "off", error=0.05)
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
    assert "first contact at t = 0.1234," in finding_text(result.motions[0], {"a": "a", "b": "b"})
    row = next(line for line in check_to_text(result).splitlines() if line.startswith("  translation"))
    assert " 0.1234 " in row
