"""Pairs of the same shapes in the same relative pose are measured once, and answer as if each had been measured."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP")
sys.path.insert(0, str(Path(__file__).parents[1] / "brep"))

from assemblies import cut, fuse, rod, shift, solid_of

from clamp3d import Scene, check
from clamp3d.brep.solid import BrepSolid
from clamp3d.collide import faces_depth
from clamp3d.collide.repeats import SAME
from clamp3d.core.pose import rotation, translation

SCREW, WASHER = (
    BrepSolid.of(solid_of(shape), name)
    for name, shape in (
        ("screw", fuse(rod(3, -12, 0), rod(5, 0, 5))),
        ("washer", cut(rod(6, -1.5, 0), rod(2.9, -2, 1))),
    )
)
PLACES = [np.eye(4), shift(40, 0, 0), translation(0, 40, 3) @ rotation((1, 2, 3), 0.7)]


def scene(*offsets, washers=PLACES):
    """A screw in a washer that is too narrow, at some places; each washer moved by an offset in its own frame."""
    made = Scene()
    for k, (at, offset) in enumerate(zip(washers, offsets, strict=True)):
        made = made.add(f"screw_{k}", SCREW, at).add(f"washer_{k}", WASHER, at @ offset)
    return made


def test_the_same_pair_elsewhere_is_not_measured_again():
    found = check(made := scene(np.eye(4), np.eye(4), np.eye(4)))
    assert found.work.queries["repeats"] == 2
    first = found.pairs[0].distance
    for row, at in zip(found.pairs, PLACES, strict=True):
        alone = check(made, pairs=[(row.a, row.b)])
        assert "repeats" not in alone.work.queries
        assert row.verdict is alone.pairs[0].verdict
        assert abs(row.distance.upper - alone.pairs[0].distance.upper) < SAME
        assert row.distance.lower <= alone.pairs[0].distance.lower + SAME
        assert row.distance.interference == pytest.approx(first.interference, abs=SAME)
        np.testing.assert_allclose(row.distance.point_a, at[:3, :3] @ first.point_a + at[:3, 3], atol=1e-9)
        assert row.where.volume == pytest.approx(found.pairs[0].where.volume, rel=1e-9)


def test_bounds_are_wider_by_what_the_pose_differs():
    a, b = check(scene(np.eye(4), shift(0.5 * SAME, 0, 0), washers=PLACES[:2])).pairs
    assert 0.0 < b.distance.upper - a.distance.upper < SAME
    assert b.distance.interference[0] < a.distance.interference[0]
    assert b.distance.interference[1] > a.distance.interference[1]


@pytest.mark.parametrize("offset", [shift(1e-5, 0, 0), rotation((0, 1, 0), 4e-7)], ids=["moved", "turned"])
def test_another_pose_is_measured(offset):
    """A turn that the digits of the pose do not show moves a long part all the same."""
    long = BrepSolid.of(solid_of(rod(1, 0, 2000)), "long")
    made = Scene()
    for name, at, other in (("a", np.eye(4), np.eye(4)), ("b", shift(90, 0, 0), offset)):
        made = made.add(f"{name}_1", SCREW, at @ shift(3.995, 0, 0)).add(f"{name}_2", long, at @ other)
    assert "repeats" not in check(made).work.queries


@pytest.mark.parametrize(("gap", "counts"), [(1.1e-6, True), (0.9e-6, False), (1e-12, False)])
def test_a_way_out_must_leave_a_gap_in_each_pose_that_counts_as_the_same(monkeypatch, gap, counts):
    """What it leaves of one pose may be gone in another one, which differs by rounding and is not measured again."""
    measure = faces_depth.faces_distance

    def hardly_apart(*bodies, **options):
        found = measure(*bodies, **options)
        return replace(found, lower=gap) if found.lower > 0.0 else found

    monkeypatch.setattr(faces_depth, "faces_distance", hardly_apart)
    beside = shift(8.9, 0, -4)
    for row in check(scene(beside, beside, beside)).pairs:
        assert row.distance.upper < 0.0
        assert math.isfinite(row.distance.lower) == counts
