"""Answers as they were once recorded: what of them is compared, and where they differ."""

import json
import math

import pytest

TOLERANCE = 2e-6
"""Processors may differ by that, and the records are rounded to six digits."""
NOT_RECORDED = {"clamp3d", "work", "weakest", "residuals", "error_bound_mm", "unbalanced", "states_beyond", "depth_mm"}
"""Version, counts of work, and what is mostly rounding or one of many equal answers."""
PLACED = {"level", "travel_mm", "measured", "volume_of_facets"}
"""Keys of a contact, an event, a difference from the matrix, a common part: unique places are compared alone."""
PLACES = {"point", "point_a", "point_b", "normal", "direction"}


def recorded(value):
    """A value of JSON without what is `NOT_RECORDED`; of nearest points that are not unique no place."""
    if isinstance(value, list | tuple):
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


def record_tests(folder, *makes):
    """A test for each function: it gives what it gave when it was recorded. And a call that records them again."""

    def answer(make):
        return json.loads(json.dumps(recorded(make()), default=lambda number: number.item()))

    @pytest.mark.parametrize("make", makes, ids=lambda make: make.__name__)
    def test(make):
        old = json.loads((folder / f"{make.__name__}.json").read_text(encoding="utf-8"))
        assert differences(answer(make), old) == []

    def record():
        folder.mkdir(exist_ok=True)
        for make in makes:
            text = json.dumps(answer(make)).replace("], [", "],\n[")
            (folder / f"{make.__name__}.json").write_text(text + "\n", encoding="utf-8")

    return test, record
