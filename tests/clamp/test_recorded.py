"""Answers of the clamp's commands, as they were once recorded: a change of any number is seen.

What they were judged by then is in the other files here. ``python -m tests.clamp.test_recorded`` records them again.
"""

import json
import math
import tempfile
from importlib import resources
from pathlib import Path

import pytest

from tests.command import call

DATA = Path(__file__).with_name("data")
TOLERANCE = 2e-6
"""Processors may differ by that, and the records are rounded to six digits."""
NOT_RECORDED = {"clamp3d", "work", "weakest", "residuals", "error_bound_mm", "unbalanced", "states_beyond", "depth_mm"}
"""Version, counts of work, and what is mostly rounding or one of many equal answers."""
PLACED = {"level", "travel_mm", "measured"}
"""Keys of a contact, an event, and a difference from the matrix: their places are unique only where they say so."""
PLACES = {"point", "point_a", "point_b", "normal", "direction"}
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


def recorded(value):
    """A value of JSON without what is `NOT_RECORDED`; of nearest points that are not unique no place."""
    if isinstance(value, list):
        return [recorded(item) for item in value]
    if not isinstance(value, dict):
        return round(value, 6) if isinstance(value, float) else value
    is_open = bool(PLACED & set(value)) and value.get("unique") is not True
    places = PLACES if is_open else set()
    return {key: recorded(item) for key, item in value.items() if key not in NOT_RECORDED | places}


def differences(new, old, path=""):
    """Where two values of JSON differ."""
    if isinstance(new, dict) and isinstance(old, dict) and list(new) == list(old):
        return [line for key in new for line in differences(new[key], old[key], f"{path}/{key}")]
    if isinstance(new, list) and isinstance(old, list) and len(new) == len(old):
        return [line for k in range(len(new)) for line in differences(new[k], old[k], f"{path}/{k}")]
    if isinstance(new, float) and isinstance(old, int | float) and math.isclose(new, old, abs_tol=TOLERANCE):
        return []
    return [] if new == old else [f"{path}: {new!r}, recorded {old!r}"]


@pytest.mark.parametrize("name", COMMANDS)
def test_answers_are_those_that_were_recorded(tmp_path, name):
    old = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    assert differences(answer(COMMANDS[name], tmp_path), old) == []


if __name__ == "__main__":
    for name, command in COMMANDS.items():
        with tempfile.TemporaryDirectory() as folder:
            text = json.dumps(answer(command, Path(folder)), indent=0)
            (DATA / f"{name}.json").write_text(text + "\n", encoding="utf-8")
