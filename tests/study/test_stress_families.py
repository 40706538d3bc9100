"""The exact kernel on families of hard cases, each with a truth that was found without it."""

import pytest

from clamp3d.study.stress import run_family
from clamp3d.study.stress_families import FAMILIES


@pytest.mark.parametrize("family", list(FAMILIES))
def test_cas_is_right_on_every_family(family):
    # The truths are built backwards from their answers; a sample of them is worked out again at 50 digits.
    (outcome,), truth_error = run_family(family, ["cas"], 2000, seed=1, time_limit=60.0, check=2)
    assert truth_error < 1e-18
    assert outcome.asked == 2000
    assert outcome.refused == 0
    assert (outcome.false_hits, outcome.false_misses, outcome.beyond_bound) == (0, 0, 0)
