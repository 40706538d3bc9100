"""``clamp3d check`` as a user calls it: the worked examples, verdicts and exit codes, pairs that cannot be answered."""

import html
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from clamp3d import Distance, Motion, Verdict, check, load_scene
from clamp3d.engine import judge, moving_pair
from clamp3d.engine.model import ModelCache
from clamp3d.engine.verdict import Thresholds
from clamp3d.errors import SolverError
from clamp3d.scenefile.file import parse_scene
from tests.kinds import measured_alike

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
V_BLOCK = EXAMPLES / "v-block" / "scene.toml"

SLIDE = """
[parts]
wall = { shape = "box", size = [10, 10, 10] }
block = { shape = "box", size = [10, 10, 10], pose = { translation = [30, 0, 0] } }
[[motions]]
name = "slide"
parts = ["block"]
translate = [-25, 0, 0]
"""
"""A clash in a motion only."""


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ([V_BLOCK], 1),
        (None, 1),  # whose clash is in a motion only
        ([EXAMPLES / "pipe-clip" / "scene.toml"], None),
        (["reference", "--clearance", "5"], 0),
        ([EXAMPLES / "hinge" / "pin.stl"], 2),  # one part alone: nothing to check
    ],
)
def test_text_json_page_and_exit_code_tell_one_story(arguments, code, tmp_path, main):
    file, data = tmp_path / "page.html", tmp_path / "data.json"
    if arguments is None:
        arguments = [tmp_path / "slide.toml"]
        arguments[0].write_text(SLIDE, encoding="utf-8")
    ended, out, _ = main("check", *arguments, "--json", data, "--html", file)
    found = json.loads(data.read_text())
    page = re.sub(r"<(script|style).*?</\1>", "", file.read_text(), flags=re.DOTALL)
    said = " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())
    assert ended == (2 if not found["work"]["pairs"] else 0 if found["clean"] else 1)
    assert code is None or ended == code
    assert not re.search(r"""(src|href)=["'](?!data:)""", page)
    clashes = [row for row in found["findings"] if row["verdict"] in ("clash", "contained")]
    assert found["clean"] == (not clashes and found["work"]["pairs"] > 0)
    lines = out.splitlines()
    start = next(k for k, line in enumerate(lines) if found["headline"] in line)
    assert start <= 1  # a clamp says first how it closes
    assert found["headline"] in said
    assert (re.search(r"\d+ clash", lines[start]) is None) == (not clashes)
    told = [row for row in found["findings"] if row["verdict"] != "contact" or "motion" in row]
    touching = [row for row in found["findings"] if row not in told]  # at rest: they stand in the table
    assert all(f"{row['a']} - {row['b']}" in out for row in touching)
    for row, line in zip(told, lines[start + 2 : start + 2 + len(told)], strict=True):
        assert row["a"] in line
        assert row["b"] in line
        assert line.split(";")[0].strip() in said
    assert "+-" not in out
    assert "\N{PLUS-MINUS SIGN}" not in said


def test_distances_measures_pairs_that_a_verdict_does_not_need(main):
    few = json.loads(main("check", V_BLOCK, "-q", "--json", "-")[1])
    assert few["counts"] == {"clash": 1, "contact": 1, "clearance": 1, "clear": 12}
    assert {"a", "b", "verdict", "at_least_mm", "at_most_mm"} <= set(few["pairs"][0])
    every = json.loads(main("check", V_BLOCK, "-q", "--distances", "--json", "-")[1])["pairs"]
    assert len(few["pairs"]) < len(every) == 15
    assert all(pair["at_most_mm"] - pair["at_least_mm"] < 0.1 for pair in every)


@pytest.mark.parametrize("name", ["pipe-clip", "v-block", "hinge"])
def test_example(name):
    expected = tomllib.loads((EXAMPLES / name / "expected.toml").read_text(encoding="utf-8"))
    scene, cache = load_scene(EXAMPLES / name / "scene.toml"), ModelCache()
    result = check(scene, cache=cache)
    assert result.clean == (expected["exit"] == 0)
    rows = {f"{row.a}:{row.b}": row for row in result.pairs}
    rows |= {f"{row.motion} {row.a}:{row.b}": row for row in result.motions}
    for key, value in (expected["pairs"] | expected.get("motions", {})).items():
        verdict = rows[key].verdict if key in rows else result.verdict(*key.split(":"))
        assert verdict.value == value["verdict"]
        if "distance" in value:
            found = rows[key].distance
            assert found.lower - 1e-6 <= value["distance"] <= found.upper + 1e-6
            # No bound so wide that anything fits: the meshes' chord errors are 0.05 mm together, doubled on a way.
            assert found.upper - found.lower <= 0.21
    measured_alike(scene, result, cache)


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
    assert limits.between(Distance(-0.03, 0.02)) == ["a gap of 0.01 mm (contact)", "an overlap of 0.01 mm (contact)"]
    assert limits.between(Distance(-0.03, 0.0), 0.02) == ["an overlap of 0.02 mm (allowed)"]
