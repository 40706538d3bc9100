"""The command line as a user meets it: a process, its exit code, stdout, stderr and files."""

import json
import math
import subprocess
import sys

import pytest

from clamp3d.bench import published


def clamp3d(*arguments, **kwargs):
    command = [sys.executable, "-m", "clamp3d", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **kwargs)


def test_without_a_command_there_is_help():
    done = clamp3d()
    assert (done.returncode, done.stderr, done.stdout) == (0, "", clamp3d("--help").stdout)


def test_help_lists_every_command_and_loads_no_numeric_library():
    done = clamp3d("--help")
    assert done.returncode == 0
    assert "reproduce" in done.stdout
    heavy = ("numba", "scipy", "trimesh", "fcl", "coacd", "meshcat")
    code = f"import sys, clamp3d.cli; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_run_prints_the_published_state_and_writes_json(tmp_path):
    path = tmp_path / "out.json"
    done = clamp3d("run", "--json", path)
    assert done.returncode == 0, done.stderr
    assert "clamped; distance between the splints 31.530 mm, tilt 12.00 deg" in done.stdout
    assert "line between the splints" in done.stderr
    data = json.loads(path.read_text())
    assert {"clamp", "method", "solver", "distance_mm", "parts", "contacts", "work"} <= set(data)
    for part, (x, y, angle) in published.FINAL_STATE.items():
        section = data["parts"][part]["section"]
        assert (round(section["x"], 3), round(section["y"], 3)) == (x, y)
        assert section["angle_deg"] == pytest.approx(angle, abs=0.01)
        T = data["parts"][part]["T_world"]
        # World: X right, Z up = -y; a counter-clockwise angle turns X towards Z.
        assert (T[0][3], T[2][3]) == pytest.approx((section["x"], -section["y"]))
        assert T[2][0] == pytest.approx(math.sin(math.radians(section["angle_deg"])))
    assert {"a", "b", "type", "relation", "distance_mm", "point"} <= set(data["contacts"][0])
    assert data["work"]["meshes_built"] == 0
    assert list(tmp_path.iterdir()) == [path]


def test_quiet_says_nothing_on_stderr():
    assert clamp3d("run", "--quiet").stderr == ""


def test_a_clamp_that_does_not_close_is_a_finding(main):
    code, out, _ = main("run", "--line", "LJ-16", "--jumper", "LJ-16", "-q")
    assert code == 1
    assert "not clamped: faces meet" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rum"], "No such command 'rum'. Did you mean 'run'?"),
        (["run", "nothing"], "unknown clamp 'nothing'; built in: reference"),
        (["run", "--line", "LJ-631"], "unknown conductor 'LJ-631'"),
        (["run", "--jumper", "-4"], "jumper diameter must be > 0"),
        (["run", "--method", "magic"], "'magic' is not one of"),
        (["run", "--unit-angle-deg", "5"], "unit_angle goes with method chords or wedges"),
        (["run", "--method", "chords", "--unit-angle-deg", "0"], "unit angle must be between 0 and 180 deg, got 0"),
        (["run", "--step", "-1"], "step must be > 0 mm, got -1"),
        (["run", "--solver", "exact", "--step", "1"], "--step and --tilt-step-deg go with --solver stepped"),
        (["run", "--json", "/nowhere/x.json", "-q"], "cannot write /nowhere/x.json: No such file or directory"),
        (["run", "--json"], "requires an argument"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, message, main):
    code, _, err = main(*arguments)
    assert code == 2
    assert message in err.splitlines()[-1]
    assert "Traceback" not in err
