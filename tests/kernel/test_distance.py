import dataclasses
import math

import mpmath as mp
import numba
import numpy as np
import pytest

from clamp3d.bench.stress.poses.truth import truth
from clamp3d.errors import InputError
from clamp3d.kernel import Capsule, Cylinder, SweptArc, features, nearest, rotation, translation
from clamp3d.kernel.distance import Feature, signed_distance, signed_distances
from clamp3d.kernel.relation import relative_pose
from clamp3d.kernel.vector import Vector
from clamp3d.testing import body
from tests.kernel.oracle import axis_distance, cases_of, exact_distance, load, surface_distance
from tests.refusals import refusals

CASES = load()


def test_worst_errors_per_feature():
    """Within 4e-16 of the largest length of the scene, as docs/kernel.md says of each feature."""
    seen = set()
    for case in CASES:
        answer = signed_distance(case.groove, case.cylinder, case.pose)
        error = float(abs(mp.mpf(answer.distance) - mp.mpf(case.value)))
        seen.add("axis inside" if answer.axis_inside else answer.feature)
        assert error <= min(4e-16 * case.size, answer.error_bound), (case, answer)
        assert (answer.distance < 0) == (mp.mpf(case.value) < 0) or abs(mp.mpf(case.value)) < 1e-12
        assert answer.error_bound <= 1e-13 * case.size
    assert seen == {*Feature, "axis inside"}


def test_oracle_is_what_its_script_makes():
    # The committed values are those of the search, not of the code under test.
    for case in CASES[:: len(CASES) // 10]:
        value = exact_distance(case.groove, case.cylinder, case.pose)
        assert abs(value - mp.mpf(case.value)) < mp.mpf(10) ** -18 * case.size


@pytest.mark.parametrize("wire", [Capsule(10.5, 80.0), Cylinder(10.5, 80.0), Cylinder(10.5, 4.0)])
def test_batches_have_the_bits_of_single_poses(wire):
    """Of poses, shared by threads or not, and of positions and axes alone, whose length does not matter."""
    rng = np.random.default_rng(0)
    groove = SweptArc(12.0, 1.2, 50.0)
    poses = np.array([rotation(rng.normal(size=3), rng.choice([0.0, 1e-9, 0.1, 1.0])) for _ in range(164)])
    poses[:, :3, 3] = rng.normal(size=(len(poses), 3)) * 8.0
    poses = np.tile(poses, (50, 1, 1))  # enough for two threads
    axes = np.stack([poses[:, :3, 3], poses[:, :3, 2]], axis=1)
    full, part = (signed_distances(groove, wire, places, full=True) for places in (poses, axes))
    for workers in (1, 2):
        assert np.array_equal(full.distance, signed_distances(groove, wire, poses, workers=workers))
    for name in (field.name for field in dataclasses.fields(full)):
        assert np.array_equal(getattr(full, name), getattr(part, name)), name
        for i in range(164):
            one = getattr(signed_distance(groove, wire, poses[i]), name)
            assert np.array_equal(one, getattr(full, name)[i]), name
    long = signed_distances(groove, wire, axes * [[[1.0], [1e150]]])
    assert np.abs(long - full.distance).max() < 1e-12
    for bad in ([0.0, 0.0, 0.0], [math.nan, 0.0, 1.0]):
        axes[7, 1] = bad
        with pytest.raises(InputError, match=r"poses\[7\] must be .* an axis that is not zero, got"):
            signed_distances(groove, wire, axes)


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_an_axis_that_is_exactly_along_an_edge(axis):
    """Beyond an end and beside it: lines that are parallel have no nearest point of their own."""
    rng = np.random.default_rng(3)
    groove, wire = SweptArc(8.0, 0.4, 16.0), Capsule(2.5, 3.0)
    places = np.stack([rng.uniform(-16.0, 16.0, (8, 3)), np.tile(axis, (8, 1))], axis=1)
    poses = np.tile(np.eye(4), (8, 1, 1))
    poses[:, :3, 2:] = places[:, ::-1].transpose(0, 2, 1)
    assert np.abs(signed_distances(groove, wire, places) - truth(cases_of(groove, wire, poses))).max() < 1e-13


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


def test_world_offsets_cost_nothing():
    rng = np.random.default_rng(5)
    for case in CASES[::60]:
        A = rotation(rng.normal(size=3), 1.0)
        A[:3, 3] = rng.uniform(-1e6, 1e6, 3)
        B = A @ case.pose
        # The exact relative pose of the two float64 world poses.
        Am, Bm = mp.matrix(A[:3].tolist()), mp.matrix(B[:3].tolist())
        R = Am[:, :3].T
        T = np.eye(4)
        T[:3, 2:] = np.column_stack([R * Bm[:, 2], R * (Bm[:, 3] - Am[:, 3])])
        answer = signed_distance(case.groove, case.cylinder, relative_pose(A, B))
        assert abs(answer.distance - truth(cases_of(case.groove, case.cylinder, [T]))[0]) <= 1e-12 * case.size


def test_tiny_and_huge_numbers():
    groove, wire = SweptArc(12.0, 1.0, 50.0), Capsule(5.0, 80.0)
    for tiny in (5e-324, 1e-310, 2.3e-162, 1e-155, 1e-100):
        for T in (translation(tiny, tiny, tiny), translation(tiny, 0.0, 0.0) @ rotation((1, 0, 0), tiny)):
            answer = signed_distance(groove, wire, T)
            assert answer.distance == 7.0
            assert abs(np.linalg.norm(answer.normal) - 1.0) < 1e-14
            assert abs(np.linalg.norm(answer.point_on_groove[:2]) - 12.0) < 1e-13
            ended = signed_distance(groove, Cylinder(5.0, 20.0), translation(0.0, 0.0, 36.0) @ T)  # 1 mm before the end
            assert ended.distance == pytest.approx(math.hypot(7.0, 1.0), abs=1e-13)
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
    # A cylinder of no length is a ball, one of no radius its axis.
    ball = signed_distance(groove, Capsule(1.0, 1e-100), T).distance
    assert ball == pytest.approx(11.0 - math.hypot(0.3, 2.0), abs=1e-14)
    thin, thick = (signed_distance(groove, Capsule(r, 80.0), T).distance for r in (1e-12, 1.0))
    assert thin - thick == pytest.approx(1.0, abs=1e-11)
    # The mouth closes: a pipe, whose distance from inside is the same all round. A groove of no length is a sheet.
    pipe = SweptArc(12.0, math.pi - 1e-9, 50.0)
    for a in np.linspace(0.0, 6.0, 7):
        answer = signed_distance(pipe, Capsule(1.0, 10.0), translation(3.0 * math.sin(a), 3.0 * math.cos(a), 0.0))
        assert answer.distance == pytest.approx(8.0, abs=1e-9)
    sheet = SweptArc(12.0, 1.0, 1e-12)
    assert signed_distance(sheet, Capsule(1.0, 4.0), translation(0.0, -20.0, 5.0)).distance == pytest.approx(2.0)


BAR = SweptArc(12.0, 1.0, 50.0), Capsule(5.0, 80.0)
NO_POSE, NO_POSES = (np.eye(3), np.zeros((2, 4, 4)), "up", None, [[1, 2], [3]]), (np.eye(4), np.zeros((2, 3, 4)), "up")
test_bad_shapes_of_input = refusals(
    *((lambda pose=pose: signed_distance(*BAR, pose), "pose") for pose in NO_POSE),
    *((lambda batch=batch: signed_distances(*BAR, batch), "poses") for batch in NO_POSES),
    (lambda: signed_distances(*BAR, np.eye(4)[None], workers=0), "workers must be a whole number >= 1, got 0"),
    (lambda: Capsule(1e200, 1.0), r"must be .*got"),
    (lambda: Capsule(1.0, math.nan), r"must be .*got"),
    (lambda: SweptArc(-1.0, 1.0, 1.0), r"must be .*got"),
    (lambda: SweptArc(1.0, 4.0, 1.0), r"must be .*got"),
)


def test_any_layout_and_number_type_gives_the_same_answer():
    T = translation(1.0, -2.0, 3.0) @ rotation((1, 1, 0), 0.1)
    expected = signed_distance(*BAR, T).distance
    for other in (np.asfortranarray(T), T.tolist()):
        assert signed_distance(*BAR, other).distance == expected
        assert signed_distances(*BAR, [other])[0] == expected
    assert signed_distances(*BAR, np.empty((0, 4, 4))).shape == (0,)


NEARLY_IN = [
    # Through the material beside a mouth of 1e-7 mm, which is thinner there than the rounding of a radius.
    (
        SweptArc(5.161415441164862, 3.1415926427670393, 2.0250675696346696),
        Capsule(3.5867976131830965, 23.721288892512312),
        (7.726659662254022e-08, 5.161415441164861, 0.0),
        (0.0, 6.298854457299527e-09, -1.0),
    ),
    # Neither end of the axis is beyond the end face's plane by more than rounding, but the axis lies on the face.
    (
        SweptArc(10.3457246493177, 3.0524651459900665, 23.430698414214742),
        Capsule(9.626253306467202, 26.304754317132005),
        (9.958802570348058e-09, 9.121022893692713, 11.715349207107371),
        (0.7071067811865476, 0.7071067811865475, 6.123233995736766e-17),
    ),
    # The same of the flat faces.
    (
        SweptArc(60.27661206694996, 0.4055364276778771, 187.53846554205296),
        Capsule(48.58597632250411, 1669.9322504748816),
        (315.64366617869393, -55.38763045396105, -102.3385888129202),
        (0.7071067811865476, -3.4762175193439656e-18, -0.7071067811865475),
    ),
]


@pytest.mark.parametrize("turned", [(1.0, 1.0, 1.0), (-1.0, 1.0, -1.0)])
@pytest.mark.parametrize(("groove", "wire", "centre", "axis"), NEARLY_IN)
def test_an_axis_that_lies_on_a_face_to_rounding_touches_it(groove, wire, centre, axis, turned):
    answer = signed_distances(groove, wire, np.array([[centre, axis]]) * turned, full=True)
    assert abs(answer.distance[0] + wire.radius) <= answer.error_bound[0]


@pytest.mark.parametrize("radius", [0.5, 10.0, 500.0])
def test_in_the_mouth_of_a_nearly_full_circle_the_lips_are_nearest(radius):
    """It is as wide as the root of what is rounded in its height, so heights alone do not say what is in it."""
    half_angle = math.pi - 1e-8
    for place in (0.0, 0.5):
        T = translation(place * radius * math.sin(half_angle), -radius * math.cos(half_angle), 0.0)
        answer = signed_distance(SweptArc(radius, half_angle, 10.0), Capsule(0.1, 4.0), T)
        true = (1.0 - place) * radius * math.sin(half_angle) - 0.1
        assert answer.distance == pytest.approx(true, abs=1e-12 * radius)


EDGE_POINTS = {  # a point in the middle of each edge of a groove of radius 10, half angle a, half length 20
    Feature.LIP_M: lambda s, h: (-s, h, 3.0),
    Feature.LIP_N: lambda s, h: (s, h, -3.0),
    Feature.END_ARC: lambda s, h: (-0.6 * s, -math.sqrt(100.0 - 0.36 * s * s), 20.0),
    Feature.END_EDGE_M: lambda s, h: (-s - 4.0, h, -20.0),
    Feature.END_EDGE_N: lambda s, h: (s + 4.0, h, 20.0),
    Feature.CORNER_M: lambda s, h: (-s, h, 20.0),
    Feature.CORNER_N: lambda s, h: (s, h, -20.0),
}


@numba.njit
def edge_normal(groove, feature, point):
    return nearest.edge_normal(groove, feature, point)


@pytest.mark.parametrize("half_angle", [0.6, 1.5, 2.4])
@pytest.mark.parametrize("feature", EDGE_POINTS)
def test_the_normal_of_an_edge_leads_straight_away_from_it(feature, half_angle):
    """For an axis through the edge itself: by the definition alone, a step along it is all of the distance."""
    s, h = 10.0 * math.sin(half_angle), -10.0 * math.cos(half_angle)
    point = np.array(EDGE_POINTS[feature](s, h))
    normal = edge_normal(features.Groove(10.0, half_angle, s, h, 20.0), float(feature), Vector(*map(float, point)))
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
    away = body(SweptArc(10.0, half_angle, 40.0)).field(point + np.outer([1e-3, 0.1], normal))
    assert away == pytest.approx([1e-3, 0.1], abs=1e-6)
