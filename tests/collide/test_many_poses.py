"""Many poses at once against the same question asked pose by pose."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.collide import batch, poses
from clamp3d.collide.batch import bounds_by_kernel, by_kernel, in_frame_of_first
from clamp3d.collide.body import Bore
from clamp3d.collide.check import check
from clamp3d.collide.model import ModelCache
from clamp3d.collide.poses import check_poses
from clamp3d.collide.scene import Part, Scene
from clamp3d.core import shapes
from clamp3d.core.distance import signed_distances
from clamp3d.core.linear import dot
from clamp3d.core.motion import FARTHEST
from clamp3d.core.pose import PoseWarning, inverse, rotation, translation
from clamp3d.core.primitives import Cylinder, SweptArc
from clamp3d.errors import InputError
from clamp3d.testing import body

GROOVES = {
    "wide": SweptArc(12.0, math.radians(70.0), 50.0),
    "short": SweptArc(7.0, math.radians(60.0), 9.0),
    "half": SweptArc(7.0, 0.5 * math.pi, 50.0),
    "narrow mouth": SweptArc(7.0, math.radians(120.0), 30.0),
}


def body_of(shape):
    """The one closed form of a shape."""
    (form,) = ModelCache().model(shape).bodies
    return form


def placed(rng, n, far):
    """Poses (n, 4, 4) of every tilt, some of them exactly along the groove, some nearly."""
    T = np.array([rotation((*rng.normal(size=2), 0.0), t) for t in rng.choice([0.0, 1e-13, 0.003, 0.03, 0.3, 2.0], n)])
    T[:, :3, 3] = rng.normal(size=(n, 3)) * rng.choice([0.1, 1.0, far], n)[:, None]
    return T


@pytest.mark.parametrize("name", GROOVES)
def test_the_batch_has_the_points_and_bounds_of_single_calls(name):
    """100 000 poses in all, bit by bit: the formula that goes pose by pose takes other ways than the batch."""
    groove, rng, told = GROOVES[name], np.random.default_rng(len(name)), 0
    block = shapes.groove_block(groove, 40.0, 30.0)
    bore = Bore(groove.radius, groove.half_angle, groove.length, np.eye(4))
    form = replace(body_of(block), bores=(bore,))  # as it was asked for: the outline's is turned by its rounding
    for radius, length in ((10.5, 80.0), (6.8, 80.0), (3.0, 20.0), (6.8, 5.0), (1.0, 0.3)):
        T, wire, rod = placed(rng, 5000, 12.0), Cylinder(radius, length), body_of(shapes.cylinder(radius, length))
        single = signed_distances(groove, wire, T, full=True, workers=1)
        found = batch._bore_rod(bore, rod.outers[0], form, rod, in_frame_of_first(T), points=True)
        lower, upper, p, q, n = found[0], found[1], found[2:5].T, found[5:8].T, found[8:11].T
        assert np.array_equal(p, single.point_on_groove)
        assert np.array_equal(q, single.point_on_cylinder)
        assert np.array_equal(n, single.normal)
        apart = single.distance > single.error_bound
        assert np.array_equal(lower[apart], (single.distance - single.error_bound)[apart])
        assert (lower[~apart] <= 0.0).all()
        # What the points attest is what they say; they do where they are on the block.
        on_block = apart & (body(block).field(p) <= 1e-10)
        assert (upper[on_block] - lower[on_block]).max() <= 1e-8
        assert (upper[apart & (body(block).field(p) > 1e-8)] == np.inf).all()
        told += int(on_block.sum())
    assert told > 3000


@given(
    st.sampled_from(sorted(GROOVES)),
    st.floats(0.3, 11.0),
    st.floats(0.1, 90.0),
    st.sampled_from(["groove", "hole", "tube"]),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=30, deadline=None)
def test_each_pose_of_many_is_answered_as_alone(name, radius, length, kind, seed):
    """Whatever else is in its block, and from whichever of both bodies it is seen."""
    rng, cache = np.random.default_rng(seed), ModelCache()
    holder = {
        "groove": shapes.groove_block(GROOVES[name], 40.0, 30.0),
        "hole": shapes.box((40.0, 40.0, 10.0), holes=[shapes.Hole(6.0, (3.0, 0.0))]),
        "tube": shapes.cylinder(9.0, 20.0, bore=6.0),
    }[kind]
    a, b = cache.model(holder), cache.model(shapes.cylinder(radius, length))
    T = placed(rng, 200, 9.0)
    many, other = by_kernel(a, b, T), by_kernel(b, a, inverse(T))
    assert np.allclose(many.lower, other.lower, rtol=0.0, atol=1e-9)
    for k, P in enumerate(T):
        one = by_kernel(a, b, P[None])
        for field in ("lower", "upper", "point_a", "point_b", "normal"):
            assert np.array_equal(getattr(one, field)[0], getattr(many, field)[k], equal_nan=True), field


@given(st.sampled_from(sorted(GROOVES)), st.floats(1.0, 11.0), st.floats(0.5, 80.0), st.integers(0, 2**32 - 1))
@settings(max_examples=12, deadline=None)
def test_verdicts_of_many_poses_are_those_of_the_check(name, radius, length, seed):
    """Among equal blocks that stand askew, one of which may be touched deeper; the bounds of both hold the truth."""
    rng = np.random.default_rng(seed)
    block = shapes.groove_block(GROOVES[name], 40.0, 30.0)
    scene = Scene(clearance=0.5)
    places = [translation(60.0 * k, 0.0, 0.0) @ rotation(rng.normal(size=3), rng.uniform(0.0, 0.5)) for k in range(3)]
    for k, place in enumerate(places):
        scene = scene.add(f"block{k}", block, place)
    scene = scene.add("wire", shapes.cylinder(radius, length)).allow(("wire", "block1"), overlap=0.3)
    T = np.array([dot(places[k % 3], P) for k, P in enumerate(placed(rng, 15, 5.0))])
    sweep = check_poses(scene, "wire", T)
    for k, P in enumerate(T):
        one = check(scene.moved({"wire": P}), pairs=[("wire", other) for other in sweep.others], depths=False)
        assert [one.verdict("wire", other).value for other in sweep.others] == sweep.verdict[k].tolist()
        for row in one.pairs:
            column = sweep.others.index(row.a if row.b == "wire" else row.b)
            assert sweep.lower[k, column] <= max(row.distance.upper, 0.0) + 1e-9
            assert row.distance.lower <= sweep.upper[k, column] + 1e-9


@pytest.mark.parametrize("kind", ["groove", "hole"])
def test_what_certainly_clashes_needs_no_lower_bound(kind):
    """All else is as without a limit, to the bit."""
    rng, cache = np.random.default_rng(11), ModelCache()
    holder = {
        "groove": shapes.groove_block(GROOVES["wide"], 40.0, 30.0),
        "hole": shapes.box((40.0, 40.0, 10.0), holes=[shapes.Hole(12.0)]),
    }[kind]
    a, b = cache.model(holder), cache.model(shapes.cylinder(11.0, 60.0))
    pairs = in_frame_of_first(placed(rng, 2000, 3.0))
    lower, upper = bounds_by_kernel(a, b, pairs)
    least, most = bounds_by_kernel(a, b, pairs, clash=-0.2)
    certain = upper < -0.2
    assert 200 < certain.sum() < 1800
    assert (least[certain] == -np.inf).all()
    assert np.isfinite(lower[certain]).any()
    assert np.array_equal(least[~certain], lower[~certain])
    assert np.array_equal(most, upper)


@pytest.mark.parametrize("bad", [0, 17, 39])
def test_the_first_bad_pose_is_named_wherever_it_is(bad, monkeypatch):
    """In the first block of poses, in a later one, at the very end; rounding errors are mended."""
    monkeypatch.setattr(poses, "_BLOCK", 8)
    scene = Scene().add("plate", shapes.box((50.0, 50.0, 4.0))).add("pin", shapes.cylinder(5.0, 20.0))
    T = np.array([translation(0.0, 0.0, 12.0 + 0.1 * k) for k in range(40)])
    sweep = check_poses(scene, "pin", T)
    rough = T.copy()
    rough[bad, 0, 0] += 1e-7
    with pytest.warns(PoseWarning, match=rf"poses\[{bad}\]"):
        again = check_poses(scene, "pin", rough)
    assert np.array_equal(sweep.row, again.row)
    assert np.allclose(sweep.lower, again.lower, atol=1e-6)
    rough[bad, :3, :3] *= 1.1
    with pytest.raises(InputError, match=rf"poses\[{bad}\] must be rigid"):
        check_poses(scene, "pin", rough)
    T[bad, 0, 3] = 2.0 * FARTHEST
    with pytest.raises(InputError, match=rf"poses\[{bad}\] must"):
        check_poses(scene, "pin", T)


def test_poses_as_positions_and_axes_are_refused():
    scene = Scene().add("plate", shapes.box((50.0, 50.0, 4.0))).add("pin", shapes.cylinder(5.0, 20.0))
    with pytest.raises(InputError, match=r"poses must have shape \(n, 4, 4\), got \(5, 2, 3\)"):
        check_poses(scene, "pin", np.zeros((5, 2, 3)))


def test_no_poses_have_no_verdicts():
    scene = Scene().add("plate", shapes.box((50.0, 50.0, 4.0))).add("pin", shapes.cylinder(5.0, 20.0))
    sweep = check_poses(scene, "pin", np.empty((0, 4, 4)))
    assert sweep.worst.shape == (0,)
    assert sweep.verdict.shape == sweep.lower.shape == sweep.upper.shape == (0, 1)


def test_a_part_keeps_its_pose_when_the_array_it_came_from_changes():
    T = np.eye(4)
    part = Part("pin", shapes.cylinder(5.0, 20.0), T)
    T[2, 3] = 100.0
    assert part.T_world[2, 3] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        part.T_world[2, 3] = 1.0


def test_the_poses_of_a_scene_follow_its_parts():
    """Asked before and after another part comes, and after one has moved; equal shapes are one."""
    plate, pin = shapes.box((50.0, 50.0, 4.0)), shapes.cylinder(5.0, 20.0)
    one = Scene().add("plate", plate)
    assert one.placed.poses.shape == (1, 4, 4)
    twin = shapes.box((50.0, 50.0, 4.0), name="twin")
    two = one.add("pin", pin, translation(0.0, 0.0, 12.0)).add("twin", twin, translation(0.0, 0.0, 50.0))
    assert two.placed.poses[:, 2, 3].tolist() == [0.0, 12.0, 50.0]
    assert two.placed.which.tolist() == [0, 1, 0]
    assert two.placed.shapes == (plate, pin)
    assert two.moved({"pin": translation(0.0, 0.0, 3.0)}).placed.poses[:, 2, 3].tolist() == [0.0, 3.0, 50.0]
    assert one.placed.poses.shape == (1, 4, 4)
