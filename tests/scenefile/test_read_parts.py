"""Folders with poses, robots, 3MF, and scene files that include them."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from clamp3d import InputError, check, load
from clamp3d.scenefile import tables
from clamp3d.scenefile.read_parts import read_parts


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "cell"
    made.mkdir()
    trimesh.creation.box((2.0, 4.0, 6.0)).export(made / "plate.stl")
    trimesh.creation.cylinder(1.0, 5.0, sections=16).export(made / "bolt.ply")
    (made / "notes.txt").write_text("left out")
    return made


def table(path, *rows, head="name,x,y,z,qx,qy,qz,qw"):
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def test_a_folder_of_meshes_with_poses(folder, tmp_path):
    turn = Rotation.from_euler("xyz", [20, 30, 40], degrees=True)
    x, y, z, w = turn.as_quat()
    poses = table(tmp_path / "poses.csv", "bolt,1,2,3,0,0,0,1", f"plate,9,0,0,{x},{y},{z},{w}", "bolt,0,0,50,1,0,0,0")
    scene = load(folder, poses=poses)
    assert scene.name == "cell"
    assert [p.name for p in scene.parts] == ["bolt_1", "plate", "bolt_2"]
    np.testing.assert_allclose(scene.parts[1].T_world[:3, :3], turn.as_matrix(), atol=1e-12)
    assert scene.parts[2].T_world[:3, 3].tolist() == [0, 0, 50]
    assert scene.parts[0].shape is scene.parts[2].shape
    plain = load(folder, chord=0.05).parts
    assert [(p.name, p.shape.error) for p in plain] == [("bolt", 0.05), ("plate", 0.05)]  # where the files put them


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["bolt,1,2,3,0,0,0,1"], r"no pose for plate \(1 of 2 files\)"),
        (["bolt,1,2,3,0,0,0,1", "nut,1,2,3,0,0,0,1"], "no file for 'nut' in .*; there are bolt, plate"),
        (["bolt,1,2,3,0,0,0,2", "plate,0,0,0,0,0,0,1"], "line 2: quaternion: must have length 1, got 2"),
        (["bolt,1,2,3,0,0,1"], "line 2: quaternion: must be of length 4, got .'0', '0', '1'."),
        (["bolt,1,2,nan,0,0,0,1"], "line 2: translation.2: must be a finite number, got 'nan'"),
        (["bolt,1,2,0,0,0,0,1", "plate,1_0,0,0,0,0,0,1"], "line 3: translation.0: must be a valid number, got '1_0'"),
        (["bolt" * 50_000 + ",1,2,0,0,0,0,1"], "line 2: field larger than field limit"),
        ([], "no pose in the table"),
        (None, "the first line must be name,x,y,z,qx,qy,qz,qw, got 'a,b'"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(folder, tmp_path, rows, message):
    with pytest.raises(InputError, match=message):
        load(folder, poses=table(tmp_path / "poses.csv", *rows or [], **({"head": "a,b"} if rows is None else {})))


def test_files_whose_names_no_part_can_have(folder):
    (folder / "bolt.ply").rename(folder / "M8 x 20, A:2.ply")
    trimesh.creation.box((1.0, 1.0, 1.0)).export(folder / "M8-x-20-A-2.stl")
    assert [p.name for p in load(folder).parts] == ["M8-x-20-A-2_1", "M8-x-20-A-2_2", "plate"]


@pytest.mark.parametrize("chord", [1e5, 1e308])
def test_no_chord_error_is_so_large_that_bounds_overflow(folder, chord):
    with pytest.raises(InputError, match="chord must be >= 0 and < 100000 mm"):
        load(folder, chord=chord)


def test_a_link_in_a_folder_that_leads_nowhere_is_refused(folder):
    (folder / "gone.stl").symlink_to(folder / "nothing.stl")
    with pytest.raises(InputError, match=r"gone\.stl: no such file"):
        load(folder)


def test_two_files_of_one_name_are_refused_by_name(folder):
    (folder / "bolt.obj").write_text("")
    with pytest.raises(InputError, match=r"bolt\.obj and bolt\.ply would both be part 'bolt'"):
        load(folder)


ROBOT = """<robot name="arm">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.02"/></geometry></collision>
    <visual><geometry><box size="9 9 9"/></geometry></visual></link>
  <link name="rail"><visual><origin xyz="0.01 0 0.05"/>
    <geometry><mesh filename="rail.stl" scale="0.001 0.001 0.001"/></geometry></visual></link>
  <link name="tip"><collision><geometry><sphere radius="0.01"/></geometry></collision>
    <collision><origin xyz="0 0 0.012"/><geometry><cylinder radius="0.004" length="0.02"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="rail"/>
    <origin xyz="0 0 0.01"/><axis xyz="0 0 1"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="tip"/>
    <origin xyz="0 0 0.2"/><axis xyz="1 0 0"/><limit lower="0.01" upper="0.05" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture
def robot(tmp_path):
    pytest.importorskip("yourdfpy")
    trimesh.creation.box((10.0, 20.0, 60.0)).export(tmp_path / "rail.stl")
    (tmp_path / "arm.urdf").write_text(ROBOT)
    return tmp_path / "arm.urdf"


def test_a_robot_with_joint_values(robot):
    assert load(robot).parts[2].T_world[0, 3] == pytest.approx(10.0)  # the nearest limit
    scene = load(robot, joints={"turn": np.pi / 6, "slide": 30.0})
    assert [p.name for p in scene.parts] == ["base", "rail", "tip_1", "tip_2"]
    base, rail, ball, pin = scene.parts
    assert base.T_world.tolist() == np.eye(4).tolist()
    assert base.shape.bounds.tolist() == [[-50.0, -50.0, -10.0], [50.0, 50.0, 10.0]]
    assert pin.shape.bounds.tolist() == [[-4.0, -4.0, -10.0], [4.0, 4.0, 10.0]]
    assert scene.notes == ("links without collision shapes are taken by their visual ones",)
    np.testing.assert_allclose(rail.T_world[:3, 3], [10 * np.cos(np.pi / 6), 5, 60], atol=1e-9)
    np.testing.assert_allclose(rail.T_world[:3, :3], Rotation.from_euler("z", 30, degrees=True).as_matrix(), atol=1e-9)
    assert np.ptp(rail.shape.mesh.vertices, axis=0).round(3).tolist() == [10.0, 20.0, 60.0]
    at = [30 * np.cos(np.pi / 6), 30 * np.sin(np.pi / 6), 210]
    np.testing.assert_allclose(ball.T_world[:3, 3], at, atol=1e-9)
    np.testing.assert_allclose(pin.T_world[:3, 3], np.add(at, [0, 0, 12]), atol=1e-9)
    V, F = ball.shape.mesh.vertices, ball.shape.mesh.faces
    deepest = np.linalg.norm(V[F].mean(axis=1), axis=1).min()
    assert 0.0 < 10.0 - deepest <= ball.shape.error < 0.1  # the facets of a ball know how far they are from it
    found = check(scene)
    assert found.verdict("tip_1", "tip_2").value == "allowed"
    assert found.verdict("base", "tip_1").value == "clear"


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ({"elbow": 1.0}, "joint must be one of turn, slide, got 'elbow'"),
        ({"turn": 2.5}, "joint turn must be from -1 to 2 rad, got 2.5"),
        ({"turn": -1.5}, "joint turn must be from -1 to 2 rad, got -1.5"),
        ({"slide": 60.0}, "joint slide must be from 10 to 50 mm, got 60"),
    ],
)
def test_joint_values_that_do_not_go(robot, joints, message):
    with pytest.raises(InputError, match=message):
        load(robot, joints=joints)


def test_what_robots_hold_besides_bodies_and_places(robot):
    more = (
        '<material name="red"><color rgba="1 0 0 1"/></material><transmission name="t"><type>a/b</type></transmission>'
        '<gazebo reference="tip"><mu1>1</mu1></gazebo><ros2_control name="r" type="system"/></robot>'
    )
    inertial = '<inertial><origin xyz="0 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    text = ROBOT.replace("</robot>", more).replace("<robot ", '<robot xmlns:d="http://drake.mit.edu" ')
    text = text.replace('<link name="tip">', f'<link name="tip">{inertial}<contact/><d:x/>')
    text = text.replace(
        '<axis xyz="1 0 0"/>', '<axis xyz="1 0 0" d:y="1"/><dynamics damping="1"/><mimic joint="turn"/>'
    )
    robot.write_text(text)
    assert [p.name for p in load(robot, joints={"turn": 0.02}).parts] == ["base", "rail", "tip_1", "tip_2"]


def test_a_continuous_joint_turns_by_any_angle(robot):
    robot.write_text(ROBOT.replace("revolute", "continuous"))
    rail = load(robot, joints={"turn": -5.0}).parts[1]
    np.testing.assert_allclose(rail.T_world[:3, :3], Rotation.from_euler("z", -5.0).as_matrix(), atol=1e-9)


@pytest.mark.parametrize(
    ("robots", "name"),
    [("arm", "../meshes/a.glb"), ("arm", "package://arms/meshes/a.glb"), ("b", "package://arm/meshes/a.glb")],
)
def test_meshes_of_a_robot_are_found_where_ros_has_them_and_keep_their_axes(robot, tmp_path, robots, name):
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    trimesh.creation.box(bounds=[(0, 0, 0), (0.01, 0.02, 0.06)]).export(tmp_path / "arm" / "meshes" / "a.glb")
    path = tmp_path / robots / "urdf" / "arm.urdf"
    path.parent.mkdir(parents=True)
    path.write_text(ROBOT.replace("rail.stl", name).replace("0.001 0.001 0.001", "1 1 1"))
    V = load(path).parts[1].shape.mesh.vertices
    np.testing.assert_allclose([V.min(axis=0), V.max(axis=0)], [[0, 0, 0], [10, 20, 60]], atol=1e-6)


def test_a_robot_without_one_of_its_meshes_is_refused(robot):
    (robot.parent / "rail.stl").unlink()
    with pytest.raises(InputError, match=r"3 of 4 bodies read; missing: rail \(.*rail.stl: no such file .*\)"):
        load(robot)
    assert [p.name for p in load(robot, partial=True).parts] == ["base", "tip_1", "tip_2"]


def test_a_scene_file_includes_any_of_them(folder, robot):
    scene = robot.parent / "cell.toml"
    scene.write_text(
        'include = "cell"\nclearance = 2.0\n'
        '[parts.arm]\nfile = "arm.urdf"\njoints = { slide = 20 }\npose = { translation = [500, 0, 0] }\n'
        '[parts.extra]\nfile = "cell/plate.stl"\nchord = 0.05\n'
        '[[allowed]]\nparts = ["arm/*", "bolt"]\n'
        '[[motions]]\nparts = ["arm/tip_*"]\ntranslate = [1, 0, 0]\n'
    )
    made = load(scene)
    assert [p.name for p in made.parts] == [
        "bolt", "plate", "arm/base", "arm/rail", "arm/tip_1", "arm/tip_2", "extra",
    ]  # fmt: skip
    assert made.parts[2].T_world[:3, 3].tolist() == [500, 0, 0]
    assert made.parts[4].T_world[:3, 3] == pytest.approx([520, 0, 210])
    assert made.parts[6].shape.error == 0.05
    assert made.motions[0].parts == ("arm/tip_1", "arm/tip_2")
    assert made.clearance == 2.0
    assert any("tip_1" in item.a and "tip_2" in item.b for item in made.allowed)


def test_a_mesh_table_takes_one_body_only(tmp_path):
    trimesh.Scene([trimesh.creation.box(), trimesh.creation.box().apply_translation((3, 0, 0))]).export(
        tmp_path / "two.glb"
    )
    (tmp_path / "scene.toml").write_text('[parts.a]\nshape = "mesh"\nfile = "two.glb"\n')
    with pytest.raises(InputError, match=r"two.glb holds 2 bodies: leave out shape, and it gives as many parts"):
        load(tmp_path / "scene.toml")
    (tmp_path / "scene.toml").write_text('[parts.a]\nfile = "two.glb"\n')
    assert [p.name for p in load(tmp_path / "scene.toml").parts] == ["a/geometry_0", "a/geometry_1"]


def test_a_file_that_a_scene_names_often_is_read_once_for_each_way_to_read_it(folder, tmp_path, monkeypatch):
    read = []
    monkeypatch.setattr(tables, "read_parts", lambda path, reader: read.append(path.name) or read_parts(path, reader))
    text = "".join(
        f'[parts.b{k}]\nfile = "cell/plate.stl"\npose.translation = [{10 * k}, 0, 0]\nunit = "{unit}"\n'
        for k, unit in enumerate(["mm", "mm", "cm", "mm"])
    )
    (tmp_path / "scene.toml").write_text(text)
    scene = load(tmp_path / "scene.toml")
    assert read == ["plate.stl"] * 2
    a, b, c, d = scene.parts
    assert a.shape is b.shape is d.shape
    assert np.ptp(c.shape.mesh.vertices, axis=0).tolist() == [20, 40, 60]
    assert [part.T_world[0, 3] for part in scene.parts] == [0, 10, 20, 30]
