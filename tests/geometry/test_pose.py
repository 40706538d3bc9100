"""Poses: rotations against mpmath, rounding errors mended and said so, anything worse refused."""

import warnings

import mpmath
import numpy as np
import pytest

from clamp3d import InputError
from clamp3d.geometry.pose import PoseWarning, check_pose, check_pose_array, inverse, nearest_rigid
from clamp3d.kernel import Capsule, Cylinder, SweptArc, rotation, translation
from clamp3d.kernel.distance import signed_distance, signed_distances
from clamp3d.kernel.pieces import groove_pieces

GROOVE, WIRE = SweptArc(12.0, 1.2, 50.0), Cylinder(10.5, 80.0)


def poses(n, seed=0):
    rng = np.random.default_rng(seed)
    made = np.array([rotation(rng.normal(size=3), rng.uniform(-3, 3)) for _ in range(n)])
    made[:, :3, 3] = rng.uniform(-20, 20, (n, 3))
    return made


@pytest.mark.parametrize("scale", [1e-9, 1e-4, 1.0, 6.0, 1e3, 1e6])
def test_rotation_is_rodrigues_formula_to_rounding(scale):
    rng = np.random.default_rng(3)
    with mpmath.workdps(50):
        for _ in range(40):
            axis, angle = rng.normal(size=3), float(rng.uniform(-scale, scale))
            k = mpmath.matrix([mpmath.mpf(float(v)) for v in axis])
            k /= mpmath.norm(k)
            K = mpmath.matrix([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
            exact = mpmath.eye(3) + mpmath.sin(angle) * K + (1 - mpmath.cos(angle)) * K * K
            true = np.array([[float(v) for v in row] for row in exact.tolist()])
            assert np.abs(rotation(axis, angle)[:3, :3] - true).max() < 1e-15


@pytest.mark.parametrize(
    "rounded", [lambda T: T.astype(np.float32), lambda T: np.array([[float(f"{v:.6g}") for v in row] for row in T])]
)
def test_rounding_errors_are_mended_and_said(rounded):
    for T in poses(20):
        given = rounded(T)
        with pytest.warns(PoseWarning, match="start has rounding errors"):
            mended = check_pose(given, "start")
        R = mended[:3, :3]
        assert np.abs(R @ R.T - np.eye(3)).max() < 2e-15
        assert np.array_equal(mended[:3, 3], given[:3, 3])
        # The nearest rotation: no turn of it comes closer to what was given.
        left = R.T @ given[:3, :3].astype(float)
        assert np.abs(left - left.T).max() < 1e-14
        assert np.abs(R - T[:3, :3]).max() < 3e-6


def test_products_of_many_poses_are_left_alone():
    T = poses(1)[0]
    for step in poses(300, seed=1):
        T = T @ step
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(check_pose(T), T)
        assert np.abs(inverse(T) @ T - np.eye(4)).max() < 1e-9


@pytest.mark.parametrize("size", [1.5e-9, 1e-7, 9e-5])
def test_every_call_mends_in_the_same_way(size):
    """A float64 pose that is rigid to rounding only is measured as its nearest rotation, alone and in a batch."""
    good = poses(50)
    rough = good.copy()
    rough[20, :3, :3] *= 1.0 + size / 2  # R R^T - 1 deviates by this size
    true = signed_distance(GROOVE, WIRE, nearest_rigid(rough[20]))
    with pytest.warns(PoseWarning):
        assert signed_distance(GROOVE, WIRE, rough[20]).distance == true.distance
    round_ = Capsule(WIRE.radius, WIRE.length)
    held = signed_distance(GROOVE, round_, nearest_rigid(rough[20])).distance
    with pytest.warns(PoseWarning):
        assert groove_pieces(GROOVE, round_, rough[20]).distance.min() == pytest.approx(held, abs=1e-9)
    with pytest.warns(PoseWarning, match=r"poses\[20\]") as told:
        found = signed_distances(GROOVE, WIRE, rough)
    assert len(told) == 1
    assert found[20] == true.distance
    others = np.arange(50) != 20
    assert np.array_equal(found[others], signed_distances(GROOVE, WIRE, good)[others])
    with pytest.warns(PoseWarning):
        assert np.array_equal(check_pose_array(rough)[others], good[others])
    assert np.array_equal(check_pose_array(good), good)


@pytest.mark.parametrize(
    ("bad", "rule"),
    [
        (np.diag([1.0001, 1.0, 1.0, 1.0]), "deviates from orthonormal by 0.0002"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "reflects"),
        (np.array([[1, 2e-4, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "rigid"),
        (np.full((4, 4), np.nan), "finite"),
        (translation(2e100, 0.0, 0.0), "offset below"),
        (translation(0.0, 0.0, -1e300), "offset below"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
    ],
)
def test_what_is_worse_than_rounding_is_refused(bad, rule):
    with pytest.raises(InputError, match=rule):
        check_pose(bad)
    with pytest.raises(InputError, match=rf"poses\[1\].*{rule}"):
        check_pose_array(np.array([np.eye(4), bad, bad]))
    with pytest.raises(InputError, match=rule):
        signed_distance(GROOVE, WIRE, bad)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_stretched_axis_is_refused_by_the_kernel(axis):
    stretched = np.eye(4)
    stretched[axis, axis] = 1.0001
    with pytest.raises(InputError, match="deviates from orthonormal"):
        signed_distance(GROOVE, WIRE, stretched)
