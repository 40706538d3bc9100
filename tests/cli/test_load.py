"""`load`: one rule for what a name or a file is."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

import clamp3d
from clamp3d import Clamp, InputError, Scene, load
from clamp3d.clamp.dimensions import PARTS
from tests.docs.project import ROOT

REFERENCE = Path(clamp3d.__file__).parent / "clamp" / "data" / "reference.toml"


@pytest.mark.parametrize("source", ["reference", REFERENCE, str(REFERENCE), "without-ending"])
def test_a_clamp_by_name_or_file(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(REFERENCE, "without-ending")
    clamp = load(source, line="LJ-500")
    assert isinstance(clamp, Clamp)
    assert clamp.line.conductor == "LJ-500"


def test_a_scene_by_its_tables_is_named_after_its_file_or_its_folder(tmp_path):
    (tmp_path / "some.toml").write_text("[clamp]")
    scene = load(tmp_path / "some.toml")
    assert isinstance(scene, Scene)
    assert ([part.name for part in scene.parts], scene.name) == ([*PARTS], "some")
    assert load(ROOT / "examples" / "hinge" / "scene.toml").name == "hinge"


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".off", ".STL"])
def test_a_mesh_is_one_part(suffix, tmp_path):
    path = tmp_path / f"my part, v2{suffix}"
    trimesh.creation.box((10.0, 20.0, 30.0)).export(path, file_type=suffix[1:].lower())
    scene = load(path, unit="in")
    assert isinstance(scene, Scene)
    (part,) = scene.parts
    assert (part.name, part.shape.fit) == ("my-part-v2", "off")
    assert np.ptp(part.shape.mesh.vertices, axis=0).round(3).tolist() == [254.0, 508.0, 762.0]


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        ("nothing", {}, "unknown clamp or file 'nothing'; built in: reference; or give a clamp or scene file (.toml)"),
        ("no.toml", {}, "no.toml: no such file"),
        ("no.stl", {}, "no.stl: no such file"),
        ("empty.toml", {}, "empty.toml: neither a clamp ([up_splint], [line], ...) nor a scene ([parts.NAME], [clamp]"),
        ("text.md", {}, "text.md: unknown kind of file; built in: reference; or give a clamp or scene file (.toml)"),
        ("bad.toml", {}, "bad.toml: not valid TOML: "),
        ("none.toml", {}, "none.toml: the scene has no parts; add [parts.NAME], include or [clamp]"),
        ("folder", {}, "folder: no geometry file in the folder; choices: .stl, .obj"),
        ("scene.toml", {"line": "LJ-500"}, "line goes with a clamp, not with scene.toml"),
        ("cube.stl", {"jumper": "16"}, "jumper goes with a clamp, not with cube.stl"),
        ("reference", {"unit": "mm"}, "unit goes with a mesh file, not with reference"),
        ("no.step", {"unit": "mm"}, "unit: STEP files state their unit themselves"),
        ("no.3mf", {"unit": "mm"}, "unit: 3MF files state their unit themselves"),
        ("", {}, "source must not be empty"),
        (3, {}, "source must be a path, a clamp's name, or an object of CadQuery, build123d, Open CASCADE or"),
    ],
)
def test_anything_else_is_one_clear_line(source, options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    texts = {"empty": "", "bad": "a = ", "scene": "[clamp]", "none": "contact = 0.01\n[parts]\n"}
    for name, text in texts.items():
        Path(f"{name}.toml").write_text(text)
    Path("text.md").write_text("A *text*")
    Path("folder").mkdir()
    trimesh.creation.box((1.0, 1.0, 1.0)).export("cube.stl")
    with pytest.raises(InputError) as error:
        load(source, **options)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)
