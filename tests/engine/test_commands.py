"""``clamp3d check`` as a user calls it."""

import html
import json
import re
from pathlib import Path

import pytest

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
