"""Scenes: which pairs are asked for, allowed contacts, parts at many poses, what is refused, work by size."""

import itertools
import math
import pickle
import sys
from collections.abc import Callable
from copy import copy, deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clamp3d import Cylinder, Distance, InputError, Motion, Part, Scene, Verdict, check_poses, shapes
from clamp3d.engine.broad import Boxes, near_pairs
from clamp3d.engine.check import check
from clamp3d.engine.model import ModelCache
from clamp3d.engine.verdict import RESOLUTION, VERDICTS, Thresholds
from clamp3d.geometry.pose import rotation, to_target, translation
from clamp3d.geometry.profile import Arc, Profile, Segment
from clamp3d.output.scene_report import check_to_text
from clamp3d.shapes import SweptArc, make_mesh, mesh
from tests.kinds import measured_alike
from tests.refusals import refusals

BOX = shapes.box((1, 1, 1))


@pytest.fixture(scope="module")
def clamp(run):
    """The assembled reference clamp, none of whose contacts is allowed."""
    return replace(run.scene, allowed=(), clearance=0.5)


def test_a_frame_without_rows_has_the_columns_of_one_with_rows():
    pytest.importorskip("pandas")
    scenes = [Scene().add("a", BOX).add("b", BOX, translation(0, 0, z)) for z in (1.0, 50.0)]
    frames = [check(scene).frame() for scene in scenes]
    assert [len(frame) for frame in frames] == [1, 0]
    assert frames[0].columns.tolist() == frames[1].columns.tolist()


def test_contacts_of_fitted_meshes_are_those_of_their_parts(clamp):
    """Of meshes with 0.05 mm chord error, in single precision: to within 0.01 mm, which is stated."""
    parts = {part.name: part for part in clamp.parts}
    for pair in itertools.product(("P1", "P2"), ("P6", "P7")):
        scene = Scene()
        for name in pair:
            made = mesh(parts[name].shape, 0.05)
            read = make_mesh(np.asarray(made.vertices, dtype=np.float32), made.faces, float32=True)
            scene = scene.add(name, shapes.MeshShape(read, "round"), parts[name].T_world)
        (row,) = check(scene).pairs
        assert (row.verdict, row.distance.method) == (Verdict.CONTACT, "groove kernel")
        assert row.distance.lower <= 0.0 <= row.distance.upper < row.distance.lower + 0.01


def test_nothing_is_meshed_where_closed_forms_decide(clamp):
    scene = Scene(clearance=0.5).add("block", shapes.box((10, 10, 10)))
    scene = scene.add("rod", shapes.cylinder(2.0, 10.0), translation(7.1, 0.0, 0.0))
    for some in (scene, clamp):
        result = check(some, depths=False)
        assert result.pairs
        assert (result.work.meshes, result.work.triangles) == (0, 0)


def test_verdicts_in_a_crowd_are_those_of_measured_distances():
    scene, box = Scene(clearance=0.5), shapes.box((10, 10, 10))
    for k in range(10):
        scene = scene.add(f"p{k}", box, translation(10.0 * k + 0.2 * (k // 2), 0.0, 0.0))
    result = check(scene)
    full = measured_alike(scene, result)
    assert len(full.pairs) == 45
    assert result.counts == {"contact": 5, "clearance": 4, "clear": 36}
    assert sum(result.work.queries.values()) < sum(full.work.queries.values()) / 4


def test_broad_phase_against_brute_force():
    rng = np.random.default_rng(0)
    n = 200
    bounds = np.sort(rng.uniform(-20, 20, (n, 2, 3)) * rng.choice([0.1, 1.0, 3.0], (n, 1, 1)), axis=1)
    T = np.array([rotation(rng.normal(size=3), rng.uniform(0, 6)) for _ in range(n)])
    T[:, :3, 3] = rng.uniform(-150, 150, (n, 3))
    world = np.array([to_target(P, list(itertools.product(*b.T))) for b, P in zip(bounds, T, strict=True)])
    low, high = world.min(axis=1), world.max(axis=1)
    between = (np.maximum(low[:, None], low) - np.minimum(high[:, None], high)).max(axis=2)
    near = np.argwhere(np.triu(between <= 2.0, k=1))
    assert sorted(near_pairs(Boxes.of(bounds, T), 2.0).tolist()) == near.tolist()


def test_a_part_without_a_pose_is_no_part_of_a_scene():
    with pytest.raises(InputError, match=r"part 'a' must be a pair \(shape, T_world\), got"):
        Scene.of({"a": BOX})


def test_brackets_in_names_stand_for_themselves():
    """Two pins that a pattern of shells would take for one another, both 0.5 mm in a plate."""
    pin = shapes.box((10, 10, 10))
    scene = Scene().add("pin[1]", pin).add("pin1", pin, translation(30, 0, 0))
    scene = scene.add("plate", shapes.box((60, 10, 10)), translation(15, 0, 9.5))
    for name, allowed in (
        ("pin[1]", ["allowed", "clash"]),
        ("pin[?]", ["allowed", "clash"]),
        ("pin?", ["clash", "allowed"]),
    ):
        result = check(scene.allow((name, "plate"), overlap=1.0), depths=False)
        assert [result.verdict(pin, "plate").value for pin in ("pin[1]", "pin1")] == allowed


def test_pairs_asked_for_and_allowed_contacts(clamp):
    result = check(clamp, pairs=[("P6", "P1"), ("P1", "P2")])
    assert result.work.pairs == 2
    assert [(r.a, r.b) for r in result.pairs] == [("P1", "P6")]
    assert result.verdict("P1", "P2") is Verdict.CLEAR
    with pytest.raises(InputError, match="pair P2:P6 was not checked"):
        result.verdict("P2", "P6")
    with pytest.raises(InputError, match=r"unknown part 'P9'; available: P1, P2"):
        check(clamp, pairs=[("P1", "P9")])
    result = check(clamp.allow(("P1", "P6"), ("P*", "P5")))
    assert result.verdict("P1", "P6") is Verdict.ALLOWED
    assert result.verdict("P4", "P5") is Verdict.ALLOWED
    assert result.verdict("P2", "P6") is Verdict.CONTACT


def test_poses_inside_are_contained_as_a_check_says():
    """A short wire in the groove, in the material, half out of it; a small box in a large one, and around it."""
    block = shapes.groove_block(SweptArc(7.0, math.radians(60), 50.0), 40.0, 30.0)
    scene = Scene(clearance=0.5).add("block", block).add("box", shapes.box((30, 30, 30)), translation(0, 100, 0))
    scene = scene.add("crate", shapes.box((90, 90, 90)), translation(300, 0, 0)).add("wire", shapes.cylinder(3.0, 20.0))
    scene = scene.allow(("wire", "box"), overlap=0.3)
    places = [(0, -4.1), (0, -13), (12, -12), (12, -12, 20), (0, -20), (0, 100), (0, 113), (300, 1, 2), (250, 0)]
    poses = np.array([rotation((1, 0, 0), 1.5), *(translation(*place, *[0] * (3 - len(place))) for place in places)])
    beside = np.array([translation(0, y, 0) for y in (0.0, 60.0, 100.0, 160.003, 160.2, 161.0)])
    for part, places in (("wire", poses), ("crate", beside)):
        sweep = check_poses(scene, part, places)
        for k, T in enumerate(places):
            one = check(scene.moved({part: T}))
            assert [one.verdict(part, name).value for name in sweep.others] == sweep.verdict[k].tolist()
        assert {"contained", "clash", "clear"} <= set(sweep.verdict.ravel())


HALF_ROD = shapes.extrusion(Profile((Arc((0.0, 0.0), 9.0, 0.0, math.pi), Segment((-9.0, 0.0), (9.0, 0.0)))), 40.0)


@pytest.mark.parametrize("moving", [shapes.cylinder(6.0, 40.0), shapes.box((9.0, 14.0, 30.0)), HALF_ROD])
def test_many_poses_have_the_verdicts_of_one_at_a_time(moving):
    """Nearly all overlaps are found in all poses at once; progress counts those that are looked at by themselves."""
    rng, stages, cache, alone = np.random.default_rng(5), [], ModelCache(), ModelCache()
    poses = np.array([translation(*rng.uniform(-30, 30, 3)) @ rotation(rng.normal(size=3), 2.0) for _ in range(60)])
    block = shapes.groove_block(SweptArc(8.0, 1.3, 50.0), 50.0, 30.0)
    scene = Scene().add("block", block).add("part", moving)
    sweep = check_poses(scene, "part", poses, progress=lambda *stage: stages.append(stage), cache=cache)
    for T, kind, most in zip(poses[sweep.row], sweep.kind, sweep.most, strict=True):
        (row,) = check(scene.moved({"part": T}), pairs=[("block", "part")], distances=True, cache=alone).pairs
        assert kind == row.verdict.value
        assert most >= min(row.distance.lower, -row.distance.interference[1] if row.distance.interference else np.inf)
    assert [(name, n) for name, n, _ in stages] == [("poses", n) for n in range(len(stages))]
    assert cache.counters.queries["boxes"] < 0.2 * (sweep.kind == "clash").sum()


test_bad_input = refusals(
    (lambda: Scene().add("a:b", BOX), "part name must not"),
    (lambda: Scene().add("a b", BOX), "part name must not be empty or hold a space"),
    (lambda: Scene().add("a", BOX).add("a", BOX), "'a' exists already; names must differ"),
    (lambda: Scene().add(Part("a", BOX), BOX), "takes a Part alone"),
    (lambda: Scene().add("a", SweptArc(7, 1, 50)), "make a part of it with groove_block"),
    (lambda: Part("a", BOX, np.diag([2.0, 1, 1, 1])), "pose of a must be rigid"),
    (lambda: Scene().add("a", BOX, np.eye(3)), r"pose of a must have shape \(4, 4\)"),
    (lambda: Scene().add("a", BOX, translation(0, 0, 2e9)), "offset of pose of a must be three"),
    (lambda: shapes.box((1, 9e-10, 1)), "outline must be wider than 1e-09 mm"),
    (lambda: shapes.box(1e-10, 1e-10, 1e-10), "outline must be wider than 1e-09 mm"),
    (lambda: Motion.screw((0, 0, 1), angle=1.0, point=(0, 1e18, 0)), "point must be three lengths up to 1e"),
    (lambda: check_poses(Scene().add("a", Cylinder(1, 2)), "a", [np.eye(4), -np.eye(4)]), r"poses\[1\] must"),
    (lambda: Scene().allow(("a", "b")), "allowed: unknown part 'a'; available: none"),
)


MARKS = [m + k * RESOLUTION for m in (-0.3, -0.01, 0.0, 0.01, 0.5) for k in (-2.0, -1.0, 0.0, 1.0, 2.0)]
BOUND = st.sampled_from([*MARKS, *(0.5 * (x + y) for x, y in itertools.pairwise(sorted(MARKS)))]) | st.floats(-1.0, 1.0)


@given(
    bounds=st.lists(st.tuples(BOUND, BOUND | st.just(math.inf)), min_size=1, max_size=40),
    allowance=st.sampled_from([None, 0.0, 0.3]),
    clearance=st.sampled_from([0.0, 0.5]),
)
def test_verdicts_of_many_distances_are_those_of_each(bounds, allowance, clearance):
    lower, upper = (np.array(x) for x in zip(*(sorted(pair) for pair in bounds), strict=True))
    lower[0] = -math.inf
    thresholds = Thresholds(clearance=clearance)
    each = [thresholds.verdict(Distance(*pair), allowance).value for pair in zip(lower, upper, strict=True)]
    assert [VERDICTS[k].value for k in thresholds.verdicts(lower, upper, allowance)] == each


def test_rows_come_as_they_are_decided_and_the_deepest_overlap_first():
    cube = shapes.box((10, 10, 10))
    scene = Scene().add("base", shapes.box((100, 10, 10)))
    for name, x, z in (("shallow", -30, 9.0), ("clear", 0, 20.0), ("deep", 30, 6.0)):
        scene = scene.add(name, cube, translation(x, 0, z))
    rows = []
    result = check(scene, on_row=rows.append)
    assert [row.b for row in rows] == ["shallow", "deep", "deep", "shallow"]
    assert [row.distance.lower for row in rows] == pytest.approx([-np.inf, -np.inf, -4.0, -1.0], abs=1e-9)
    assert {row.b: row.distance.upper for row in result.pairs} == {row.b: row.distance.upper for row in rows[2:]}


def names(scene):
    return [part.name for part in scene.parts]


def test_no_scene_sees_what_was_added_to_another():
    first = Scene().add("a", BOX)
    left, right = first.add("b", BOX), first.add("c", BOX).allow(("a", "c"), overlap=1.0)
    more = right.allow(("c", "a"), overlap=3.0).add("b", BOX).moved({"a": translation(1, 2, 3)})
    assert [names(scene) for scene in (first, left, right, more)] == [["a"], ["a", "b"], ["a", "c"], ["a", "c", "b"]]
    assert [scene.allowance("a", "c") for scene in (right, more)] == [1.0, 3.0]
    assert left.allowance("a", "b") is None
    assert (right.index("c"), more.index("b")) == (1, 2)
    assert [scene.parts[0].T_world[0, 3] for scene in (first, right, more)] == [0.0, 0.0, 1.0]
    for scene in (first, left, right, more):
        same = Scene(scene.parts, allowed=scene.allowed)
        assert (scene, hash(scene), repr(scene)) == (same, hash(same), repr(same))
        assert replace(scene, clearance=2.0).parts == scene.parts
        for wrong in (scene.index, lambda x, scene=scene: scene.moved({x: np.eye(4)})):
            with pytest.raises(InputError, match="unknown part 'd'"):
                wrong("d")


def test_what_is_copied_or_pickled_cannot_be_written_to_either():
    T = rotation((1, 2, 3), 0.5)
    scene = Scene().add("a", BOX, T).add("b", BOX)
    size = len(pickle.dumps(scene))
    scene.add("c", BOX)  # whose name is none of the scene's
    for again in (pickle.loads(pickle.dumps(scene)), copy(scene), deepcopy(scene)):
        assert again.parts[0].T_world.tobytes() == T.tobytes()
        assert not again.parts[0].T_world.flags.writeable
        assert names(again) == ["a", "b"]
        assert again.index("b") == 1
    assert len(pickle.dumps(scene)) == size


SIZES = (100, 400)
CUBE = shapes.box((10, 10, 10))
PIN = shapes.cylinder(3, 12)


def calls(run: Callable[[], object]) -> int:
    """Functions of Python and C that a call comes to; what one of C copies is not seen."""
    count = 0

    def told(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(told)
    try:
        run()
    finally:
        sys.setprofile(None)
    return count


def row_of_boxes(n: int) -> Scene:
    """Boxes that each touch the next one, with a gap too small after every second: pairs that are allowed, and not."""
    scene = Scene(clearance=0.5)
    for k in range(n):
        scene = scene.add(f"p{k}", PIN if k % 5 == 0 else CUBE, translation(10.0 * k + 0.2 * (k // 2), 0.0, 0.0))
    return scene


def allowed(scene: Scene) -> Scene:
    names = [part.name for part in scene.parts]
    for a, b in zip(names[::2], names[1::2], strict=False):
        scene = scene.allow((a, b))
    scene.allowance(*names[:2])
    return scene


STEPS: dict[str, Callable[[Scene], object]] = {
    "add": lambda scene: row_of_boxes(len(scene.parts)),
    "allow": allowed,
    "check": check,
    "verdict": lambda scene: (
        lambda result: [result.verdict(x.name, y.name) for x, y in zip(scene.parts, scene.parts[1:], strict=False)]
    )(check(scene)),
    "to_dict": lambda scene: check(scene).to_dict(),
    "text": lambda scene: check_to_text(check(scene)),
    "poses": lambda scene: check_poses(scene, "p1", np.tile(np.eye(4), (50, 1, 1))),
}


@pytest.mark.parametrize("step", STEPS)
def test_work_grows_with_the_parts(step):
    run = STEPS[step]
    few, many = (row_of_boxes(n) for n in SIZES)
    run(few)  # what is made once
    grown = calls(lambda: run(many)) / calls(lambda: run(few))
    assert grown <= 1.3 * SIZES[1] / SIZES[0], f"{step}: {grown:.1f} times the work for 4 times the parts"


def test_bounds_of_many_poses_hold_the_gap_and_say_nothing_of_how_deep_an_overlap_is():
    scene = Scene(clearance=5.0).add("ring", shapes.cylinder(9.0, 8.0, bore=4.0)).add("pin", shapes.cylinder(3.0, 40.0))
    poses = check_poses(scene, "pin", [translation(x, 0.0, 0.0) for x in (0.0, 0.6, 2.0)])
    assert poses.verdict[:, 0].tolist() == ["clearance", "clearance", "clash"]
    for lower, upper, gap in zip(poses.lower[:2, 0], poses.upper[:2, 0], (1.0, 0.4), strict=True):
        assert 0.0 < lower <= gap <= upper < np.inf
    assert poses.lower[2, 0] == -np.inf
    assert -1.0 - 1e-9 <= poses.upper[2, 0] < 0.0
