"""The motion families: truths against independent ones, cas without a fault on all of them, faults that are found."""

import dataclasses

import pytest

import clamp3d
from clamp3d import first_contact
from clamp3d.bench.stress import motions
from clamp3d.bench.stress.motions import MOTIONS, TRUTH_ERROR
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


def test_stepped_motion_misses_what_is_thin_and_cas_does_not():
    outcomes, _ = run_family("motion: thin and fast", ["cas", "stepped 100"], 8, 1, 60.0, 0)
    cas, stepped = outcomes
    assert (cas.wrong, cas.beyond_bound) == (0, 0)
    assert stepped.false_misses > 2
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
    (outcome,), _ = run_family("motion: thin and fast", ["cas"], 10, 1, 60.0, 0)
    assert outcome.wrong > 2, outcome.notes
