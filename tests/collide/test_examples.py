"""The worked examples: parts made by Open CASCADE, verdicts written down beforehand."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clamp3d.collide.check import check
from clamp3d.collide.scene import Scene
from clamp3d.core.pose import rotation
from clamp3d.scenefile.file import load_scene
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


def test_hinge_meets_where_the_solids_first_do():
    import manifold3d

    scene = load_scene(EXAMPLES / "hinge" / "scene.toml")
    solids = {}
    for part in scene.parts[:2]:
        mesh = part.shape.mesh
        solids[part.name] = manifold3d.Manifold(
            manifold3d.Mesh64(vert_properties=np.array(mesh.vertices), tri_verts=np.array(mesh.faces, dtype=np.uint64))
        )
    folded, past = math.radians(180.0), math.radians(-320.0)

    def common(t):
        T = rotation([0, 0, 1], folded + t * past)
        return (solids["leaf-a"] ^ solids["leaf-b"].transform(np.ascontiguousarray(T[:3]))).volume()

    instants = np.linspace(0.0, 1.0, 641)
    first = instants[np.argmax([common(t) > 1e-9 for t in instants])]
    only = Scene(scene.parts[:2]).moved({"leaf-b": rotation([0, 0, 1], folded) @ scene.parts[1].T_world})
    row = check(replace(only, motions=scene.motions[1:])).motions[0]
    # Contact within the meshes' error of 0.05 mm, at 12 mm from the axis, is told before the facets meet.
    assert first - 0.01 <= row.contact_at <= first + 1e-6


def test_bar_in_v_block_from_step_and_from_stl():
    from clamp3d.fit.fit import fit_file

    pytest.importorskip("OCP")
    stl, step = (
        fit_file(EXAMPLES / "v-block" / f"bar.{kind}", unit=unit) for kind, unit in (("stl", "mm"), ("step", None))
    )
    for result in (stl, step):
        assert result.cylinders[0].radius == pytest.approx(15.0, abs=2e-5)
