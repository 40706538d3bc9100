"""Flat-ended cylinders on boxes, holes and cylinders: the engine is not wrong, and a wrong answer is found out."""

from __future__ import annotations

import pytest

from clamp3d.bench.stress.poses.solids import SOLIDS
from clamp3d.bench.stress.worker import run_here


@pytest.mark.parametrize("name", SOLIDS)
def test_the_engine_is_never_wrong(name):
    family = SOLIDS[name]
    cases = family.cases(60, 5)
    truths = family.truths(cases)
    assert (truths[:, 0] <= truths[:, 1]).all()
    assert max(family.difference(cases, truths, i) for i in range(0, 60, 15)) <= family.truth_error
    answers = run_here(family.methods["cas"][1](), cases)
    found = family.judge("cas", cases, truths, answers)
    assert (found.answered, found.wrong, found.beyond_bound) == (60, 0, 0), found.examples
    answers.distance *= 1.01
    assert family.judge("cas", cases, truths, answers).beyond_bound > 0


def test_the_way_into_a_hole_bounds_the_depth():
    """Of pins that lean into the wall of their hole it is far shorter than the way off the plate."""
    family = SOLIDS["solid: hole"]
    cases = family.cases(60, 5)
    ways = [family._into_hole(cases, i) for i in range(60)]
    truths = family.truths(cases)
    assert all(-low <= way * (1.0 + 1e-9) + 1e-9 for way, (low, _) in zip(ways, truths, strict=True) if low < 0.0)
    assert sum(way < 0.5 * cases.radius[i] for i, way in enumerate(ways)) > 5
