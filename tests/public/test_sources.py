"""`check`, `view`, `report` and `export` take a path, a list of parts and objects of other libraries alike."""

import json
import pickle

import pytest
import trimesh

import clamp3d
from clamp3d import shapes
from clamp3d.kernel import translation


@pytest.fixture
def boxes(tmp_path):
    """Two boxes of 10 mm, 5 mm into each other, by everything that they can come as."""
    T = translation(5.0, 0.0, 0.0)
    scene, box, cube = trimesh.Scene(), shapes.box(10, 10, 10), trimesh.creation.box((10, 10, 10))
    scene.add_geometry(cube, node_name="a", geom_name="a")
    scene.add_geometry(cube.copy(), node_name="b", geom_name="b", transform=T)
    drawn = clamp3d.Scene().add("a", box).add("b", box, T)
    clamp3d.export(drawn, tmp_path / "two.glb")
    return {
        "path": tmp_path / "two.glb",
        "list": [("a", box), ("b", box, T)],
        "meshes": [("a", cube), ("b", shapes.make_mesh(cube.vertices, cube.faces), T)],
        "trimesh": scene,
        "scene": drawn,
    }


@pytest.mark.parametrize("kind", ["path", "list", "meshes", "trimesh", "scene"])
@pytest.mark.usefixtures("without_pictures")
def test_every_source_is_taken_by_all_four(boxes, kind, tmp_path):
    source = boxes[kind]
    result = clamp3d.check(source)
    (row,) = result.findings
    assert ({row.a, row.b}, str(row.verdict)) == ({"a", "b"}, "clash")
    assert row.distance.upper == pytest.approx(-5.0, abs=1e-6)
    with clamp3d.view(source, serve=False) as viewer:
        assert viewer.story["findings"][0]["verdict"] == "clash"
    data, page, _ = sorted(clamp3d.report(source, tmp_path / "report"), key=lambda path: path.suffix != ".json")
    assert json.loads(data.read_text())["passed"] is False
    assert page.exists()
    (written,) = clamp3d.export(source, tmp_path / "out.stl").files
    assert trimesh.load(written).volume == pytest.approx(2000.0, rel=1e-6)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ([1], r"a list of parts must hold \(name, shape\) or \(name, shape, pose\), got 1"),
        ([("a", 5)], "a part's shape must be a Solid, MeshShape, Mesh, Cylinder or a mesh of trimesh, got int"),
    ],
)
def test_what_is_no_source_is_refused_in_one_line(source, message):
    for function, *arguments in ((clamp3d.check,), (clamp3d.view,), (clamp3d.report, "x"), (clamp3d.export, "x.stl")):
        with pytest.raises(clamp3d.InputError, match=message):
            function(source, *arguments)


def test_results_can_be_pickled(boxes, run):
    result = clamp3d.check(boxes["scene"])
    again = pickle.loads(pickle.dumps(result))
    assert again.to_dict() == result.to_dict()
    assert pickle.loads(pickle.dumps(run)).distance == run.distance
