"""Whole clamps: the truth against closed forms and brute force, and the exact solver without a fault on each family."""

import math

import numpy as np
import pytest

from clamp3d.bench.stress.assemblies.clamps import clamp_of
from clamp3d.bench.stress.assemblies.envelope import Envelope
from clamp3d.bench.stress.assemblies.family import ASSEMBLIES, EXACT
from clamp3d.bench.stress.assemblies.minima import minima
from clamp3d.bench.stress.run import run_family

CLAMPS = 1


@pytest.mark.parametrize("family", ASSEMBLIES)
def test_every_answer_is_an_equilibrium_and_every_firm_one_is_named(family):
    (outcome,), _ = run_family(family, ["cas"], 100 * CLAMPS, 20, 60.0, 0)
    assert (outcome.asked, outcome.answered, outcome.refused, outcome.exceptions) == (CLAMPS, CLAMPS, 0, 0)
    assert (outcome.false_hits, outcome.false_misses, outcome.beyond_bound) == (0, 0, 0), outcome.examples
    assert outcome.worst_error <= EXACT


def symmetric(R=20.0, r=14.0, aside=0.0):
    """Four equal grooves with flanks of 60 degrees, the lower ones ``aside`` mm to the right."""
    offsets = np.array([48.0, 48.0, 48.0 - aside, 48.0 + aside])
    return clamp_of(R, math.pi / 3, offsets, 2.0 * r)


def straight_d(clamp, aside=0.0):
    """Distance of a symmetric clamp closed straight: both centres 2 (R - r) apart, ``aside`` of it sideways."""
    up, down, r = clamp.up_splint.line_groove, clamp.down_splint.line_groove, clamp.line.radius
    return up.centre_depth - down.centre_depth - math.sqrt((2.0 * (up.radius - r)) ** 2 - aside**2)


@pytest.mark.parametrize("aside", [0.0, 1.0, 2.0])
def test_minima_of_a_symmetric_clamp_in_closed_form(aside):
    clamp = symmetric(aside=aside)
    straight = [m for m in minima(Envelope(clamp)) if abs(m.tilt) < 1e-9 and not m.slipped]
    assert straight[0].d == pytest.approx(straight_d(clamp, aside), abs=1e-10)
    assert straight[0].firm


@pytest.mark.parametrize("lift", [0.0, 1e-9, 1e-6, 1e-3, 0.5])
def test_falls_is_the_way_down_to_the_closed_form(lift):
    clamp = symmetric()
    up, down = clamp.up_splint.line_groove, clamp.down_splint.line_groove
    y = 0.5 * (up.centre_depth + straight_d(clamp) + down.centre_depth)
    middle = clamp.up_splint.width / 2
    q = np.array([middle - 48.0, y, middle + 48.0, y, straight_d(clamp) + lift, *[0.0] * 5])
    envelope = Envelope(clamp)
    assert envelope.falls(q) == pytest.approx(lift, abs=1e-12)
    assert envelope.overlap(q) == pytest.approx(0.0, abs=1e-12)
    q[4] -= 2.0 * lift
    assert envelope.overlap(q) == pytest.approx(lift, abs=1e-12)


def test_the_papers_search_stops_a_step_short():
    (stepped,), _ = run_family("assembly: random clamps", ["stepped"], 100, 1, 60.0, 0)
    assert stepped.asked == 1
    assert 1e-4 < stepped.worst_error < 3.0
