"""Objects of other libraries: what they hold, where it is, and how it is called."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from clamp3d import InputError, check, load
from clamp3d.geometry.shells import volume


def volumes(scene):
    return [volume(p.shape.mesh.vertices, p.shape.mesh.faces) for p in scene.parts]


def centre(part):
    return part.T_world[:3, :3] @ part.shape.mesh.vertices.mean(axis=0) + part.T_world[:3, 3]


def test_a_trimesh_scene():
    source = trimesh.Scene()
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    assert (load(box).parts[0].name, volumes(load(box))) == ("part", pytest.approx([6.0]))
    move = trimesh.transformations.translation_matrix([5.0, 0.0, 0.0])
    source.add_geometry(box, node_name="lid", geom_name="box", transform=move)
    source.graph.update("base", geometry="box")
    source.units = "inches"
    scene = load(source)
    assert scene.parts[0].shape is scene.parts[1].shape
    assert {p.name: centre(p).round(6).tolist() for p in scene.parts} == {"lid": [127.0, 0, 0], "base": [0, 0, 0]}
    assert volumes(scene) == pytest.approx([6.0 * 25.4**3] * 2, rel=1e-6)
    assert check(scene).counts == {"clear": 1}
    dot = trimesh.PointCloud([[0.0, 0.0, 0.0]])
    source.add_geometry(dot, node_name="dot")
    assert "dot: PointCloud, left out" in load(source).notes
    for units, mm in (("millimeters", 1.0), ("centimeters", 10.0), ("meters", 1e3)):
        box.units = units
        assert volumes(load(box)) == pytest.approx([6.0 * mm**3])
    box.units = "furlongs"
    with pytest.raises(InputError, match=r"units must be one of millimeters, .*, None, got 'furlongs'"):
        load(box)
    with pytest.raises(InputError, match=r"source must be a trimesh.Scene or a trimesh.Trimesh, got PointCloud"):
        load(dot)


@pytest.mark.parametrize("scale", [1e-13, 1e-5, 1e5])
def test_places_may_scale_by_any_factor(scale):
    source = trimesh.Scene({"box": trimesh.creation.box((1.0 / scale, 2.0 / scale, 3.0 / scale))})
    for name, factor in (("box", 1.0), ("twice", 2.0), ("again", 1.0)):
        source.graph.update(name, geometry="box", matrix=np.diag([*[factor * scale] * 3, 1.0]))
    scene = load(source)
    assert sorted(volumes(scene)) == pytest.approx([6.0, 6.0, 48.0], rel=1e-6)
    assert len({id(part.shape) for part in scene.parts}) == 2


def test_what_is_no_body_is_refused():
    for thing in (3, object(), [1, 2], None, SimpleNamespace(wrapped=None)):
        with pytest.raises(InputError, match="source must be a path, a clamp's name, or an object of CadQuery"):
            load(thing)
    with pytest.raises(InputError, match="source must be a path"):
        load(pytest.importorskip("build123d").Compound())
    with pytest.raises(InputError, match="source must be a path"):
        load(pytest.importorskip("OCP").TopoDS.TopoDS_Solid())
    with pytest.raises(InputError, match="joints goes with a robot description"):
        load(trimesh.creation.box(), joints={"a": 1.0})


def test_shapes_of_open_cascade_and_of_cadquery():
    pytest.importorskip("OCP")

    from tests.cad import location, occ, random_pose
    from tests.files.step_scenes import pin, plate

    assert volumes(load(occ.BRepPrimAPI_MakeBox(0.1, 0.2, 0.3).Shape())) == pytest.approx([0.006])
    # CadQuery's classes hold a shape in `wrapped`, a Workplane in `vals()`, an assembly a tree with places.
    T, S = random_pose(np.random.default_rng(1)), random_pose(np.random.default_rng(2))
    held = SimpleNamespace(wrapped=pin())
    stack = SimpleNamespace(vals=lambda: [held, SimpleNamespace(wrapped=plate())])
    assert [p.name for p in load(stack).parts] == ["part_1", "part_2"]

    def assembly(name, T, obj, *children):
        return SimpleNamespace(name=name, loc=SimpleNamespace(wrapped=location(T)), obj=obj, children=list(children))

    second = assembly("bolt", np.eye(4), held, assembly("x", S, stack))
    scene = load(assembly("top", T, None, assembly("bolt", S, held), second))
    assert scene.name == "top"
    assert [p.name for p in scene.parts] == ["bolt_1", "bolt_2", "x_1", "x_2"]
    for part, place in zip(scene.parts, (T @ S, T, T @ S, T @ S), strict=True):
        np.testing.assert_allclose(part.T_world, place, atol=1e-9)
    assert scene.parts[0].shape is scene.parts[1].shape


def test_build123d_parts_and_assemblies():
    bd = pytest.importorskip("build123d")
    with bd.BuildPart() as made:
        bd.Box(4, 4, 4)
        with bd.Locations((0, 0, 10)):
            bd.Cylinder(1, 2)
    assert sorted(volumes(load(made))) == pytest.approx([2 * np.pi, 64.0], rel=1e-2)
    pin, plate = bd.Cylinder(2, 10), bd.Pos(10, 0, 0) * bd.Box(20, 20, 3)
    pin.label, plate.label = "pin", "plate"
    inner = bd.Compound(label="inner", children=[pin, plate])
    inner.location = bd.Location((0, 0, 5), (0, 0, 90))
    whole = bd.Compound(label="whole", children=[inner, bd.Pos(0, -30, 0) * bd.Sphere(3)])
    scene = load(whole)
    assert scene.name == "whole"
    assert [p.name for p in scene.parts] == ["pin", "plate", "part"]
    for part, shape in zip(scene.parts, (inner.children[0], inner.children[1], whole.children[1]), strict=True):
        truth = shape.moved(inner.location) if shape.parent is inner else shape
        middle = truth.center(bd.CenterOf.BOUNDING_BOX)
        V = part.shape.mesh.vertices @ part.T_world[:3, :3].T + part.T_world[:3, 3]
        np.testing.assert_allclose(0.5 * (V.min(axis=0) + V.max(axis=0)), [*middle], atol=0.05)
