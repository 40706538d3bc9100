"""Triangles that a motion can never bring near each other, against distances at many times."""

from __future__ import annotations

import fcl
import numpy as np
import pytest

from clamp3d.collide.invariants import can_meet
from clamp3d.collide.surface import fcl_tree
from clamp3d.core.motion import Motion

TIMES = np.linspace(0.0, 1.0, 40)


def motion(rng, kind):
    axis, point, way = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3) * 5.0
    if kind == "translation":
        return Motion.translate(way)
    if kind == "rotation":
        return Motion.screw(axis, rng.uniform(-6.0, 6.0), point=point)
    if kind == "screw":
        return Motion.screw(axis, rng.uniform(-6.0, 6.0), point=point, travel=4.0)
    turn = Motion.screw(axis, 2.0, point=point)
    return Motion(turn.axis, turn.point, turn.angle, way)


def away(one, other, T):
    """Distance of two sets of triangles, the first at ``T``, by FCL."""
    trees = [fcl_tree(t.reshape(-1, 3), np.arange(3 * len(t)).reshape(-1, 3)) for t in (one, other)]
    place = fcl.Transform(T[:3, :3], T[:3, 3])
    pair = fcl.CollisionObject(trees[0], place), fcl.CollisionObject(trees[1])
    if fcl.collide(*pair, fcl.CollisionRequest(), fcl.CollisionResult()):
        return 0.0
    return fcl.distance(*pair, fcl.DistanceRequest(), fcl.DistanceResult())


@pytest.mark.parametrize("kind", ["translation", "rotation", "screw", "carried"])
@pytest.mark.parametrize("seed", range(60))
def test_what_comes_near_is_kept(kind, seed):
    """Two triangles that come within their least distance, seen at many times, may come within it."""
    rng = np.random.default_rng(seed)
    moves = motion(rng, kind)
    one, other = (rng.normal(size=3) * 2.0 + rng.normal(size=(1, 3, 3)) * rng.choice([1.0, 5.0]) for _ in range(2))
    errors = rng.uniform(0.0, 0.1, size=(2, 1))
    least = min(away(one, other, moves.at(t)) for t in TIMES) - errors.sum()
    assert np.all(can_meet(moves, (one, errors[0]), (other, errors[1]), max(least, 0.0) + 1e-9))


def test_rings_of_a_hinge_are_told_apart_by_their_height():
    """Rings one above the other about the axis of a turn: nothing of them comes nearer than they are."""
    angle = np.linspace(0.0, 2.0 * np.pi, 13)
    up = np.array([0.0, 0.0, 1.0])
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(13)], axis=1)
    lower = np.stack([ring[:-1], ring[1:], ring[:-1] - up], axis=1)
    upper = lower + 1.2 * up
    none = np.zeros(12)
    turn = Motion.screw([0.0, 0.0, 1.0], 3.0)
    assert not np.any(can_meet(turn, (upper, none), (lower, none), 0.199))
    assert np.all(can_meet(turn, (upper, none), (lower, none), 0.201))


def test_a_plate_that_the_axis_passes_through_is_near_the_axis():
    plate = 10.0 * np.array([[[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]])
    tip = np.array([[[0.1, 0.0, 0.5], [0.1, 0.1, 0.6], [0.0, 0.1, 0.6]]])
    turn, none = Motion.screw([0.0, 0.0, 1.0], 3.0), np.zeros(1)
    assert np.all(can_meet(turn, (plate, none), (tip, none), 0.501))
    assert not np.any(can_meet(turn, (plate, none), (tip, none), 0.499))
