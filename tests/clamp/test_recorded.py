"""Answers of the clamp's commands, as they were once recorded: a change of any number is seen.

What they were judged by then is in the other files here. ``python -m tests.clamp.test_recorded`` records them again.
"""

import json
import tempfile
from importlib import resources
from pathlib import Path

import pytest

from tests.command import call
from tests.recorded import differences, recorded

DATA = Path(__file__).with_name("data")
OTHER_CLAMP = {
    'name = "reference"': 'name = "other"',
    "thickness = 27.7260": "thickness = 29.1",
    "radius = 23.8012": "radius = 22.4",
    "offset = 46.0349": "offset = 45.2",
    "offset = 49.8315": "offset = 50.6",
    "face_depth = 24.5505": "face_depth = 25.3",
    "apex_thickness = 12.19": "apex_thickness = 11.4",
    "height = 26.400": "height = 24.0\n[joints]\nhole = true\nsaddle = true\nwasher = true\n[limits]\nline_load = 90.0",
}
COMMANDS = {
    "forces": "run OTHER --torque 40 --friction 0.12 --measured 31.4 --groove-friction 0.15",
    "chords": "run --line 30 --method chords --unit-angle-deg 7 --no-equilibria",
    "stepped": "run --jumper LJ-240 --solver stepped --tilt-step-deg 2 --step 0.5",
    "not-closed": "run --line 70",
    "other-jumper": "run --line LJ-500 --jumper LJ-400",
    "thin-wires": "run OTHER --line 24 --jumper 12",
    "other-order": "run OTHER --sequence P1->P7->P2->P3|P4->P5 --no-equilibria",
    "jumper-sweep": "sweep OTHER --wire p7 --steps 8 --seat-tolerance 0.3",
    "line-sweep": "sweep --line LJ-500 --steps 4 --yaw-deg 2",
    "tolerance": "tolerance --n 4 --seed 3",
    "normal": "tolerance --n 2 --distribution normal --tolerance 0.2 --wire-tolerance-percent 2",
}


def answer(command, folder):
    """The JSON of a command, without what is `NOT_RECORDED`, and its exit code."""
    text = resources.files("clamp3d.clamp").joinpath("data/reference.toml").read_text(encoding="utf-8")
    for old, new in OTHER_CLAMP.items():
        assert text.count(old) >= 1
        text = text.replace(old, new, 1)
    (folder / "other.toml").write_text(text, encoding="utf-8")
    arguments = [str(folder / "other.toml") if word == "OTHER" else word for word in command.split()]
    code, out, err = call(*arguments, "--quiet", "--json", "-")
    assert out.startswith("{"), err
    return {"exit code": code} | recorded(json.loads(out))


@pytest.mark.parametrize("name", COMMANDS)
def test_answers_are_those_that_were_recorded(tmp_path, name):
    old = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    assert differences(answer(COMMANDS[name], tmp_path), old) == []


if __name__ == "__main__":
    for name, command in COMMANDS.items():
        with tempfile.TemporaryDirectory() as folder:
            text = json.dumps(answer(command, Path(folder)), indent=0)
            (DATA / f"{name}.json").write_text(text + "\n", encoding="utf-8")
