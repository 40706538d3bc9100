"""Files read back by other libraries; the exit code and JSON of ``check``."""

import json
import math

import numpy as np
import pytest
import trimesh

from clamp3d import Scene, assemble, check, export, load
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import Hole, box, cylinder

SKEW = translation(3.0, 4.0, -5.0) @ rotation((1.0, 2.0, 3.0), 0.7)
VOLUMES = {
    "box": 12.0 * 10.0 * 8.0 - math.pi * 2.0**2 * 8.0,
    "pin": math.pi * 3.0**2 * 20.0,
    "tube": math.pi * (6.0**2 - 4.0**2) * 10.0,
}


def three_parts(gap=0.5):
    """A drilled box, a pin ``gap`` mm over it, a tube round the pin."""
    scene = Scene(name="three").add("box", box((12.0, 10.0, 8.0), holes=[Hole(2.0, (1.0, 0.5))]), SKEW)
    scene = scene.add("pin", cylinder(3.0, 20.0), SKEW @ translation(0, 0, 14.0 + gap))
    return scene.add("tube", cylinder(6.0, 10.0, bore=4.0), SKEW @ translation(0, 0, 15.0 + gap))


@pytest.mark.parametrize("format", ["stl", "obj", "ply", "glb", "3mf"])
def test_meshes_are_read_back_by_trimesh(format, tmp_path):
    written = export(three_parts(), tmp_path / f"three.{format}", mesh_error=0.002)
    loaded = trimesh.load_scene(written.files[0])
    scale = 1000.0 if format == "glb" else 1.0
    bodies = [body for mesh in loaded.dump() for body in mesh.split()]
    assert sorted(body.volume * scale**3 for body in bodies) == pytest.approx(sorted(VOLUMES.values()), rel=3e-3)
    assert all(body.is_watertight for body in bodies)
    low, high = np.array(loaded.bounds) * scale
    if format == "glb":  # Y is up there: turned back, (x, y, z) -> (x, -z, y)
        low, high = np.array([low[0], -high[2], low[1]]), np.array([high[0], -low[2], high[1]])
    truth = np.array([part.shape.bounds_at(part.T_world) for part in three_parts().parts])
    np.testing.assert_allclose([low, high], [truth[:, 0].min(axis=0), truth[:, 1].max(axis=0)], atol=0.01)
    assert json.loads(written.manifest.read_text())


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    return export(three_parts(), tmp_path_factory.mktemp("step") / "three.step").files[0]


def test_step_is_read_back_by_open_cascade(step):
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    from tests.cad import read_step, volume

    parts = read_step(step)
    assert [volume(part) for part in parts] == pytest.approx(list(VOLUMES.values()), rel=1e-9)
    gaps = [BRepExtrema_DistShapeShape(parts[i], parts[j]).Value() for i, j in ((0, 1), (1, 2))]
    assert gaps == pytest.approx([0.5, 1.0], abs=1e-6)


def test_step_is_read_as_it_was_written(step):
    scene = load(step)
    assert [part.name for part in scene.parts] == ["box", "pin", "tube"]
    result = check(scene, distances=True)
    gaps = {(row.a, row.b): row.distance for row in result.pairs}
    for pair, truth in ((("box", "pin"), 0.5), (("pin", "tube"), 1.0)):
        assert gaps[pair].lower - 1e-6 <= truth <= gaps[pair].upper + 1e-6
        assert gaps[pair].upper - gaps[pair].lower < 0.01
    assert result.clean


def test_the_clamp_as_step_touches_where_it_should(tmp_path):
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    from tests.cad import read_step

    parts = read_step(export(assemble(), tmp_path / "clamp.step").files[0])
    assert len(parts) == 7
    for (i, j), truth in {(0, 5): 0.0, (1, 5): 0.0, (0, 6): 0.0, (1, 6): 0.0, (1, 2): 0.0, (0, 3): 1.0}.items():
        assert BRepExtrema_DistShapeShape(parts[i], parts[j]).Value() == pytest.approx(truth, abs=1e-5)


@pytest.mark.parametrize(
    ("gap", "code", "verdict"), [(0.5, 0, "clear"), (0.005, 0, "contact"), (-0.5, 1, "clash"), (-8.0, 1, "contained")]
)
def test_exit_code_and_json_of_check(gap, code, verdict, tmp_path, main):
    file = export(three_parts(gap).moved({"tube": translation(90, 0, 0)}), tmp_path / "three.glb").files[0]
    ended, out, _ = main("check", file, "--quiet", "--json", "-")
    data = json.loads(out)
    assert ended == code
    assert data["clean"] == (code == 0)
    assert {"headline", "scene", "thresholds", "clean", "counts", "findings", "parts", "pairs", "motions"} <= set(data)
    row = next((row for row in data["pairs"] if {row["a"], row["b"]} == {"box", "pin"}), {"verdict": "clear"})
    assert row["verdict"].replace("contained", "clash") == verdict.replace("contained", "clash")
    if verdict != "clear":
        assert {"distance_mm", "at_least_mm", "at_most_mm", "point_a", "normal", "depth_mm", "method"} <= set(row)
