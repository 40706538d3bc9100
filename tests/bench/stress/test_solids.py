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
