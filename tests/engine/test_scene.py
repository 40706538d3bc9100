"""Scenes: the clamp, broad phase, ladder against full model, allowed contacts, tables, pose sweeps."""

import importlib.machinery
import importlib.util
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.engine.answer import Distance
from clamp3d.engine.broad import Boxes, near_pairs
from clamp3d.engine.check import check
from clamp3d.engine.poses import check_poses
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import RESOLUTION, VERDICTS, Thresholds, Verdict
from clamp3d.errors import InputError
from clamp3d.geometry import shapes
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import rotation, translation
from clamp3d.geometry.primitives import Cylinder, SweptArc
from tests.kinds import measured_alike

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def run():
    return assemble(load_clamp(), Cas())


@pytest.fixture(scope="module")
def pack():
    loader = importlib.machinery.SourceFileLoader("measure_scenes", str(ROOT / "scripts" / "measure-scenes"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module.pack


def clamp_scene(run, **settings):
    scene = Scene(**settings)
    for name, part in parts(run.clamp).items():
        scene = scene.add(name, part, run.T_world(name))
    return scene


TOUCHING = {
    ("P1", "P5"),
    ("P1", "P6"),
    ("P1", "P7"),
    ("P2", "P3"),
    ("P2", "P6"),
    ("P2", "P7"),
    ("P3", "P4"),
    ("P4", "P5"),
}


def test_closed_clamp(run):
    scene = clamp_scene(run, clearance=0.5)
    result = check(scene)
    for a, b in itertools.combinations(run.poses, 2):
        expected = Verdict.CONTACT if (a, b) in TOUCHING else Verdict.CLEAR
        assert result.verdict(a, b) is expected, (a, b)
    grooves = {(r.a, r.b): r for r in result.pairs}
    for pair in (("P1", "P6"), ("P1", "P7"), ("P2", "P6"), ("P2", "P7"), ("P2", "P3")):
        assert grooves[pair].distance.method == "groove kernel"
        assert abs(grooves[pair].distance.value) < 1e-6
    measured_alike(scene, result)


def test_clamp_from_meshes_read_back(run):
    """Meshes with 0.05 mm chord error, fitted: the final state's contacts to within 0.01 mm and their stated bound."""
    scene = Scene(clearance=0.5)
    for name in ("P1", "P2", "P6", "P7"):
        made = mesh(parts(run.clamp)[name], 0.05)
        vertices = np.asarray(made.vertices, dtype=np.float32)  # what an STL keeps
        shape = shapes.MeshShape(make_mesh(vertices, made.faces, float32=True), "round", name)
        scene = scene.add(name, shape, run.T_world(name))
    result = check(scene)
    for pair in (("P1", "P6"), ("P1", "P7"), ("P2", "P6"), ("P2", "P7")):
        assert result.verdict(*pair) is Verdict.CONTACT
        row = next(r for r in result.pairs if (r.a, r.b) == pair)
        assert row.distance.method == "groove kernel"
        assert row.distance.lower <= 0.0 <= row.distance.upper
        assert row.distance.upper - row.distance.lower < 0.01
    assert result.verdict("P1", "P2") is Verdict.CLEAR


def test_verdicts_in_a_crowd_are_those_of_measured_distances(pack):
    scene = pack(10)
    result = check(scene)
    full = measured_alike(scene, result)
    assert len(full.pairs) == 10 * 9 // 2
    assert set(result.counts) >= {"clear", "contact", "clearance"}
    assert sum(result.counts.values()) == 45
    assert sum(result.work.queries.values()) < sum(full.work.queries.values()) / 4


def test_many_parts_ask_of_near_pairs_alone(pack):
    result = check(pack(400))
    assert sum(result.counts.values()) == 400 * 399 // 2
    assert result.work.candidates < 800
    assert sum(result.work.queries.values()) < 20 * result.work.candidates


def test_broad_phase_against_brute_force():
    rng = np.random.default_rng(0)
    n = 200
    bounds = np.sort(rng.uniform(-20, 20, (n, 2, 3)) * rng.choice([0.1, 1.0, 3.0], (n, 1, 1)), axis=1)
    T = np.array([rotation(rng.normal(size=3), rng.uniform(0, 6)) for _ in range(n)])
    T[:, :3, 3] = rng.uniform(-150, 150, (n, 3))
    boxes = Boxes.of(bounds, T)
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    world = np.array(
        [np.where(corners == 0, b[0], b[1]) @ P[:3, :3].T + P[:3, 3] for b, P in zip(bounds, T, strict=True)]
    )
    low, high = world.min(axis=1), world.max(axis=1)
    near = {
        (i, j)
        for i, j in itertools.combinations(range(n), 2)
        if (np.maximum(low[i], low[j]) - np.minimum(high[i], high[j])).max() <= 2.0
    }
    assert {tuple(p) for p in near_pairs(boxes, 2.0).tolist()} == near


def test_allowed_contacts(run):
    scene = clamp_scene(run).allow(("P1", "P6"), ("P*", "P5"))
    result = check(scene)
    assert result.verdict("P1", "P6") is Verdict.ALLOWED
    assert result.verdict("P4", "P5") is Verdict.ALLOWED
    assert result.verdict("P2", "P6") is Verdict.CONTACT


def test_pairs_asked_for_only(run):
    result = check(clamp_scene(run), pairs=[("P6", "P1"), ("P1", "P2")])
    assert result.work.pairs == 2
    assert [(r.a, r.b) for r in result.pairs] == [("P1", "P6")]
    assert result.verdict("P1", "P2") is Verdict.CLEAR
    with pytest.raises(InputError, match="pair P2:P6 was not checked"):
        result.verdict("P2", "P6")
    with pytest.raises(InputError, match=r"unknown part 'P9'; available: P1, P2"):
        check(clamp_scene(run), pairs=[("P1", "P9")])


def test_poses_inside_are_contained_as_a_check_says():
    """A short wire in the groove, in the material, half out of it; a small box in a large one, and around it."""
    block = shapes.groove_block(SweptArc(7.0, math.radians(60), 50.0), 40.0, 30.0)
    scene = Scene(clearance=0.5).add("block", block).add("box", shapes.box((30, 30, 30)), translation(0, 100, 0))
    scene = scene.add("crate", shapes.box((90, 90, 90)), translation(300, 0, 0)).add("wire", shapes.cylinder(3.0, 20.0))
    scene = scene.allow(("wire", "box"), overlap=0.3)
    places = [
        (0, -4.1, 0),
        (0, -13, 0),
        (12, -12, 0),
        (12, -12, 20),
        (0, -20, 0),
        (0, 100, 0),
        (0, 113, 0),
        (300, 1, 2),
    ]
    poses = np.array([translation(*place) for place in places] + [rotation((1, 0, 0), 1.5), translation(250, 0, 0)])
    for part, places in (("wire", poses), ("crate", np.array([translation(0, y, 0) for y in (0.0, 60.0, 100.0)]))):
        sweep = check_poses(scene, part, places)
        for k, T in enumerate(places):
            one = check(scene.moved({part: T}))
            assert [one.verdict(part, name).value for name in sweep.others] == sweep.verdict[k].tolist()
        assert {"contained", "clash", "clear"} <= set(sweep.verdict.ravel())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene().add("a:b", shapes.box((1, 1, 1))), "part name must not"),
        (lambda: Scene().add("a", shapes.box((1, 1, 1))).add("a", shapes.box((1, 1, 1))), "'a' is there twice"),
        (lambda: Scene().add("a", SweptArc(7, 1, 50)), "make a part of it with groove_block"),
        (lambda: Scene().add("a", shapes.box((1, 1, 1)), np.eye(3)), r"pose of a must have shape \(4, 4\)"),
        (lambda: shapes.box((1, 9e-10, 1)), "outline must be wider than 1e-09 mm"),
        (lambda: shapes.box((1, -1, 1)), "size must be a finite length > 0 mm, got -1"),
        (lambda: shapes.cylinder(5, 10, bore=6), "bore must be between 0 and radius = 5 mm, got 6"),
        (lambda: shapes.groove_block(SweptArc(7, 1, 50), 10, 20), "width must be > 11.78"),
        (lambda: shapes.groove_block(SweptArc(7, 1, 50), 40, 2), "height must be > 3.2"),
        (lambda: Scene(clearance=0.001), "clearance must be 0 or > contact = 0.01 mm"),
        (
            lambda: Motion.screw((0, 0, 1), parts="pin", angle=1.0, point=(0, 1e18, 0)),
            "point must be three lengths up to 1e",
        ),
        (lambda: Scene().add("a", shapes.box((1, 1, 1)), translation(0, 0, 2e9)), "offset of pose of a must be three"),
        (lambda: check_poses(Scene().add("a", Cylinder(1, 2)), "a", [np.eye(4), -np.eye(4)]), r"poses\[1\] must"),
        (lambda: Scene().allow(("a", "b")), "allowed: unknown part 'a'; available: none"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make()


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
    assert [(row.b, row.distance.lower) for row in rows] == [
        ("shallow", -np.inf),
        ("deep", -np.inf),
        ("deep", pytest.approx(-4.0, abs=1e-9)),
        ("shallow", pytest.approx(-1.0, abs=1e-9)),
    ]
    assert {row.b: row.distance.upper for row in result.pairs} == {row.b: row.distance.upper for row in rows[2:]}
