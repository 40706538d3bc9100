"""What swept triangles keep of others: exact on straight ways, never too much on arcs; against the hulls' distance."""

import math

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from clamp3d.collide import swept_mesh
from clamp3d.collide.swept_mesh import Standing, swept_gap
from clamp3d.core.motion import Motion
from tests.hulls import apart

SLOW = settings(
    deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate], suppress_health_check=[*HealthCheck]
)
seeds = st.integers(0, 10**6)


def standing(triangles, errors, *, wide=False):
    """Triangles that are a piece each; ``wide``: one piece with a triangle that no others come near."""
    n = len(triangles)
    if not wide:
        return Standing(triangles, errors, np.arange(n))
    far = 1e6 + np.eye(3)
    return Standing(np.concatenate([triangles, far[None]]), np.append(errors, 0.0), np.zeros(n + 1, dtype=np.int64))


def some_triangles(rng, most, spread):
    n = rng.integers(1, most)
    return spread * rng.normal(size=(n, 1, 3)) + rng.choice([0.05, 0.5, 3.0]) * rng.normal(size=(n, 3, 3))


def moved(way, t, points):
    turn = Rotation.from_rotvec(t * way.angle * way.axis).as_matrix()
    return (points - way.point) @ turn.T + way.point + t * way.travel


def turning(rng, angle):
    """A turn by ``angle``, with or without travel, along its axis or across it; the axis is where the triangles are."""
    axis, travel = rng.normal(size=3), rng.normal(size=3) * rng.choice([0.0, 3.0])
    axis /= np.linalg.norm(axis)
    if rng.random() < 0.5:
        travel = (travel @ axis) * axis
    return Motion(axis, 2.0 * rng.normal(size=3), angle, travel)


@settings(SLOW, max_examples=80)
@given(seeds, st.sampled_from([0.0, 0.5]), st.sampled_from([0.1, 1.0, 20.0]))
def test_on_a_straight_way_it_is_the_distance_of_the_hulls(seed, error, most):
    """Less the errors, and no more than is asked for: to the digit where all have one error, else to the largest."""
    rng = np.random.default_rng(seed)
    still, moving = some_triangles(rng, 5, 6.0), some_triangles(rng, 4, 6.0)
    off, moving_off = error * rng.uniform(0.5, 1.0, len(still)), error * rng.uniform(0.5, 1.0, len(moving))
    by = rng.normal(size=3) * rng.choice([0.0, 1.0, 10.0])
    first, last = sorted(rng.uniform(size=2))
    way = moving, moving_off, Motion.translate(by), (first, last), most
    gap, near = (swept_gap(standing(still, off, wide=wide), *way) for wide in (False, True))
    swept = np.concatenate([moving + first * by, moving + last * by], axis=1)
    truth = np.array([[apart(one, other) for other in swept] for one in still])
    least = (truth - off[:, None] - moving_off).min()
    assert gap <= min(least, most) + 1e-9
    if truth.min() > 1e-9:
        assert near >= min((truth - off.max() - moving_off.max()).min(), most) - 1e-9


@pytest.mark.parametrize("way", [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)])
def test_errors_of_both_sides_count_whichever_way_the_other_lies(way):
    """Points 2 mm apart, known to within 0.9 and 0.6 mm: half a millimetre is left, also where less is looked for."""
    point = 1e-3 * np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]])
    still = standing(point, np.array([0.9]), wide=True)
    for most in (0.55, 9.0):
        gap = swept_gap(still, point + 2.0 * way, np.array([0.6]), Motion.translate((0.0, 0.0, 0.0)), (0.0, 1.0), most)
        assert gap == pytest.approx(0.5, abs=5e-3)


@settings(SLOW, max_examples=80)
@example(
    3461, 0.4851880664671877, 3000, 0.0, 0.5
)  # one standing triangle is inside the hull of what a moving one sweeps
@given(
    seeds, st.floats(0.05, 1.5), st.sampled_from([3000, 0]), st.sampled_from([0.0, 0.5]), st.sampled_from([0.5, 9.0])
)
def test_on_an_arc_it_is_no_more_than_at_any_time_and_little_less(seed, angle, many, error, most):
    """At no time are two triangles nearer; what is lost is no more than the arc and the turn of a triangle account for.

    With ``many`` 0 whole triangles stand for their ways: then as far as they travel from the middle may be lost.
    """
    rng = np.random.default_rng(seed)
    way, (first, span) = turning(rng, angle), (rng.uniform(0.0, 0.5), rng.uniform(0.1, 0.5))
    still, moving = some_triangles(rng, 3, 4.0), some_triangles(rng, 3, 4.0)
    off, moving_off = error * rng.uniform(0.5, 1.0, len(still)), error * rng.uniform(0.5, 1.0, len(moving))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(swept_mesh, "_MOST", many)
        gap, near = (
            swept_gap(standing(still, off, wide=wide), moving, moving_off, way, (first, first + span), most)
            for wide in (False, True)
        )
    least = truth = math.inf
    for t in np.linspace(first, first + span, 9):
        at = moved(way, t, moving)
        far = np.array([[apart(one, other) for other in at] for one in still])
        least, truth = min(least, (far - off[:, None] - moving_off).min()), min(truth, far.min())
    assert gap <= min(least, most) + 1e-9
    size = np.linalg.norm(moving - np.roll(moving, 1, axis=1), axis=2).max()
    out = np.linalg.norm(np.cross(moving - way.point, way.axis), axis=2).max()
    turned = angle * span
    lost = turned * size + turned * turned * out if many else span * np.linalg.norm(way.travel) + turned * (size + out)
    if truth > lost:
        assert near >= min(truth - off.max() - moving_off.max() - lost, most) - 1e-9


@settings(SLOW, max_examples=60)
@given(seeds, st.floats(0.3, 1.5))
def test_what_the_side_of_a_turning_triangle_passes_is_met(seed, angle):
    """A needle whose tip is on an edge at some time: the edge sweeps a twisted surface, which no two flats hold."""
    rng = np.random.default_rng(seed)
    moving, way = 4.0 * rng.normal(size=(1, 3, 3)), turning(rng, angle)
    for t, s in rng.uniform(0.2, 0.8, (4, 2)):
        at = moved(way, t, moving[0])
        tip = (1.0 - s) * at[0] + s * at[1]
        later = moved(way, t + 1e-4, moving[0])
        normal = np.cross(at[1] - at[0], (1.0 - s) * later[0] + s * later[1] - tip)
        for side in (40.0, -40.0):
            root = tip + side * normal / np.linalg.norm(normal)
            needle = np.array([[tip, root, root + 0.01 * rng.normal(size=3)]])
            assert (
                swept_gap(standing(needle, np.zeros(1), wide=True), moving, np.zeros(1), way, (0.0, 1.0), 9.0) <= 1e-9
            )


def test_a_bead_that_a_face_passes_over_is_met(monkeypatch):
    """No triangle of the swept hull's surface comes near it: it is inside, whatever else stands elsewhere."""
    bead = trimesh.creation.box(bounds=[(-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)])
    inside = Standing(bead.triangles, np.zeros(12), np.zeros(12, dtype=np.int64))
    far = np.array([[50.0, 50.0, 50.0], [51.0, 51.0, 51.0]])
    two = Standing(
        np.vstack([bead.triangles, trimesh.creation.box(bounds=far).triangles]),
        np.zeros(24),
        np.repeat([7, 4], 12),
    )
    face, way = np.array([[(-9.0, -9.0, 5.0), (9.0, -9.0, 5.0), (0.0, 9.0, 5.0)]]), Motion.translate((0.0, 0.0, -10.0))
    beside = face + np.array([0.0, 25.0, 0.0])
    for still in (inside, two):
        assert swept_gap(still, face, np.zeros(1), way, (0.0, 1.0), 1.0) == -np.inf
        assert swept_gap(still, np.vstack([face, beside]), np.zeros(2), way, (0.0, 1.0), 30.0) == -np.inf
        assert swept_gap(still, face, np.zeros(1), way, (0.0, 0.4), 9.0) == pytest.approx(0.9, abs=1e-9)
        assert swept_gap(still, face, np.full(1, 0.2), way, (0.0, 0.4), 9.0) == pytest.approx(0.7, abs=1e-9)
    # Too many for their hulls: 5 - 0.1 - 2 in the middle, less the 2 mm that it moves to either side.
    monkeypatch.setattr(swept_mesh, "_MOST", 0)
    assert swept_gap(inside, face, np.zeros(1), way, (0.0, 0.4), 9.0) == pytest.approx(0.9, abs=1e-9)
    turn = Motion.screw((1.0, 0.0, 0.0), 0.1)
    assert swept_gap(inside, face, np.zeros(1), turn, (0.0, 1.0), 9.0) <= 4.9


def test_a_piece_beside_a_slanted_way_is_not_held():
    """The box around what a face sweeps holds the bead, the hull of it does not: 1 mm is left, however long the way."""
    bead = trimesh.creation.box(bounds=[(-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)])
    still = Standing(bead.triangles, np.zeros(12), np.zeros(12, dtype=np.int64))
    face = np.array([[(-20.0, -21.0, -9.0), (20.0, 19.0, -9.0), (0.0, -1.0, 9.0)]])
    way = Motion.translate((20.0, 20.0, 0.0))
    left = 0.5 * math.sqrt(2.0) - 0.1 * math.sqrt(2.0)
    assert swept_gap(still, face, np.zeros(1), way, (0.0, 1.0), 9.0) == pytest.approx(left, abs=1e-9)
