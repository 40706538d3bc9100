"""``clamp3d export`` from the command line to the files, and the committed review set."""

import json

import numpy as np
import pytest
import trimesh

from clamp3d.clamp.dimensions import PARTS
from tests.docs.project import ROOT, python


def test_final_state_is_exported_where_it_is_published(main, tmp_path):
    code, out, err = main("export", "--format", "glb", "--output", tmp_path)
    assert code == 0
    assert out.split() == [str(tmp_path / "reference.glb"), str(tmp_path / "manifest-glb.json")]
    assert "state final: nut tightened (clamped)" in err
    listing = json.loads((tmp_path / "manifest-glb.json").read_text())
    assert (listing["state"], listing["status"]) == ("final", "clamped")
    assert listing["parameters"]["saddle"]["radius"] == 49.230
    # As a reader sees it: metres, Y up; the nut's top face 67.774 mm above the line, the bolt's end 120.184 mm.
    scene = trimesh.load(tmp_path / "reference.glb")
    assert scene.bounds[1][1] == pytest.approx(0.120184, abs=1e-6)


def test_scenes_and_meshes_are_exported_too(main, tmp_path):
    hinge = ROOT / "examples" / "hinge"
    assert main("export", hinge / "scene.toml", "-o", tmp_path / "hinge.3mf")[0] == 0
    meshes = [trimesh.load(hinge / f"{name}.stl") for name in ("leaf-a", "leaf-b", "pin")]
    expected = trimesh.util.concatenate(meshes).bounds
    assert trimesh.load(tmp_path / "hinge.3mf").bounds == pytest.approx(expected, abs=1e-5)
    assert main("export", hinge / "pin.stl", "-f", "obj", "-o", tmp_path / "pin")[0] == 0
    assert (tmp_path / "pin" / "pin.obj").is_file()
    assert main("export", ROOT / "examples/v-block/scene.toml", "--clashes", "-o", tmp_path / "all.glb")[0] == 0
    assert [n for n in trimesh.load(tmp_path / "all.glb").graph.nodes_geometry if n.startswith("clash ")]
    assert main("export", "--clashes", "-q", "--output", tmp_path / "clamp.glb")[0] == 2  # a clamp has none to give
    assert not (tmp_path / "clamp.glb").exists()
    _, out, _ = main("export", "-o", tmp_path / "final.step", "-q")
    assert out.split() == [str(tmp_path / f"final.step{s}") for s in ("", ".manifest.json")]


def test_review_set_is_what_a_new_build_gives():
    done = python("scripts/build-meshes", "--check")
    assert (done.stdout, done.returncode) == ("", 0), done.stderr


def test_an_order_of_assembly_is_exported_as_it_stands_after_a_step(main, tmp_path):
    """The jumper is in its groove, the saddle on the bolt still waits below."""
    order = ("--sequence", "P1 -> P7 -> P2 -> P3|P4 -> P5")
    assert main("export", "-f", "glb", "-o", tmp_path / "a", *order, "--state", "P7")[0] == 0
    listing = json.loads((tmp_path / "a" / "manifest-glb.json").read_text())
    place = {name: np.array(listing["parts"][name]["T_world_part"])[:3, 3] for name in PARTS}
    assert abs(place["P7"][0] - place["P1"][0]) < 137.0
    assert place["P3"][2] < place["P1"][2] - 150.0
    assert main("export", "-f", "stl", "-o", tmp_path / "c", *order)[0] == 2
