"""``clamp3d check`` and ``clamp3d sweep`` as a user calls them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def clamp3d(*arguments, cwd=None):
    command = [sys.executable, "-m", "clamp3d", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(EXAMPLES.parent)}
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, check=False)


def test_check_writes_all_outputs(tmp_path):
    page, data = tmp_path / "page.html", tmp_path / "data.json"
    done = clamp3d("check", EXAMPLES / "v-block" / "scene.toml", "--full", "--json", data, "--html", page)
    assert done.returncode == 1, done.stderr
    assert done.stderr == ""
    assert "block-3 and bar-low clash: overlap 0.0707 mm" in done.stdout
    assert "agrees in all 15 verdicts" in done.stdout
    found = json.loads(data.read_text())
    verdicts = {(p["a"], p["b"]): p["verdict"] for p in found["pairs"]}
    assert verdicts[("block-3", "bar-low")] == "clash"
    assert found["counts"] == {"clash": 1, "contact": 1, "clearance": 1, "clear": 12}
    assert found["full"]["work"]["full"] is True
    html = page.read_text()
    assert "block-3" in html
    assert not re.search(r"""(src|href)=["'](?!data:|#)|url\(["']?http""", html)


def test_check_of_some_pairs_is_clean(tmp_path):
    scene = EXAMPLES / "v-block" / "scene.toml"
    done = clamp3d("check", scene, "--pairs", "block:bar,bar-high:block-2", "--clearance", "0.05")
    assert done.returncode == 0, done.stderr
    assert "2 pairs" in done.stdout
    assert "1 contact, 1 clear" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check", "none.toml"], "none.toml: cannot be read"),
        (["check", EXAMPLES / "hinge" / "scene.toml", "--pairs", "leaf-a"], "must read like P1:P6,P2:P7, got 'leaf-a'"),
        (
            ["check", EXAMPLES / "hinge" / "scene.toml", "--pairs", "leaf-a:leg"],
            "unknown part 'leg'; available: leaf-a",
        ),
        (["check", EXAMPLES / "hinge" / "scene.toml", "--clearance", "-1"], "clearance must be 0 or > contact"),
        (["sweep", "--yaw-deg", "95"], "yaw: half range must be < 90 deg, got 95"),
        (["sweep", "--offset", "-1"], "offset: half range must be > 0"),
        (["sweep", "--offset", "0", "--yaw-deg", "0", "--pitch-deg", "0"], "nothing to vary"),
        (["sweep", "--map", "map.bmp"], "the name must end in one of .png, .svg, .pdf"),
        (["sweep", "--seat-tolerance", "0"], "seat tolerance must be a finite length > 0 mm"),
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
    from PIL import Image

    picture, data = tmp_path / "map.png", tmp_path / "map.json"
    done = clamp3d("sweep", "--steps", "21", "--random", "500", "--map", picture, "--json", data)
    assert done.returncode == 0, done.stderr
    assert "offset   -1.148 to +1.896 mm" in done.stdout
    found = json.loads(data.read_text())
    assert [grid["over"] for grid in found["grids"]] == [["offset", "yaw"], ["offset", "pitch"], ["yaw", "pitch"]]
    assert len(found["random"]["outcome"]) == 500
    assert set(found["grids"][0]["points"]["outcome"]) == {"closes", "touches wrongly", "cannot seat"}
    with Image.open(picture) as image:
        assert image.width > 1000
        colours = {c for _, c in image.convert("RGB").getcolors(1 << 20)}
    assert {(0x00, 0x9E, 0x73), (0xE6, 0x9F, 0x00), (0x4A, 0x4F, 0x55)} <= colours
