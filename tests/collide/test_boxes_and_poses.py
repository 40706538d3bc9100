"""Boxes of parts and passes over many poses, against all pairs and all points one by one."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from clamp3d import shapes
from clamp3d.collide import broad, poses
from clamp3d.collide.answer import Distance
from clamp3d.collide.batch import members
from clamp3d.collide.broad import Boxes, box_gaps, near_pairs, world_boxes
from clamp3d.collide.model import ModelCache
from clamp3d.collide.poses import PoseVerdicts, check_poses
from clamp3d.collide.scene import Scene
from clamp3d.collide.verdict import Verdict
from clamp3d.core.linear import to_target
from clamp3d.core.pose import inverse, rotation, translation
from clamp3d.testing import body
from tests.hulls import apart
from tests.kinds import DRAWN

SIDES = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def some_poses(rng, n, reach):
    T = np.array([rotation(rng.normal(size=3), rng.choice([0.0, 0.3, 2.0])) for _ in range(n)])
    T[:, :3, 3] = reach * rng.normal(size=(n, 3))
    return T


def some_boxes(rng, n, reach):
    low = -rng.uniform(0.1, 4.0, (n, 3)) + rng.normal(size=(n, 1))
    bounds = np.stack([low, low + rng.uniform(0.5, 6.0, (n, 3))], axis=1)
    return bounds, some_poses(rng, n, reach)


def corners(bounds, T):
    return to_target(T, np.where(SIDES < 0.0, bounds[0], bounds[1]))


def test_gaps_of_boxes_are_never_more_than_their_distance():
    """And on the sides of each other as much; of boxes that meet, nothing."""
    rng = np.random.default_rng(0)
    bounds, T = some_boxes(rng, 40, 4.0)
    boxes = Boxes.of(bounds, T)
    pairs = np.array(list(itertools.combinations(range(40), 2)))
    found = box_gaps(boxes, pairs)
    truth = np.array([apart(corners(bounds[i], T[i]), corners(bounds[j], T[j])) for i, j in pairs])
    meet = truth < 1e-7
    assert 20 < meet.sum() < len(pairs) - 20
    assert (found[meet] <= 1e-9).all()
    assert (found[~meet] <= truth[~meet] + 1e-9).all()
    assert (found[~meet] > 0.0).all()  # one of fifteen axes parts any two boxes that are apart
    assert (found >= 0.55 * truth)[~meet].all()
    for way in np.eye(3):  # square to each other: exact, also across an edge or a corner
        for aside in (0.0, 4.0, 7.0):
            pair = Boxes.of(
                np.array([[[-1.0] * 3, [1.0] * 3]] * 2),
                np.array([np.eye(4), translation(*(5.0 * way + aside * np.roll(way, 1)))]),
            )
            expected = math.hypot(3.0, max(0.0, aside - 2.0))
            assert box_gaps(pair, np.array([[0, 1]]))[0] == pytest.approx(expected, abs=1e-9)
    both = Boxes.of(bounds[:3], T[:3]).joined(Boxes.of(bounds[3:], T[3:]))
    assert (box_gaps(both, pairs) == found).all()
    around = np.array([corners(b, P) for b, P in zip(bounds, T, strict=True)])
    assert boxes.reach == pytest.approx(0.5 * np.ptp(around, axis=1), abs=1e-9)
    assert boxes.centre == pytest.approx(around.mean(axis=1), abs=1e-9)


@pytest.mark.parametrize("few", [0, 1000])
def test_pairs_whose_boxes_come_near(few, monkeypatch):
    monkeypatch.setattr(broad, "FEW", few)
    rng = np.random.default_rng(1)
    bounds, T = some_boxes(rng, 30, 9.0)
    around = np.array([corners(b, P) for b, P in zip(bounds, T, strict=True)])
    low, high = around.min(axis=1), around.max(axis=1)
    for reach in (0.0, 1.0, 5.0):
        between = np.maximum(low[:, None] - high, low - high[:, None]).max(axis=2)
        expected = [(i, j) for i, j in itertools.combinations(range(30), 2) if between[i, j] <= reach]
        assert list(map(tuple, near_pairs(Boxes.of(bounds, T), reach).tolist())) == expected


@pytest.mark.parametrize("block", [7, 4096])
@pytest.mark.parametrize("few", [0, 1000])
def test_poses_whose_boxes_come_near_others(few, block, monkeypatch):
    monkeypatch.setattr(poses, "FEW", few)
    monkeypatch.setattr(poses, "_BLOCK", block)
    rng = np.random.default_rng(2)
    bounds, T = some_boxes(rng, 12, 12.0)
    own, way = np.array([[-1.0, -2.0, 0.0], [2.0, -1.0, 5.0]]), some_poses(rng, 40, 12.0)
    around = np.array([corners(own, P) for P in way])
    others = np.array([corners(b, P) for b, P in zip(bounds, T, strict=True)])
    for reach in (0.0, 1.5):
        placed, row, column = poses._near(way, own, world_boxes(bounds, T, np.arange(12)), reach)
        assert (placed == way).all()
        gap = np.maximum(
            around.min(axis=1)[:, None] - others.max(axis=1), others.min(axis=1) - around.max(axis=1)[:, None]
        ).max(axis=2)
        assert sorted(zip(row.tolist(), column.tolist(), strict=True)) == list(map(tuple, np.argwhere(gap <= reach)))


def test_boxes_at_poses_that_two_roundings_have_passed_through():
    """Seen from one another two poses are off by the sum of what each may be: they have boxes like all others."""
    rng = np.random.default_rng(6)
    bounds, T = some_boxes(rng, 30, 9.0)
    T[:, :3, :3] *= 1.0 + 8e-10
    around = np.array([corners(b, P) for b, P in zip(bounds, T, strict=True)])
    found = world_boxes(bounds, T, np.arange(30))
    assert found == pytest.approx(np.hstack([around.min(axis=1), around.max(axis=1)]).T, abs=1e-9)
    first = world_boxes(bounds[:1], T)
    assert (first[:, 0] == found[:, 0]).all()
    assert first[3:, 5] == pytest.approx(corners(bounds[0], T[5]).max(axis=0), abs=1e-9)


def test_poses_as_others_see_them():
    from clamp3d.collide.poses_kernel import between

    rng = np.random.default_rng(3)
    A, T = some_poses(rng, 5, 4.0), some_poses(rng, 7, 4.0)
    column, row, out = rng.integers(0, 5, 20), rng.integers(0, 7, 20), np.empty((20, 4, 4))
    between(A, column, T, row, out)
    assert out == pytest.approx(np.linalg.inv(A)[column] @ T[row], abs=1e-12)


@pytest.mark.parametrize("k", [0, 3, 4, 5, 6])
def test_points_that_stand_out_of_a_body(k):
    """As the body's definition has it, from within and from without the slack."""
    from clamp3d.collide.poses_kernel import stand_out

    (form,) = ModelCache().model(DRAWN[k]).bodies
    rng, seen = np.random.default_rng(k), set()
    T, points = some_poses(rng, 200, 5.0), rng.uniform(-2.0, 2.0, (3, 3))
    T[:, :3, 3] = rng.uniform(*(1.1 * form.bounds), (200, 3))
    whole, found = body(DRAWN[k]), np.empty(200, dtype=np.int64)
    for slack in (0.0, 0.7):
        stand_out(T, points, *members(form), slack, found)
        for P, out in zip(T, found, strict=True):
            x = to_target(P, points)
            depth = form.depth(x)
            assert out == (depth.min() < -slack)
            if abs(depth.min()) > 1e-9:
                assert (depth.min() < 0.0) == (whole.field(x).max() > 0.0)
            seen.add(int(out))
    assert seen == {0, 1}


def test_what_is_noted_of_many_poses():
    """The worst verdict of each pose; bounds where nothing came near, and where something did."""
    rank = np.array([[*Verdict].index(Verdict(name)) for name in ("contact", "clearance", "clash")], dtype=np.int8)
    found = PoseVerdicts(
        "a", ("b", "c"), 4, 0.5, np.array([0, 0, 2]), np.array([0, 1, 1]), np.array([0.0, 0.2, -1.0]),
        np.array([0.01, 0.3, -0.5]), rank,
    )  # fmt: skip
    assert found.kind.tolist() == ["contact", "clearance", "clash"]
    assert found.worst.tolist() == ["contact", "clear", "clash", "clear"]
    assert found.verdict.tolist() == [["contact", "clearance"], ["clear"] * 2, ["clear", "clash"], ["clear"] * 2]
    assert found.lower.tolist() == [[0.0, 0.2], [0.5, 0.5], [0.5, -1.0], [0.5, 0.5]]
    inf = math.inf
    assert found.upper.tolist() == [[0.01, 0.3], [inf, inf], [inf, -0.5], [inf, inf]]
    assert repr(found) == "PoseVerdicts('a': 4 poses; 1 clash, 1 contact, 2 clear)"


@pytest.mark.parametrize("clearance", [0.0, 2.0])
def test_bounds_of_poses_hold_and_are_as_sharp_as_the_verdict_needs(clearance):
    """A pin about a plate with a hole and a box, against the closed forms of where it stands."""
    scene = Scene(clearance=clearance).add("plate", shapes.box((40, 40, 4), holes=[shapes.Hole(5.0)]))
    scene = scene.add("box", shapes.box((6, 6, 6)), translation(0, 40, 0)).add("pin", shapes.cylinder(3.0, 20.0))
    x = np.array([0.0, 1.0, 1.9, 1.995, 2.5, 10.0, 22.9, 23.005, 23.5, 24.9, 25.1])
    sweep = check_poses(scene, "pin", np.array([translation(at, 0.0, 1.0) for at in x]))
    truth = np.where(x < 10.0, 2.0 - x, x - 23.0)
    truth[x == 10.0] = -7.0
    low, high = sweep.lower[:, 0], sweep.upper[:, 0]
    assert (low <= np.maximum(truth, -5.0) + 1e-9).all()
    assert (high >= truth - 1e-9).all()
    near = truth > 0.0
    kinds = np.where(truth > 0.01, np.where(truth < clearance, "clearance", "clear"), "contact")
    assert (sweep.verdict[near, 0] == kinds[near]).all()
    assert (sweep.verdict[truth < -0.01, 0] == "clash").all()
    assert (low[truth < -0.01] == -np.inf).all()
    assert (sweep.verdict[:, 1] == "clear").all()
    for k, at in enumerate(x):  # each as alone
        one = check_poses(scene, "pin", [translation(at, 0.0, 1.0)], others=("plate",))
        assert (one.lower[0, 0], one.upper[0, 0], one.worst[0]) == (low[k], high[k], sweep.verdict[k, 0])


def test_a_pose_that_fails_is_a_finding_of_its_own(monkeypatch):
    def fails(*arguments, **options):
        raise ValueError("no answer")

    scene = Scene().add("a", shapes.box((5, 5, 5))).add("b", shapes.box((5, 5, 5)))
    monkeypatch.setattr(poses, "judge", fails)
    sweep = check_poses(scene, "b", np.array([translation(5.0, 0, 0), translation(50.0, 0, 0)]))
    assert sweep.worst.tolist() == ["failed", "clear"]
    assert sweep.upper[0, 0] == math.inf
    assert sweep.lower[0, 0] <= 0.0


def test_a_pose_seen_from_the_other_side_is_the_inverse():
    T = some_poses(np.random.default_rng(4), 1, 3.0)[0]
    found = Distance(1.0, 1.0, np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 3.0]), np.array([1.0, 0.0, 0.0]))
    back = found.moved(T).moved(inverse(T))
    assert back.point_a == pytest.approx(found.point_a, abs=1e-12)
    assert back.normal == pytest.approx(found.normal, abs=1e-12)
    turned = found.swapped()
    assert turned.point_a.tolist() == found.point_b.tolist()
    assert turned.normal.tolist() == [-1.0, 0.0, 0.0]


def test_equal_others_are_met_where_they_stand_and_as_each_may_be():
    """Three equal boxes, one turned, one that may be touched deeper: at each pose as with that one alone."""
    unit = shapes.box((4.0, 6.0, 4.0))
    scene = Scene(clearance=1.0).add("a", unit).add("b", unit, translation(20.0, 0.0, 0.0))
    scene = scene.add("c", unit, translation(40.0, 0.0, 0.0) @ rotation((0.0, 0.0, 1.0), 0.5 * math.pi))
    scene = scene.add("pin", shapes.cylinder(1.0, 9.0)).allow(("pin", "b"), overlap=0.3)
    way = np.array([translation(x + 2.0 + 1.0 + gap, 0.0, 0.0) for x in (0.0, 20.0, 40.0) for gap in (-0.2, 0.5, 1.5)])
    sweep = check_poses(scene, "pin", way)
    assert sweep.worst.tolist() == [
        *("clash", "clearance", "clear"),
        *("allowed", "allowed", "clear"),
        *("clash", "clash", "clearance"),
    ]
    assert sweep.verdict[3].tolist() == ["clear", "allowed", "clear"]
    gaps = sweep.upper[np.arange(9), np.repeat(np.arange(3), 3)]
    assert gaps[[1, 4]] == pytest.approx(0.5, abs=1e-6)
    assert gaps[8] == pytest.approx(0.5, abs=1e-6)
