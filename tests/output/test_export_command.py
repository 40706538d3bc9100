"""``clamp3d export`` from the command line to the files, and the committed review set."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from clamp3d import cli
from clamp3d.clamp.dimensions import PARTS

ROOT = Path(__file__).resolve().parents[2]
# x, y, degrees of the published final state (section frame: y down), relative to the line.
PUBLISHED = {
    "P1": (-23.328, -41.374, 0.0),
    "P2": (45.172, -20.374, 12.0),
    "P3": (45.172, -21.604, 0.0),
    "P4": (45.172, -120.184, 0.0),
    "P5": (45.172, -67.774, 0.0),
    "P6": (0.0, 0.0, 0.0),
    "P7": (94.969, -9.260, 0.0),
}


@pytest.fixture
def clamp3d(monkeypatch: pytest.MonkeyPatch):
    def run(*arguments: object) -> int:
        monkeypatch.setattr(sys, "argv", ["clamp3d", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return int(stop.value.code or 0)

    return run


def test_final_state_is_exported_where_it_is_published(clamp3d, tmp_path: Path, capfd) -> None:
    assert clamp3d("export", "--format", "glb", "--output", tmp_path) == 0
    out, err = capfd.readouterr()
    assert out.split() == [str(tmp_path / "reference.glb"), str(tmp_path / "manifest-glb.json")]
    assert "state final: nut tightened (clamped)" in err
    listing = json.loads((tmp_path / "manifest-glb.json").read_text())
    for name, (x, y, degrees) in PUBLISHED.items():
        T = np.array(listing["parts"][name]["T_world_part"])
        np.testing.assert_allclose(T[:3, 3], [x, 0.0, -y], atol=6e-4)
        assert np.degrees(np.arctan2(T[2, 0], T[0, 0])) == pytest.approx(degrees, abs=0.01)
    assert (listing["state"], listing["status"]) == ("final", "clamped")
    assert listing["parameters"]["saddle"]["radius"] == 49.230
    # As a reader sees it: metres, Y up; the nut's top face 67.774 mm above the line, the bolt's end 120.184 mm.
    scene = trimesh.load(tmp_path / "reference.glb")
    assert scene.bounds[1][1] == pytest.approx(0.120184, abs=1e-6)


def test_scenes_and_meshes_are_exported_too(clamp3d, tmp_path: Path, capfd) -> None:
    hinge = ROOT / "examples" / "hinge"
    assert clamp3d("export", hinge / "scene.toml", "-o", tmp_path / "hinge.3mf") == 0
    meshes = [trimesh.load(hinge / f"{name}.stl") for name in ("leaf-a", "leaf-b", "pin")]
    expected = trimesh.util.concatenate(meshes).bounds
    assert trimesh.load(tmp_path / "hinge.3mf").bounds == pytest.approx(expected, abs=1e-5)
    assert clamp3d("export", hinge / "pin.stl", "-f", "obj", "-o", tmp_path / "pin") == 0
    assert (tmp_path / "pin" / "pin.obj").is_file()
    capfd.readouterr()
    assert clamp3d("export", hinge / "scene.toml", "-o", tmp_path / "hinge.step") == 2
    assert "leaf-a is a mesh: STEP holds true faces" in capfd.readouterr().err
    assert clamp3d("export", hinge / "pin.stl", "-o", tmp_path / "a.glb", "--state", "open") == 2
    assert "state goes with an assembled clamp" in capfd.readouterr().err
    assert clamp3d("export", "-o", tmp_path / "final.step", "-q") == 0
    assert capfd.readouterr().out.split() == [str(tmp_path / f"final.step{s}") for s in ("", ".manifest.json")]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--state", "P9"), "unknown state 'P9'; available: open, P1|P2P3P4P5 (or 1), P7 (or 2)"),
        (("--mesh-error", "0"), "mesh_error must be a finite length >= 1e-06 mm, got 0"),
        (("--mesh-error", "wide"), "must be a finite number or a fraction like 1/3, got 'wide'"),
        (("--format", "dwg"), "'dwg' is not one of"),
        (("--format", "glb", "--unit", "mm"), "unit of glb must be m"),
        (("nowhere.toml",), "nowhere.toml"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(clamp3d, tmp_path: Path, capfd, arguments, message: str) -> None:
    assert clamp3d("export", "--format", "stl", "--output", tmp_path / "out", *arguments) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert message in err.splitlines()[-1]
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_step_without_open_cascade_says_what_to_install(clamp3d, tmp_path: Path, capfd, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "OCP", None)
    assert clamp3d("export", "--format", "step", "--output", tmp_path / "out", "-q") == 2
    assert "STEP needs Open CASCADE: pip install 'clamp3d[step]'" in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


def test_review_set_is_what_a_new_build_gives() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "build-meshes"), "--check"],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert (done.stdout, done.returncode) == ("", 0), done.stderr


def test_an_order_of_assembly_is_exported_as_it_stands_after_a_step(clamp3d, tmp_path: Path, capfd) -> None:
    """The jumper is in its groove, the saddle on the bolt still waits below."""
    order = ("--sequence", "P1 -> P7 -> P2 -> P3|P4 -> P5")
    assert clamp3d("export", "-f", "glb", "-o", tmp_path / "a", *order, "--state", "P7") == 0
    listing = json.loads((tmp_path / "a" / "manifest-glb.json").read_text())
    place = {name: np.array(listing["parts"][name]["T_world_part"])[:3, 3] for name in PARTS}
    assert abs(place["P7"][0] - place["P1"][0]) < 137.0
    assert place["P3"][2] < place["P1"][2] - 150.0
    assert clamp3d("export", "-f", "stl", "-o", tmp_path / "c", *order) == 2


def test_clashes_are_exported_on_demand(clamp3d, tmp_path: Path) -> None:
    """A scene file gives the bodies of its clashes; a clamp has none to give and is refused."""
    (tmp_path / "scene.toml").write_text(
        '[parts.a]\nshape = "box"\nsize = [10, 10, 10]\n[parts.b]\nshape = "box"\nsize = [10, 10, 10]\n'
        "pose = { translation = [8, 0, 0] }\n",
        encoding="utf-8",
    )
    assert clamp3d("export", tmp_path / "scene.toml", "--clashes", "-q", "--output", tmp_path / "out.glb") == 0
    scene = trimesh.load(tmp_path / "out.glb")
    assert set(scene.graph.nodes_geometry) == {"a", "b", "clash a - b"}
    assert clamp3d("export", "--clashes", "-q", "--output", tmp_path / "clamp.glb") == 2
    assert not (tmp_path / "clamp.glb").exists()
