"""No input ends in a traceback, a dead interpreter or a lost file; `scripts/fuzz` asks the same at length."""

from __future__ import annotations

import pytest

from tests.fuzz import runner

COUNTS = {"clamp files": 30, "scene files": 30, "API calls": 300, "mesh files": 30, "command lines": 30}


@pytest.mark.parametrize("kind", COUNTS)
def test_every_input_ends_in_an_answer_or_a_clear_refusal(kind):
    counts, wrong = runner.run(kind, COUNTS[kind], seed=1)
    assert not wrong, wrong
    # Nothing but refusals would prove little, and nothing but answers too.
    assert counts.total() >= 0.9 * COUNTS[kind]
    assert min(counts["answered"], counts["refused"]) > 0.05 * COUNTS[kind]


@pytest.mark.parametrize(
    ("way", "words"),
    [("raises", ["exit code 1", "IndexError"]), ("dies", ["exit code -6"]), ("hangs", ["exit code 1", "Timeout"])],
)
def test_what_raises_dies_or_hangs_is_told(way, words):
    counts, wrong = runner.run(way, 2, seed=0, limit=1.0)
    assert not counts
    assert all(word in wrong for word in [way, *words])
