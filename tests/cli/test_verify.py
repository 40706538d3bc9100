"""What --json wrote is computed again, from the arguments that it holds."""

import json
import os
import subprocess
import sys

import pytest
import trimesh

BOXES = """
[parts.a]
shape = "box"
size = [10, 10, 10]
[parts.b]
shape = "cylinder"
radius = 4
length = 10
pose = { translation = [9.5, 0, 0], rpy_deg = [0, 30, 10] }
"""


@pytest.fixture
def call(tmp_path, monkeypatch, main):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(BOXES)
    trimesh.creation.icosphere(subdivisions=2, radius=5.0).export(tmp_path / "ball.stl")
    return main


@pytest.mark.parametrize(
    ("arguments", "kept"),
    [
        (
            ("run", "-q", "--line", "LJ-500", "--jumper", "16", "--no-equilibria"),
            ["run", "--line", "LJ-500", "--jumper", "16", "--no-equilibria"],
        ),
        (("run", "--step", "1/3", "reference"), ["run", "--step", repr(1 / 3), "reference"]),
        (("check", "scene.toml", "--distances", "-q"), ["check", "--distances", "scene.toml"]),
        (("fit", "ball.stl"), ["fit", "ball.stl"]),
        (("sweep", "--steps", "3", "--random", "4"), ["sweep", "--steps", "3", "--random", "4"]),
        (("tolerance", "--n", "2", "--processes", "1"), ["tolerance", "--n", "2"]),
    ],
)
def test_every_value_is_found_again(call, tmp_path, arguments, kept):
    call(*arguments, "--json", "result.json")
    assert json.loads((tmp_path / "result.json").read_text())["command"] == kept
    code, out, err = call("verify", "result.json", "--tolerance", "0")
    assert (code, err) == (0, "")
    assert out.endswith("values computed again, all equal\n")


@pytest.mark.parametrize(
    ("command", "environment", "tolerance"),
    [
        (("run", "-q"), {"OPENBLAS_NUM_THREADS": "1"}, "0"),
        (("check", "-q", "scene.toml"), {"OPENBLAS_NUM_THREADS": "1"}, "0"),
        # Another processor rounds otherwise: the last digits of matrix products differ.
        (("tolerance", "-q", "--n", "2"), {"OPENBLAS_CORETYPE": "Nehalem"}, "1e-9"),
    ],
)
def test_the_same_bits_whatever_the_threads_and_nearly_so_on_another_processor(
    call, tmp_path, command, environment, tolerance
):
    call(*command, "--json", "result.json")
    line = [sys.executable, "-m", "clamp3d", "verify", "result.json", "--tolerance", tolerance]
    path = os.pathsep.join(map(os.path.abspath, filter(None, sys.path)))
    done = subprocess.run(
        line, env={**os.environ, "PYTHONPATH": path, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "values computed again" in done.stdout


def test_a_changed_value_is_a_finding(call, tmp_path):
    file = tmp_path / "result.json"
    assert call("check", "scene.toml", "-q", "--json", str(file))[0] == 1
    data = json.loads(file.read_text())
    data["parts"]["a"]["T_world"][0][3] = 1e-6
    data["clean"] = True
    del data["thresholds"]["contact_mm"]
    file.write_text(json.dumps(data))
    code, out, _ = call("verify", "result.json")
    assert code == 1
    lines = out.splitlines()
    assert lines[:3] == [
        "thresholds.contact_mm: nothing in the file, 0.01 now",
        "clean: True in the file, False now",
        "parts.a.T_world.0.3: 1e-06 in the file, 0.0 now",
    ]
    assert (
        "3 differ by more than 1e-09; the largest difference of a number is 1e-06, of parts.a.T_world.0.3" in lines[3]
    )
    assert call("verify", "result.json", "--tolerance", "1e-5")[1].splitlines()[0].startswith("thresholds")


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", "not a JSON file"),
        ("[1]", "does not say what was asked"),
        ('{"command": ["run", 3]}', "does not say what was asked"),
        ('{"command": ["view"]}', "asked for 'view', must be one of run, check, fit, sweep, tolerance"),
        ('{"command": ["check", "gone.toml"]}', "gone.toml"),
    ],
)
def test_what_is_no_result_is_bad_input(call, tmp_path, text, rule):
    (tmp_path / "result.json").write_text(text)
    code, out, err = call("verify", "result.json")
    assert (code, out) == (2, "")
    assert rule in err
    assert len(err.splitlines()) == 1


def test_a_file_that_is_not_there(call):
    code, _, err = call("verify", "none.json")
    assert (code, err) == (2, "clamp3d: error: none.json: cannot be read: No such file or directory\n")
