"""Every mesh format read back by a reader that had no part in writing it; the command, and the committed review set."""

import hashlib
import json
import math
import struct
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from clamp3d import InputError, Part, Scene, export, load, shapes
from clamp3d.clamp.dimensions import PARTS, TITLES
from clamp3d.clamp.parts import clamp_scene, parts
from clamp3d.geometry.meshing import volume_bounds
from clamp3d.kernel import translation
from clamp3d.output.export import FORMATS
from clamp3d.output.palette import PART_COLOURS
from tests.docs.project import ROOT, python
from tests.kinds import mesh_shape

MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
MESH_ERROR = 0.02
FACETED = [f for f in FORMATS if f != "step"]
COLOURS = {name: trimesh.visual.color.hex_to_rgba(colour)[:3] for name, colour in PART_COLOURS.items()}


def read_glb(path):
    """The JSON of a GLB file."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + length])


@pytest.mark.parametrize("format", ["stl", "ply"])
def test_a_format_that_would_lose_accuracy_is_refused(reference, tmp_path, format):
    scene = clamp_scene(reference, dict.fromkeys(PARTS, translation(1e6, 0.0, 0.0)))
    with pytest.raises(InputError, match=rf"{format} holds 32-bit numbers: the pose of P1 up splint would lose 0\.03"):
        export(scene, tmp_path / format, format=format)
    assert not (tmp_path / format).exists()
    # The others hold the same place exactly.
    for other, rounding in (("obj", 1e-9), ("3mf", 1e-5)):
        written = export(scene, tmp_path, format=other, mesh_error=MESH_ERROR, names=["P1"])
        solid = trimesh.load(written.files[0], process=False, force="mesh")
        np.testing.assert_allclose(solid.bounds - [1e6, 0, 0], parts(reference)["P1"].bounds, atol=rounding)


@pytest.mark.parametrize("format", FACETED)
@pytest.mark.parametrize("unit", ["mm", "in"])
def test_every_format_is_read_back_in_its_place(reference, odd_poses, odd_scene, tmp_path, format, unit):
    """By trimesh's readers: each part where it stands, closed, of its volume, and in its colour where there are any."""
    unit = "m" if format == "glb" else unit
    written = export(odd_scene, tmp_path, format=format, layout="parts", mesh_error=MESH_ERROR, unit=unit)
    models = [path for path in written.files if path.suffix != ".mtl"]
    assert [path.name for path in models] == [f"{n}-{TITLES[n].replace(' ', '-')}.{format}" for n in PARTS]
    for name, path in zip(PARTS, models, strict=True):
        solid = trimesh.load(path, process=False, force="mesh")
        vertices = np.asarray(solid.vertices) * MM[unit]
        if format == "glb":  # Y up back to Z up
            vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
        part, closed, rounding = parts(reference)[name], trimesh.Trimesh(vertices, solid.faces, process=False), 1e-3
        closed.merge_vertices()
        assert closed.is_watertight
        assert closed.is_winding_consistent
        low, high = np.array(volume_bounds(part, MESH_ERROR)) + np.array([-1.0, 1.0]) * rounding * closed.area
        assert low <= closed.volume <= high
        outwards = (closed.bounds - part.bounds_at(odd_poses[name])) * [[-1.0], [1.0]]  # of the part's box
        assert (outwards <= rounding).all()
        assert (outwards >= -MESH_ERROR - rounding).all()
        text = path.read_bytes()
        if format in ("stl", "ply", "obj"):
            assert f"unit {unit}".encode() in text
        if format == "ply":
            assert (np.asarray(solid.visual.vertex_colors)[:, :3] == COLOURS[name]).all()


@pytest.mark.parametrize("format", ["glb", "3mf"])
def test_poses_are_read_back_as_they_were(odd_poses, odd_scene, tmp_path, format):
    (path,) = export(odd_scene, tmp_path / f"all.{format}").files
    read = load(path).parts
    assert len(read) == len(odd_poses)
    for part, T in zip(read, odd_poses.values(), strict=True):
        np.testing.assert_allclose(part.T_world, T, rtol=1e-5, atol=1e-5)


def test_a_mesh_of_one_part_stands_in_the_frame_of_its_file(tmp_path):
    part = Part("box", shapes.box((1.0, 2.0, 3.0)), translation(10.0, 20.0, 30.0))
    export(Scene((part,)), tmp_path / "box.glb")
    (tmp_path / "cell.toml").write_text('[parts.box]\nshape = "mesh"\nfile = "box.glb"\n', encoding="utf-8")
    (read,) = load(tmp_path / "cell.toml").parts
    assert read.T_world.tolist() == np.eye(4).tolist()
    np.testing.assert_allclose(read.shape.mesh.vertices.min(axis=0), [9.5, 19.0, 28.5], atol=1e-5)
    np.testing.assert_allclose(read.shape.mesh.vertices.max(axis=0), [10.5, 21.0, 31.5], atol=1e-5)


def test_a_placed_ball_of_a_robot_is_no_mesh_in_its_file(tmp_path):
    (tmp_path / "ball.urdf").write_text(
        '<robot name="r"><link name="l"><collision><origin xyz="0.01 0.02 0.03"/>'
        '<geometry><sphere radius="0.004"/></geometry></collision></link></robot>',
        encoding="utf-8",
    )
    (tmp_path / "cell.toml").write_text('[parts.ball]\nshape = "mesh"\nfile = "ball.urdf"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"ball\.urdf places its body itself: leave out shape"):
        load(tmp_path / "cell.toml")


def test_glb_is_y_up_with_named_coloured_nodes(odd_poses, odd_scene, tmp_path):
    written = export(odd_scene, tmp_path, format="glb", mesh_error=MESH_ERROR)
    tree = read_glb(written.files[0])
    assert tree["asset"]["extras"] == {"unit": "m", "mesh_error_mm": MESH_ERROR}
    nodes = tree["nodes"]
    (root,) = (nodes[i] for i in tree["scenes"][tree["scene"]]["nodes"])
    turn = np.array(root["matrix"]).reshape(4, 4).T
    np.testing.assert_array_equal(turn @ [0, 0, 1, 1], [0, 1, 0, 1])  # up
    assert root["name"] == "reference"
    for name, child in zip(PARTS, (nodes[i] for i in root["children"]), strict=True):
        assert child["name"] == f"{name} {TITLES[name]}"
        T = np.array(child["matrix"]).reshape(4, 4).T
        np.testing.assert_allclose(T[:3, 3] * 1000.0, odd_poses[name][:3, 3], atol=1e-9)
        (primitive,) = tree["meshes"][child["mesh"]]["primitives"]
        colour = tree["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
        srgb = [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in colour[:3]]
        assert [round(255 * c) for c in srgb] == COLOURS[name].tolist()


def test_obj_has_named_coloured_objects(odd_scene, tmp_path):
    model, materials = export(odd_scene, tmp_path, format="obj", layout="assembly", mesh_error=MESH_ERROR).files
    scene = trimesh.load(model, split_objects=True, group_material=False, process=False)
    assert set(scene.geometry) == {f"{n}_{TITLES[n].replace(' ', '_')}" for n in PARTS}
    for name in PARTS:
        solid = scene.geometry[f"{name}_{TITLES[name].replace(' ', '_')}"]
        np.testing.assert_allclose(solid.visual.material.main_color[:3], COLOURS[name], atol=1)
        assert f"newmtl {name}_" in materials.read_text()


def test_3mf_by_lib3mf(odd_scene, tmp_path):
    lib3mf = pytest.importorskip("lib3mf", reason="lib3mf is not installed")
    written = export(odd_scene, tmp_path, format="3mf", mesh_error=MESH_ERROR)
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(written.files[0]))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    meshes = model.GetMeshObjects()
    names = []
    while meshes.MoveNext():
        item = meshes.GetCurrentMeshObject()
        assert item.IsManifoldAndOriented()
        names.append(item.GetName())
    assert names == [f"{n} {TITLES[n]}" for n in PARTS]
    trees = model.GetComponentsObjects()
    assert trees.MoveNext()
    assert trees.GetCurrentComponentsObject().GetName() == "reference"


@pytest.mark.parametrize("format", FACETED)
def test_same_input_gives_the_same_bytes_as_the_manifest_says(reference, odd_poses, odd_scene, tmp_path, format):
    runs = [export(odd_scene, tmp_path / str(i), format=format, mesh_error=MESH_ERROR) for i in range(2)]
    for a, b in zip((*runs[0].files, runs[0].manifest), (*runs[1].files, runs[1].manifest), strict=True):
        assert a.read_bytes() == b.read_bytes()
    listing = json.loads(runs[0].manifest.read_text())
    assert list(listing["files"]) == [p.name for p in runs[0].files]
    for path in runs[0].files:
        entry = listing["files"][path.name]
        assert entry["bytes"] == path.stat().st_size
        assert entry["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert listing["unit"] == ("m" if format == "glb" else "mm")
    assert listing["up"] == ("Y" if format == "glb" else "Z")
    assert (listing["scene"], listing["mesh_error_mm"]) == ("reference", MESH_ERROR)
    for name in PARTS:
        entry = listing["parts"][name]
        assert 0.0 < entry["chord_error_mm"] <= MESH_ERROR
        assert entry["volume_mm3"] == pytest.approx(parts(reference)[name].volume, abs=1e-6)
        np.testing.assert_array_equal(entry["T_world_part"], odd_poses[name])
    # The box in the manifest is the one a reader sees, of all parts or of the first.
    if format in ("stl", "ply", "glb", "3mf"):
        boxes = np.array([listing["parts"][n]["bounds"] for n in PARTS[: 7 if len(runs[0].files) == 1 else 1]])
        expected = [boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]
        tolerance = 1e-4 if listing["unit"] == "mm" else 1e-7
        np.testing.assert_allclose(trimesh.load(runs[0].files[0]).bounds, expected, atol=tolerance)


def test_bad_settings_are_one_clear_line_and_leave_no_file(reference, odd_scene, tmp_path):
    for source, arguments, message in [
        (reference, {"format": "dxf"}, "format must be one of stl, obj, ply, glb, 3mf, step, got 'dxf'"),
        (reference, {}, "output must end in one of stl, obj, ply, glb, 3mf, step, or be a folder with a format"),
        (odd_scene, {"format": "glb", "unit": "mm"}, "unit of glb must be m, as glTF 2.0 demands, got 'mm'"),
        (reference, {"format": "stl", "unit": "ft"}, "unit must be one of mm, cm, m, in, got 'ft'"),
        (reference, {"format": "stl", "layout": "zip"}, "layout must be one of parts, assembly, got 'zip'"),
        (reference, {"format": "stl", "mesh_error": math.nan}, "mesh_error must be a finite length"),
        (reference, {"format": "3mf"}, "layout assembly needs poses"),
        (odd_scene, {"format": "stl", "state": "final"}, "state goes with an assembled clamp"),
        (odd_scene, {"format": "stl", "names": ["P8"]}, "unknown part 'P8'; available: P1"),
        (odd_scene, {"format": "stl", "names": []}, "names must name at least one part, available: P1"),
        (parts(reference), {"format": "stl"}, "source must be a path, a clamp's name, or an object of CadQuery"),
    ]:
        with pytest.raises(InputError, match="^.*" + message.replace("(", r"\(")):
            export(source, tmp_path / "none", **arguments)
    assert not (tmp_path / "none").exists()


def test_files_are_written_whole_or_not_at_all(reference, tmp_path):
    (tmp_path / "P7-jumper.stl").mkdir()
    (tmp_path / "P1-up-splint.stl").write_text("mine")
    with pytest.raises(InputError, match=r"cannot write .*P7-jumper\.stl: it is a folder"):
        export(reference, tmp_path, format="stl")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["P1-up-splint.stl", "P7-jumper.stl"]
    assert (tmp_path / "P1-up-splint.stl").read_text() == "mine"
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cannot write into .*file"):
        export(reference, tmp_path / "file", format="stl")


def test_any_name_gives_readable_files(odd_scene, tmp_path):
    odd = replace(odd_scene, name='Überklemme <5>/"a"\nnext\x01')
    for format in FACETED:
        written = export(odd, tmp_path, format=format, layout="assembly", mesh_error=0.5)
        assert written.files[0].name == f"berklemme-5-a-next.{format}"
        loaded = trimesh.load(written.files[0])
        assert loaded.extents.max() > 0.1


def test_parts_without_a_letter_for_a_file_name_are_numbered(tmp_path):
    scene = Scene().add("夹", shapes.box((1, 2, 3))).add("线", shapes.box((1, 2, 3)))
    assert [path.name for path in export(scene, tmp_path, format="stl").files] == ["part.stl", "part-2.stl"]


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("names", [("a\x0bb", "c"), ("x\\", "y"), ("\ud800x", "y"), ("a_b", "a\x0bb", "a\x0cb")])
def test_any_part_name_gives_files_with_all_parts(names, format, tmp_path):
    if format in ("3mf", "step"):
        pytest.importorskip({"3mf": "lib3mf", "step": "OCP"}[format])
    scene = Scene(name="s\ud800")
    for k, name in enumerate(names):
        scene = scene.add(name, shapes.box((1, 2, 3)), translation(10.0 * k, 0.0, 0.0))
    (file, *_) = export(scene, tmp_path, format=format, layout="assembly").files
    read = load(file).parts
    assert len(read) == (len(names) if format in ("glb", "3mf", "step") else 1)
    assert format == "step" or sum(len(part.shape.mesh.faces) for part in read) == 12 * len(names)


@pytest.mark.parametrize("name", ["world", "root", "P3"])
def test_names_of_a_file_and_its_parts_are_apart_from_those_of_the_writer(odd_scene, tmp_path, name):
    """A clamp called "world" became trimesh's own root: its parts lost the turn to Y up."""
    plain = export(odd_scene, tmp_path / "plain.glb", mesh_error=0.5).files[0]
    odd = export(replace(odd_scene, name=name), tmp_path / "odd.glb", mesh_error=0.5).files[0]
    np.testing.assert_array_equal(trimesh.load(odd).bounds, trimesh.load(plain).bounds)
    tree = read_glb(odd)
    (root,) = (tree["nodes"][i] for i in tree["scenes"][tree["scene"]]["nodes"])
    assert root["name"] == name
    assert [tree["nodes"][i]["name"] for i in root["children"]] == [f"{n} {TITLES[n]}" for n in PARTS]
    clashing = Scene().add("world", shapes.box((1, 2, 3))).add("root", shapes.cylinder(1, 9))
    tree = read_glb(export(clashing, tmp_path / "clashing.glb").files[0])
    assert [m["name"] for m in tree["meshes"]] == ["world", "root"]


def test_a_scene_of_drawn_solids_and_meshes(tmp_path):
    """A named file by its suffix; a mesh keeps its facets; volumes without a closed form lie between bounds."""
    block = trimesh.creation.box((4.0, 6.0, 8.0))
    tube = shapes.cylinder(5.0, 40.0, bore=3.0)
    scene = Scene(name="pair").add("tube", tube, translation(0, 0, 7))
    scene = scene.add("a/b", mesh_shape(block)).add("a-b", shapes.box((1, 1, 1)))
    written = export(scene, tmp_path / "pair.STL", mesh_error=0.2)
    assert [p.name for p in (*written.files, written.manifest)] == ["pair.STL", "pair.STL.manifest.json"]
    listing = json.loads(written.manifest.read_text())
    assert list(listing["files"]) == ["pair.STL"]
    entry = listing["parts"]["tube"]
    low, high = entry["volume_bounds_mm3"]
    assert low < math.pi * (25.0 - 9.0) * 40.0 < high
    assert low <= entry["mesh_volume_mm3"] <= high
    assert listing["parts"]["a/b"]["mesh_volume_mm3"] == 192.0
    assert listing["parts"]["a/b"]["chord_error_mm"] == 0.0
    assert listing["parts"]["tube"]["bounds"][1][2] == 27.0
    names = [p.name for p in export(scene, tmp_path, format="ply").files]
    assert names == ["tube.ply", "a-b.ply", "a-b-2.ply"]
    solid = trimesh.load(tmp_path / "a-b.ply", process=False)
    np.testing.assert_array_equal(solid.bounds, [[-2, -3, -4], [2, 3, 4]])
    with pytest.raises(InputError, match="a/b is a mesh: STEP holds true faces"):
        export(scene, tmp_path / "pair.step")
    with pytest.raises(InputError, match=r"output pair\.glb and format stl contradict each other"):
        export(scene, tmp_path / "pair.glb", format="stl")
    with pytest.raises(InputError, match="layout parts needs a folder"):
        export(scene, tmp_path / "pair.glb", layout="parts")


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
