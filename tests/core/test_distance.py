import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clamp3d.core import kernel_distance, kernel_features
from clamp3d.core.distance import Feature, signed_distance, signed_distances
from clamp3d.core.kernel_vector import Vector
from clamp3d.core.pose import rotation, translation
from clamp3d.core.primitives import Capsule, Cylinder, SweptArc
from clamp3d.core.relation3d import relative_pose
from clamp3d.errors import InputError
from clamp3d.testing import body
from tests.core.oracle import axis_distance, load, make_oracle, surface_distance

CASES = load()

# Worst error over the largest length of the scene, per feature: the table of the README.
WORST = {
    "ARC": 4e-16,
    "LIP_M": 4e-16,
    "LIP_N": 4e-16,
    "FLAT_M": 4e-16,
    "FLAT_N": 4e-16,
    "END_FACE": 4e-16,
    "END_ARC": 4e-16,
    "END_EDGE_M": 4e-16,
    "END_EDGE_N": 4e-16,
    "CORNER_M": 4e-16,
    "CORNER_N": 4e-16,
    "axis inside": 4e-16,
}


def errors():
    for case in CASES:
        answer = signed_distance(case.groove, case.cylinder, case.pose)
        yield case, answer, float(abs(mp.mpf(answer.distance) - mp.mpf(case.value)))


def test_worst_errors_per_feature():
    worst = dict.fromkeys(WORST, -1.0)
    for case, answer, error in errors():
        name = "axis inside" if answer.axis_inside else answer.feature.name
        worst[name] = max(worst[name], error / case.size)
        assert error <= answer.error_bound, (case, answer)
        assert (answer.distance < 0) == (mp.mpf(case.value) < 0) or abs(mp.mpf(case.value)) < 1e-12
        assert answer.error_bound <= 1e-13 * case.size
    assert min(worst.values()) >= 0.0, "a feature without a case"
    assert all(worst[name] <= WORST[name] for name in WORST), worst


def test_oracle_is_what_its_script_makes():
    # The committed values are those of the search, not of the code under test.
    mp.mp.dps = 50
    for case in CASES[:: len(CASES) // 10]:
        g, w = case.groove, case.cylinder
        c, d = make_oracle.axis_of(case.pose)
        value = make_oracle.exact_distance(g.radius, g.half_angle, g.length, w.radius, w.length, c, d)
        assert abs(mp.mpf(value) - mp.mpf(case.value)) < mp.mpf(10) ** -18 * case.size


@pytest.mark.parametrize("wire", [Capsule(10.5, 80.0), Cylinder(10.5, 80.0), Cylinder(10.5, 4.0)])
def test_batch_has_the_bits_of_single(wire):
    rng = np.random.default_rng(0)
    groove = SweptArc(12.0, 1.2, 50.0)
    poses = np.array([rotation(rng.normal(size=3), rng.choice([0.0, 1e-9, 0.1, 1.0])) for _ in range(164)])
    poses[:, :3, 3] = rng.normal(size=(len(poses), 3)) * 8.0
    poses = np.tile(poses, (50, 1, 1))  # enough for two threads
    full = signed_distances(groove, wire, poses, full=True)
    assert np.array_equal(full.distance, signed_distances(groove, wire, poses, workers=2))
    assert np.array_equal(full.distance, signed_distances(groove, wire, poses, workers=1))
    for i in range(164):
        one = signed_distance(groove, wire, poses[i])
        assert one.distance == full.distance[i]
        assert one.feature == full.feature[i]
        assert one.axis_inside == full.axis_inside[i]
        assert one.error_bound == full.error_bound[i]
        assert one.along == full.along[i]
        for name in ("point_on_groove", "point_on_cylinder", "normal", "gradient"):
            assert np.array_equal(getattr(one, name), getattr(full, name)[i]), name


@pytest.mark.parametrize("wire", [Capsule(10.5, 80.0), Cylinder(10.5, 20.0)])
def test_position_and_axis_alone_have_the_bits_of_poses(wire):
    rng = np.random.default_rng(1)
    groove = SweptArc(12.0, 1.2, 50.0)
    poses = np.array([rotation(rng.normal(size=3), rng.choice([0.0, 1e-9, 0.1, 1.0])) for _ in range(300)])
    poses[:, :3, 3] = rng.normal(size=(len(poses), 3)) * 8.0
    axes = np.stack([poses[:, :3, 3], poses[:, :3, 2]], axis=1)
    whole, part = (signed_distances(groove, wire, given, full=True) for given in (poses, axes))
    assert np.array_equal(signed_distances(groove, wire, axes), whole.distance)
    for field in dataclasses.fields(whole):
        assert np.array_equal(getattr(whole, field.name), getattr(part, field.name)), field.name
    long = signed_distances(groove, wire, axes * [[[1.0], [1e150]]])
    assert np.abs(long - whole.distance).max() < 1e-12
    for bad in ([0.0, 0.0, 0.0], [math.nan, 0.0, 1.0]):
        axes[7, 1] = bad
        with pytest.raises(InputError, match=r"poses\[7\] must be .* an axis that is not zero, got"):
            signed_distances(groove, wire, axes)


def test_witnesses_lie_on_both_surfaces_and_moving_by_the_distance_makes_them_touch():
    for case in CASES:
        a = signed_distance(case.groove, case.cylinder, case.pose)
        tol = 1e-12 * case.size
        assert abs(np.linalg.norm(a.normal) - 1.0) < 1e-14
        assert np.abs(a.point_on_groove + a.distance * a.normal - a.point_on_cylinder).max() <= tol
        assert surface_distance(case.groove, a.point_on_groove[None])[0] <= tol
        # Inside the material the axis point is radius + depth before the groove's point, on the normal's other side.
        reach = axis_distance(case.cylinder, case.pose, a.point_on_cylinder[None])[0]
        assert reach <= case.cylinder.radius + tol
        if not a.axis_inside:
            assert abs(reach - case.cylinder.radius) <= tol
        if a.distance > 0.0:
            moved = translation(*(-a.distance * a.normal)) @ case.pose
            assert abs(signed_distance(case.groove, case.cylinder, moved).distance) <= tol


angles = st.floats(-3.2, 3.2)
offsets = st.floats(-60.0, 60.0)
poses = st.builds(
    lambda a, b, c, x, y, z: translation(x, y, z) @ rotation((0, 0, 1), a) @ rotation((1, 0, 0), b * c),
    angles,
    angles,
    st.sampled_from([0.0, 1e-12, 1e-7, 1e-3, 1.0]),
    offsets,
    offsets,
    offsets,
)
scenes = st.tuples(
    st.builds(SweptArc, st.floats(1.0, 30.0), st.floats(0.05, 3.1), st.floats(0.1, 80.0)),
    st.builds(Capsule, st.floats(0.1, 30.0), st.floats(1e-6, 150.0)),
    poses,
)


@settings(max_examples=200, deadline=None)
@given(scenes)
def test_agrees_with_dense_search(scene):
    groove, wire, T = scene
    answer = signed_distance(groove, wire, T)
    t = np.linspace(-0.5, 0.5, 4001) * wire.length
    d = T[:3, 2] / np.linalg.norm(T[:3, 2])
    P = T[:3, 3] + t[:, None] * d
    samples = make_oracle.point_distance(P, groove.radius, groove.half_angle, groove.length / 2) - wire.radius
    # Lipschitz constant 1: between two samples the distance falls by half their spacing at most.
    assert answer.distance <= samples.min() + 1e-11
    assert answer.distance >= samples.min() - 0.5 * wire.length / 4000 - 1e-11


@settings(max_examples=150, deadline=None)
@given(scenes, st.sampled_from([Capsule, Cylinder]))
def test_mirror_images(scene, kind):
    groove, wire, T = scene
    wire = kind(wire.radius, wire.length)
    a = signed_distance(groove, wire, T)
    for axis in (0, 2):
        mirror = np.eye(4)
        mirror[axis, axis] = -1.0
        b = signed_distance(groove, wire, mirror @ T @ mirror)
        assert abs(a.distance - b.distance) <= a.error_bound + b.error_bound


@settings(max_examples=150, deadline=None)
@given(scenes, st.floats(-1.0, 1.0), st.sampled_from([1.0, 1e3, 1e6]))
def test_moving_both_bodies_changes_nothing(scene, angle, far):
    groove, wire, T = scene
    a = signed_distance(groove, wire, T)
    A = translation(far, -0.7 * far, 0.3 * far) @ rotation((1, 2, 3), angle)
    B = A @ T  # rounds to about far * 1e-16
    b = signed_distance(groove, wire, relative_pose(A, B))
    assert abs(a.distance - b.distance) <= 1e-12 * max(1.0, far, 200.0)


def test_world_offsets_cost_nothing():
    mp.mp.dps = 50
    rng = np.random.default_rng(5)
    for case in CASES[::40]:
        A = rotation(rng.normal(size=3), 1.0)
        A[:3, 3] = rng.uniform(-1e6, 1e6, 3)
        B = A @ case.pose
        # The exact relative pose of the two float64 world poses.
        Am, Bm = mp.matrix(A[:3].tolist()), mp.matrix(B[:3].tolist())
        R = Am[:, :3].T
        c, d = R * (Bm[:, 3] - Am[:, 3]), R * Bm[:, 2]
        n = mp.norm(d)
        g, w = case.groove, case.cylinder
        exact = make_oracle.exact_distance(g.radius, g.half_angle, g.length, w.radius, w.length, list(c), list(d / n))
        answer = signed_distance(g, w, relative_pose(A, B))
        assert abs(mp.mpf(answer.distance) - mp.mpf(exact)) <= 1e-12 * case.size


def test_no_wrong_sign_at_a_nanometre():
    # Gaps made from closed forms: an arc, a lip, a flat face, and the ends of a tilted wire (below).
    groove = SweptArc(12.0, math.radians(70.0), 50.0)
    h, s = -12.0 * math.cos(groove.half_angle), 12.0 * math.sin(groove.half_angle)
    for gap in (1e-9, -1e-9, 3e-10, -3e-10):
        for T in (
            translation(0.0, -1.5 + gap, 3.0),
            translation((1.5 - gap) * math.sin(1.0), -(1.5 - gap) * math.cos(1.0), 3.0),
            translation(-s - 4.0, h + 10.5 + gap, -80.0 + 20.0),
            translation(s - (10.5 + gap) * math.sin(0.3), h + (10.5 + gap) * math.cos(0.3), 0.0),
        ):
            assert signed_distance(groove, Capsule(10.5, 80.0), T).distance == pytest.approx(gap, abs=2e-14)


def test_tilted_wire_touches_at_both_ends():
    # R - (L / 2 tan t + r / cos t) = 0
    groove, wire = SweptArc(7.0, math.pi / 2, 50.0), Capsule(6.935, 100.0)
    zero = math.radians(0.148915009)
    for axis in ((0, 1, 0), (1, 0, 0)):
        inside, outside = (signed_distance(groove, wire, rotation(axis, zero * f)).distance for f in (0.9999, 1.0001))
        assert inside > 0.0 > outside
    t = 0.002
    wanted = (7.0 - 25.0 * math.tan(t)) * math.cos(t) - 6.935
    assert signed_distance(groove, wire, rotation((1, 0, 0), t)).distance == pytest.approx(wanted, abs=1e-14)


def test_tiny_and_huge_numbers():
    groove, wire = SweptArc(12.0, 1.0, 50.0), Capsule(5.0, 80.0)
    for tiny in (5e-324, 1e-310, 2.3e-162, 1e-155, 1e-100):
        for T in (translation(tiny, tiny, tiny), translation(tiny, 0.0, 0.0) @ rotation((1, 0, 0), tiny)):
            answer = signed_distance(groove, wire, T)
            assert answer.distance == 7.0
            assert abs(np.linalg.norm(answer.normal) - 1.0) < 1e-14
            assert abs(np.linalg.norm(answer.point_on_groove[:2]) - 12.0) < 1e-13
        # On the major axis of the end arcs but for a hair: the stationary points of a tilted axis run together.
        tilted = rotation((1, 0, 0), 0.3)
        tilted[:3, 3] = (tiny, 25.0 * math.tan(-0.3) + tiny, 25.0)
        at_zero = tilted.copy()
        at_zero[0, 3] = 0.0
        long = Capsule(1.0, 200.0)
        assert signed_distance(groove, long, tilted).distance == pytest.approx(
            signed_distance(groove, long, at_zero).distance, abs=1e-14
        )
    far = signed_distance(groove, wire, translation(0.0, 1e90, 0.0))
    assert far.distance == 1e90


def test_limits():
    T = translation(0.3, -2.0, 1.0) @ rotation((1, 2, 3), 0.3)
    groove = SweptArc(12.0, 1.0, 50.0)
    # A cylinder of no length is a ball; its direction does not matter.
    balls = [
        signed_distance(groove, Capsule(1.0, 1e-100), translation(0.3, -2.0, 1.0) @ rotation((1, 2, 3), a))
        for a in (0.0, 0.3, 2.0)
    ]
    assert len({b.distance for b in balls}) == 1
    assert balls[0].distance == pytest.approx(11.0 - math.hypot(0.3, 2.0), abs=1e-14)
    # A cylinder of no radius is its axis.
    thin, thick = (signed_distance(groove, Capsule(r, 80.0), T).distance for r in (1e-12, 1.0))
    assert thin - thick == pytest.approx(1.0, abs=1e-11)
    # The mouth closes: a pipe, whose distance from inside is the same all round.
    pipe = SweptArc(12.0, math.pi - 1e-9, 50.0)
    for a in np.linspace(0.0, 6.0, 7):
        answer = signed_distance(pipe, Capsule(1.0, 10.0), translation(3.0 * math.sin(a), 3.0 * math.cos(a), 0.0))
        assert answer.distance == pytest.approx(8.0, abs=1e-9)
    # A groove of no length is a sheet.
    sheet = SweptArc(12.0, 1.0, 1e-12)
    assert signed_distance(sheet, Capsule(1.0, 4.0), translation(0.0, -20.0, 5.0)).distance == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda T: T.__setitem__((0, 3), np.nan), "finite"),
        (lambda T: T.__setitem__((1, 1), np.inf), "finite"),
        (lambda T: T.__setitem__((1, 3), -np.inf), "finite"),
        (lambda T: T.__setitem__((0, 0), -1.0), "reflects"),
        (lambda T: T.__setitem__((slice(0, 3), slice(0, 3)), 1.001 * np.eye(3)), "rigid"),
        (lambda T: T.__setitem__((0, 1), 1.1e-4), "rigid"),
        (lambda T: T.__setitem__((3, 0), 1e-3), "last row"),
        (lambda T: T.__setitem__((3, 3), np.nan), "finite"),
        (lambda T: T.__setitem__((1, 3), 1e200), "offset below 1e"),
    ],
)
def test_bad_poses_are_named(change, rule):
    groove, wire = SweptArc(12.0, 1.0, 50.0), Capsule(5.0, 80.0)
    T = np.eye(4)
    change(T)
    with pytest.raises(InputError, match=f"pose.*{rule}"):
        signed_distance(groove, wire, T)
    many = np.tile(np.eye(4), (10_000, 1, 1))
    many[9_000] = many[9_900] = T
    for full in (False, True):
        with pytest.raises(ValueError, match=rf"poses\[9000\].*{rule}"):
            signed_distances(groove, wire, many, full=full)


def test_bad_shapes_of_input():
    groove, wire = SweptArc(12.0, 1.0, 50.0), Capsule(5.0, 80.0)
    for pose in (np.eye(3), np.zeros((2, 4, 4)), "up", None, [[1, 2], [3]]):
        with pytest.raises(InputError, match="pose"):
            signed_distance(groove, wire, pose)
    for batch in (np.eye(4), np.zeros((2, 3, 4)), "up"):
        with pytest.raises(InputError, match="poses"):
            signed_distances(groove, wire, batch)
    with pytest.raises(InputError, match="workers must be a whole number >= 1, got 0"):
        signed_distances(groove, wire, np.eye(4)[None], workers=0)
    for make in (
        lambda: Capsule(1e200, 1.0),
        lambda: Capsule(1.0, math.nan),
        lambda: SweptArc(-1.0, 1.0, 1.0),
        lambda: SweptArc(1.0, 4.0, 1.0),
        lambda: Capsule(1.0, 0.0),
    ):
        with pytest.raises(InputError, match=r"must be .*got"):
            make()
    assert signed_distances(groove, wire, np.empty((0, 4, 4))).shape == (0,)
    # Any layout and number type gives the same answer.
    T = translation(1.0, -2.0, 3.0) @ rotation((1, 1, 0), 0.1)
    wanted = signed_distance(groove, wire, T).distance
    assert signed_distance(groove, wire, np.asfortranarray(T)).distance == wanted
    assert signed_distance(groove, wire, T.tolist()).distance == wanted
    assert signed_distances(groove, wire, np.asfortranarray(T[None]))[0] == wanted


def test_axis_through_the_thin_edge_beside_a_nearly_closed_mouth():
    # The material beside a mouth of 1e-7 mm is thinner there than the rounding of a radius; the axis passes through it.
    groove = SweptArc(5.161415441164862, 3.1415926427670393, 2.0250675696346696)
    wire = Capsule(3.5867976131830965, 23.721288892512312)
    T = np.eye(4)
    T[:3, 0] = -0.9911410683349434, -0.13281333765803433, -8.365718838961366e-10
    T[:3, 1] = -0.13281333765803433, 0.9911410683349434, 6.243053336094173e-09
    T[:3, 2] = 0.0, 6.298854457299527e-09, -1.0
    T[:3, 3] = 7.726659662254022e-08, 5.161415441164861, 0.0
    answer = signed_distance(groove, wire, T)
    assert abs(answer.distance + wire.radius) <= answer.error_bound


@pytest.mark.parametrize("turned", [np.eye(4), np.diag([-1.0, 1.0, -1.0, 1.0])])
def test_axis_level_with_an_end_face_touches_it(turned):
    # Neither end of the axis is beyond the face's plane by more than rounding, but the axis lies on the face.
    groove = SweptArc(10.3457246493177, 3.0524651459900665, 23.430698414214742)
    wire = Capsule(9.626253306467202, 26.304754317132005)
    T = np.eye(4)
    T[:3, 0] = -0.11533551134736529, 0.1153355113473654, -0.9866080476280759
    T[:3, 1] = -0.6976372408510326, 0.6976372408510327, 0.16310904437068008
    T[:3, 2] = 0.7071067811865476, 0.7071067811865475, 6.123233995736766e-17
    T[:3, 3] = 9.958802570348058e-09, 9.121022893692713, 11.715349207107371
    answer = signed_distance(groove, wire, turned @ T)
    assert abs(answer.distance + wire.radius) <= answer.error_bound


@pytest.mark.parametrize("turned", [np.eye(4), np.diag([-1.0, 1.0, -1.0, 1.0])])
def test_axis_level_with_the_flat_faces_touches_them(turned):
    groove = SweptArc(60.27661206694996, 0.4055364276778771, 187.53846554205296)
    wire = Capsule(48.58597632250411, 1669.9322504748816)
    T = np.eye(4)
    T[:3, 0] = 0.1960587234597981, -0.9607923573335858, 0.19605872345979813
    T[:3, 1] = -0.679382791182787, -0.27726890573840257, -0.6793827911827871
    T[:3, 2] = 0.7071067811865476, -3.4762175193439656e-18, -0.7071067811865475
    T[:3, 3] = 315.64366617869393, -55.38763045396105, -102.3385888129202
    answer = signed_distance(groove, wire, turned @ T)
    assert abs(answer.distance + wire.radius) <= answer.error_bound


EDGE_POINTS = {  # a point in the middle of each edge of a groove of radius 10, half angle a, half length 20
    Feature.LIP_M: lambda s, h: (-s, h, 3.0),
    Feature.LIP_N: lambda s, h: (s, h, -3.0),
    Feature.END_ARC: lambda s, h: (-0.6 * s, -math.sqrt(100.0 - 0.36 * s * s), 20.0),
    Feature.END_EDGE_M: lambda s, h: (-s - 4.0, h, -20.0),
    Feature.END_EDGE_N: lambda s, h: (s + 4.0, h, 20.0),
    Feature.CORNER_M: lambda s, h: (-s, h, 20.0),
    Feature.CORNER_N: lambda s, h: (s, h, -20.0),
}


@pytest.mark.parametrize("half_angle", [0.6, 1.5, 2.4])
@pytest.mark.parametrize("feature", EDGE_POINTS)
def test_the_normal_of_an_edge_leads_straight_away_from_it(feature, half_angle):
    """For an axis through the edge itself: by the definition alone, a step along it is all of the distance."""
    s, h = 10.0 * math.sin(half_angle), -10.0 * math.cos(half_angle)
    point = np.array(EDGE_POINTS[feature](s, h))
    groove = kernel_features.groove_of(10.0, half_angle, 20.0)
    normal = kernel_distance.edge_normal(groove, float(feature), Vector(*map(float, point)))
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
    away = body(SweptArc(10.0, half_angle, 40.0)).field(point + np.outer([1e-3, 0.1], normal))
    assert away == pytest.approx([1e-3, 0.1], abs=1e-6)
