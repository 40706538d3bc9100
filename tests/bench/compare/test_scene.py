"""The committed poses of the comparison: their distances by closed form, by search, and what each group promises."""

import mpmath
import numpy as np

from clamp3d.bench.compare.scene import BANDS, CLEAR, GROOVE, OVERLAP, WIRE, known_poses
from clamp3d.geometry.pose import check_pose
from tests.kernel.oracle import exact_distance

POSES = known_poses()


def test_every_group_is_what_its_name_says():
    assert len(POSES) == 420
    assert POSES.parallel.sum() == 210
    for T in POSES.T:
        check_pose(T)
    lean = np.abs(POSES.T[:, :2, 2]).max(axis=1)
    assert (lean[POSES.parallel] == 0.0).all()
    assert lean[~POSES.parallel].min() > 5e-4
    d = POSES.distance
    assert ((d > 1e-3) & (d < 1.0))[POSES.group == CLEAR].all()
    assert ((d < -1e-3) & (d > -0.3))[POSES.group == OVERLAP].all()
    for band in BANDS:
        of = d[POSES.group == f"{band:g}"]
        assert np.abs(of).max() <= band
        assert (of > 0.0).sum() == (of < 0.0).sum() == 40
        assert (np.abs(of) > band / 2).any()


def test_parallel_distances_are_the_closed_form_at_50_digits():
    """Centre inside the arc's sector: R - r - |centre|, the whole truth for a wire along the groove."""
    checked = 0
    with mpmath.workdps(50):
        for T, d, rest in zip(POSES.T, POSES.distance, POSES.residual, strict=True):
            x, y = (mpmath.mpf(float(v)) for v in T[:2, 3])
            if (T[:2, 2] == 0.0).all() and mpmath.atan2(abs(x), -y) < GROOVE.half_angle:
                exact = mpmath.mpf(GROOVE.radius) - mpmath.mpf(WIRE.radius) - mpmath.hypot(x, y)
                assert abs(exact - mpmath.mpf(float(d)) - mpmath.mpf(float(rest))) < mpmath.mpf(10) ** -24
                checked += 1
    assert checked > 150


def test_tilted_distances_are_those_of_the_search():
    for i in np.flatnonzero(~POSES.parallel)[::52]:
        value = exact_distance(GROOVE, WIRE, POSES.T[i])
        stored = mpmath.mpf(float(POSES.distance[i])) + mpmath.mpf(float(POSES.residual[i]))
        assert abs(value - stored) < mpmath.mpf(10) ** -22
