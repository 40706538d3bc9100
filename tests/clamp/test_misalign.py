"""Misplaced wires against the section's closed form and against the scene check."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.features import groove_pairs
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.placement import FREEDOMS, Outcome, Placement
from clamp3d.errors import InputError


@pytest.fixture(scope="module")
def closing():
    return Placement(load_clamp(), "P6")


def test_nominal_wire_closes_without_opening(closing):
    answer = closing.close(np.zeros((1, 4)))
    assert answer.outcome[0] == Outcome.CLOSES
    assert abs(answer.opening[0]) < 1e-6


def test_opening_over_offset_is_that_of_two_circles(closing):
    """A wire u beside a groove's centre touches it sqrt((R - r)^2 - u^2) below: in the section, and tilted alike."""
    clamp = closing.clamp
    run = assemble(clamp, Cas())
    g = clamp.up_splint.line_groove.radius - clamp.line.radius
    beside = []
    for splint in ("P1", "P2"):
        centre = run.T_world(splint) @ groove_pairs(clamp)[splint, "P6"].T_a_groove
        beside.append(run.T_world("P6")[0, 3] - centre[0, 3])
    dx = np.linspace(-1.0, 1.5, 11)
    m = np.zeros((len(dx), 4))
    m[:, 0] = dx
    expected = sum(math.sqrt(g * g - u * u) - np.sqrt(g * g - (u + dx) ** 2) for u in beside)
    np.testing.assert_allclose(closing.close(m).opening, expected, atol=1e-6)


def test_height_is_free_because_the_clamp_floats(closing):
    m = np.zeros((5, 4))
    m[:, 1] = np.linspace(-20, 20, 5)
    answer = closing.close(m)
    assert (answer.outcome == Outcome.CLOSES).all()
    np.testing.assert_allclose(answer.opening, 0.0, atol=1e-6)


def test_opening_of_a_pitched_wire_is_at_least_that_of_its_lift_at_the_ends(closing):
    # A wire pitched by a lifts a splint of half length 30 by 30 tan a less what its own leaning takes back.
    for a in (0.002, 0.008, 0.02):
        opening = closing.close(np.array([[0, 0, 0, a]])).opening[0]
        assert opening == pytest.approx(2 * 30.0 * math.tan(a), rel=0.06)


def test_limits_are_where_the_outcome_turns(closing):
    ranges = {"offset": 15.0, "yaw": math.radians(6), "pitch": math.radians(3)}
    tolerances = closing.tolerance(ranges, samples=300)
    for limit in tolerances.limits:
        column = FREEDOMS.index(limit.freedom)
        step = 1e-5 * ranges[limit.freedom]
        m = np.zeros((4, 4))
        m[:, column] = limit.low + step, limit.high - step, limit.low - step, limit.high + step
        assert [o == Outcome.CLOSES for o in closing.close(m).outcome] == [True, True, False, False]
    assert 0.2 < tolerances.together < 1.0
    wide = closing.limits("height", 25.0)
    assert (wide.low, wide.high, wide.low_open, wide.high_open) == (-25.0, 25.0, True, True)


def test_a_cloud_fills_the_ranges_and_nothing_else(closing):
    name, other = FREEDOMS[0], FREEDOMS[2]
    found = closing.cloud({name: 0.5, other: 0.02}, 400, seed=3).misplacement
    for freedom, column in zip(FREEDOMS, found.T, strict=True):
        reach = {name: 0.5, other: 0.02}.get(freedom, 0.0)
        assert np.abs(column).max() <= reach
        assert np.std(column) == pytest.approx(reach / math.sqrt(3.0), rel=0.1)
        assert abs(column.mean()) <= 0.1 * reach


def test_outcomes_by_mouth(closing):
    m = np.zeros((3, 4))
    m[:, 0] = 0.0, 6.0, 14.0  # in the groove, on a lip, on the face beside the mouth
    assert closing.close(m).outcome.tolist() == [Outcome.CLOSES, Outcome.TOUCHES_WRONGLY, Outcome.CANNOT_SEAT]


def test_bad_input():
    clamp = load_clamp()
    with pytest.raises(InputError, match="wire must be one of P6, P7, got 'P1'"):
        Placement(clamp, "P1")
    with pytest.raises(InputError, match="seat tolerance must be a finite length > 0 mm"):
        Placement(clamp, seat_tolerance=-1.0)
    with pytest.raises(InputError, match=r"misplacements must have shape \(n, 4\)"):
        Placement(clamp).close(np.zeros((2, 3)))
    thin = replace(clamp, line=replace(clamp.line, conductor=None, diameter=3.0))
    with pytest.raises(InputError, match="not clamped"):
        Placement(thin)
