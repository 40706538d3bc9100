"""STEP and GLB go out as a STEP file came in: tree, names, colours and instances, read by other readers."""

import numpy as np
import pytest
import trimesh

pytest.importorskip("OCP")


from clamp3d import check, export, load
from clamp3d.files.open_cascade import occ
from clamp3d.kernel import translation
from tests.cad import Tree, block, random_pose
from tests.files.step_scenes import pin, plate
from tests.output.step_reader import children, read_step

RED, GREEN, BLUE = "#FF0000", "#00FF00", "#0000FF"


def assert_same(leaf, other, colour):
    assert leaf.path == other.path
    assert (leaf.face_colours, leaf.colour) == (other.face_colours, colour)
    assert leaf.volume == pytest.approx(other.volume, rel=1e-9)
    np.testing.assert_allclose(leaf.T, other.T, atol=1e-9)


def by_name(path):
    return {leaf.name: leaf for leaf in read_step(path)}


def coloured(path):
    """Two uses of a sub-assembly, a pin in four places, one of them blue; the plate has no colour, but a red face."""
    tree = Tree()
    colours = occ.XCAFDoc_DocumentTool.ColorTool_s(tree.document.Main())

    def paint(label, hexadecimal):
        colour = occ.Quantity_Color()
        occ.Quantity_Color.ColorFromHex_s(hexadecimal, colour)
        colours.SetColor(label, colour, occ.XCAFDoc_ColorType.XCAFDoc_ColorGen)

    rng = np.random.default_rng(8)
    root, sub = tree.product("machine"), tree.product("sub, assembly")
    body = plate()
    plates, pins = tree.product("plate", body), tree.product("pin", pin())
    paint(pins, GREEN)
    paint(tree.tool.AddSubShape(plates, occ.TopExp_Explorer(body, occ.TopAbs_ShapeEnum.TopAbs_FACE).Current()), RED)
    tree.put(sub, plates, random_pose(rng), "plate")
    tree.put(sub, pins, random_pose(rng), "pin")
    tree.put(root, sub, random_pose(rng), "left")
    tree.put(root, sub, random_pose(rng), "right")
    tree.put(root, pins, random_pose(rng), "loose")
    tree.put(root, pins, random_pose(rng), "blue one")
    paint(list(children(root))[-1], BLUE)
    layers = occ.XCAFDoc_DocumentTool.LayerTool_s(tree.document.Main())
    layers.SetLayer(plates, occ.TCollection_ExtendedString("outer"))
    return tree.write(path)


@pytest.fixture
def machine(tmp_path):
    return coloured(tmp_path / "machine.step")


def test_tree_names_colours_and_instances_stay(machine, tmp_path):
    before, scene = read_step(machine), load(machine)
    after = read_step(export(scene, tmp_path / "again.step").files[0])
    assert [leaf.name for leaf in after] == [part.name for part in scene.parts]
    assert after[1].path == ("machine", "sub, assembly", "pin")
    own = after[0].colour  # the program's, where the file states none
    for was, leaf in zip(before, after, strict=True):
        assert_same(leaf, was, was.colour or own)
    assert [leaf.colour for leaf in after] == [own, GREEN, own, GREEN, GREEN, BLUE]
    assert [leaf.face_colours for leaf in after] == [[RED], [], [RED], [], [], []]
    assert len({leaf.solid for leaf in after}) == len({leaf.solid for leaf in before}) == 2
    assert scene.parts[0].component.face_colours == {0: RED}  # of the first face, as painted
    assert [part.name for part in load(tmp_path / "again.step").parts] == [part.name for part in scene.parts]


def test_parts_that_clash_have_the_programs_colour(machine, tmp_path):
    scene = load(machine)
    place = {part.name: part.T_world for part in scene.parts}
    result = check(scene.moved({"pin_1": place["plate_1"]}))
    (row,) = result.findings
    assert {row.a, row.b} == {"plate_1", "pin_1"}
    after = by_name(export(result, tmp_path / "found.step").files[0])
    clash = f"clash {row.a} - {row.b}"
    assert [*after] == [*place, clash]
    assert after[clash].path == ("machine", clash)
    assert after[clash].colour == "#D32F2F"
    assert after["pin_1"].colour not in (GREEN, BLUE)
    assert (after["pin_2"].colour, after["pin_4"].colour) == (GREEN, BLUE)
    assert (after["plate_1"].face_colours, after["plate_2"].face_colours) == ([], [RED])
    np.testing.assert_allclose(after["pin_1"].T, place["plate_1"][:3], atol=1e-9)

    # Those that only touch keep theirs.
    result = check(scene.moved({"pin_1": place["pin_4"] @ translation(0, 0, 10)}))
    assert result.verdict("pin_1", "pin_4").value == "contact"
    after = by_name(export(result, tmp_path / "touching.step").files[0])
    assert (after["pin_1"].colour, after["pin_4"].colour) == (GREEN, BLUE)


def test_a_chosen_part_and_a_part_of_one_product(machine, tmp_path):
    (leaf,) = read_step(export(load(machine), tmp_path / "pin.step", names=["pin_2"]).files[0])
    assert (leaf.name, leaf.path) == ("pin_2", ("machine", "sub, assembly", "pin"))
    tree = Tree()
    tree.product("lid", plate())
    (before,) = read_step(tree.write(tmp_path / "a.step"))
    (after,) = read_step(export(load(tmp_path / "a.step"), tmp_path / "b.step").files[0])
    assert (after.name, after.path) == (before.name, before.path)


def test_equal_solids_of_two_products_and_solids_of_one_keep_their_names(tmp_path):
    tree = Tree()
    root = tree.product("pads")
    for k, name in enumerate(("left pad", "right pad")):
        tree.put(root, tree.product(name, block((0, 0, 0), (1, 2, 3))), translation(5 * k, 0, 0), "pad")
    scene = load(tree.write(tmp_path / "pads.step"))
    again = by_name(export(scene, tmp_path / "again.step").files[0])
    assert {name: leaf.path for name, leaf in again.items()} == {
        "left-pad": ("pads", "left pad"),
        "right-pad": ("pads", "right pad"),
    }


def test_two_files_of_a_scene_are_two_trees(machine, tmp_path):
    (tmp_path / "two.toml").write_text(
        '[parts.a]\nfile = "machine.step"\n[parts.b]\nfile = "machine.step"\npose = { translation = [500, 0, 0] }\n'
        '[parts.ball]\nshape = "cylinder"\nradius = 1\nlength = 2\n'
    )
    scene = load(tmp_path / "two.toml")
    after = by_name(export(scene, tmp_path / "out.step").files[0])
    assert [*after] == [part.name for part in scene.parts]
    for part in scene.parts:
        np.testing.assert_allclose(after[part.name].T, part.T_world[:3], atol=1e-9)
    assert after["a/pin_1"].path == ("two", "a", "machine", "sub, assembly", "pin")
    assert after["ball"].path == ("two", "ball")


def test_an_assembly_of_build123d_keeps_its_tree_and_colours(tmp_path):
    bd = pytest.importorskip("build123d")
    rod, lid = bd.Cylinder(2, 10), bd.Pos(10, 0, 0) * bd.Box(20, 20, 3)
    rod.label, lid.label, rod.color, lid.color = "rod", "lid", bd.Color(0, 0, 1), bd.Color(1, 0, 0)
    whole = bd.Compound(label="whole", children=[bd.Compound(label="inner", children=[rod, lid])])
    bd.export_step(whole, tmp_path / "in.step")
    assert [part.name for part in load(whole).parts] == ["rod", "lid"]
    read = bd.import_step(export(load(tmp_path / "in.step"), tmp_path / "out.step").files[0])
    assert (read.label, [child.label for child in read.children]) == ("whole", ["inner"])
    assert {leaf.label: tuple(leaf.color)[:3] for leaf in read.leaves} == {"rod": (0, 0, 1), "lid": (1, 0, 0)}


def test_glb_has_the_tree_and_shares_meshes_of_one_colour(machine, tmp_path):
    scene = load(machine)
    read = trimesh.load_scene(export(scene, tmp_path / "machine.glb").files[0])
    above = read.graph.transforms.parents
    assert {name: above[name] for name in ("plate_1", "pin_1", "left", "pin_3")} == {
        "plate_1": "left", "pin_1": "left", "left": "machine_1", "pin_3": "machine_1",
    }  # fmt: skip
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for part in scene.parts:
        T, key = read.graph[part.name]
        V = trimesh.transform_points(read.geometry[key].vertices, T) @ turn.T * 1000.0
        truth = part.shape.mesh.vertices @ part.T_world[:3, :3].T + part.T_world[:3, 3]
        np.testing.assert_allclose([V.min(axis=0), V.max(axis=0)], [truth.min(axis=0), truth.max(axis=0)], atol=1e-3)
    assert read.graph["pin_1"][1] == read.graph["pin_3"][1]
    assert read.graph["pin_1"][1] != read.graph["pin_4"][1]
