"""The motion families: truths against independent ones, cas without a fault on all of them, faults that are found."""

import dataclasses
import math

import numpy as np
import pytest

import clamp3d
from clamp3d import first_contact
from clamp3d.bench.stress import motions
from clamp3d.bench.stress.motions import MOTIONS, TRUTH_ERROR, least_distance, through
from clamp3d.bench.stress.poses.cases import Cases, Shapes
from clamp3d.bench.stress.run import run_family

CASES = 3  # the campaign of docs/methods.md has 100 000


@pytest.mark.parametrize("family", MOTIONS)
def test_cas_is_never_wrong_and_never_beyond_its_bound(family):
    (outcome,), difference = run_family(family, ["cas"], CASES, 20, 60.0, 1)
    assert difference < TRUTH_ERROR
    assert outcome.answered + outcome.refused == outcome.asked == CASES
    assert outcome.refused <= 1, outcome.notes  # a clearance that stays within 1e-6 mm of contact
    assert (outcome.false_hits, outcome.false_misses, outcome.exceptions) == (0, 0, 0), outcome.notes
    assert outcome.beyond_bound == 0, outcome.examples
    assert outcome.worst_error < 1e-6


_HALF = math.radians(100.0)


def _one(start, vector, *, R=7.0, half=_HALF, L=50.0, r=6.935, length=200.0, **more):
    one = np.ones(1)
    shapes = Shapes(R * one, half * one, L * one, r * one, length * one)
    T = np.eye(4)
    T[:3, 3] = start
    cases = Cases(shapes, np.zeros(1, int), T[None], np.full(1, np.nan))
    return through(cases, 0.0, travel=np.array([vector]), **more)


@pytest.mark.parametrize("gap", [0.0, 1e-3, -1e-3])
def test_known_answers_of_a_double_root(gap):
    """Those of the program: tests/geometry/test_motion.py."""
    # On a line at 45 degrees the wire's centre passes the lip at r + gap.
    half = math.radians(60.0)
    s, h = 7.0 * math.sin(half), -7.0 * math.cos(half)
    up, along = np.array([-1.0, 1.0]) / math.sqrt(2.0), np.array([1.0, 1.0]) / math.sqrt(2.0)
    start = np.array([s, h]) + (2.0 + gap) * up - 2.0 * along
    cases = _one((*start, 0.0), (*(8.0 * along), 0.0), half=half, r=2.0)
    assert least_distance(cases, 0)[0] == pytest.approx(gap, abs=1e-12)


def test_stepped_motion_misses_what_is_thin_and_cas_does_not():
    outcomes, _ = run_family("motion: thin and fast", ["cas", "stepped 100"], 30, 3, 60.0, 0)
    cas, stepped = outcomes
    assert (cas.wrong, cas.beyond_bound) == (0, 0)
    assert stepped.false_misses > 4
    assert stepped.false_hits == 0


@pytest.mark.parametrize("fault", ["misses", "late"])
def test_a_wrong_first_contact_is_seen(fault, monkeypatch):
    def wrong(groove, wire, motion, start):
        right = first_contact(groove, wire, motion, start)
        t = 1.0 if fault == "misses" else min(1.0, right.t + 1e-4)
        contact = clamp3d.kernel.signed_distance(groove, wire, motion.at(t, start)).distance
        touches = right.touches and fault != "misses"
        return dataclasses.replace(right, touches=touches, t=t, distance=clamp3d.Distance(contact, contact))

    monkeypatch.setattr(motions, "first_contact", wrong)
    (outcome,), _ = run_family("motion: thin and fast", ["cas"], 20, 3, 60.0, 0)
    assert outcome.wrong > 2, outcome.notes
