"""Files read back by other libraries, and the commands as a process: exit codes, JSON, what is written."""

import csv
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from clamp3d import InputError, Scene, assemble, check, export, load, report, view
from clamp3d.kernel import rotation, translation
from clamp3d.shapes import Hole, SweptArc, box, cylinder, groove_block

EXAMPLES = Path(__file__).parents[2] / "examples"
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


# --- Files ------------------------------------------------------------------------------------------------------------


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


def test_3mf_is_read_back_by_lib3mf(tmp_path):
    lib3mf = pytest.importorskip("lib3mf", reason="lib3mf (extra 3mf) is not installed")
    path = export(three_parts(), tmp_path / "three.3mf").files[0]
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(path))
    objects, names = model.GetMeshObjects(), []
    while objects.MoveNext():
        mesh = objects.GetCurrentMeshObject()
        assert mesh.IsManifoldAndOriented()
        names.append(mesh.GetName())
    assert sorted(names) == ["box", "pin", "tube"]
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter


def solids(path):
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    explorer, found = TopExp_Explorer(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_SOLID), []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    return export(three_parts(), tmp_path_factory.mktemp("step") / "three.step").files[0]


def test_step_is_read_back_by_open_cascade(step):
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    parts, volumes = solids(step), []
    for part in parts:
        properties = GProp_GProps()
        BRepGProp.VolumeProperties_s(part, properties)
        volumes.append(properties.Mass())
    assert volumes == pytest.approx(list(VOLUMES.values()), rel=1e-9)
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

    parts = solids(export(assemble(), tmp_path / "clamp.step").files[0])
    assert len(parts) == 7
    for (i, j), truth in {(0, 5): 0.0, (1, 5): 0.0, (0, 6): 0.0, (1, 6): 0.0, (1, 2): 0.0, (0, 3): 1.0}.items():
        assert BRepExtrema_DistShapeShape(parts[i], parts[j]).Value() == pytest.approx(truth, abs=1e-5)


@pytest.mark.parametrize("cut", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("format", ["stl", "glb", "step", "3mf"])
def test_a_file_that_is_cut_short_is_refused_in_one_line(format, cut, tmp_path, main):
    whole = export(three_parts(), tmp_path / f"whole.{format}").files[0].read_bytes()
    path = tmp_path / f"cut.{format}"
    path.write_bytes(whole[: int(cut * len(whole))])
    with pytest.raises(InputError) as caught:
        load(path)
    assert "\n" not in str(caught.value)
    code, out, err = main("check", path, "--quiet")
    assert (code, out, err.count("\n")) == (2, "", 1)


def test_coloured_faces_and_shared_instances_are_read(tmp_path):
    pytest.importorskip("OCP", reason="Open CASCADE (extra step) is not installed")
    from OCP.Quantity import Quantity_Color, Quantity_NameOfColor
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    from tests.public.placed_pairs import StepFile, block, first_solid

    file, cube = StepFile(), first_solid(block((0, 0, 0), (10, 10, 10)))
    label = file.product("cube", cube)
    face = file.tool.AddSubShape(label, TopExp_Explorer(cube, TopAbs_ShapeEnum.TopAbs_FACE).Current())
    red = Quantity_Color(Quantity_NameOfColor.Quantity_NOC_RED)
    XCAFDoc_DocumentTool.ColorTool_s(file.document.Main()).SetColor(face, red, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    file.put(label, np.eye(4))
    file.put(label, translation(0, 0, 20.0))
    scene = load(file.write(tmp_path / "coloured.step"))
    assert len(scene.parts) == 2
    row = check(scene, distances=True).pairs[0]
    assert row.distance.lower - 1e-6 <= 10.0 <= row.distance.upper + 1e-6


# --- View and report --------------------------------------------------------------------------------------------------


def test_a_page_needs_neither_server_nor_network(tmp_path):
    with view(check(three_parts()), serve=False) as viewer:
        viewer.save_html(tmp_path / "three.html")
    page = (tmp_path / "three.html").read_text()
    assert "<html" in page.lower()
    assert not [word for word in page.split() if word.startswith(('src="http', 'href="http'))]


def test_report_view_and_check_print_the_same_numbers(tmp_path):
    result = check(three_parts(gap=-0.3))
    with view(result, serve=False) as viewer:
        finding = viewer.story["findings"][0]
    report(result.scene, tmp_path)
    with open(tmp_path / "pairs.csv", newline="") as file:
        rows = {(row["a"], row["b"]): row for row in csv.DictReader(file)}
    data = json.loads((tmp_path / "report.json").read_text())
    assert finding["verdict"] == rows["box", "pin"]["verdict"] == result.findings[0].verdict.value == "clash"
    assert data["headline"].startswith("1 clash")
    assert (tmp_path / "report.html").stat().st_size > 1000


# --- Commands ---------------------------------------------------------------------------------------------------------


def clamp3d(*arguments, **more):
    command = [sys.executable, "-m", "clamp3d", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **more)


@pytest.mark.parametrize(
    ("gap", "code", "verdict"), [(0.5, 0, "clear"), (0.005, 0, "contact"), (-0.5, 1, "clash"), (-8.0, 1, "contained")]
)
def test_check_as_a_process(gap, code, verdict, tmp_path):
    file = export(three_parts(gap).moved({"tube": translation(90, 0, 0)}), tmp_path / "three.glb").files[0]
    done = clamp3d("check", file, "--quiet", "--json", "-")
    data = json.loads(done.stdout)
    assert done.returncode == code
    assert data["clean"] == (code == 0)
    assert {"headline", "scene", "thresholds", "clean", "counts", "findings", "parts", "pairs", "motions"} <= set(data)
    row = next((row for row in data["pairs"] if {row["a"], row["b"]} == {"box", "pin"}), {"verdict": "clear"})
    assert row["verdict"].replace("contained", "clash") == verdict.replace("contained", "clash")
    if verdict != "clear":
        assert {"distance_mm", "at_least_mm", "at_most_mm", "point_a", "normal", "depth_mm", "method"} <= set(row)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rum"], "command 'rum'"),
        (["check", "nowhere.step"], "nowhere.step"),
        (["check", "reference", "--pairs", "P1:P9"], "unknown part 'P9'; available: P1"),
        (["run", "--line", "LJ-631"], "unknown conductor 'LJ-631'"),
        (["run", "--jumper", "-4"], "jumper diameter must be > 0"),
        (["run", "--json", "/nowhere/x.json", "-q"], "cannot write /nowhere/x.json"),
        (["export", "reference", "--output", "x.doc"], "x.doc"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, message, main):
    code, out, err = main(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("clamp3d: error: ")
    assert err.count("\n") == 1
    assert message in err


def test_an_undecided_pair_ends_with_3_and_is_not_said_to_be_clean(tmp_path, main):
    made = trimesh.creation.box((10, 10, 10))
    trimesh.Trimesh(made.vertices, made.faces[1:], process=False).export(tmp_path / "open.stl")
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "inside.stl")
    code, out, _ = main("check", tmp_path, "--quiet")
    assert code == 3
    assert "uncertain" in out or "undecided" in out


def test_help_lists_the_commands():
    out = clamp3d("--help").stdout
    for command in ("run", "check", "view", "report", "export", "fit", "sweep", "tolerance", "reproduce", "conductors"):
        assert f"\n  {command} " in out


def test_fit_finds_the_groove_that_was_drawn(tmp_path, main):
    shape = groove_block(SweptArc(7.0, math.radians(60.0), 50.0), 40.0, 20.0)
    file = export(Scene().add("block", shape), tmp_path / "block.stl", mesh_error=0.002).files[0]
    code, out, _ = main("fit", file, "--quiet", "--json", "-")
    data = json.loads(out)
    assert code == 0
    (groove,) = data["grooves"]
    assert groove["radius_mm"] == pytest.approx(7.0, abs=0.01)
