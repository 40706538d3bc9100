"""STEP assemblies against what Open CASCADE wrote: names, placements, instances, units, and nothing left out."""

import re
from contextlib import chdir

import numpy as np
import pytest

pytest.importorskip("OCP")


from clamp3d import InputError, load
from clamp3d.files.formats import load_bodies
from clamp3d.files.open_cascade import explore, from_bytes, occ, volume_of
from clamp3d.files.part21 import announced
from clamp3d.geometry.shells import volume
from tests.cad import Tree, location, random_pose
from tests.files.step_scenes import nested, pin, plate


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    tree, truth = nested(np.random.default_rng(7))
    return load(tree.write(tmp_path_factory.mktemp("step") / "machine.step", "INCH")), truth


def test_names_places_and_volumes_of_a_tree(written):
    scene, truth = written
    assert scene.name == "machine"
    assert [part.name for part in scene.parts] == [name for name, _, _ in truth]
    assert len({id(part.shape) for part in scene.parts}) == 2
    for part, (_, size, T) in zip(scene.parts, truth, strict=True):
        np.testing.assert_allclose(part.T_world, T, atol=1e-6)
        mesh = part.shape.mesh
        V = mesh.vertices @ T[:3, :3].T + T[:3, 3]
        np.testing.assert_allclose(part.shape.bounds_at(T), [V.min(axis=0), V.max(axis=0)], atol=0.03)
        assert mesh.watertight
        area = part.shape.error * np.abs(mesh.vertices).max() ** 2 * 20
        assert abs(volume(mesh.vertices, mesh.faces) - size) < area


def test_several_solids_of_one_product_are_several_parts(tmp_path):
    both = occ.TopoDS_Compound()
    builder = occ.BRep_Builder()
    builder.MakeCompound(both)
    builder.Add(both, plate())
    T = random_pose(np.random.default_rng(3))
    builder.Add(both, pin().Moved(location(T)))
    tree = Tree()
    tree.product("welded", both)
    scene = load(tree.write(tmp_path / "welded.step"))
    assert [part.name for part in scene.parts] == ["welded_1", "welded_2"]
    np.testing.assert_allclose(load(both).parts[1].T_world, T, atol=1e-9)


def test_what_has_no_name_is_called_after_what_holds_it_and_names_need_not_be_utf8(tmp_path):
    tree = Tree()
    root, blank = tree.product("top"), tree.product(" ", pin())
    tree.put(root, blank, np.eye(4), name="=>[0:1:1:2]")  # as Open CASCADE names an instance that nobody named
    tree.put(root, tree.product("PARTNAME", plate()), random_pose(np.random.default_rng(5)), name="=>[0:1:1:3]")
    path = tree.write(tmp_path / "blank.step")
    path.write_bytes(path.read_bytes().replace(b"PARTNAME", "Bügel".encode("latin-1")))
    assert [part.name for part in load(path).parts] == ["top", "Bügel"]


def test_a_shell_is_refused_by_name_and_curves_are_left_out(tmp_path):
    sewing = occ.BRepBuilderAPI_Sewing()
    for face in [*explore(occ.BRepPrimAPI_MakeBox(1.0, 1.0, 1.0).Shape(), "FACE")][:5]:  # a box without its top
        sewing.Add(face)
    sewing.Perform()
    tree = Tree()
    root = tree.product("top")
    tree.put(root, tree.product("pin", pin()), np.eye(4))
    tree.put(root, tree.product("lid", sewing.SewedShape()), np.eye(4))
    line = occ.BRepBuilderAPI_MakeEdge(occ.gp_Pnt(0, 0, 0), occ.gp_Pnt(5, 0, 0)).Edge()
    tree.put(root, tree.product("axis", line), np.eye(4))
    path = tree.write(tmp_path / "shell.step")
    with pytest.raises(InputError, match=r"only 1 of 2 bodies read; missing: lid \(a surface, not a solid\)"):
        load(path)
    scene = load(path, partial=True)
    assert [part.name for part in scene.parts] == ["pin"]
    assert scene.notes[0].startswith("1 of 2 bodies read; missing: lid")
    assert scene.notes[1] == "products that hold curves or points only are left out: 1"


def test_a_line_less_is_never_a_body_less(tmp_path):
    """Every sixteenth line of the file deleted in turn: the file is refused, or everything is there."""
    tree, truth = nested(np.random.default_rng(7))
    lines = tree.write(tmp_path / "machine.step").read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line.startswith("DATA"))
    refused = 0
    for k in range(first + 1, len(lines), 16):
        damaged = tmp_path / f"{k}.step"
        damaged.write_text("".join(lines[:k] + lines[k + 1 :]))
        try:
            sizes = sorted(volume_of(from_bytes(body.shape.brep)) for body in load_bodies(damaged).bodies)
        except InputError:
            refused += 1
            continue
        assert sizes == pytest.approx(sorted(size for _, size, _ in truth), rel=1e-3), lines[k]
    assert refused > 30


@pytest.mark.parametrize(
    ("text", "instead", "message"),
    [
        ("\nDATA;", "\nDATA; /* it's no text;\n #69 = ( */", None),
        ("DIRECTION('',", "DIRECTION('it''s (, #999999',", None),
        ("MANIFOLD_SOLID_BREP('',#69", "MANIFOLD_SOLID_BREP('',#0069", None),
        ("\n#69 =", "\n#069 =", None),
        ("DIRECTION('',", "DIRECTION('', ,", "damaged: .*Incorrect syntax"),
        ("DIRECTION('',", "DIRECTION(#999999,", "damaged: Unresolved Reference"),
        ("CARTESIAN_POINT('',(0.,", "CARTESIAN_POINT('',('0',", "damaged: .*not a Real"),
        ("AXIS2_PLACEMENT_3D(", "AXIS2_PLACEMENT3D(", "damaged: .*transform_item"),
        ("_TRANSFORMATION('','',#11,", "_TRANSFORMATION('','',$,", "damaged: .*transform_item_1"),
        ("SI_UNIT(.MILLI.", "SI_UNIT(.MILLX.", "damaged: Enumeration si_prefix has not an allowed value"),
        ("SI_UNIT(.MILLI.,.METRE.", "SI_UNIT(.MILLI.,.MTTRE.", "damaged: Enumeration si_unit_name has not an"),
        ("SI_UNIT(.MILLI.", "SI_UNIT('MILLI'", r"damaged: .*\(prefix\) is not an enumeration"),
        ("SI_UNIT(.MILLI.", "SI_UNIX(.MILLI.", r"damaged: .*\(unit\) : Entity has illegal type"),
        (
            "SI_UNIT(.MILLI.,.METRE.)",
            "CONVERSION_BASED_UNIT('INCH',#11)",
            "#11, which a unit is made of, is no measure",
        ),
        ("\n#12 ", "\n#11 ", "damaged: #11 is defined 2 times"),
        ("\nENDSEC;\nEND-", "\nEND-", "not a readable STEP file, or it is cut off"),
        ("\nHEADER;", "\n", "not a readable STEP file, or it is cut off"),
        ("ADVANCED_FACE('',(#71),", "ADVANCED_FACE('',(),", r"missing: FACE_BOUND \(#71\) that belongs to nothing"),
        ("MANIFOLD_SOLID_BREP('',#69", "MANIFOLD_SOLID_BRAP('',#69", "missing: 1 of the file's 2 closed shells"),
    ],
)
def test_a_text_that_is_not_whole_is_refused(tmp_path, text, instead, message):
    path = nested(np.random.default_rng(7))[0].write(tmp_path / "machine.step")
    before = path.read_text()
    assert text in before
    path.write_text(before.replace(text, instead, 1))
    if message is None:
        assert len(load(path).parts) == 5
    else:
        with pytest.raises(InputError, match=message):
            load(path)


KINDS = (
    "ADVANCED_FACE|CLOSED_SHELL|EDGE_LOOP|FACE_BOUND|ORIENTED_EDGE|MANIFOLD_SOLID_BREP|PRODUCT_DEFINITION|"
    "ITEM_DEFINED_TRANSFORMATION|ADVANCED_BREP_SHAPE_REPRESENTATION"
)


def test_what_nothing_refers_to_any_more_is_missing(tmp_path):
    path = nested(np.random.default_rng(7))[0].write(tmp_path / "machine.step")
    for number, kind in re.findall(rf"\n#(\d+) = ({KINDS})\(", before := path.read_text()):
        path.write_text(re.sub(rf"(?<!\n)#{number}\b", "$", before))
        assert announced(path).lost == (f"{kind} (#{number}) that belongs to nothing",)


@pytest.mark.parametrize(
    ("axes", "mirrors"),
    [
        ("#900,#901,#903,1.,#902", True),
        ("#900,#901,#903,1.,$", True),
        ("#901,#900,#903,1.,#902", False),
        ("$,$,#903,1.,$", False),
    ],
)
def test_an_instance_that_is_mirrored_is_missing(tmp_path, axes, mirrors):
    """Open CASCADE turns it by half a turn instead."""
    path = nested(np.random.default_rng(7))[0].write(tmp_path / "machine.step")
    operator = f"CARTESIAN_TRANSFORMATION_OPERATOR_3D('','',$,{axes});\n#903 = CARTESIAN_POINT('',(30.,0.,0.));\n"
    directions = ("(-1.,0.,0.)", "(0.,1.,0.)", "(0.,0.,1.)")
    operator += "".join(f"#{900 + k} = DIRECTION('',{values});\n" for k, values in enumerate(directions))
    before = path.read_text()
    assert "#900 " not in before
    path.write_text(re.sub(r"ITEM_DEFINED_TRANSFORMATION\([^;]*;\s", operator, before, count=1))
    if mirrors:
        with pytest.raises(InputError, match=r"missing: .*OPERATOR_3D \(#\d+\), a placement that mirrors"):
            load(path)
    else:
        assert len(load(path).parts) == 5


@pytest.fixture
def in_files(tmp_path):
    """An assembly of which each part is a file of its own."""
    tree, truth = nested(np.random.default_rng(7))
    tree.tool.UpdateAssemblies()
    writer = occ.STEPCAFControl_Writer()
    with chdir(tmp_path):
        assert writer.Transfer(tree.document, occ.STEPControl_StepModelType.STEPControl_AsIs, "of_")
        writer.Write("machine.step")
    return tmp_path / "machine.step", truth


def test_parts_in_files_of_their_own_are_read(in_files):
    path, truth = in_files
    assert {file.name for file in path.parent.iterdir()} == {"machine.step", "of_plate.stp", "of_pin: 5 x 10.stp"}
    scene = load(path)
    assert [part.name for part in scene.parts] == [name for name, _, _ in truth]
    volumes = [volume_of(from_bytes(part.shape.brep)) for part in scene.parts]
    assert volumes == pytest.approx([size for _, size, _ in truth])


def test_parts_in_files_that_are_lost_damaged_or_elsewhere_are_refused(in_files, tmp_path_factory):
    path, _ = in_files
    plate = path.parent / "of_plate.stp"
    text = plate.read_text()
    plate.write_text(text[: len(text) // 2])
    with pytest.raises(InputError, match=r"names 'of_plate.stp': not a readable STEP file, or it is cut off"):
        load(path)
    plate.write_text(text.replace("MANIFOLD_SOLID_BREP", "MANIFOLD_SOLID_BRAP"))
    with pytest.raises(InputError, match="1 of the file's 2 closed shells"):
        load(path)
    plate.unlink()
    with pytest.raises(InputError, match=r"names 'of_plate.stp': .*no such file"):
        load(path)
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "of_plate.stp"
    elsewhere.write_text(text)
    path.write_text(path.read_text().replace("of_plate.stp", f"../{elsewhere.parent.name}/of_plate.stp"))
    with pytest.raises(InputError, match=r"of_plate.stp', which is outside of its folder"):
        load(path)
