"""The worked examples: parts made by Open CASCADE, verdicts written down beforehand."""

import tomllib
from pathlib import Path

import pytest

from clamp3d import check, load_scene
from tests.kinds import measured_alike

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("name", ["pipe-clip", "v-block", "hinge"])
def test_example(name):
    expected = tomllib.loads((EXAMPLES / name / "expected.toml").read_text(encoding="utf-8"))
    scene = load_scene(EXAMPLES / name / "scene.toml")
    result = check(scene)
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
    measured_alike(scene, result)
