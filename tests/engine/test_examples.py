"""The worked examples: parts made by Open CASCADE, verdicts written down beforehand."""

import tomllib
from pathlib import Path

import pytest

from clamp3d import check, load_scene
from tests.kinds import measured_alike

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def _expect(row, expected):
    assert row.verdict.value == expected["verdict"]
    if "distance" in expected:
        assert row.distance.lower - 1e-6 <= expected["distance"] <= row.distance.upper + 1e-6
        # No bound so wide that anything fits: the meshes' chord errors are 0.05 mm together, doubled on a way.
        assert row.distance.upper - row.distance.lower <= 0.21


@pytest.mark.parametrize("name", ["pipe-clip", "v-block", "hinge"])
def test_example(name):
    expected = tomllib.loads((EXAMPLES / name / "expected.toml").read_text(encoding="utf-8"))
    scene = load_scene(EXAMPLES / name / "scene.toml")
    result = check(scene)
    assert result.clean == (expected["exit"] == 0)
    by_name = {f"{row.a}:{row.b}": row for row in result.pairs}
    for key, value in expected["pairs"].items():
        a, b = key.split(":")
        assert result.verdict(a, b).value == value["verdict"]
        if "distance" in value:
            _expect(by_name[key], value)
    moved = {f"{row.motion} {row.a}:{row.b}": row for row in result.motions}
    for key, value in expected.get("motions", {}).items():
        _expect(moved[key], value)
    measured_alike(scene, result)
