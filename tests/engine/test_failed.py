"""A pair that cannot be answered is a row of its own, with its reason; exit codes follow the worst certain verdict."""

import json
from dataclasses import replace

import pytest

from clamp3d import Distance, Motion, Verdict, check
from clamp3d.engine import judge, moving_pair
from clamp3d.engine.verdict import Thresholds
from clamp3d.errors import SolverError
from clamp3d.scenefile.file import parse_scene

SCENE = """
[parts]
a = { shape = "box", size = [10, 10, 10] }
b = { shape = "box", size = [10, 10, 10], pose = { translation = [9.999, 0, 0] } }
c = { shape = "box", size = [10, 10, 10], pose = { translation = [0, 0, %g] } }
"""


@pytest.fixture
def broken(monkeypatch):
    """The pair a, b fails; every other one is answered."""
    refine = judge.refine

    def ask(a, b, T, *args, **kwargs):
        if abs(abs(T[0, 3]) - 9.999) < 1e-9 and abs(T[2, 3]) < 1e-9:
            raise SolverError("features and boxes disagree")
        return refine(a, b, T, *args, **kwargs)

    monkeypatch.setattr(judge, "refine", ask)
    monkeypatch.setattr(moving_pair, "refine", ask)


def test_a_motion_that_fails_is_a_row(broken):
    scene = parse_scene(SCENE % 30.0)
    up = Motion.translate((0.0, 0.0, 5.0), parts=("c",), name="up")
    aside = Motion.translate((0.0, 3.0, 0.0), parts=("b",), name="aside")
    assert [row.verdict for row in check(replace(scene, motions=(up,))).motions] == []
    (row,) = check(replace(scene, motions=(aside,))).motions
    assert (row.verdict, row.motion, row.t) == (Verdict.FAILED, "aside", None)
    assert row.reason


@pytest.mark.parametrize(
    ("z", "broken_pair", "code"), [(10.0, False, 0), (9.0, False, 1), (9.0, True, 1), (10.0, True, 4)]
)
def test_exit_code_is_that_of_the_worst_certain_verdict(z, broken_pair, code, tmp_path, request, main):
    if broken_pair:
        request.getfixturevalue("broken")
    file, page = tmp_path / "scene.toml", tmp_path / "page.html"
    file.write_text(SCENE % z)
    ended, out, _ = main("check", file, "--json", "-", "--html", page, "-q")
    assert ended == code
    data = json.loads(out)
    assert data["clean"] == (code == 0)
    assert ("failed" in data["counts"]) == broken_pair
    if broken_pair:
        assert "features and boxes disagree" in page.read_text()
        assert "1 pair failed" in data["headline"]
        assert [row["reason"] for row in data["pairs"] if row["verdict"] == "failed"] == ["features and boxes disagree"]


def test_an_uncertain_verdict_names_the_thresholds_between_its_bounds():
    limits = Thresholds(contact=0.01, clearance=0.5)
    assert limits.between(Distance(0.2, 0.9)) == ["a gap of 0.5 mm (clearance)"]
    assert limits.between(Distance(-0.03, 0.02)) == [
        "a gap of 0.01 mm (contact)",
        "an overlap of 0.01 mm (contact)",
    ]
    assert limits.between(Distance(-0.03, 0.0), 0.02) == ["an overlap of 0.02 mm (allowed)"]
