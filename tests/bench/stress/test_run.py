"""The stress families: truths checked among themselves, and cas without a fault on all of them."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from clamp3d.bench.stress.outcome import judge
from clamp3d.bench.stress.poses.family import POSES
from clamp3d.bench.stress.poses.flat import FLATS
from clamp3d.bench.stress.poses.truth import EXTENDED_ERROR, EXTENDED_WORKS, truth, truth_50_digits
from clamp3d.bench.stress.run import KINDS, run_family, run_stress
from clamp3d.bench.stress.worker import Answers, run_isolated
from clamp3d.cli import group
from tests.bench.stress.fatal import Fatal
from tests.refusals import refusals

CASES = 100 if EXTENDED_WORKS else 50  # the campaigns of docs/methods.md have 100 000


@pytest.mark.parametrize("family", POSES)
def test_cas_is_never_wrong_and_never_beyond_its_bound(family):
    (outcome,), difference = run_family(family, ["cas"], CASES, 20, 60.0, 2)
    assert difference < EXTENDED_ERROR
    assert (outcome.asked, outcome.answered, outcome.refused) == (CASES, CASES, 0)
    assert (outcome.false_hits, outcome.false_misses, outcome.exceptions, outcome.crashes) == (0, 0, 0, 0)
    assert outcome.beyond_bound == 0, outcome.examples
    assert outcome.worst_relative < 1e-14


@pytest.mark.parametrize("family", FLATS)
def test_flat_ends_are_never_wrong_and_never_beyond_their_bound(family):
    (outcome,), difference = run_family(family, ["cas"], 40, 20, 60.0, 1)
    assert difference <= FLATS[family].truth_error
    assert (outcome.answered, outcome.wrong, outcome.beyond_bound) == (40, 0, 0), outcome.examples


def test_no_minimum_of_a_long_thin_groove_is_missed():
    """Near a corner of a groove of 4 m by 0.006 mm; that its end arc is so near the axis was computed at 40 digits."""
    cases = POSES["mixed sizes"].cases(3000, 7)
    assert float(truth_50_digits(cases, 1496)) == pytest.approx(-9.2076469758107e-09, abs=1e-20)


def test_same_seed_same_cases_and_same_result_on_two_processes():
    one, two = (run_stress(["tangency"], ["cas"], n=20, seed=5, check=1, workers=n).to_dict() for n in (1, 2))
    for run in (one, two):
        assert [row.pop("seconds") > 0.0 for row in run["outcomes"]] == [True]
    assert one["outcomes"] == two["outcomes"]
    other = POSES["tangency"].cases(100, 6)
    assert not np.array_equal(POSES["tangency"].cases(100, 5).T_groove_wire, other.T_groove_wire)


def test_a_wrong_method_is_seen():
    """The judge on answers that are off by known amounts."""
    cases = POSES["tangency"].cases(200, 1)
    exact = truth(cases)
    answers = Answers.empty(200)
    answers.tried[:] = True
    answers.distance[:] = np.asarray(exact, float)
    answers.bound[:] = 1e-3
    near = np.abs(np.asarray(exact, float)) > 1e-2
    hits, frees = np.flatnonzero(near & (exact < 0))[:3], np.flatnonzero(near & (exact > 0))[:5]
    answers.distance[hits] = 2.0
    answers.distance[frees] = -2.0
    answers.distance[199], answers.failed[198] = np.nan, True
    answers.distance[198] = np.nan
    outcome = judge("tangency", "cas", cases.scene(), exact, answers, "depth")
    assert (outcome.false_misses, outcome.false_hits, outcome.exceptions, outcome.beyond_bound) == (3, 5, 2, 8)
    assert outcome.wrong == 10


def test_a_method_that_ends_the_interpreter_is_counted():
    cases = POSES["tangency"].cases(4, 0)
    answers = run_isolated(Fatal(*cases.gap[[1, 3]]), cases, time_limit=60.0, case_limit=1.0)
    assert answers.crashed == [1]
    assert answers.timeouts == [3]
    assert np.isfinite(answers.distance).sum() == 2
    assert any("ended with SIGSEGV" in note for note in answers.notes)


test_names_and_numbers_are_checked = refusals(
    (lambda: run_stress(["x"]), f"unknown family 'x'; available: {', '.join([*KINDS, *POSES][: len(KINDS) + 2])}"),
    (lambda: run_stress(methods=["x"]), "unknown method 'x'; available: cas"),
    (lambda: run_stress(n=0), "n must be at least 1"),
)


def test_command(tmp_path):
    files = {name: tmp_path / name for name in ("a.json", "a.md", "a.png")}
    arguments = ["stress", "--family", "ties", "--method", "cas", "--method", "chords 5 deg", "--n", "40"]
    arguments += ["--json", str(files["a.json"]), "--markdown", str(files["a.md"]), "--plot", str(files["a.png"])]
    result = CliRunner().invoke(group, arguments)
    assert result.exit_code == 0, result.output
    data = json.loads(files["a.json"].read_text())
    assert data["outcomes"][0]["beyond_bound"] == 0
    assert data["seed"] == 0
    assert data["machine"]["cores"]
    assert "| ties | 0 of 40 |" in files["a.md"].read_text()
    assert files["a.png"].read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("family", ["tangency", "flat ends: rims", "motion: screws", "assembly: poor starts"])
def test_command_prints_a_case_that_runs(family, capsys):
    result = CliRunner().invoke(group, ["stress", "--family", family, "--n", "300", "--case", "2"])
    assert result.exit_code == 0
    code, _, truth = result.output.rpartition("# truth: ")
    exec(code, {})
    number = r"-?\d+\.\d+(?:e[-+]\d+)?"
    printed, truths = ([*map(float, re.findall(number, text))] for text in (capsys.readouterr().out, truth))
    assert min(abs(one - other) for one in printed for other in truths) < 1e-6
