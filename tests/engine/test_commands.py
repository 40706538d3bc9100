"""``clamp3d check`` and ``clamp3d sweep`` as a user calls them."""

import contextlib
import html
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from clamp3d import cli

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def process(*arguments):
    """The command as a process of its own."""
    command = [sys.executable, "-m", "clamp3d", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(EXAMPLES.parent)}
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False)


def clamp3d(*arguments, cwd="."):
    """The same in this process: only the start-up is spared."""
    with pytest.MonkeyPatch.context() as patch, contextlib.chdir(cwd):
        patch.setattr(sys, "argv", ["clamp3d", *map(str, arguments)])
        patch.setattr(cli, "end_on_signals", lambda: None)
        out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as ended:
            cli.main()
        said = [stream.buffer.getvalue().decode() for stream in (out, err)]
    return subprocess.CompletedProcess(arguments, ended.value.code, *said)


SLIDE = """
[parts.wall]
shape = "box"
size = [10, 10, 10]
[parts.block]
shape = "box"
size = [10, 10, 10]
pose = { translation = [30, 0, 0] }
[[motions]]
name = "slide"
parts = ["block"]
translate = [-25, 0, 0]
"""
"""A clash in a motion only."""


def page_text(page):
    """What a page says, without its scripts and styles."""
    return html.unescape(re.sub(r"<[^>]*>", " ", re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)))


def test_check_writes_all_outputs(tmp_path):
    page, data = tmp_path / "page.html", tmp_path / "data.json"
    done = process("check", EXAMPLES / "v-block" / "scene.toml", "--json", data, "--html", page)
    assert done.returncode == 1, done.stderr
    assert done.stderr == ""
    assert re.search(r"block-3 - bar-low +clash +overlap 0\.1", done.stdout)
    found = json.loads(data.read_text())
    verdicts = {(p["a"], p["b"]): p["verdict"] for p in found["pairs"]}
    assert verdicts[("block-3", "bar-low")] == "clash"
    assert found["counts"] == {"clash": 1, "contact": 1, "clearance": 1, "clear": 12}
    assert {"a", "b", "verdict", "at_least_mm", "at_most_mm"} <= set(found["pairs"][0])
    text = re.sub(r"<script>.*?</script>", "", page.read_text(), count=1, flags=re.DOTALL)
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ([EXAMPLES / "v-block" / "scene.toml"], 1),
        (None, 1),  # whose clash is in a motion only
        ([EXAMPLES / "pipe-clip" / "scene.toml"], None),
        (["reference", "--clearance", "5"], 0),
        ([EXAMPLES / "hinge" / "pin.stl"], 2),  # one part alone: nothing to check
    ],
)
def test_text_json_page_and_exit_code_tell_one_story(arguments, code, tmp_path):
    file, data = tmp_path / "page.html", tmp_path / "data.json"
    if arguments is None:
        arguments = [tmp_path / "slide.toml"]
        arguments[0].write_text(SLIDE, encoding="utf-8")
    done = clamp3d("check", *arguments, "--json", data, "--html", file)
    found, page = json.loads(data.read_text()), file.read_text()
    said = page_text(page)
    assert done.returncode == (2 if not found["work"]["pairs"] else 0 if found["clean"] else 1)
    assert code is None or done.returncode == code
    clashes = [row for row in found["findings"] if row["verdict"] in ("clash", "contained")]
    assert found["clean"] == (not clashes and found["work"]["pairs"] > 0)
    lines = done.stdout.splitlines()
    start = next(k for k, line in enumerate(lines) if found["headline"] in line)
    assert start <= 1  # a clamp says first how it closes
    first = lines[start]
    assert found["headline"] in " ".join(said.split())
    assert (re.search(r"\d+ clash", first) is None) == (not clashes)
    told = [row for row in found["findings"] if row["verdict"] != "contact" or "motion" in row]
    touching = [row for row in found["findings"] if row not in told]  # at rest: they stand in the table
    assert all(f"{row['a']} - {row['b']}" in done.stdout for row in touching)
    listed = lines[start + 2 : start + 2 + len(told)]
    for row, line in zip(told, listed, strict=True):
        assert row["a"] in line
        assert row["b"] in line
        assert line.split(";")[0].strip() in " ".join(said.split())
    assert "+-" not in done.stdout
    assert "\N{PLUS-MINUS SIGN}" not in said


def test_a_clash_in_motion_is_told_with_its_depth_and_first_contact(tmp_path):
    (tmp_path / "slide.toml").write_text(SLIDE, encoding="utf-8")
    done = clamp3d("check", tmp_path / "slide.toml")
    clash = next(line for line in done.stdout.splitlines() if "block and wall" in line or "wall and block" in line)
    assert re.search(r"overlap at least \d+(\.\d+)? mm", clash)  # that of an instant: at another it may be deeper
    t = float(re.search(r"first contact at t = ([\d.]+)", clash)[1])
    assert t == pytest.approx((20.0 - 0.01) / 25.0, abs=2e-4)


def test_check_takes_wires_for_a_clamp_only(tmp_path):
    assert clamp3d("check", "reference", "--line", "LJ-500", "-q").returncode == 0
    done = clamp3d("check", EXAMPLES / "hinge" / "scene.toml", "--line", "LJ-500")
    assert done.returncode == 2
    assert "line goes with a clamp" in done.stderr


def test_distances_measures_pairs_that_a_verdict_does_not_need(tmp_path):
    data = tmp_path / "data.json"
    scene = EXAMPLES / "v-block" / "scene.toml"
    clamp3d("check", scene, "--json", data)
    few = json.loads(data.read_text())["pairs"]
    clamp3d("check", scene, "--distances", "--json", data)
    every = json.loads(data.read_text())["pairs"]
    assert len(few) < len(every) == 15
    assert all(pair["at_most_mm"] - pair["at_least_mm"] < 0.1 for pair in every)


def test_check_of_some_pairs_is_clean(tmp_path):
    scene = EXAMPLES / "v-block" / "scene.toml"
    done = clamp3d("check", scene, "--pairs", "block:bar,bar-high:block-2", "--clearance", "0.05")
    assert done.returncode == 0, done.stderr
    assert "2 pairs" in done.stdout
    assert "1 contact, 1 clear" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "none.toml"], "none.toml: no such file"),
        (["check", EXAMPLES / "hinge" / "scene.toml", "--pairs", "leaf-a"], "must read like P1:P6,P2:P7, got 'leaf-a'"),
        (
            ["check", EXAMPLES / "hinge" / "scene.toml", "--pairs", "leaf-a:leg"],
            "unknown part 'leg'; available: leaf-a",
        ),
        (["check", EXAMPLES / "hinge" / "scene.toml", "--clearance", "-1"], "clearance must be 0 or > contact"),
        (["sweep", "--yaw-deg", "95"], "yaw must be > 0 and < 90 deg, got 95 deg"),
        (["sweep", "--pitch-deg", "0"], "pitch must be > 0 and < 90 deg, got 0 deg"),
        (["sweep", "--map", "map.bmp"], "the name must end in one of .png, .svg, .pdf"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, message, tmp_path):
    done = clamp3d(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_sweep_writes_map_and_points(tmp_path):
    picture, data = tmp_path / "map.png", tmp_path / "map.json"
    done = clamp3d("sweep", "--wire", "P7", "--steps", "8", "--map", picture, "--json", data)
    assert done.returncode == 0, done.stderr
    assert "  yaw    -5.402 to +5.402 deg\n" in done.stdout
    written = json.loads(data.read_text())
    assert (len(written["height_mm"]), len(written["sideways_mm"])) == (2, 8)
    assert {name for row in written["outcome"] for name in row} == {"seated", "not clamped"}
    assert sum(written["counts"].values()) == 16
    low, high = written["captured_mm"]
    assert f"sideways {low:+.1f} to {high:+.1f} mm" in done.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
