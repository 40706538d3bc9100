"""Compiled loops of the clamp: against the model asked groove by groove, NumPy, and what makes a step the best one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_clamps import whole_clamp
from scipy.optimize import linprog

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.closing import CLOSING, _Motion
from clamp3d.clamp.dimensions import Joints
from clamp3d.clamp.kernel_landscape import under
from clamp3d.clamp.section import EDGE, SIZE, SPLINTS, WIRES, Gaps, S, Section
from clamp3d.core.contact_model import Pieces
from clamp3d.core.groove_pair import GroovePair
from clamp3d.core.pose import Array


class OneByOne(Cas):
    """The same closed forms, asked in three dimensions and one groove after the other, as any other model is.

    Its arrays are in Fortran's order, which a model of somebody else's may have, and compiled loops can't read.
    """

    def pieces(self, pair: GroovePair, T_a_b: Array) -> Pieces:
        found = super().pieces(pair, T_a_b)
        return replace(found, point=np.asfortranarray(found.point), normal=np.asfortranarray(found.normal))


def _states(section: Section, rng: np.random.Generator, count: int) -> list[Array]:
    """From near the open state to far beside it, where wires leave the faces."""
    opened = section.open_state(section.open_distance())
    scale = np.array([20.0, 10.0, 20.0, 10.0, 10.0, 10.0, 0.1, 0.1, 0.1, 0.1])
    return [opened + rng.normal(size=SIZE) * scale * rng.choice([0.01, 0.3, 1.0, 2.0]) for _ in range(count)]


@pytest.mark.parametrize("joints", [Joints(), Joints(hole=True, saddle=True, washer=True)])
def test_gaps_of_a_state_at_once_are_those_one_by_one(joints: Joints) -> None:
    rng = np.random.default_rng(7)
    seen: set[str] = set()
    for _ in range(6):
        clamp = replace(whole_clamp(rng), joints=joints)
        once, single = Section(clamp, Cas()), Section(clamp, OneByOne())
        for q in _states(once, rng, 30):
            for found, wanted in [
                (once.gaps(q), single.gaps(q)),
                *((once.wire_gaps(q, wire), single.wire_gaps(q, wire)) for wire in WIRES),
            ]:
                assert found.pair == wanted.pair
                assert found.feature == wanted.feature
                assert found.value == pytest.approx(wanted.value, abs=1e-11)
                assert found.gradient == pytest.approx(wanted.gradient, abs=1e-9)
                assert found.point == pytest.approx(wanted.point, abs=1e-9)
                assert found.normal == pytest.approx(wanted.normal, abs=1e-9)
                seen |= set(found.feature)
            for splint in SPLINTS:
                for wire in WIRES:
                    given = q, splint, wire, rng.random(3), 1e-4
                    assert once.wire_curvature(*given) == pytest.approx(single.wire_curvature(*given), abs=1e-6)
        assert once.queries == single.queries
        tilts, tilted = np.linspace(-0.2, 0.2, 9), np.zeros((9, SIZE))
        tilted[:, S] = tilts * once.lever
        assert once.face_gaps(tilts) == pytest.approx([once.face_gap(q) for q in tilted], abs=1e-12)
    assert seen >= {"arc", EDGE, "shank", "slot"}


def test_a_step_goes_as_far_as_the_gaps_let_and_no_further() -> None:
    """The conditions of the least of a convex function: nothing overlaps, nothing pulls, what pushes touches."""
    rng = np.random.default_rng(11)
    section = Section(whole_clamp(rng), Cas())
    pushed = impossible = 0
    for _ in range(300):
        n, k = int(rng.integers(1, 8)), int(rng.integers(0, 6))
        moving = np.sort(rng.choice(SIZE, n, replace=False))
        gradient, value = rng.normal(size=(k, SIZE)), rng.uniform(-0.5, 0.3, k)
        nothing = np.zeros((k, 2))
        gaps = Gaps(value, gradient, (("P1", "P2"),) * k, ("",) * k, nothing, nothing)
        half, h = rng.normal(size=(n, n)), float(rng.uniform(0.1, 2.0))
        bend, at, target = half @ half.T, rng.normal(size=SIZE), rng.normal(size=SIZE)
        apart = (rng.random(k) < 0.2).astype(np.int64)
        found = _Motion(section, CLOSING, moving, 10.0)._move(at, target, bend, gaps, apart, h)  # all gaps are near
        counted, A = apart == 0, gradient[:, moving]
        if found is None:
            impossible += 1
            none = linprog(np.zeros(n), A_ub=-A[counted], b_ub=value[counted], bounds=(None, None))
            assert none.status == 2  # infeasible
            continue
        move, force = found
        gap = value + A @ move
        assert (gap[counted] >= -1e-9).all()
        assert (force >= 0.0).all()
        assert (force[~counted] == 0.0).all()
        assert force * gap == pytest.approx(np.zeros(k), abs=1e-8)
        assert (np.eye(n) + h * bend) @ move + (at - target)[moving] == pytest.approx(h * force @ A, abs=1e-8)
        pushed += bool(force.any())
    assert pushed > 100
    assert impossible > 5


def test_what_is_far_does_not_count_in_a_step() -> None:
    """Unless the step closes it: a gap is asked within twice the stride and what lowering the bolt by h takes of it."""
    section = Section(whole_clamp(np.random.default_rng(3)), Cas())
    moving, h, stride = np.array([4]), 1.0, 0.1
    at = np.zeros(SIZE)
    for slope, value, counts in ((1.0, 1.1, True), (1.0, 1.3, False), (0.1, 0.29, True), (0.1, 0.31, False)):
        gaps = Gaps(
            np.array([value]), slope * CLOSING[None], (("P1", "P2"),), ("",), np.zeros((1, 2)), np.zeros((1, 2))
        )
        motion = _Motion(section, CLOSING, moving, stride)
        found = motion._move(at, at - 10.0 * CLOSING, np.zeros((1, 1)), gaps, np.zeros(1, np.int64), h)
        assert found is not None
        assert bool(found[1].any()) is counts


def test_a_turned_curve_is_what_numpy_interpolates() -> None:
    rng = np.random.default_rng(2)
    for n in (2, 30, 200):
        u, v, x = np.sort(rng.uniform(-30.0, 30.0, n)), rng.uniform(-9.0, 9.0, n), np.linspace(-60.0, 90.0, 301)
        tilts = rng.uniform(-0.6, 0.6, 8)
        x[:8] = 20.0 + u[0] * np.cos(tilts) + v[0] * np.sin(tilts)  # where curves begin
        x.sort()
        found = np.empty((8, len(x)))
        under(u, v, tilts, 20.0, x, np.empty((2, n)), found)
        for row, tilt in zip(found, tilts, strict=True):
            c, s = np.cos(tilt), np.sin(tilt)
            wanted = np.interp(x, np.maximum.accumulate(20.0 + u * c + v * s), v * c - u * s)
            assert row == pytest.approx(wanted, abs=1e-9)
