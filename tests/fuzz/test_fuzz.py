"""No input ends in a traceback, a dead interpreter or a lost file; `scripts/fuzz` asks the same at length."""

from __future__ import annotations

import pytest

import clamp3d
from tests.fuzz import api_targets, runner

COUNTS = {"clamp files": 50, "scene files": 50, "API calls": 800, "mesh files": 50, "command lines": 50}
SEED = 20_000


@pytest.mark.parametrize("kind", COUNTS)
def test_every_input_ends_in_an_answer_or_a_clear_refusal(kind):
    tally = runner.run(kind, COUNTS[kind], SEED)
    assert tally.n == COUNTS[kind]
    assert not tally.failures, "\n".join(f"{i}: {note} <- {text[:300]}" for i, text, note in tally.failures[:5])
    # Nothing but refusals would prove little, and nothing but answers too.
    assert min(tally.answered, tally.refused) > 0.05 * tally.n


def test_everything_public_is_called():
    called = {word for name in api_targets.targets() for word in name.split(".")}
    modules = (clamp3d.figures, clamp3d.kernel, clamp3d.shapes)
    public = {*clamp3d.__all__, *(name for module in modules for name in module.__all__)}
    assert public <= called | api_targets.RESULTS


def test_what_dies_or_hangs_is_counted_and_ends_nothing_else():
    n, seed = 6, 38
    ways = [runner._own_test(runner.generator("own test", seed, i), None)[0] for i in range(n)]
    tally = runner.run("own test", n, seed, limit=3.0)
    assert (tally.n, tally.answered, tally.refused) == (n, ways.count("answers"), ways.count("refuses"))
    notes = {index: note for index, _, note in tally.failures}
    words = {"raises": "IndexError", "dies": "code -6", "hangs": "no answer"}
    assert set(ways) == {"answers", "refuses", *words}
    assert all(words[way] in notes[i] for i, way in enumerate(ways) if way in words)
